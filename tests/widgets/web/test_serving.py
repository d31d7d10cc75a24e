"""``segdeform serve`` as a user starts it: who reaches it, what it refuses, how it ends."""

from __future__ import annotations

import asyncio
import gzip
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.request import Request, urlopen

import numpy as np
import pytest

pytest.importorskip("trame")
pytest.importorskip("aiohttp")
from aiohttp import ClientSession, WSServerHandshakeError
from chromium import CTRL, Chromium, Page, needs_chromium
from limbed import torso
from web_hands import call, connected, line, only_file, pull, rested
from yarl import URL

from vtk_segdeform import Session, load_session, models
from vtk_segdeform.io import write_mesh
from vtk_segdeform.widgets.editor import About, Autosaves
from vtk_segdeform.widgets.web import serving as program_of_serve

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


class Program:
    """``segdeform serve cactus.ply``, with temporary and autosaved files in *folder*."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, self.unsaved = folder, folder / "data" / "segdeform" / "unsaved"
        (folder / "tmp").mkdir(exist_ok=True)
        words = ["serve", str(folder / "cactus.ply"), "--port", "0", *options]
        own = {"TMPDIR": str(folder / "tmp"), "XDG_DATA_HOME": str(folder / "data")}
        with (folder / "errors").open("ab") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "vtk_segdeform", *words], stdout=subprocess.PIPE,
                stderr=errors, text=True, env={**os.environ, **own},
            )  # fmt: skip
        self.said = ""
        while "Open this address" not in self.said:
            said = self.process.stdout.readline()
            assert said, self.errors
            self.said += said
        self.address = re.search(r"http://127\.0\.0\.1:\d+/\S+", self.said)[0]
        self.port, self.secret = URL(self.address).port, URL(self.address).path.strip("/")

    @property
    def errors(self) -> str:
        """What it has printed to the standard error output."""
        return (self.folder / "errors").read_text()

    @property
    def rest(self) -> list[Path]:
        """The files of it that are there."""
        return [*(self.folder / "tmp").iterdir(), *self.unsaved.glob("*/*")]

    def end(self, how: signal.Signals) -> int:
        self.process.send_signal(how)
        return self.process.wait(60)


@contextmanager
def serving(folder: Path, *options: str) -> Iterator[Program]:
    if not (folder / "cactus.ply").exists():
        write_mesh(folder / "cactus.ply", torso(2))  # small: each program prepares it
    program = Program(folder, *options)
    try:
        yield program
    finally:
        program.process.kill()
        program.process.communicate()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """Yield a program that continues work on its file; at the end, end it by Ctrl+C."""
    folder = tmp_path_factory.mktemp("served")
    unsaved(folder).release()
    browser = folder / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {folder}/opened\n')
    browser.chmod(0o700)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BROWSER", f"{browser} %s")
        with serving(folder, "--upload-limit", "1", "--open") as program:
            yield program
            require_end(program)


def work():
    """Return a session with regions."""
    session = Session(torso(2))
    session.segment(2)
    return session


def unsaved(folder):
    """Return the unsaved work of a program in *folder* that has been killed."""
    slot = Autosaves(folder / "data" / "segdeform" / "unsaved").new(
        About("cactus.ply", mesh=str(folder / "cactus.ply"))
    )
    slot.write(work())
    return slot


def require_end(program):
    """Check that Ctrl+C ends a program at once, which leaves nothing."""
    with socket.create_connection(("127.0.0.1", program.port)) as half:
        half.sendall(b"GET / HTTP/1.1\r\n")
        assert program.end(signal.SIGINT) == 0
    assert program.rest == []
    assert program.errors == ""


def do(story):
    return asyncio.run(asyncio.wait_for(story, 120.0))


async def answer(program, data):
    """Send bytes; return the first line of the answer and the rest."""
    reader, writer = await asyncio.open_connection("127.0.0.1", program.port)
    writer.write(data)
    head = await asyncio.wait_for(reader.readline(), 60.0)
    rest = await reader.read(4096)
    writer.close()
    return head.decode("latin-1"), rest.decode("latin-1")


def get(program, path, *headers):
    lines = [f"GET {path} HTTP/1.1", f"Host: 127.0.0.1:{program.port}", "Connection: close"]
    return do(answer(program, "\r\n".join([*lines, *headers, "", ""]).encode("latin-1")))


def test_only_the_whole_address_reaches_the_editor(served):
    secret = served.secret
    assert len(secret) >= 43
    assert "200" in get(served, f"/{secret}/index.html")[0]
    wrong = ("/", "//", f"/{secret[:-1]}/", f"/{secret}x/", f"/{secret}", f"/?token={secret}")
    for path in (
        *wrong,
        "/index.html",
        "/ws",
        f"//{secret}/",
        "/%C3%A9/",
        f"/%2f{secret}/",
    ):
        head, text = get(served, path)
        assert " 403 " in head, path
        assert "it contains a secret" in text
        assert secret not in text

    async def enter(path):
        async with (
            ClientSession() as session,
            session.ws_connect(f"http://127.0.0.1:{served.port}/{path}"),
        ):
            return True

    assert do(enter(f"{secret}/ws"))
    for path in ("ws", f"{secret[:-1]}/ws", f"{secret}x/ws"):
        with pytest.raises(WSServerHandshakeError, match="403"):
            do(enter(path))


def test_no_other_page_learns_the_address(served):
    _, text = get(served, f"/{served.secret}/index.html")
    for header in ("Referrer-Policy: no-referrer", "Cache-Control: no-store"):
        assert header in text


def test_the_files_of_the_page_are_compressed_for_browsers_that_accept_it(served):
    address = f"http://127.0.0.1:{served.port}/{served.secret}/__segdeform/surface.js"
    with urlopen(address) as answer:
        plain = answer.read()
        assert "Content-Encoding" not in answer.headers
    with urlopen(Request(address, headers={"Accept-Encoding": "gzip"})) as answer:
        packed = answer.read()
        assert answer.headers["Content-Encoding"] == "gzip"
    assert gzip.decompress(packed) == plain
    assert len(packed) < 0.5 * len(plain)


@pytest.mark.parametrize(
    "tail", ["../../etc/passwd", "..%2f..%2fetc/passwd", "%2e%2e/%2e%2e/setup.cfg", "..\\x",
             "__segdeform/../../web_editor.py", "__segdeform/..%2f..%2fweb_editor.py", "%2e%2e"],
)  # fmt: skip
def test_a_path_names_no_file_but_those_of_the_page(served, tail):
    head, text = get(served, f"/{served.secret}/{tail}")
    assert re.search(" 40[34] ", head)
    assert "import" not in text


ODD = [
    "GET {path}%00", "GET {path}a%00b", "GET {path}%", "GET {path}%zz", "GET {path}%ff%fe",
    "GET {path}%1b[31m", "GET {path}" + 300 * "x", "GET {path}" + 3000 * "a/", "GET /" + 9000 * "x",
    "GET {path}\xff", "GET {path}\x1b[31m", "GET {path}a b",
    "GET {path}?x=%zz", "GET http://evil.example{path}index.html",
    "GET http://127.0.0.1:99999999/", "GET http://[::1/", "GET //[/", "GET *", "OPTIONS *",
    "CONNECT 127.0.0.1:22", "GET foo", "GET ", "PUT {path}", "\x1bGET /", "FOO /",
]  # fmt: skip
ODD_HEADERS = [
    "X: " + 9000 * "a", "\n".join(f"X{k}: a" for k in range(500)), "Content-Length: -5", "X",
    "Transfer-Encoding: foo", "Expect: \x1b[31m", "Range: bytes=9-1", "Cookie: \xff=\xe9; \"",
    "Upgrade: websocket", "Upgrade: h2c\nConnection: Upgrade", "Host: two",
    "If-None-Match: \"\xff", "If-Modified-Since: Mon, 99 Foo 99999 99:99:99 GMT",
]  # fmt: skip


def test_no_request_is_answered_by_500_or_by_a_traceback(served):
    path, host = f"/{served.secret}/", f"Host: 127.0.0.1:{served.port}\nConnection: close"
    heads = [f"{odd.format(path=path)} HTTP/1.1\n{host}\n\n" for odd in ODD]
    heads += [f"GET {path}index.html HTTP/1.1\n{host}\n{more}\n\n" for more in ODD_HEADERS]
    requests = [head.replace("\n", "\r\n").encode("latin-1") for head in heads]
    requests += [b"\x16\x03\x01\x02\0", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"\0\xff" * 100]
    upload = f"POST {path}upload?name=a.ply HTTP/1.1\n{host}\nX-Segdeform: upload\n"
    for more in (
        "Content-Encoding: gzip\nContent-Length: 5\n\nabcde",
        "Transfer-Encoding: chunked\n\nzz\nabc\n",
        "Transfer-Encoding: chunked\n\n3\nabcdef\n",
    ):
        requests.append((upload + more).replace("\n", "\r\n").encode())
    for data in requests:
        head, rest = do(answer(served, data))
        assert re.match(r"HTTP/1\.[01] [234]", head), data
        assert "Traceback" not in rest


async def parts(size, part=100_000):
    for _ in range(size // part):
        yield bytes(part)


def test_an_upload_above_the_limit_is_refused_by_its_size_and_as_it_arrives(served):
    async def send(body):
        url, headers = f"{served.address}upload?name=a.ply", {"X-Segdeform": "upload"}
        async with (
            ClientSession() as session,
            session.post(url, data=body, headers=headers) as answer,
        ):
            return answer.status, await answer.text()

    for body in (bytes(1_000_001), parts(1_100_000)):
        assert do(send(body)) == (413, "a.ply is larger than 1 MB, the limit of this server.")


@pytest.mark.campaign
def test_a_crowd_larger_than_the_usual_limit_of_files_keeps_out_nobody(tmp_path):
    """1,200 half-sent requests, without the secret, to a program that may open 1,024 files."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    hard = before[1]
    if hard != resource.RLIM_INFINITY and hard < 4096:
        pytest.skip("the system allows no more files")
    crowd = []
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (1024, hard))
        with serving(tmp_path) as program:
            resource.setrlimit(resource.RLIMIT_NOFILE, (4096, hard))  # for this process
            for _ in range(1200):
                crowd.append(socket.create_connection(("127.0.0.1", program.port), timeout=5.0))
                crowd[-1].sendall(b"GET / HTTP/1.1\r\nHost: local")
            assert " 200 " in get(program, f"/{program.secret}/index.html")[0]
    finally:
        for each in crowd:
            each.close()
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_a_command_line_names_an_address_that_works_once(served):
    opened = URL(only_file(served.folder, "opened").read_text().strip())
    assert served.secret not in str(opened)
    head, text = get(served, opened.path)
    assert " 303 " in head
    assert f"Location: {served.secret}/" in text
    assert " 403 " in get(served, opened.path)[0]


