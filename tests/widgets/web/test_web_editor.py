"""The editor in a real browser, by a real mouse, keys, fingers, uploads and downloads."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame")
from chromium import ALT, CTRL, Chromium, needs_chromium
from web_hands import Served, line, only_file

from vtk_segdeform import models
from vtk_segdeform.session import Change, load_session

pytestmark = [needs_chromium, pytest.mark.filterwarnings("ignore::DeprecationWarning")]


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with Chromium(1100, 640) as browser:
        yield browser


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    (tmp_path / "server").mkdir()
    mesh = models.cactus(700)
    with Served(mesh, name="cactus.ply", folder=tmp_path / "server", upload_limit=10**6) as served:
        yield served


def _top(served: Served) -> Any:
    """Return a vertex on the upper side that the camera sees."""
    vertices = served.web.session.vertices
    near = vertices[:, 2] > np.quantile(vertices[:, 2], 0.9)
    return vertices[near][np.argmin(vertices[near][:, 1])]


def test_a_pull_by_mouse_keeps_the_volume_in_every_frame_and_one_z_undoes_it(
    served: Served, browser: Chromium
) -> None:
    page, session = served.page(browser), served.web.session
    rest, changes = session.vertices, []
    served.call(
        lambda: session.on_change(
            lambda change: changes.append(session.volume_change) if change & Change.POSE else None
        )
    )
    start = served.seen(page, _top(served))
    page.drag(line(start, (start[0] + 90, start[1] + 20), 12), pause=0.02)
    served.wait(lambda: session.position == 1 and served.is_at_rest)
    assert np.abs(session.vertices - rest).max() > 0.05 * session.mesh.diagonal
    assert len(changes) > 2
    assert np.abs(changes).max() < 1e-12
    page.key("y")  # nothing to redo
    page.key("z")
    served.wait(lambda: session.position == 0)
    page.key("y")
    served.wait(lambda: session.position == 1)
    page.wait("document.querySelector('.sd-history .selected').textContent == 'Pull'")
    assert [m for m in page.messages() if m.startswith("error") and "405" not in m] == []


def test_a_downloaded_session_uploads_to_the_same_pose(
    served: Served, browser: Chromium, tmp_path: Path
) -> None:
    page, web = served.page(browser), served.web
    start = served.seen(page, _top(served))
    page.drag(line(start, (start[0] + 60, start[1]), 5), pause=0.02)
    served.wait(lambda: web.session.position == 1 and served.is_at_rest)
    posed = web.session.vertices
    page.save_downloads(tmp_path)
    page.key("s", modifiers=CTRL)
    file = only_file(tmp_path, "*.segdeform")
    assert file.name == "cactus.segdeform"
    np.testing.assert_allclose(load_session(file).vertices, posed, atol=1e-12)
    page.wait("!document.querySelector('.sd-document b')")  # nothing is unsaved
    page.key("Home")
    served.wait(lambda: web.session.state.pose is None)
    before = web.session
    page.wait("!!document.querySelector('.sd-document b')")
    page.choose_files(".sd-file", file)
    page.wait("!!document.querySelector('[data-name=discard]')")
    page.click("[data-name=discard]")
    served.wait(lambda: web.session is not before)
    np.testing.assert_allclose(web.session.vertices, posed, atol=1e-12)
    page.wait("document.querySelector('.sd-document').innerText.includes('cactus.segdeform')")
    page.wait("document.querySelector('.sd-hint').innerText.includes('Opened cactus.segdeform')")


def test_regions_cages_and_a_handle_by_keys_and_mouse(served: Served, browser: Chromium) -> None:
    page, web = served.page(browser), served.web
    page.key("g")
    served.wait(lambda: web.session.regions is not None and not web.editor.is_busy)
    page.key("f")
    served.wait(lambda: web.session.cages and not web.editor.is_busy)
    page.wait("document.querySelector('.sd-hint').textContent.includes('cages fitted')")
    heights = web.session.mesh.vertices[:, 2]
    served.call(lambda: web.session.set_fixed(np.flatnonzero(heights < np.quantile(heights, 0.1))))
    tip = np.flatnonzero(heights > 0.95 * heights.max())
    served.call(lambda: web.session.add_handle(tip, "tip"))
    page.wait("!document.querySelector('[data-name=\"mode.deform\"]').disabled")
    page.click("[data-name='mode.deform']")
    served.wait(lambda: web.editor.mode.name == "DEFORM" and not web.editor.is_busy)
    page.wait("document.querySelector('.sd-table')?.innerText.includes('tip')")
    gizmo = served.call(lambda: web.editor.widgets.dragger.gizmo.centre)
    start, steps = served.seen(page, np.asarray(gizmo)), web.session.position
    page.drag(line(start, (start[0] + 50, start[1]), 6), pause=0.02)
    served.wait(lambda: web.session.position == steps + 1)
    assert abs(web.session.volume_change) < 1e-12


def test_one_finger_pulls_and_two_turn(served: Served, browser: Chromium) -> None:
    page, web = served.page(browser, touch=True, size=(390, 700)), served.web
    camera = web.plotter.camera
    where, (x, y) = camera.position, served.seen(page, _top(served))
    page.touch("touchStart", [(x, y)])
    for shift in (15, 30, 45):
        page.touch("touchMove", [(x + shift, y)])
    page.touch("touchEnd")
    served.wait(lambda: web.session.position == 1)
    assert camera.position == where
    page.touch("touchStart", [(x, y), (x - 60, y)])
    for shift in (15, 30, 45):
        page.touch("touchMove", [(x + shift, y), (x - 60 + shift, y)])
    page.touch("touchEnd")
    served.wait(lambda: camera.position != where)
    assert web.session.position == 1


def test_the_page_reads_and_writes_no_file_of_the_server(
    served: Served, browser: Chromium, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page, web = served.page(browser), served.web
    event = {"x": 0.5, "y": 0.5, "control": True}
    for key in "srom":
        served.call(lambda key=key: web.stream.put([{**event, "name": "KeyPress", "key": key}]))
        served.call(lambda key=key: web.stream.put([{**event, "name": "KeyRelease", "key": key}]))
    for name in ("save", "save.session", "save.session_as", "open", "record_input"):
        served.call(lambda name=name: web.model.press(name, "/etc/passwd"))
        served.call(lambda name=name: web.model.press("hint", name))
    served.wait(lambda: not len(web.stream.inputs))
    assert [path.name for path in tmp_path.iterdir()] == ["server"]
    assert not web.editor.controller.recordings.is_recording
    for path, method, header, status in (
        ("upload?name=a.ply", "POST", False, 403),
        ("upload?name=a.exe", "POST", True, 415),
        ("upload?name=../../a.ply", "POST", True, 413),
        ("download/ply", "GET", False, 403),
        ("download/..%2F..%2Fpasswd", "GET", True, 404),
    ):
        assert _status(f"http://127.0.0.1:{served.port}/{path}", method, header=header) == status
    assert [*(tmp_path / "server").rglob("*")] == []
    page.click((400, 200), modifiers=ALT)  # still there
    served.wait(lambda: not len(web.stream.inputs))


def _status(url: str, method: str, *, header: bool) -> int:
    body = bytes(10**6 + 1) if method == "POST" else None
    headers = {"X-Segdeform": "yes"} if header else {}
    request = urllib.request.Request(url, body, headers, method=method)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code
    except (urllib.error.URLError, ConnectionError):  # refused before the body was sent
        return 413
