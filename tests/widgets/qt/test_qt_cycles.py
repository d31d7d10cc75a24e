"""Cycles of opening, using and closing the editor release everything.

Threads, timers, files, VTK windows and memory return to their earlier values in every host: a
`DeformWidget`, a dock over an existing pyvistaqt view, a dock over a window of plain VTK.  The last
one draws into an X window, which is impossible in a process that uses EGL, so it is tested in a
separate process.
"""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest
from campaign import every
from qt_hands import (
    ONE_SCREEN,
    Qt,
    QtCore,
    QtHand,
    QtTest,
    QtWidgets,
    application,
    new_screen,
    small,
    until,
)
from vtkmodules.vtkCommonCore import vtkWeakReference

import pyvistaqt  # isort: skip
from vtk_segdeform.kernels import compiled_kernels
from vtk_segdeform.session.session import Session
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.qt.widget import DeformWidget, deform_dock

WARM = 1  # cycles until caches, fonts and shaders are loaded
# Memory is stable after a dozen cycles.  A leak per cycle would be 0.45 MiB for a bound session,
# 0.8 for the actors of the mesh, 4 for an editor; allocators vary by a few MiB in all.  A window of
# plain VTK with a sphere loses 0.3 by itself.
SETTLED, MORE, SLACK, OF_PLAIN_VTK = 12, 0.2, 4.0, 0.35  # cycles; MiB a cycle, in all, a cycle


class Widget:
    """A `DeformWidget` in a separate window."""

    def __init__(self, session):
        self.window = DeformWidget(session)
        self.editor, self.panel = self.window.editor, self.window.panel
        self.plotter = self.window.plotter
        self.drawn_on = self.plotter.interactor

    def end(self):
        self.window.close()


class Dock:
    """A dock over an existing `QtInteractor`."""

    def __init__(self, session):
        self.window = QtWidgets.QMainWindow()
        self.plotter = pyvistaqt.QtInteractor(self.window, auto_update=False, off_screen=False)
        self.window.setCentralWidget(self.plotter)
        dock = deform_dock(self.plotter, session, self.window)
        self.window.addDockWidget(Qt.RightDockWidgetArea, dock)
        self.editor, self.panel, self.drawn_on = dock.editor, dock.panel, self.plotter.interactor

    def end(self):
        self.plotter.close()
        self.window.close()


class PlainDock:
    """A dock over a window of plain VTK, without pyvista."""

    def __init__(self, session):
        from vtkmodules.qt.QVTKRenderWindowInteractor import QVTKRenderWindowInteractor
        from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self.window = QtWidgets.QMainWindow()
        self.drawn_on = QVTKRenderWindowInteractor(self.window)
        self.window.setCentralWidget(self.drawn_on)
        renderer, window = vtkRenderer(), self.drawn_on.GetRenderWindow()
        window.SetMultiSamples(0)  # as conftest does for the other windows
        window.AddRenderer(renderer)
        interactor = window.GetInteractor()
        interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
        show(self.window)  # drawn while empty, as many applications do
        interactor.Initialize()
        dock = deform_dock((renderer, interactor), session, self.window)
        self.window.addDockWidget(Qt.RightDockWidgetArea, dock)
        self.editor, self.panel = dock.editor, dock.panel
        seen = self.editor.view.to_display(session.mesh.vertices)[:, :2] / renderer.GetSize()
        assert 0.0 < seen.min() < seen.max() < 1.0  # the editor has set the camera

    def end(self):
        self.editor.remove()
        self.window.close()


class Forgetful(PlainDock):
    """The same for an application that closes its window without removing the editor."""

    def end(self):
        self.drawn_on.Finalize()
        self.window.close()


def fifty(kind):
    """Return the parameters of a long test that detects small leaks."""
    return pytest.param(kind, 50, marks=pytest.mark.campaign)


def ready():
    """Return a session, complete except for a pose."""
    mesh, state = small()
    return Session(mesh, state=state)


def show(window):
    window.resize(560, 300)
    window.show()
    until(lambda: window.windowHandle() and window.windowHandle().isExposed(), "the window")


def dragged(host):
    """Drag the handle by a real mouse; return the session's volume change at every move."""
    editor = host.editor
    editor.mode = Mode.DEFORM
    until(lambda: not editor.is_busy, "binding")
    editor.view.renderer.ResetCamera()
    editor.view.render()
    application().processEvents()
    hand, changes = QtHand(host.drawn_on, editor.view), []
    session = editor.session
    stop = session.on_change(lambda _: changes.append(session.volume_change))
    start = np.array(hand.at(editor.widgets.dragger.gizmo.centre))
    hand.drag(start + t * np.array([5.0, 25.0]) for t in np.linspace(0.0, 1.0, 4))
    stop()
    moved = np.array(hand.at(editor.widgets.dragger.gizmo.centre)) - start
    assert moved == pytest.approx([5.0, 25.0], abs=3.0)
    assert hand.failures == []
    return changes


def timers():
    """Return the number of Qt timers, and of active ones."""
    tops = [application(), *application().topLevelWidgets()]
    every = {id(each): each for top in tops for each in top.findChildren(QtCore.QTimer)}
    every |= {id(each): each for each in gc.get_objects() if issubclass(type(each), QtCore.QTimer)}
    running = []
    for each in every.values():
        with contextlib.suppress(RuntimeError):  # Qt has deleted the object of a Python wrapper
            running.append(each.isActive())
    return len(running), sum(running)


