"""``segdeform serve`` as it is started by hand: in short, and by real pages in the campaign."""

from __future__ import annotations

import asyncio
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("trame")
pytest.importorskip("aiohttp")
import aiohttp
from chromium import CTRL, Chromium, Page, needs_chromium
from solids import OCTAHEDRON
from visitors import Visitor
from web_hands import line, only_file, pull, rested

from vtk_segdeform import Mesh, Session, load_session, models
from vtk_segdeform.io import write_mesh

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


class Program:
    """``segdeform serve FILE``, run as a user runs it."""

    def __init__(self, file: Path, folder: Path, *options: str) -> None:
        command = [sys.executable, "-m", "vtk_segdeform", "serve", str(file), "--port", "0"]
        self.process = subprocess.Popen(
            [*command, *options], stdout=subprocess.PIPE, text=True,
            env={**os.environ, "TMPDIR": str(folder)},
        )  # fmt: skip
        said = self.process.stdout.readline()
        self.address = re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", said)[0]

    @property
    def children(self) -> list[int]:
        """The client processes."""
        task = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        return [int(word) for word in task.read_text().split()]

    @property
    def left_behind(self) -> tuple[int, int, int]:
        """Numbers of threads and open files, and resident memory in bytes."""
        of = Path(f"/proc/{self.process.pid}")
        pages = int((of / "statm").read_text().split()[1])
        threads, files = len([*(of / "task").iterdir()]), len([*(of / "fd").iterdir()])
        return threads, files, pages * os.sysconf("SC_PAGE_SIZE")


@contextmanager
def served(folder: Path, *options: str, mesh: Mesh | None = None) -> Iterator[Program]:
    write_mesh(folder / "cactus.ply", mesh or models.cactus(700))
    program = Program(folder / "cactus.ply", folder, *options)
    try:
        yield program
    finally:
        program.process.terminate()
        program.process.communicate(timeout=60)


