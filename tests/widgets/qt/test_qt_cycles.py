"""Opened, used by a real mouse and closed, again and again: nothing is left of it.

Threads, timers, files, windows of VTK and memory return to where they were, whichever host the
editor is in: a `DeformWidget`, a dock over a pyvistaqt view of somebody's, a dock over a window
of plain VTK.  The last draws by itself into a window of X, which a process that draws by EGL
cannot: it is tested in a process of its own.
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
from qt_hands import (
    ONE_SCREEN,
    Qt,
    QtCore,
    QtHand,
    QtTest,
    QtWidgets,
    application,
    small,
    until,
)
from vtkmodules.vtkCommonCore import vtkWeakReference

import pyvistaqt  # isort: skip
from vtk_segdeform.session.session import Session
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.qt.widget import DeformWidget, deform_dock

WARM = 2  # cycles until caches, fonts and shaders are there
# Memory is settled after a dozen cycles.  Of what could stay behind from then on, each time, a
# bound session takes 0.45 MiB, what draws the mesh 0.8, an editor 4; allocators come and go with
# a few in all.  A window of plain VTK by itself, with a sphere in it, takes 0.3 that never return.
SETTLED, MORE, SLACK, OF_PLAIN_VTK = 12, 0.2, 4.0, 0.35  # cycles; MiB a cycle, in all, a cycle


class Widget:
    """A `DeformWidget` in a window of its own."""

    def __init__(self, session):
        self.window = DeformWidget(session)
        self.editor, self.panel = self.window.editor, self.window.panel
        self.plotter = self.window.plotter
        self.drawn_on = self.plotter.interactor

    def end(self):
        self.window.close()


class Dock:
    """A dock over a `QtInteractor` that is somebody else's."""

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
    """A dock over a window of plain VTK, which knows nothing of pyvista."""

    def __init__(self, session):
        from vtkmodules.qt.QVTKRenderWindowInteractor import QVTKRenderWindowInteractor
        from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self.window = QtWidgets.QMainWindow()
        self.drawn_on = QVTKRenderWindowInteractor(self.window)
        self.window.setCentralWidget(self.drawn_on)
        renderer, window = vtkRenderer(), self.drawn_on.GetRenderWindow()
        window.SetMultiSamples(0)  # as of the others, by conftest
        window.AddRenderer(renderer)
        interactor = window.GetInteractor()
        interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
        show(self.window)  # drawn while it is empty, as in many an application
        interactor.Initialize()
        dock = deform_dock((renderer, interactor), session, self.window)
        self.window.addDockWidget(Qt.RightDockWidgetArea, dock)
        self.editor, self.panel = dock.editor, dock.panel
        seen = self.editor.view.to_display(session.mesh.vertices)[:, :2] / renderer.GetSize()
        assert 0.0 < seen.min() < seen.max() < 1.0  # nobody had aimed the camera yet

    def end(self):
        self.editor.remove()
        self.window.close()


class Forgetful(PlainDock):
    """The same, by an application that closes its window and forgets about the editor."""

    def end(self):
        self.drawn_on.Finalize()
        self.window.close()


def fifty(kind):
    """Return the parameters of a test that sees what leaks a little, and takes long."""
    return pytest.param(kind, 50, marks=pytest.mark.campaign)


def ready():
    """Return a session that lacks nothing but a pose."""
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
    """Return how many timers of Qt there are, and how many of them run."""
    tops = [application(), *application().topLevelWidgets()]
    every = {id(each): each for top in tops for each in top.findChildren(QtCore.QTimer)}
    every |= {id(each): each for each in gc.get_objects() if issubclass(type(each), QtCore.QTimer)}
    running = []
    for each in every.values():
        with contextlib.suppress(RuntimeError):  # Qt has deleted what Python still has a name for
            running.append(each.isActive())
    return len(running), sum(running)


def one_cycle(kind, *, in_a_job):
    """Open, drag, close, and return what should be gone by then, as weak references."""
    session = ready()
    host = kind(session)
    show(host.window)
    changes = dragged(host)  # and close it while the pose is being refined
    assert max(map(abs, changes)) < 1e-12
    assert host.window.findChildren(QtCore.QTimer)  # they are seen while there are some
    if in_a_job:
        host.editor.mode = Mode.REGIONS
        application().processEvents()
        host.panel.refresh()
        QtTest.QTest.mouseClick(host.panel.regions.segment, Qt.LeftButton)
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
    nobody = session._listeners._listeners  # who would be spoken to by a change of the session
    assert kind is Forgetful or nobody == {}
    return [*gone, weakref.ref(session)]


def delete_now():
    """Let Qt delete what is to be deleted later, and then what PyQt has for that."""
    for _ in range(2):
        application().sendPostedEvents(None, QtCore.QEvent.DeferredDelete)
        application().processEvents()


def mebibytes():
    """Return how much memory the process has now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2.0**20


def watch_cycles(kind, times):
    """Go through some cycles; nothing may be left of any."""
    application()
    memory = []

    def cycle(number):
        gone = one_cycle(kind, in_a_job=number % 4 == 1 and kind is not Forgetful)
        gc.collect()
        delete_now()
        assert [each() for each in gone] == [None] * len(gone)
        memory.append(mebibytes())

    for number in range(WARM):
        cycle(number)
    threads, files = threading.active_count(), len(os.listdir("/proc/self/fd"))
    tasks, ticking = len(os.listdir("/proc/self/task")), timers()
    for number in range(times):
        cycle(number)
    assert threading.active_count() == threads
    assert len(os.listdir("/proc/self/task")) <= tasks
    assert len(os.listdir("/proc/self/fd")) <= files
    assert all(np.less_equal(timers(), ticking))  # what an earlier test left may go meanwhile
    assert application().topLevelWidgets() == []
    if times > SETTLED:
        grown = min(memory[-3:]) - min(memory[SETTLED - 3 : SETTLED])
        each = MORE + OF_PLAIN_VTK * issubclass(kind, PlainDock)
        bound = SLACK + each * (len(memory) - SETTLED)
        assert grown < bound, f"{grown:.1f} MiB more: {np.round(memory, 1)}"


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs Linux's /proc")
@pytest.mark.parametrize(("kind", "times"), [(Widget, 2), (Dock, 1), fifty(Widget), fifty(Dock)])
def test_nothing_is_left(kind, times):
    watch_cycles(kind, times)


@pytest.mark.skipif(ONE_SCREEN not in os.environ, reason="run by the test below")
@pytest.mark.parametrize(("kind", "times"), [(PlainDock, 1), fifty(PlainDock), fifty(Forgetful)])
def test_nothing_is_left_in_plain_vtk(kind, times):
    watch_cycles(kind, times)


@pytest.mark.skipif(ONE_SCREEN in os.environ, reason="runs the test above")
@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs Linux's /proc")
@pytest.mark.parametrize("times", [1, pytest.param(50, marks=pytest.mark.campaign)])
def test_a_dock_over_plain_vtk_works_and_leaves_nothing(times):
    application()  # or skip
    chosen = ["-k", f"plain_vtk and -{times}", "-m", "campaign or not campaign"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", __file__, *chosen],
        env={**os.environ, ONE_SCREEN: "yes"}, capture_output=True, text=True,
    )  # fmt: skip
    assert f"{1 if times == 1 else 2} passed" in done.stdout, done.stdout + done.stderr
