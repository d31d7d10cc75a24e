"""The editor in pyvistaqt's views: real Qt events, background jobs, and closing."""

from __future__ import annotations

import functools
import runpy
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from qt_hands import Qt, QtCore, QtHand, QtWidgets, application, until
from qt_moments import delete_now

import pyvistaqt  # isort: skip
import vtk_segdeform.widgets.plugin  # noqa: F401 - pyvistaqt ignores pyvista's entry points
from vtk_segdeform import Regions, models
from vtk_segdeform.widgets.editor import actions
from vtk_segdeform.widgets.editor.editor import Mode

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")
MESH = models.cactus(700)
EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "qt_application.py"


def in_a_window():
    """Return a QtInteractor in a window of an application, and that window."""
    window = QtWidgets.QMainWindow()
    plotter = pyvistaqt.QtInteractor(window, auto_update=False, off_screen=False)
    window.setCentralWidget(plotter)
    window.resize(700, 500)
    window.show()
    return plotter, window


def in_the_background():
    """Return a BackgroundPlotter and its window."""
    plotter = pyvistaqt.BackgroundPlotter(
        show=True, off_screen=False, auto_update=False, window_size=(700, 500),
        app=application(), toolbar=False, menu_bar=False, editor=False,
    )  # fmt: skip
    return plotter, plotter.app_window


@contextmanager
def shown(host):
    """Yield a plotter with the editor in it, the editor, a hand and the window."""
    app = application()
    plotter, window = host()
    until(lambda: window.isVisible() and window.windowHandle().isExposed(), "the window")
    editor = plotter.segdeform.edit(MESH)
    plotter.camera_position = "xz"
    plotter.render()
    app.processEvents()
    hand = QtHand(plotter.interactor, editor.view)
    plotter.interactor.setFocus()
    yield plotter, editor, hand, window
    assert hand.failures == []
    if not plotter._closed:
        plotter.close()
    window.close()
    window.deleteLater()
    delete_now()


@pytest.fixture(scope="module")
def shared(unprepared):
    """Yield a plotter with the editor in it, the editor, a hand and the window."""
    with shown(in_a_window) as view:
        yield view


@pytest.fixture
def again(shared):
    """Return the shared view as it was at first, after the tests that close theirs."""
    plotter, editor, hand, window = shared
    window.raise_()  # others may cover it, and Qt draws no covered one
    while editor.session.undo() is not None:
        pass
    editor.On()
    editor.mode = Mode.REGIONS
    plotter.camera_position = "xz"
    plotter.render()
    application().processEvents()
    plotter.interactor.setFocus()
    assert hand.failures == []
    return shared


def around(editor, mask):
    """Return two corners of a rectangle on the screen around some vertices."""
    seen = editor.view.to_display(editor.session.vertices[mask])[:, :2]
    return seen.min(axis=0) - 4.0, seen.max(axis=0) + 4.0


def test_closing_a_background_plotter_removes_the_editor():
    with shown(in_the_background) as (plotter, editor, hand, window):
        hand.key("g")  # during a job
        plotter.close()
        window.close()
        assert not editor.is_busy
        assert not editor.GetEnabled()


def test_a_job_is_stopped_by_escape_while_qt_runs(again, monkeypatch):
    _, editor, hand, _ = again
    end = time.monotonic() + 60.0

    def endless(mesh, n_regions, *, progress, **_):  # the real one may end before the key
        while time.monotonic() < end:
            progress(0.5, "looking everywhere")
            time.sleep(0.001)
        return Regions.single(mesh)

    monkeypatch.setattr(actions, "find_regions", endless)
    hand.key("g")
    until(lambda: "looking everywhere" in editor.status, "the job")
    hand.key("Escape")
    until(lambda: not editor.is_busy, "the end")
    assert editor.session.regions is None
    assert "Cancelled" in editor.status