def test_damaged_work_is_reported_and_left(tmp_path, monkeypatch):
    slot = unsaved(tmp_path)
    slot.path.write_bytes(b"damaged")
    slot.release()
    path, said = tmp_path / "cactus.ply", []
    write_mesh(path, torso(2))
    monkeypatch.setattr(program_of_serve, "Autosaves", lambda: Autosaves(slot.path.parents[1]))
    monkeypatch.setattr(program_of_serve, "WebEditor", lambda session, **_: 1 / 0)
    with pytest.raises(ZeroDivisionError):  # instead of the program itself
        program_of_serve.serve_until_stopped(
            path, host="", port=0, upload_limit=1, started=print, say=said.append
        )
    assert "The unsaved work on cactus.ply cannot be read" in said[0]
    assert slot.path.read_bytes() == b"damaged"


def press(program, *names):
    """Use controls as a page does; return the names of the states in the history."""

    async def story():
        async with connected(f"{program.address}ws") as (send, answers):
            for name in names:
                await send(call("trame.trigger", "press", [name, None], {}))
                assert "error" not in (await answers())[0]
            return await answers()

    return do(story())


def changed(program):
    """Change the session, and wait until that is autosaved; return it."""
    press(program, "mode.regions", "regions.segment")
    deadline = time.monotonic() + 60.0
    while not [*program.unsaved.glob("*/session.segdeform")]:
        assert time.monotonic() < deadline, program.errors
        time.sleep(0.05)
    return load_session(only_file(program.unsaved, "*/session.segdeform"))


