"""The editor in a notebook: a real kernel, whose cells and page share a session."""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign import every

pytest.importorskip("trame")
pytest.importorskip("ipykernel", reason="Jupyter is missing: pip install ipykernel nbclient")
pytest.importorskip("nbclient", reason="Jupyter is missing: pip install ipykernel nbclient")
from chromium import Chromium, needs_chromium
from nbclient.exceptions import CellExecutionError
from notebooks import Kernel, example, kernel, loaded, status
from web_hands import line

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
SMALL = "sd.models.cactus(700)"


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kernel]:
    folder = tmp_path_factory.mktemp("kernel")
    with kernel(folder) as running:
        running.run(
            "import asyncio, gc, sys, weakref\nimport pyvista as pv\nimport vtk_segdeform as sd"
        )
        running.run("from vtk_segdeform.widgets.web import web_editor")
        running.run("web_editor._SAMPLES = 0")  # multisampling in software takes long
        running.run("from vtk_segdeform.widgets.editor import preparing")
        running.run("prepare, preparing.lacking = preparing.lacking, lambda *_: None")
        running.run(f"mesh = {SMALL}")
        running.run("kept = sd.edit(mesh)")  # runs until the kernel ends
        running.wait("kept.web.server.running")
        address = running.value("kept.address").strip("'")
        yield running
        assert status(address) == 200
    assert status(address) is None
    assert [*folder.glob("segdeform-*")] == []


@pytest.fixture
def kept(cells: Kernel) -> str:
    """Return the address of the editor that runs all the time."""
    return cells.value("kept.address").strip("'")


@pytest.fixture
def address(cells: Kernel) -> Iterator[str]:
    """Yield the address of another editor."""
    cells.run("editor = sd.edit(mesh)")
    cells.wait("editor.web.server.running")
    yield cells.value("editor.address").strip("'")
    cells.run("editor.close()")


def test_the_example_keeps_the_volume_and_shows_the_page(cells: Kernel) -> None:
    sources = example(lambda source: source.replace("sd.models.cactus()", "mesh"))
    assert "mesh = mesh" in sources[0]
    shown = [cells.run(source)[-1]["data"] for source in sources]
    n_regions, page, position, volume, moved = shown
    assert int(n_regions["text/plain"]) == 3
    assert "<iframe" not in page["text/html"]  # only once the kernel answers
    picture = re.search(r'base64,([^"]+)"', page["text/html"])
    assert picture is not None
    assert base64.b64decode(picture[1])[:2] == b"\xff\xd8"
    assert "Run the cell to start the editor." in page["text/html"]
    assert page["text/plain"] == "<NotebookEditor of 700 vertices, live>"
    assert int(position["text/plain"]) == 3
    assert abs(float(volume["text/plain"])) < 1e-12
    assert float(moved["text/plain"]) > 0.05
    cells.run("editor.close()")


@needs_chromium
def test_a_pull_in_the_output_of_a_cell_is_there_in_the_next_cell(
    cells: Kernel, browser: Chromium, tmp_path: Path
) -> None:
    cells.run("preparing.lacking = prepare")
    cells.run("pulled = sd.edit(mesh)")
    cells.wait("pulled.web.server.running")
    before = cells.value("pulled.session.history.position")
    (tmp_path / "output.html").write_text(cells.html("pulled"))
    shown = browser.page((tmp_path / "output.html").as_uri(), size=(700, 680))
    frame = "document.querySelector('iframe')"
    cells.wait("True")  # the kernel answers only between cells
    shown.wait(f"!!{frame}")
    page = shown.frame(shown.evaluate(f"{frame}.src"))
    page.wait("Number(document.querySelector('canvas')?.dataset.number) > 0")
    cells.wait("not (pulled.web.editor.is_busy or pulled.web.editor.is_preparing)")
    left, top, width, height = page.box(".sd-canvas")
    x, y, _, _ = shown.box("iframe")
    start = x + left + 0.5 * width, y + top + 0.5 * height
    shown.drag(line(start, (start[0] + 90, start[1] - 30), 8), pause=0.02)
    cells.wait(f"pulled.session.history.position > {before}")
    assert [m for m in page.messages() if m.startswith("error")] == []
    shown.close()
    assert abs(float(cells.value("pulled.session.volume_change"))) < 1e-12
    cells.wait("abs(pulled.mesh.vertices - mesh.vertices).max() > 0.02 * mesh.diagonal")
    assert cells.value("type(pulled.mesh) is sd.Mesh") == "True"
    cells.run("pulled.close(); preparing.lacking = lambda *_: None")