def test_the_camera_rotates_beside_the_mesh_and_ctrl_erases(again):
    _, editor, hand, _ = again
    before = editor.view.camera.GetPosition()
    hand.drag([(30, 400), (60, 380), (90, 380)])
    assert editor.view.camera.GetPosition() != before
    editor.session.set_fixed(MESH.vertices[:, 2] < 0.3)
    for key in "3tvs":
        hand.key(key)
    hand.drag(around(editor, slice(None)), held=Qt.ControlModifier)
    assert len(editor.session.fixed) == 0


def test_alt_the_keypad_and_ctrl_i_arrive_while_the_editor_is_on(again):
    _, editor, hand, _ = again
    editor.mode = Mode.HANDLES
    middle = hand.at(MESH.vertices.mean(axis=0))
    camera = editor.view.camera
    before = camera.GetPosition()
    way = [middle, *((middle[0] + d, middle[1] + d) for d in (20, 40))]
    hand.drag(way, held=Qt.AltModifier)
    assert camera.GetPosition() != before
    assert not len(editor.session.fixed)
    hand.key("i", Qt.ControlModifier)
    assert len(editor.session.fixed) == MESH.n_vertices
    hand.key("7", Qt.KeypadModifier)
    until(lambda: abs(camera.GetDirectionOfProjection()[2]) > 0.99, "the view from the top")
    hand.key("page_down", Qt.KeypadModifier)  # 3, without Num Lock
    until(lambda: abs(camera.GetDirectionOfProjection()[0]) > 0.99, "the view from the side")
    hand.key("Home", Qt.KeypadModifier)
    until(lambda: abs(camera.GetDirectionOfProjection()[2]) > 0.99, "the view from the top again")
    assert editor.mode is Mode.HANDLES
    interactor = editor.view.interactor
    editor.Off()
    interactor.SetAltKey(False)
    hand.press(middle, Qt.AltModifier)
    assert not interactor.GetAltKey()
    hand.release(middle, Qt.AltModifier)


def test_each_change_is_drawn_once(again):
    _, editor, _, _ = again
    editor.mode = Mode.HANDLES
    drawn = []
    window = editor.view.window
    observer = window.AddObserver("EndEvent", lambda *_: drawn.append(len(editor.session.fixed)))

    def rest():
        """Wait until nothing has been drawn for a tenth of a second."""
        count, end = len(drawn), time.monotonic() + 0.1
        while time.monotonic() < end:
            application().processEvents()
            if len(drawn) > count:
                count, end = len(drawn), time.monotonic() + 0.1
            time.sleep(0.002)

    rest()
    drawn.clear()
    for number in (3, 5):
        editor.session.set_fixed(range(number))
        until(lambda number=number: number in drawn, "a picture")
        rest()
    window.RemoveObserver(observer)
    assert drawn == [3, 5]


# The example of an application.


def is_drawn(picture):
    """Return whether a picture shows the cactus, and not only the status line, which is 0.04."""
    grey = np.array(Image.open(picture).convert("L"))
    return 0.1 < (grey < 215).mean() < 0.5


def test_the_example_of_an_application_runs(tmp_path, monkeypatch):
    app, later = application(), QtCore.QTimer.singleShot
    monkeypatch.setattr(models, "cactus", lambda _: MESH)
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), "--picture", str(tmp_path / "window.png")])
    soon = functools.partial(later, 50)  # instead of a second
    # `quit` would close the windows of other tests, too.
    ended = lambda do: soon(lambda: (do(), app.exit()))  # noqa: E731
    monkeypatch.setattr(QtCore.QTimer, "singleShot", lambda _, do: ended(do))
    limit = QtCore.QTimer()
    limit.setSingleShot(True)
    limit.timeout.connect(app.exit)
    limit.start(60_000)
    window = runpy.run_path(str(EXAMPLE), run_name="__main__")["window"]
    assert limit.isActive()  # it has ended by itself
    assert is_drawn(tmp_path / "window.png")
    assert not window.editor.editor.GetEnabled()
    window.deleteLater()
    delete_now()