@pytest.mark.campaign
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_a_killed_one_is_continued(tmp_path, how):
    with serving(tmp_path) as program:
        before = changed(program)
        program.end(how)
    with serving(tmp_path) as program:
        require_continued(program, before)
        require_end(program)


def test_unsaved_work_is_continued(served):
    require_continued(served, work())


def require_continued(program, before):
    assert "Recovered the unsaved work on cactus.ply" in program.said
    after = load_session(only_file(program.unsaved, "*/session.segdeform"))
    np.testing.assert_array_equal(after.regions.membership, before.regions.membership)


def test_the_work_on_another_file_is_left_alone(tmp_path):
    autosaves = Autosaves(tmp_path)
    for name in ("one.ply", "two.ply"):
        slot = autosaves.new(About(name, mesh=f"/meshes/{name}"))
        slot.write(Session(models.sphere(300)))
        slot.release()
    slot = program_of_serve.recoverable(autosaves, Path("/meshes/one.ply"))
    assert slot.about.name == "one.ply"
    assert [each.about.name for each in autosaves.abandoned()] == ["two.ply"]


def opened(browser: Chromium, address: str) -> Page:
    """Open *address* and wait for the first picture and the end of the preparation."""
    page = browser.page(address)
    rested(page)
    return page


def saved(page: Page, folder: Path) -> Session:
    """Download the session of *page* and return it."""
    folder.mkdir()
    page.save_downloads(folder)
    page.key("s", modifiers=CTRL)
    return load_session(only_file(folder, "*.segdeform"))


@pytest.mark.campaign
@needs_chromium
def test_two_pages_show_the_same_work_and_a_killed_browser_loses_nothing(tmp_path: Path) -> None:
    with serving(tmp_path) as program:
        with Chromium(900, 600) as browser:
            page, other = opened(browser, program.address), opened(browser, program.address)
            pull(page, page.centre(".sd-canvas"), (60.0, 10.0))
            before = saved(other, tmp_path / "before")
            x, y = page.centre(".sd-canvas")
            page.drag(line((x, y), (x - 30.0, y + 30.0), 8), pause=0.05, release=False)
            browser.kill()
        with Chromium(900, 600) as browser:
            page = opened(browser, program.address)
            after = saved(page, tmp_path / "after")
            page.key("z", modifiers=CTRL)
            rested(page)
            undone = saved(page, tmp_path / "undone")
    assert np.abs(before.vertices - before.mesh.vertices).max() > 0.03 * before.mesh.diagonal
    assert abs(after.volume_change) < 1e-12
    assert np.abs(after.vertices - before.vertices).max() > 0.03 * before.mesh.diagonal
    np.testing.assert_array_equal(undone.vertices, before.vertices)
