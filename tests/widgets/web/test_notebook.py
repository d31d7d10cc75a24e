"""The editor in a notebook: a real kernel, whose cells and page share a session."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator

import pytest
from campaign import every

pytest.importorskip("trame")
pytest.importorskip("anywidget", reason="pip install anywidget")
pytest.importorskip("ipykernel", reason="Jupyter is missing: pip install ipykernel nbclient")
pytest.importorskip("nbclient", reason="Jupyter is missing: pip install ipykernel nbclient")
from nbclient.exceptions import CellExecutionError
from notebooks import Kernel, example, kernel

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
SMALL = "sd.models.cactus(700)"


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kernel]:
    folder = tmp_path_factory.mktemp("kernel")
    with kernel(folder) as running:
        running.run(
            "import asyncio, gc, sys, weakref\nimport psutil, pyvista as pv\n"
            "import vtk_segdeform as sd"
        )
        running.run("from vtk_segdeform.widgets.web import web_editor")
        running.run("web_editor._SAMPLES = 0")  # multisampling in software takes long
        running.run("from vtk_segdeform.widgets.editor import preparing")
        running.run("preparing.lacking = lambda *_: None")
        running.run(f"mesh = {SMALL}")
        running.run("kept = sd.edit(mesh)")  # runs until the kernel ends
        running.wait("kept.web.server.running")
        yield running
    assert [*folder.glob("segdeform-*")] == []


def test_the_example_keeps_the_volume_and_shows_a_picture_and_the_page(cells: Kernel) -> None:
    sources = example(lambda source: source.replace("sd.models.cactus()", "mesh"))
    assert "mesh = mesh" in sources[0]
    outputs = [cells.run(source) for source in sources]
    n_regions, page, position, volume, moved = (each[-1]["data"] for each in outputs)
    assert int(n_regions["text/plain"]) == 3
    assert "application/vnd.jupyter.widget-view+json" in page
    still = outputs[1][-2]["data"]  # what a saved notebook shows
    picture = re.search(r'base64,([^"]+)"', still["text/html"])
    assert picture is not None
    assert base64.b64decode(picture[1])[:2] == b"\xff\xd8"
    assert "Run the cell to start the editor." in still["text/html"]
    assert still["text/plain"] == "<NotebookEditor of 700 vertices, live>"
    assert int(position["text/plain"]) == 3
    assert abs(float(volume["text/plain"])) < 1e-12
    assert float(moved["text/plain"]) > 0.05
    cells.run("editor.close()")


def test_the_kernel_answers_the_page_and_listens_nowhere(cells: Kernel) -> None:
    ports = (
        "sorted(c.laddr for c in psutil.Process().net_connections('inet') if c.status == 'LISTEN')"
    )
    cells.run(f"before = {ports}; heard = []; comm = kept._widget.comm")
    cells.run(
        "comm.publish_msg = lambda *_, data, **__: heard.append(data['content']['kind'])\n"
        "def say(kind):\n"
        "    content = {'method': 'custom', 'content': {'kind': kind, 'page': 'a'}}\n"
        "    comm.handle_msg({'content': {'data': content}, 'buffers': []})"
    )
    cells.run("say('open'); say('connect')")
    cells.wait("heard == ['document', 'connected'] and len(kept.web.endpoint.connections) == 1")
    cells.run("say('close')")
    cells.wait("heard[2:] == ['close'] and not kept.web.endpoint.connections")
    assert cells.value("len(before) > 0") == "True"  # the kernel's own
    assert cells.value(f"{ports} == before") == "True"


def test_an_editor_ends_when_it_is_gone_and_not_before(cells: Kernel) -> None:
    cells.run("former = sd.edit(mesh)")
    cells.wait("former.web.server.running")
    cells.run("server = former.web.server; former = None; gc.collect();")
    cells.wait("not server.running")
    cells.run("del server")
    assert cells.value("kept.web.server.running") == "True"


@pytest.mark.campaign
def test_the_last_editor_is_freed_when_it_has_ended_also_if_a_page_was_there(cells: Kernel) -> None:
    cells.run("last = sd.edit(mesh)")
    cells.wait("last.web.server.running")
    cells.run(
        "content = {'method': 'custom', 'content': {'kind': 'connect', 'page': 'a'}}\n"
        "last._widget.comm.handle_msg({'content': {'data': content}, 'buffers': []})"
    )
    cells.wait("last.web.endpoint.connections")
    cells.run("session = weakref.ref(last.session); last = None")
    cells.wait("[gc.collect(), session() is None][1]")


def test_a_page_cannot_end_its_server_and_the_end_of_that_does_not_end_the_kernel(
    cells: Kernel,
) -> None:
    cells.run("editor = sd.edit(mesh)")
    cells.wait("editor.web.server.running")
    assert cells.value("editor.web.server.protocol.exit is None") == "True"  # application.exit
    cells.run("await editor.web.server.stop()")
    cells.wait("not editor.is_live")
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
        page = cells.run(f"p.show(jupyter_backend='{backend}')")[-1]["data"]
        assert "application/vnd.jupyter.widget-view+json" in page
    cells.wait("p.segdeform.added[-1].web.server.running")
    assert cells.value("p.segdeform.added[-1].session is e.session") == "True"
    (still,) = cells.run("p.show(jupyter_backend='static')")
    assert "image/png" in still["data"]
    cells.run("server = p.segdeform.added[-1].web.server; p.close()")
    cells.wait("not server.running")


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


def test_without_anywidget_one_sentence_says_what_to_install(cells: Kernel) -> None:
    cells.run(
        "name = 'vtk_segdeform.widgets.web.widget'\n"
        "hidden = {n: sys.modules.pop(n) for n in (name, 'anywidget')}\n"
        "sys.modules['anywidget'] = None"
    )
    try:
        with pytest.raises(CellExecutionError, match=r"anywidget: pip install 'vtk-segdeform\[ju"):
            cells.run("sd.edit(mesh)")
    finally:
        cells.run("sys.modules.update(hidden)")
