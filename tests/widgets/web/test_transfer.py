"""Uploads of a page: each arrives as a whole, apart from all others, or is refused.

And its downloads, which are read again.
"""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("trame")
from aiohttp import ClientSession, web
from scipy.spatial import cKDTree
from web_hands import Served
from yarl import URL

from vtk_segdeform import Mesh, models
from vtk_segdeform.io import read_polydata, stored
from vtk_segdeform.widgets.editor import write_posed
from vtk_segdeform.widgets.panel import status as panel_status
from vtk_segdeform.widgets.web import transfer
from vtk_segdeform.widgets.web.transfer import Transfer

LIMIT = 1000  # bytes
HEADERS = {"X-Segdeform": "upload"}


class Editor:
    """Instead of an editor: it notes what each file that it is to open contains."""

    def __init__(self, path: Path) -> None:
        self.path, self.is_busy, self.opened = path, False, []

    def do(self, action):
        action(SimpleNamespace(open=self._open))

    def _open(self, path: Path) -> None:
        self.path = path
        self.opened.append(path.read_bytes())


@pytest.fixture
def told(tmp_path):
    """Return a function that runs a story with an editor, its names and ``send(name, body)``."""

    async def tell(story):
        editor, names = Editor(tmp_path / "first.ply"), {}
        transfer = Transfer(editor, tmp_path / "uploads", LIMIT, names, lambda: None)
        application = web.Application()
        transfer.add_routes(application)
        runner = web.AppRunner(application, shutdown_timeout=0.5)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        url = URL(f"http://127.0.0.1:{runner.addresses[0][1]}/upload")
        async with ClientSession(headers=HEADERS) as session:

            async def send(name, body):
                async with session.post(url % {"name": name}, data=body) as answer:
                    return answer.status, await answer.text()

            try:
                await story(editor, names, send)
            finally:
                await runner.cleanup()

    return lambda story: asyncio.run(asyncio.wait_for(tell(story), 20.0))


class Slow:
    """A body that arrives in two parts, the second one when it is let."""

    def __init__(self, first: bytes, second: bytes) -> None:
        self._parts, self.begun, self.rest = (first, second), asyncio.Event(), asyncio.Event()

    async def parts(self):
        yield self._parts[0]
        self.begun.set()
        await self.rest.wait()
        yield self._parts[1]


def test_of_two_uploads_at_once_the_second_is_refused_and_the_first_arrives_whole(told, tmp_path):
    async def story(editor, names, send):
        slow = Slow(b"first ", b"file")
        first = asyncio.create_task(send("one.ply", slow.parts()))
        await slow.begun.wait()
        while not [*(tmp_path / "uploads").rglob(".segdeform-*")]:  # until it is being stored
            await asyncio.sleep(0.005)
        assert await send("two.ply", b"second file") == (
            409, "Another upload is in progress. Wait until it is complete."
        )  # fmt: skip
        slow.rest.set()
        assert await first == (200, "")
        assert editor.opened == [b"first file"]
        assert names[str(editor.path)] == "one.ply"
        assert (await send("two.ply", b"second file"))[0] == 200
        assert editor.opened == [b"first file", b"second file"]
        assert names[str(editor.path)] == "two.ply"

    told(story)


def test_a_file_is_kept_until_another_one_is_open(told, tmp_path):
    async def story(editor, names, send):
        assert (await send("one.ply", b"first"))[0] == 200
        first = editor.path
        for name, body, status in (("two.exe", b"x", 415), ("two.ply", bytes(LIMIT + 1), 413)):
            assert (await send(name, body))[0] == status
        editor.is_busy = True
        assert (await send("two.ply", b"second"))[0] == 409
        editor.is_busy = False
        editor.do, do = lambda _: ValueError("Finish the drag first."), editor.do
        assert await send("two.ply", b"second") == (409, "Finish the drag first.")
        editor.do = do
        assert first.read_bytes() == b"first"
        assert [*(tmp_path / "uploads").iterdir()] == [first.parent]
        assert (await send("two.ply", b"second"))[0] == 200
        assert [*(tmp_path / "uploads").iterdir()] == [editor.path.parent]

    told(story)


def test_an_upload_that_breaks_off_leaves_nothing_and_the_next_one_works(told, tmp_path):
    async def story(editor, names, send):
        slow = Slow(b"first ", b"file")
        first = asyncio.create_task(send("one.ply", slow.parts()))
        await slow.begun.wait()
        first.cancel()
        await asyncio.wait([first])
        while [*(tmp_path / "uploads").glob("*")]:
            await asyncio.sleep(0.005)
        assert (await send("two.ply", b"second"))[0] == 200
        assert editor.opened == [b"second"]

    told(story)


