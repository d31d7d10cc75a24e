"""Simulated hands for the desktop program: a window on a screen, and answers to its dialogs.

Run as a program, it waits for lines such as "drag FOLDER" and for each starts a program that drags,
saves, or rests after a drag, until it is killed; ``FOLDER/told`` contains its reports.
"""

from __future__ import annotations

import hashlib
import os
import signal
import sys
import warnings
from pathlib import Path

import numpy as np
from qt_hands import Qt, QtCore, QtHand, QtTest, QtWidgets, application, until
from qtpy import QtGui
from scenes import sausage

import pyvistaqt  # isort: skip
from vtk_segdeform import Session
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.app.window import Window
from vtk_segdeform.widgets.editor import Autosaves, Slot

INTERVAL = 0.3  # seconds


def ready_session() -> Session:
    """Return a session, complete except for a pose."""
    scene = sausage(is_coarse=True)
    return scene.session()


def digest(session: Session) -> str:
    """Return a digest of the pose, which differs if any stored bit differs."""
    pose, parts = session.state.pose, [session.vertices, session.fixed]
    if pose is not None:
        parts += [*pose.cage_vertices, *pose.targets.values()]
    whole = hashlib.sha256()
    for part in parts:
        whole.update(np.ascontiguousarray(part).tobytes())
    return whole.hexdigest()[:16]


class Boxes(QtCore.QObject):
    """A user who reads each dialog and gives the next prepared answer, or else closes it.

    Attributes
    ----------
    answers : list of str
        What to click, box by box.
    seen : list of str
        What the boxes said.
    """

    _newest = 0

    def __init__(self):
        super().__init__()
        self.answers, self.seen, self.unexpected = [], [], []
        self._number = Boxes._newest = Boxes._newest + 1
        self._timer = QtCore.QTimer(self)
        self._timer.timeout.connect(self._look)
        self._timer.start(10)

    def _look(self):
        if self._number != Boxes._newest:  # of a test that failed, whose objects live on
            self._timer.stop()
            return
        box = application().activeModalWidget()
        if not isinstance(box, QtWidgets.QMessageBox) or not box.isVisible():
            return
        text = f"{box.text()}\n{box.informativeText()}"
        self.seen.append(text)
        if not self.answers:
            self.unexpected.append(text)
            box.reject()
            return
        answer = self.answers.pop(0)
        if answer == "Escape":
            QtTest.QTest.keyClick(box, Qt.Key_Escape)
            return
        (button,) = (b for b in box.buttons() if b.text().replace("&", "") == answer)
        QtTest.QTest.mouseClick(button, Qt.LeftButton)


class AppHand:
    """A hand on a window of the program."""

    def __init__(self, window: Window):
        self.window = window
        window.resize(600, 400)
        window.show()
        until(lambda: window.windowHandle() and window.windowHandle().isExposed(), "the window")
        window.activateWindow()
        until(window.isActiveWindow, "the focus")

    @property
    def page(self):
        return self.window.pages.currentWidget()

    @property
    def title(self):
        """The visible title: with a star if there are unsaved changes."""
        star = "*" if self.window.isWindowModified() else ""
        return self.window.windowTitle().replace("[*]", star)

    def settle(self):
        """Let the window run until nothing is being opened, computed or autosaved."""
        application().processEvents()
        until(lambda: self.page is not self.window.pages.waiting, "the file")
        if self.window.has_mesh:
            until(lambda: not self.window.editor.is_busy, "the job")
            dragger = self.window.editor.widgets.dragger
            until(lambda: not dragger.is_refining, "refinement")
            until(lambda: self.window.autosaver.is_idle, "the autosave")

    def click(self, button):
        assert button.isVisible()
        assert button.isEnabled()
        QtTest.QTest.mouseClick(button, Qt.LeftButton)
        application().processEvents()

    def choose(self, *path):
        """Click through menus, by the beginnings of their labels."""
        action = self._open_menu(path[0])
        for name in path[1:]:
            menu = action.menu()
            until(menu.isVisible, f"the menu {name}")
            action = _named(menu, name)
            assert action.isEnabled(), name
            _click(menu, action)
        application().processEvents()

    def reads(self, *path):
        """Return (is enabled, is ticked) of the entries of an open menu, by label."""
        menus = [self._open_menu(path[0]).menu()]
        for name in path[1:]:
            action = _named(menus[-1], name)
            _click(menus[-1], action)
            until(action.menu().isVisible, f"the menu {name}")
            menus.append(action.menu())
        said = {
            a.text().replace("&", "").partition("\t")[0]: (a.isEnabled(), a.isChecked())
            for a in menus[-1].actions()
        }
        for menu in reversed(menus):
            QtTest.QTest.keyClick(menu, Qt.Key_Escape)
        application().processEvents()
        return said

    def _open_menu(self, name):
        """Click on a menu of the bar until it is open; return its action.

        The focus that returns late from a dialog can close it again.
        """
        bar = self.window.menuBar()
        action = _named(bar, name)

        def is_open():
            if not action.menu().isVisible():
                _click(bar, action)
            return action.menu().isVisible()

        until(is_open, f"the menu {name}")
        return action

    def view_hand(self) -> QtHand:
        """Return a hand on the view, from the front, with handles to drag."""
        editor, plotter = self.window.editor, self.window.editor_widget.plotter
        editor.mode = Mode.DEFORM
        self.settle()
        plotter.camera_position = "xz"
        plotter.render()
        plotter.setFocus()
        return QtHand(plotter.interactor, editor.view)

    def way(self, *, by=(0.0, 60.0), steps=6):
        """Return a path on the screen that starts at the centre of the handle."""
        view, gizmo = self.window.editor.view, self.window.editor.widgets.dragger.gizmo
        start = view.to_display(np.array([gizmo.centre]))[0, :2]
        return [start + t * np.array(by) for t in np.linspace(0.0, 1.0, steps)]


