"""Simulated hands for the desktop program: a window on a screen, and answers to its dialogs."""

from __future__ import annotations

import hashlib
import warnings
from pathlib import Path

import numpy as np
from qt_hands import Qt, QtCore, QtHand, QtTest, QtWidgets, application, until
from qtpy import QtGui
from scenes import sausage

from vtk_segdeform import Session
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.app.window import Window


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
    """Close a window and release everything that Qt deletes with it."""
    window.close()
    window.deleteLater()
    for _ in range(2):
        application().sendPostedEvents(None, QtCore.QEvent.DeferredDelete)
        application().processEvents()


# The program that is killed.