def test_an_upload_that_stops_is_ended(told, tmp_path, monkeypatch):
    async def story(editor, names, send):
        slow = Slow(b"first ", b"file")
        monkeypatch.setattr(transfer, "_UPLOAD_TIMEOUT", 0.05)
        assert await send("one.ply", slow.parts()) == (408, "The upload stopped. Try it again.")
        assert [*(tmp_path / "uploads").glob("*")] == []
        monkeypatch.undo()
        assert (await send("two.ply", b"second"))[0] == 200

    told(story)


@pytest.mark.parametrize(
    "name", ["\x1b[31mred\x9b.ply", "a\nb\r\t\0.ply", "\u202egpj.ply", "../../x.ply", "/etc/x.ply"]
)
def test_names_are_shown_without_control_characters_and_name_no_file(told, tmp_path, name):
    async def story(editor, names, send):
        before = {*tmp_path.iterdir()}
        assert (await send(name, b"mesh"))[0] == 200
        assert names[str(editor.path)].isprintable()
        assert "/" not in names[str(editor.path)]
        assert editor.path.name == "upload.ply"
        assert editor.path.parents[1] == tmp_path / "uploads"
        assert {*tmp_path.iterdir()} - before <= {tmp_path / "uploads"}

    told(story)


def test_a_full_disk_is_told(told, monkeypatch):
    def refuse(*_, **__):
        raise OSError(28, "No space left on device")

    async def story(editor, names, send):
        monkeypatch.setattr(transfer, "replacing", refuse)
        assert await send("one.ply", b"mesh") == (
            507, "one.ply could not be stored: No space left on device."
        )  # fmt: skip
        assert editor.opened == []

    told(story)


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """Return the editor of a body far from the origin."""
    ball, folder = models.sphere(300), tmp_path_factory.mktemp("server")
    with Served(Mesh(ball.vertices + [5e5, 5.4e6, 100.0], ball.faces), folder=folder) as served:
        yield served


def download(served, suffix):
    """Return status and content of a download."""

    async def story():
        url = f"http://127.0.0.1:{served.port}/download/{suffix}"
        async with ClientSession(headers=HEADERS) as session, session.get(url) as answer:
            return answer.status, await answer.read()

    return asyncio.run(asyncio.wait_for(story(), 60.0))


@pytest.mark.parametrize(("suffix", "is_told"), [("ply", False), ("stl", True), ("vtp", False)])
def test_a_download_is_read_again_and_its_loss_is_told(served, tmp_path, suffix, is_told):
    served.call(lambda: served.web.editor.controller.say(""))
    status, data = download(served, suffix)
    assert status == 200
    (tmp_path / f"download.{suffix}").write_bytes(data)
    far = served.web.session.mesh
    points = read_polydata(tmp_path / f"download.{suffix}").points
    assert (cKDTree(points).query(far.vertices)[0].max() > 0.2) == is_told
    shown = served.call(lambda: panel_status(served.web.editor).text)
    assert shown.startswith("In the file, vertices moved by up to 0.25") == is_told
    assert ("the volume changed by" in shown) == is_told


@pytest.mark.parametrize("suffix", ["stl", "vtp"])
def test_a_download_that_cannot_be_read_again_is_refused_with_the_reason(
    served, monkeypatch, suffix
):
    def damaged(session, path, **_):
        written = write_posed(session, path)
        path.write_bytes(path.read_bytes()[:500])
        return written

    monkeypatch.setattr(transfer, "write_posed", damaged)
    status, text = download(served, suffix)
    assert status == 409
    assert text.startswith(b"The file cannot be read again: save the mesh again")
    assert b"/" not in text


def upload(served, data):
    """Return the status of an upload."""

    async def story():
        url = f"http://127.0.0.1:{served.port}/upload?name=new.ply"
        async with (
            ClientSession(headers=HEADERS) as session,
            session.post(url, data=data) as answer,
        ):
            return answer.status

    return asyncio.run(asyncio.wait_for(story(), 60.0))


def test_the_server_goes_on_while_a_download_is_read_again(served, monkeypatch):
    data = download(served, "ply")[1]
    go_on, read = threading.Event(), stored.read_polydata

    def gated(path):
        assert go_on.wait(30.0)
        return read(path)

    monkeypatch.setattr(stored, "read_polydata", gated)
    with ThreadPoolExecutor(1) as other:
        answer = other.submit(download, served, "stl")
        served.wait(lambda: [*served.folder.glob("*/download.stl")])
        assert served.call(lambda: not answer.done())
        before = served.web.session
        assert upload(served, data) == 200
        served.wait(lambda: served.web.session is not before)
        go_on.set()
        assert answer.result(60)[0] == 200
    assert not [*served.folder.glob("*/download.stl")]
