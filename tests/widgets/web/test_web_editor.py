"""The editor in a real browser, by a real mouse, keys, fingers, uploads and downloads."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame")
from chromium import ALT, CTRL, Chromium, Page, needs_chromium
from solids import OCTAHEDRON
from web_hands import Served, line, only_file

from vtk_segdeform import Mesh, read_mesh
from vtk_segdeform.io import write_mesh
from vtk_segdeform.models.implicit import Limb, standing_body
from vtk_segdeform.session import Change, Session, load_session, save_session
from vtk_segdeform.widgets.editor import Mode, opening
from vtk_segdeform.widgets.editor.actions import to_mode

pytestmark = [
    needs_chromium,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.usefixtures("bound_once"),
]
LIMIT = 4 * 10**6  # bytes of an upload: more than the session of any mesh here
# A body with an arm, two regions.
LIMBS = [Limb([(0, 0, 0), (0, 0, 1)], [0.2, 0.2]), Limb([(0, 0, 0.5), (0.7, 0, 0.5)], [0.15, 0.12])]
SIZE = 1010, 480  # the side panel is beside the view from 1001 on


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder, mesh = tmp_path_factory.mktemp("server"), Mesh(*OCTAHEDRON)
    with Served(mesh, name="small.ply", folder=folder, upload_limit=LIMIT) as served:
        yield served


@pytest.fixture(scope="module")
def loaded(server: Served, browser: Chromium) -> Iterator[Page]:
    page = server.page(browser, size=SIZE)
    yield page
    page.close()


@pytest.fixture
def served(server: Served, tmp_path: Path) -> Served:
    """Return the shared editor with a new session, of a mesh that is soon prepared."""
    write_mesh(tmp_path / "small.ply", Mesh(*OCTAHEDRON))
    server.wait(lambda: server.is_at_rest)
    server.call(lambda: server.web.editor.do(to_mode(Mode.PULL)))
    _open(server, tmp_path / "small.ply")
    return server


@pytest.fixture
def cactus_file(tmp_path: Path, cactus: Mesh) -> Path:
    write_mesh(tmp_path / "cactus.ply", cactus)
    return tmp_path / "cactus.ply"


def _open(server: Served, file: Path) -> None:
    web, before = server.web, server.web.session
    server.call(lambda: web.editor.do(opening(file)))
    server.wait(lambda: web.session is not before and server.is_at_rest)


@pytest.fixture
def page(served: Served, loaded: Page) -> Page:
    """Return the shared page, which shows the new session, without focus."""
    loaded.evaluate("document.activeElement.blur()")
    loaded.wait("document.querySelectorAll('.sd-history .sd-row').length == 1")
    return loaded


def _seen(served: Served, lowest: float, highest: float) -> Any:
    """Return the vertex nearest to the camera, of those between two quantiles of height in view.

    It is not hidden: what hides it is in front of it, at the same height.
    """
    view, vertices = served.web.editor.view, served.web.session.vertices
    shown = served.call(lambda: view.to_display(vertices))
    low, high = np.quantile(shown[:, 1], [lowest, highest])
    among = (shown[:, 1] >= low) & (shown[:, 1] <= high)
    return vertices[among][np.argmin(shown[among, 2])]


def _top(served: Served) -> Any:
    """Return a vertex on the upper side that the camera sees."""
    return _seen(served, 0.9, 1.0)


def _upload(served: Served, page: Page, file: Path) -> None:
    before = served.web.session
    page.choose_files(".sd-file", file)
    page.wait("!!document.querySelector('[data-name=discard]') || "
              f"document.querySelector('.sd-name').textContent == '{file.name}'")  # fmt: skip
    if page.evaluate("!!document.querySelector('[data-name=discard]')"):
        page.click("[data-name=discard]")
    served.wait(lambda: served.web.session is not before and served.is_at_rest)
    page.wait(f"document.querySelector('.sd-name').textContent == '{file.name}'")


def _step_by_step(
    served: Served, page: Page, positions: Iterable[int], key: str, button: str
) -> None:
    """Undo or redo with the key and with the button in turn, one step each."""
    session, seen = served.web.session, list[int]()
    stop = served.call(lambda: session.on_change(lambda _: seen.append(session.history.position)))
    for turn, position in enumerate(positions):
        seen.clear()
        if turn % 2:
            page.click(f"[data-name={button}]")
        else:
            page.key(key, modifiers=CTRL)
        served.wait(lambda: seen and served.is_at_rest and not len(served.web.stream.inputs))
        assert set(seen) == {position}
    served.call(stop)


def tell_a_story(served: Served, page: Page, mesh: Path, folder: Path, **options: int) -> None:
    """Upload, pull, regions, cages, a handle, drag, turn, undo, redo, download, upload again.

    From the second step on, the session has the *options*.
    """
    web, editor, known = served.web, served.web.editor, len(page.messages())
    _upload(served, page, mesh)
    session, changes = web.session, list[float]()
    rest = session.vertices

    def notice(change: Change) -> None:
        if change & Change.POSE and session.has_volume:
            changes.append(session.volume_change)

    served.call(lambda: session.on_change(notice))
    start = served.seen(page, _top(served))
    page.drag(line(start, (start[0] + 60, start[1] + 15), 8), pause=0.02)
    served.wait(lambda: session.history.undo_label == "pull" and served.is_at_rest)
    assert np.abs(session.vertices - rest).max() > 0.03 * session.mesh.diagonal
    assert len(changes) > 2

    served.call(lambda: session.change_options(**options))
    page.key("g")
    served.wait(lambda: " found" in editor.status and served.is_at_rest)
    page.key("f")
    served.wait(lambda: " fitted" in editor.status and served.is_at_rest)
    page.wait("document.querySelector('.sd-history .selected').textContent == 'Fit cages'")
    page.key("2")
    served.wait(lambda: editor.mode is Mode.CAGES)
    page.key("3")
    served.wait(lambda: editor.mode is Mode.HANDLES)
    start = served.seen(page, _seen(served, 0.0, 0.15))
    page.drag(line(start, (start[0] + 4, start[1] - 4), 4), pause=0.02)
    served.wait(lambda: len(session.fixed) > 0)
    page.key("d")
    page.key("a")
    start = served.seen(page, _top(served))
    page.drag(line(start, (start[0] + 24, start[1] + 18), 8), pause=0.02)
    served.wait(lambda: any(len(ids) > 1 for ids in session.handles.values()))
    page.key("4")
    served.wait(lambda: editor.mode is Mode.DEFORM and served.is_at_rest)
    for turns in (False, True):
        steps = session.history.position
        gizmo = served.call(lambda: editor.widgets.dragger.gizmo.centre)
        start = served.seen(page, np.asarray(gizmo))
        page.drag(line(start, (start[0] + 30, start[1]), 5), pause=0.02, release=False)
        if turns:
            page.key("r")
            page.move((start[0] + 45, start[1] + 5))
        page.release((start[0] + 45, start[1] + 5))
        served.wait(lambda steps=steps: session.history.position == steps + 1 and served.is_at_rest)
    assert np.abs(changes).max() < 1e-12

    served.wait(lambda: not editor.controller.finishing.is_pending)  # which changes the last step
    posed, steps = session.vertices, session.history.position
    _step_by_step(served, page, range(steps - 1, -1, -1), "z", "undo")
    np.testing.assert_array_equal(session.vertices, rest)
    _step_by_step(served, page, range(1, steps + 1), "y", "redo")
    np.testing.assert_array_equal(session.vertices, posed)

    page.save_downloads(folder)
    page.key("s", modifiers=CTRL)
    file = only_file(folder, "*.segdeform")
    assert file.stem == mesh.stem
    np.testing.assert_array_equal(load_session(file).vertices, posed)
    page.wait("!document.querySelector('.sd-document b')")  # nothing is unsaved
    page.click("[data-name=download]")
    page.wait("!!document.querySelector('.sd-menu button:nth-of-type(3)')")
    page.evaluate("[...document.querySelectorAll('.sd-menu button')]"
                  ".find((each) => each.textContent.includes('.obj')).click()")  # fmt: skip
    written = read_mesh(only_file(folder, "*.obj"))
    np.testing.assert_allclose(written.vertices, posed, atol=1e-6 * session.mesh.diagonal)

    page.key("Home")
    served.wait(lambda: session.state.pose is None)
    page.wait("!!document.querySelector('.sd-document b')")
    _upload(served, page, file)
    np.testing.assert_array_equal(web.session.vertices, posed)
    assert [m for m in page.messages()[known:] if m.startswith("error")] == []


def test_a_story_by_mouse_and_keys_comes_back_from_its_download_to_the_bit(
    served: Served, page: Page, tmp_path: Path
) -> None:
    write_mesh(tmp_path / "arm.ply", standing_body(LIMBS, 250, blend=0.05))
    (tmp_path / "down").mkdir()
    tell_a_story(served, page, tmp_path / "arm.ply", tmp_path / "down", n_cage_vertices=50)


def test_a_right_click_opens_a_menu_and_a_click_on_before_after_lasts(
    served: Served, page: Page, cactus_file: Path
) -> None:
    _open(served, cactus_file)
    session, editor = served.web.session, served.web.editor
    place = served.seen(page, _top(served))
    page.click(place, button="right")
    page.wait("document.querySelectorAll('.sd-context button').length > 5")
    page.key("Escape")
    page.wait("!document.querySelector('.sd-context')")
    page.click(place, button="right")
    page.wait("!!document.querySelector('.sd-context')")
    page.evaluate("[...document.querySelectorAll('.sd-context button')]"
                  ".find((each) => each.textContent.includes('Pin this')).click()")  # fmt: skip
    served.wait(lambda: list(session.handles) == ["pin 1"])
    page.wait("!document.querySelector('.sd-context')")
    page.drag(line(place, (place[0] + 60, place[1] + 15), 8), pause=0.02)
    served.wait(lambda: session.state.pose is not None and served.is_at_rest)
    for stays in (True, False):  # a click keeps the mesh at rest until the next one
        page.click("[data-name=compare]")
        served.wait(lambda stays=stays: editor.controller.shows_rest is stays)
        page.wait(f"!!document.querySelector('[data-name=compare].down') === {str(stays).lower()}")


@pytest.mark.campaign
def test_the_history_is_previewed_and_keys_reach_the_toolbar_and_the_help(
    served: Served, page: Page, cactus_file: Path
) -> None:
    _open(served, cactus_file)
    page.wait("document.querySelectorAll('.sd-history .sd-row').length == 1")
    web = served.web
    surface = web.editor.widgets.surface
    start = served.seen(page, _top(served))
    page.drag(line(start, (start[0] + 60, start[1]), 5), pause=0.02)
    served.wait(lambda: web.session.history.position == 1 and served.is_at_rest)
    page.wait("document.querySelectorAll('.sd-history .sd-row').length == 2")
    page.move(page.centre(".sd-history .sd-row"))
    served.wait(lambda: web.editor.widgets.surface.instead is not None)
    page.move(start)
    served.wait(lambda: web.editor.widgets.surface.instead is None)
    assert web.session.history.position == 1

    page.key("F6")
    page.wait("document.activeElement.dataset.name == 'open'")
    page.key("F6")
    page.wait("document.activeElement == document.body")
    page.key("?")
    page.wait("document.querySelector('.sd-help').textContent.includes('Auto-segment')")
    page.key("z", modifiers=CTRL)  # nothing behind it
    page.key("Escape")
    page.wait("!document.querySelector('.sd-help')")
    served.wait(lambda: not len(web.stream.inputs))
    assert web.session.history.position == 1
    page.evaluate("document.activeElement.blur()")
    page.key("Tab")
    page.wait("document.activeElement != document.body")
    assert surface is not None


@pytest.mark.campaign
def test_one_finger_pulls_and_two_turn(
    served: Served, browser: Chromium, cactus_file: Path
) -> None:
    _open(served, cactus_file)
    page, web = served.page(browser, touch=True, size=(390, 700)), served.web
    hint = page.evaluate("document.querySelector('.sd-hint').textContent")
    assert "Shift" not in hint + page.evaluate("document.querySelector('.sd-cards').textContent")
    assert "Choose Pin" in hint
    camera = web.plotter.camera
    where, (x, y) = camera.position, served.seen(page, _top(served))
    page.touch("touchStart", [(x, y)])
    for shift in (15, 30, 45):
        page.touch("touchMove", [(x + shift, y)])
    page.touch("touchEnd")
    served.wait(lambda: web.session.history.position == 1)
    assert camera.position == where
    page.touch("touchStart", [(x, y), (x - 60, y)])
    for shift in (15, 30, 45):
        page.touch("touchMove", [(x + shift, y), (x - 60 + shift, y)])
    page.touch("touchEnd")
    served.wait(lambda: camera.position != where)
    assert web.session.history.position == 1
    page.close()


def test_landmarks_and_poses_come_from_files_of_the_visitor_and_landmarks_go_to_one(
    served: Served, page: Page, tmp_path: Path
) -> None:
    session, other = served.web.session, Session(served.web.session.mesh)
    other.saved_poses.save("wave")
    save_session(tmp_path / "other.segdeform", other)
    page.choose_files("[data-name='poses.copy']", tmp_path / "other.segdeform")
    served.wait(lambda: [*session.saved_poses] == ["wave"] and served.is_at_rest)
    page.wait("document.querySelector('.sd-hint').textContent.includes('Copied 1 pose')")
    (tmp_path / "points.csv").write_text("nose,1,0,0\n")
    page.choose_files("[data-name='landmarks.source']", tmp_path / "points.csv")
    served.wait(lambda: [*session.landmarks] == ["nose"])
    (tmp_path / "damaged.csv").write_text("nose,1\n")
    page.choose_files("[data-name='landmarks.target']", tmp_path / "damaged.csv")
    page.wait("document.querySelector('.sd-fault span')?.textContent.startsWith('damaged.csv')")
    page.save_downloads(tmp_path)
    save = (
        "[...document.querySelectorAll('.sd-asks button')]"
        ".find((each) => each.textContent == 'Save ...')"
    )
    page.wait(f"{save} !== undefined")
    page.evaluate(f"{save}.click()")
    assert only_file(tmp_path, "small-source.csv").read_text().splitlines()[-1].startswith("nose,1")
    page.wait("document.querySelector('.sd-hint').textContent.startsWith('Downloaded')")


def test_the_page_reads_and_writes_no_file_of_the_server(
    served: Served, page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    web, folder = served.web, served.folder
    before = [*tmp_path.iterdir()], [*folder.rglob("*")]
    event = {"x": 0.5, "y": 0.5, "control": True}
    for key in "srom":
        served.call(lambda key=key: web.stream.put([{**event, "name": "KeyPress", "key": key}]))
        served.call(lambda key=key: web.stream.put([{**event, "name": "KeyRelease", "key": key}]))
    for name in ("save", "save.session", "save.session_as", "open"):
        served.call(lambda name=name: web.model.press(name, "/etc/passwd"))
        served.call(lambda name=name: web.model.press("hint", name))
    served.wait(lambda: not len(web.stream.inputs))
    assert [*tmp_path.iterdir()] == before[0]
    for path, method, header, status in (
        ("upload?name=a.ply", "POST", False, 403),
        ("upload?name=a.exe", "POST", True, 415),
        ("upload?name=../../a.ply", "POST", True, 413),
        ("download/ply", "GET", False, 403),
        ("download/..%2F..%2Fpasswd", "GET", True, 404),
        ("download/ply?field=landmarks.save_source", "GET", True, 404),
        ("download/csv?field=landmarks.source", "GET", True, 409),
        ("download/csv?field=/etc/passwd", "GET", True, 409),
        ("download/csv?field=landmarks.save_source", "GET", True, 409),  # there is none
    ):
        assert _status(f"http://127.0.0.1:{served.port}/{path}", method, header=header) == status
    assert [*folder.rglob("*")] == before[1]
    page.click((400, 200), modifiers=ALT)  # still there
    served.wait(lambda: not len(web.stream.inputs))


def _status(url: str, method: str, *, header: bool) -> int:
    body = bytes(LIMIT + 1) if method == "POST" else None
    headers = {"X-Segdeform": "yes"} if header else {}
    request = urllib.request.Request(url, body, headers, method=method)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code
    except (urllib.error.URLError, ConnectionError):  # refused before the body was sent
        return 413
