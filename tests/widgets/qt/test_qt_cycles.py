"""Cycles of opening, using and closing the editor release everything.

Threads, timers, files, VTK windows and memory return to their earlier values in a `DeformWidget`
and in a dock over an existing pyvistaqt view.
"""

from __future__ import annotations

import contextlib
import gc
import os
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest
from campaign import every
from qt_hands import (
    Qt,
    QtCore,
    QtHand,
    QtTest,
    QtWidgets,
    application,
    small,
    until,
)
from qt_moments import delete_now
from vtkmodules.vtkCommonCore import vtkWeakReference

import pyvistaqt  # isort: skip
from vtk_segdeform.kernels import compiled_kernels
from vtk_segdeform.session.session import Session
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.qt.widget import DeformWidget, close_view, deform_dock

WARM = 1  # cycles until caches, fonts and shaders are loaded
# Memory is stable after a dozen cycles.  A leak per cycle would be 0.45 MiB for a bound session,
# 0.8 for the actors of the mesh, 4 for an editor; allocators vary by a few MiB in all.
SETTLED, MORE, SLACK = 12, 0.2, 4.0  # cycles; MiB a cycle, in all


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
        close_view(self.plotter)
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
    assert not host.editor.is_busy
    del host
    delete_now()
    listeners = session.history._listeners._listeners
    assert listeners == {}
    return [*gone, weakref.ref(session)]


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
        gone = one_cycle(kind, in_a_job=number % 4 == 1)
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
        bound = SLACK + MORE * (len(memory) - SETTLED)
        assert grown < bound, f"{grown:.1f} MiB more: {np.round(memory, 1)}"


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs Linux's /proc")
@pytest.mark.parametrize(
    ("kind", "times"), [*every(2, [(Dock, 1), (Widget, 1)]), fifty(Widget), fifty(Dock)]
)
def test_nothing_is_left(kind, times):
    watch_cycles(kind, times)