def test_only_the_address_with_the_secret_reaches_the_editor(cells: Kernel, kept: str) -> None:
    root, secret = re.fullmatch(r"(http://127\.0\.0\.1:\d+/)([\w-]{43})/index\.html", kept).groups()
    assert status(kept) == 200
    assert status(f"{root}{secret}/ws", upgrade=True) == 101
    for place in ("", "index.html", "ws", f"{secret[:-1]}/ws", "x/index.html", f"%2F{secret}/ws"):
        assert status(root + place) == 403
        assert status(root + place, upgrade=True) == 403
    for place in ("nothing", "../../etc/passwd", "%2e%2e/%2e%2e/setup.cfg"):
        assert status(f"{root}{secret}/{place}") == 404
    assert status(kept.replace("127.0.0.1", "127.0.0.2")) is None  # bound to one address


def test_the_files_of_the_page_are_compressed_for_browsers_that_accept_it(kept: str) -> None:
    script = kept.replace("index.html", "__segdeform/surface.js")
    plain, encoding = loaded(script)
    assert encoding == ""
    packed, encoding = loaded(script, **{"Accept-Encoding": "gzip"})
    assert encoding == "gzip"
    assert gzip.decompress(packed) == plain
    assert len(packed) < 0.5 * len(plain)


def test_an_editor_ends_when_it_is_gone_and_not_before(cells: Kernel, kept: str) -> None:
    cells.run("former = sd.edit(mesh)")
    cells.wait("former.web.server.running")
    address = cells.value("former.address").strip("'")
    assert status(address) == status(kept) == 200
    cells.run("server = former.web.server; former = None; gc.collect();")
    cells.wait("not server.running")
    cells.run("del server")
    assert status(address) is None
    assert status(kept) == 200


@pytest.mark.campaign
def test_the_last_editor_is_freed_when_it_has_ended_also_if_a_page_was_there(cells: Kernel) -> None:
    cells.run("last = sd.edit(mesh)")
    cells.wait("last.web.server.running")
    address = cells.value("last.address").strip("'")
    assert status(address) == 200
    assert status(address.replace("index.html", "ws"), upgrade=True) == 101
    cells.run("session = weakref.ref(last.session); last = None")
    cells.wait("[gc.collect(), session() is None][1]")


def test_a_page_cannot_end_its_server_and_the_end_of_that_does_not_end_the_kernel(
    cells: Kernel, address: str
) -> None:
    assert cells.value("editor.web.server.protocol.exit is None") == "True"  # application.exit
    cells.run("await editor.web.server.stop()")
    cells.wait("not editor.is_live")
    assert status(address) is None
    assert cells.value("editor.session.history.position") == "0"
    assert "This editor is closed." in cells.html("editor")


@pytest.mark.parametrize(
    ("given", "same"),
    every(
        2,
        [("pv.Sphere()", "pv.PolyData"), ("mesh", "sd.Mesh"), ("sd.Session(mesh)", "sd.Session")],
    ),
)
def test_the_mesh_is_of_the_type_that_was_given(cells: Kernel, given: str, same: str) -> None:
    source = f"e = sd.edit({given}); e.close(); type(e.mesh) is {same}"
    assert cells.value(source) == "True"


@pytest.mark.campaign
def test_a_plotter_shows_the_page_or_a_picture(cells: Kernel) -> None:
    # pyvista would import all of trame's views, which look for files in the network.
    cells.run("pv.jupyter._entry_points_loaded = True")
    cells.run("p = pv.Plotter(); e = p.segdeform.edit(mesh)")
    for backend in ("trame", "server"):
        html = cells.html(f"p.show(jupyter_backend='{backend}')")
        (place,) = re.findall(r"const page = '(\d+/[\w-]+/index\.html)'", html)
    cells.wait("p.segdeform.added[-1].web.server.running")
    assert status(f"http://127.0.0.1:{place}") == 200
    assert cells.value("p.segdeform.added[-1].session is e.session") == "True"
    (still,) = cells.run("p.show(jupyter_backend='static')")
    assert "image/png" in still["data"]
    cells.run("server = p.segdeform.added[-1].web.server; p.close()")
    cells.wait("not server.running")
    assert status(f"http://127.0.0.1:{place}") is None


def test_without_trame_one_sentence_says_what_to_install(cells: Kernel) -> None:
    cells.run(
        "import vtk_segdeform.widgets.web as web\n"
        "vars(web).pop('WebEditor', None)\n"
        "hidden = {n: m for n, m in sys.modules.items()"
        " if n == 'trame' or n.endswith('.web_editor')}\n"
        "for n in hidden: del sys.modules[n]\n"
        "sys.modules['trame'] = None"
    )
    try:
        with pytest.raises(CellExecutionError, match=r"pip install 'vtk-segdeform\[web\]', or"):
            cells.run("sd.edit(mesh)")
    finally:
        cells.run("del sys.modules['trame']; sys.modules.update(hidden)")