def _named(menu, beginning):
    actions = [a for a in menu.actions() if a.text().replace("&", "").startswith(beginning)]
    assert actions, f"no {beginning} in {[a.text() for a in menu.actions()]}"
    return actions[0]


def _click(menu, action):
    place = menu.actionGeometry(action).center()
    QtTest.QTest.mouseClick(menu, Qt.LeftButton, Qt.NoModifier, place)
    application().processEvents()


def slots(folder: Path) -> list[Path]:
    """Return the current autosave files beside the settings in *folder*."""
    return sorted((folder / "unsaved").glob("*/session.segdeform"))


def drop(hand, *paths):
    """Drag files over the centre of the window and drop them, by system events."""
    mime, window = QtCore.QMimeData(), hand.window.windowHandle()
    mime.setUrls([QtCore.QUrl.fromLocalFile(str(path)) for path in paths])
    place = QtCore.QPoint(window.width() // 3, window.height() // 2)
    about = Qt.CopyAction, mime, Qt.LeftButton, Qt.NoModifier
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Qt prefers a QPointF
        enter = QtGui.QDragEnterEvent(place, *about)
    application().sendEvent(window, enter)
    if enter.isAccepted():
        assert hand.window.pages.start.target.is_highlighted
        application().sendEvent(window, QtGui.QDropEvent(QtCore.QPointF(place), *about))
    application().processEvents()
    return enter.isAccepted()


def settings_in(folder: Path):
    """Return settings for the tests."""
    return QtCore.QSettings(str(folder / "settings.ini"), QtCore.QSettings.Format.IniFormat)


def delete(window) -> None:
    """Close a window and release everything that Qt deletes with it.

    PySide would take what is new in the same place for what the views remember; of a test that
    failed they live on.
    """
    window.close()
    for view in window.findChildren(pyvistaqt.QtInteractor):
        view._ctx = view._surface = None
    window.deleteLater()
    for _ in range(2):
        application().sendPostedEvents(None, QtCore.QEvent.DeferredDelete)
        application().processEvents()


# The program that is killed.


def _start_programs() -> None:
    """Fork a program for each line, so that imports and compilation happen once."""
    ready_session().bind()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # do not wait for children
    for line in sys.stdin:
        if os.fork() == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            what, folder = line.rstrip("\n").split(" ", 1)
            _run(what, Path(folder))


def _run(what: str, folder: Path) -> None:
    """Run the program: open the session, then drag, rest or save, and report each step."""
    told = os.open(folder / "told", os.O_WRONLY | os.O_CREAT | os.O_APPEND)

    def tell(*words):
        os.write(told, f"{' '.join(words)}\n".encode())

    tell("number", str(os.getpid()))
    poses = _told_poses(tell)
    application()
    window = Window(settings_in(folder), Autosaves(folder / "unsaved"), interval=INTERVAL)
    hand = AppHand(window)
    window.open(folder / "arm.segdeform")
    until(lambda: window.has_mesh, "the file")
    session = window.session
    poses(session)
    session.on_change(lambda _: poses(session))
    view = hand.view_hand()
    if what != "save":
        view.drag(hand.way(steps=6))
        hand.settle()
        tell("finished", digest(session))
        until(lambda: what == "drag", "the end", 60.0)
        there = hand.way(by=(0.0, -90.0), steps=20)
        view.press(there[0])
        while True:  # back and forth, without releasing
            for place in [*there, *reversed(there)]:
                view.move(place)
                tell("moved")
    while True:
        for by in (25.0, -25.0):
            view.drag(hand.way(by=(0.0, by), steps=3))
            tell("saving")
            QtTest.QTest.keyClick(view.widget, Qt.Key_S, Qt.ControlModifier)
            tell("saved", digest(session))


def _told_poses(tell):
    """Return a function that reports new poses of a session; autosaves are reported as well."""
    digests, poses, write = {}, [], Slot.write

    def tell_pose(session):
        pose = session.state.pose
        if id(pose) not in digests:
            poses.append(pose)  # so that its id is not reused
            digests[id(pose)] = digest(session)
            tell("pose", digests[id(pose)])

    def telling_write(slot, session, view):
        shown = digests.get(id(session.state.pose))
        write(slot, session, view)
        if shown is not None:
            tell("kept", shown)

    Slot.write = telling_write
    return tell_pose


if __name__ == "__main__":
    _start_programs()