def one_cycle(kind, *, in_a_job):
    """Open, drag and close; return weak references to objects that should be released."""
    session = ready()
    host = kind(session)
    show(host.window)
    changes = dragged(host)  # close the window during refinement
    assert max(map(abs, changes)) < 1e-12
    assert host.window.findChildren(QtCore.QTimer)  # timers can be found while they exist
    if in_a_job:
        host.editor.mode = Mode.REGIONS
        application().processEvents()
        host.panel.refresh()
        QtTest.QTest.mouseClick(host.panel.controls["regions.segment"], Qt.LeftButton)
        assert host.editor.is_busy
    window = host.editor.view.window
    drawn = [vtkWeakReference() for _ in range(3)]
    for reference, each in zip(
        drawn, (window, window.GetInteractor(), host.editor.view.renderer), strict=True
    ):
        reference.Set(each)
    parts = host.window, host.editor, host.panel, host.drawn_on, host.editor.widgets.dragger, host
    gone = [*map(weakref.ref, parts), *(reference.Get for reference in drawn)]
    del window, each, parts
    host.end()
    host.window.deleteLater()
    assert kind is Forgetful or not host.editor.is_busy
    del host
    delete_now()
    listeners = session.history._listeners._listeners
    assert kind is Forgetful or listeners == {}
    return [*gone, weakref.ref(session)]


def delete_now():
    """Let Qt process deferred deletes, and then collect the wrappers of PyQt."""
    for _ in range(2):
        application().sendPostedEvents(None, QtCore.QEvent.DeferredDelete)
        application().processEvents()


def mebibytes():
    """Return the memory of the process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2.0**20


def watch_cycles(kind, times):
    """Run some cycles and check that each releases everything."""
    application()
    compiled_kernels()  # or a thread would load them meanwhile
    memory = []

    def cycle(number):
        gone = one_cycle(kind, in_a_job=number % 4 == 1 and kind is not Forgetful)
        gc.collect()
        delete_now()
        assert [each() for each in gone] == [None] * len(gone)
        memory.append(mebibytes())

    for number in range(WARM):
        cycle(number)
    windows = application().topLevelWidgets()  # of earlier tests
    threads, files = threading.active_count(), len(os.listdir("/proc/self/fd"))
    tasks, ticking = len(os.listdir("/proc/self/task")), timers()
    for number in range(times):
        cycle(number)
    assert threading.active_count() <= threads  # one of an earlier test may end meanwhile
    assert len(os.listdir("/proc/self/task")) <= tasks
    assert len(os.listdir("/proc/self/fd")) <= files
    assert all(np.less_equal(timers(), ticking))  # timers of an earlier test may end meanwhile
    assert [each for each in application().topLevelWidgets() if each not in windows] == []
    if times > SETTLED:
        grown = min(memory[-3:]) - min(memory[SETTLED - 3 : SETTLED])
        each = MORE + OF_PLAIN_VTK * issubclass(kind, PlainDock)
        bound = SLACK + each * (len(memory) - SETTLED)
        assert grown < bound, f"{grown:.1f} MiB more: {np.round(memory, 1)}"


DELETED = """
import shiboken6
from qtpy import QtWidgets
from vtk_segdeform import models
from vtk_segdeform.widgets.qt import DeformWidget

application, mesh = QtWidgets.QApplication([]), models.cactus(700)

def shown(window):
    window.resize(500, 400)
    window.show()
    let_run()
    return window

def let_run():
    end = time.monotonic() + 0.4
    while time.monotonic() < end:
        application.processEvents()

other = shown(DeformWidget(mesh))
for _ in range(4):
    third = shown(DeformWidget(mesh))
    window, widget = QtWidgets.QMainWindow(), DeformWidget(mesh)
    window.setCentralWidget(widget)
    shown(window)
    shiboken6.delete(window)
    let_run()
    other.editor.view.request_render()
    let_run()
    other.editor.view.render()
print("all drawn", flush=True)
"""


@pytest.mark.campaign
def test_a_window_that_qt_deletes_without_closing_it_leaves_the_others_as_they_are():
    pytest.importorskip("shiboken6")
    application()  # or skip
    own = {"DISPLAY": new_screen(), "PYVISTA_OFF_SCREEN": "false", "QT_XCB_GL_INTEGRATION": ""}
    environment = {**os.environ, **own}
    environment.pop("VTK_DEFAULT_OPENGL_WINDOW", None)
    done = subprocess.run(
        [sys.executable, "-c", DELETED], capture_output=True, text=True, env=environment
    )
    assert "all drawn" in done.stdout, done.stderr[-2000:]  # it may crash at its own end


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs Linux's /proc")
@pytest.mark.parametrize(
    ("kind", "times"), [*every(2, [(Dock, 1), (Widget, 1)]), fifty(Widget), fifty(Dock)]
)
def test_nothing_is_left(kind, times):
    watch_cycles(kind, times)


@pytest.mark.skipif(ONE_SCREEN not in os.environ, reason="run by the test below")
@pytest.mark.parametrize(("kind", "times"), [(PlainDock, 1), fifty(PlainDock), fifty(Forgetful)])
def test_nothing_is_left_in_plain_vtk(kind, times):
    watch_cycles(kind, times)


@pytest.mark.skipif(ONE_SCREEN in os.environ, reason="runs the test above")
@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs Linux's /proc")
@pytest.mark.campaign
@pytest.mark.parametrize("times", [1, 50])
def test_a_dock_over_plain_vtk_works_and_leaves_nothing(times):
    application()  # or skip
    chosen = ["-k", f"plain_vtk and -{times}", "-m", "campaign or not campaign"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", __file__, *chosen],
        env={**os.environ, ONE_SCREEN: "yes"}, capture_output=True, text=True,
    )  # fmt: skip
    assert f"{1 if times == 1 else 2} passed" in done.stdout, done.stdout + done.stderr