def until(true: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "did not happen"
        time.sleep(0.1)


def opened(browser: Chromium, address: str) -> Page:
    """Open *address* and wait for the first picture and the end of the preparation."""
    page = browser.page(address)
    rested(page)
    return page


def pulled(page: Page, by: tuple[float, float]) -> None:
    """Pull the surface in the middle of the view."""
    pull(page, page.centre(".sd-canvas"), by)


def saved(page: Page, folder: Path) -> Session:
    """Download the session of *page* and return it."""
    folder.mkdir()
    page.save_downloads(folder)
    page.key("s", modifiers=CTRL)
    return load_session(only_file(folder, "*.segdeform"))


def moved(session: Session, vertices: object) -> float:
    """Return the largest distance of *session*'s pose from *vertices*, in diagonals."""
    return float(np.abs(session.vertices - vertices).max() / session.mesh.diagonal)


def test_the_program_serves_the_editor(tmp_path: Path) -> None:
    """And what it does not need it does not load; its client ends with it."""

    async def visit(program: Program) -> tuple[int, str]:
        base, token = program.address.split("/?token=")
        server = SimpleNamespace(
            port=int(base.rpartition(":")[2]), access=SimpleNamespace(token=token)
        )
        async with aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as session:
            guest = Visitor(server, session)
            _, _, headers = await guest.get(f"/?token={token}")
            guest.path, guest.cookie = headers["Location"], headers["Set-Cookie"].split(";")[0]
            await guest.get(f"{guest.path}index.html")
            status, text, headers = await guest.get(f"{guest.path}index.html")
            assert headers["Content-Encoding"] in ("deflate", "gzip")
            for only in ({"Accept-Encoding": "identity"}, {"Range": "bytes=0-"}):
                _, plain, headers = await guest.get(f"{guest.path}index.html", **only)
                assert "Content-Encoding" not in headers
                assert plain == text
            async with session.head(guest.base + guest.path + "index.html", headers={
                "Cookie": guest.cookie}) as answer:  # fmt: skip
                assert answer.status == 200
            (client,) = program.children
            loaded = [Path(f"/proc/{k}/maps").read_text() for k in (client, program.process.pid)]
            for library in ("numpy", "vtkmodules"):
                assert [library in each for each in loaded] == [True, False]
            async with guest.socket():
                program.process.terminate()
                assert await asyncio.to_thread(program.process.wait, 60) == 0
            assert not Path(f"/proc/{client}").exists()
            return status, text

    with served(tmp_path, mesh=Mesh(*OCTAHEDRON)) as program:
        status, text = asyncio.run(visit(program))
    assert status == 200
    assert "<html" in text
    assert [*tmp_path.glob("segdeform-serve-*")] == []


@pytest.mark.campaign
@needs_chromium
def test_two_pages_do_not_see_each_other(tmp_path: Path) -> None:
    with served(tmp_path) as program, Chromium(900, 600) as browser:
        one, other = opened(browser, program.address), opened(browser, program.address)
        pulled(one, (60.0, 10.0))
        pulled(other, (-40.0, 20.0))
        first, second = saved(one, tmp_path / "one"), saved(other, tmp_path / "other")
        for session in (first, second):
            assert moved(session, session.mesh.vertices) > 0.03
            assert abs(session.volume_change) < 1e-12
        assert moved(first, second.vertices) > 0.05


@pytest.mark.campaign
@needs_chromium
def test_a_browser_killed_in_a_drag_loses_nothing(tmp_path: Path) -> None:
    with served(tmp_path) as program:
        with Chromium(900, 600) as browser:
            page = opened(browser, program.address)
            pulled(page, (60.0, 10.0))
            before = saved(page, tmp_path / "before")
            x, y = page.centre(".sd-canvas")
            page.drag(line((x, y), (x - 30.0, y + 30.0), 8), pause=0.05, release=False)
            browser.kill()
        time.sleep(6.0)  # until it is no reload
        with Chromium(900, 600) as browser:
            page = opened(browser, program.address)
            after = saved(page, tmp_path / "after")
            page.key("z")
            rested(page)
            undone = saved(page, tmp_path / "undone")
        assert len(program.children) == 1
    assert abs(after.volume_change) < 1e-12
    assert moved(after, before.vertices) > 0.03
    np.testing.assert_array_equal(undone.vertices, before.vertices)


@pytest.mark.campaign
@needs_chromium
def test_fifty_pages_leave_nothing_behind(tmp_path: Path) -> None:
    with served(tmp_path, "--keep", "4") as program, Chromium(900, 600) as browser:
        first = None
        for k in range(50):
            page = browser.page(program.address)
            page.wait("Number(document.querySelector('canvas')?.dataset.number) > 0", 120.0)
            page.close()
            until(lambda: not program.children)
            if k == 4:
                first = program.left_behind
        until(lambda: program.left_behind[:2] <= first[:2])  # connections are being closed
        print(f"threads, files, bytes after 5 and 50: {first}, {program.left_behind}")
        assert program.left_behind[2] < first[2] + 3e6
        (folder,) = tmp_path.glob("segdeform-serve-*")
        assert [each.name for each in folder.iterdir()] == ["lock"]


@pytest.mark.campaign
@needs_chromium
def test_an_upload_of_two_gigabytes_is_refused_by_name(tmp_path: Path) -> None:
    large = tmp_path / "large.ply"
    with large.open("wb") as file:
        file.truncate(2_000_000_000)
    with served(tmp_path, "--upload-limit", "5") as program, Chromium(900, 600) as browser:
        page = opened(browser, program.address)
        memory = program.left_behind[2]
        page.choose_files(".sd-file", large)
        page.wait("document.body.innerText.includes('large.ply is larger than 5 MB')", 120.0)
        assert program.left_behind[2] < memory + 20e6
        pulled(page, (60.0, 10.0))  # and the page works on
        session = saved(page, tmp_path / "after")
        assert moved(session, session.mesh.vertices) > 0.03
