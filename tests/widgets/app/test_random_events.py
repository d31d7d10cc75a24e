"""Random events all over the window of the program: no exception, and no growing memory.

The document is saved and opened again now and then.  Before that, undo leads back through every
state, and redo forward again, to the bit.
"""

from __future__ import annotations

import gc
import logging
import sys
import traceback

import numpy as np
import pytest
from app_hands import AppHand, Boxes, delete, digest, settings_in
from monkey import KEYS, ODDS
from qt_hands import Qt, QtCore, QtTest, QtWidgets, application, small
from qtpy import QtGui
from soaking import resident

from vtk_segdeform import Session
from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.kernels import compiled_kernels
from vtk_segdeform.session.store import save_session
from vtk_segdeform.widgets.app.window import Window
from vtk_segdeform.widgets.editor import Autosaves

COUNTS = 1_000, 5_000, 10_000, 20_000
KINDS = [0.15, 0.35, 0.15, 0.15, 0.05, 0.12, 0.018, 0.01, 0.002]
HELD = Qt.NoModifier, Qt.NoModifier, Qt.NoModifier, Qt.ShiftModifier, Qt.ControlModifier


@pytest.fixture(scope="module")
def bound_once_in_memory() -> None:
    """Keep no bindings for other tests: they are 100 MB after 20,000 events."""


class Anywhere:
    """A hand that moves all over the window, and draws its actions at random.

    Attributes
    ----------
    n_states : int
        States of all documents that undo and redo have led to.
    """

    def __init__(self, hand: AppHand, seed: int) -> None:
        self.rng, self.hand, self.window = np.random.default_rng(seed), hand, hand.window
        self.boxes, self.n_states = Boxes(), 0
        self.path = self.window.editor.path
        self.view = hand.view_hand()
        self.place = self.around(self.view.widget)

    def around(self, widget) -> QtCore.QPoint:
        """Return a place in *widget*."""
        return QtCore.QPoint(*(self.rng.integers(0, max(1, s)) for s in widget.size().toTuple()))

    def act(self) -> None:
        """Send one event."""
        view, held = self.view.widget, self.pick(HELD)
        button = Qt.LeftButton if self.rng.random() < 0.9 else Qt.RightButton
        kind = self.rng.choice(len(KINDS), p=KINDS)
        if kind == 0:
            x = self.pick(self.window.editor.widgets.surface.points)
            at = self.view.at(x)  # not a number if it is behind the eye
            self.place = self.view._pixel(at) if np.isfinite(at).all() else QtCore.QPoint(-1, -1)
            if not view.rect().contains(self.place):
                self.place = self.around(view)
            if self.rng.random() < 0.1:  # otherwise the wheel takes the mesh out of sight
                self.view.view.renderer.ResetCamera()
            QtTest.QTest.mousePress(view, button, held, self.place)
        elif kind == 1:
            self.place += QtCore.QPoint(*self.rng.integers(-15, 16, 2).tolist())
            QtTest.QTest.mouseMove(view, self.place)
        elif kind == 2:
            QtTest.QTest.mouseRelease(view, button, held, self.place)
        elif kind == 3:
            self.view.types(str(self.rng.choice(KEYS, p=ODDS / ODDS.sum())))
        elif kind == 4:
            self.wheel(self.pick([view, self.window.editor_widget.panel]))
        elif kind == 5:
            self.press_control()
        elif kind == 6:
            self.window.resize(*self.rng.integers([450, 330], [750, 560]).tolist())
        elif kind == 7:
            dark = QtGui.QPalette(QtGui.QColor("#2b2d31"))
            application().setPalette(self.pick([dark, QtGui.QPalette()]))
        else:
            self.open_again()
        application().processEvents()
        self.close_what_asks()
        assert not any("Could not" in each for each in self.boxes.seen), self.boxes.seen[-1]

    def pick(self, things):
        """Return one of *things*."""
        return things[self.rng.integers(len(things))]

    def wheel(self, widget) -> None:
        """Turn the wheel over *widget*."""
        place = QtCore.QPointF(self.around(widget))
        turned = QtCore.QPoint(0, int(self.pick([-120, 120])))
        event = QtGui.QWheelEvent(
            place, widget.mapToGlobal(place), QtCore.QPoint(), turned, Qt.NoButton,
            self.pick(HELD), Qt.NoScrollPhase, False,
        )  # fmt: skip
        application().sendEvent(widget, event)

    def press_control(self) -> None:
        """Click on a control of the panel, on a row of a list, or type a number into a field."""
        kinds = QtWidgets.QAbstractButton, QtWidgets.QAbstractSpinBox, QtWidgets.QAbstractItemView
        panel = self.window.editor_widget.panel
        found = [w for kind in kinds for w in panel.findChildren(kind)]
        found = [w for w in found if w.isVisible() and w.isEnabled()]
        if not found:  # in a narrow window it is closed at first
            self.window.editor_widget.panel_button.click()
            return
        control = self.pick(found)
        if isinstance(control, QtWidgets.QAbstractSpinBox):
            QtTest.QTest.keyClicks(control.lineEdit(), str(self.rng.integers(0, 30)))
            QtTest.QTest.keyClick(control, Qt.Key_Return)
        else:
            target = getattr(control, "viewport", lambda: control)()
            place = target.rect().center() if target is control else self.around(target)
            QtTest.QTest.mouseClick(target, Qt.LeftButton, Qt.NoModifier, place)

    def open_again(self) -> None:
        """Undo and redo everything; then open the last saved document, and discard this one."""
        self.undo_and_redo()
        self.boxes.answers = ["Discard"]
        self.window.open(self.path)
        self.hand.settle()
        self.boxes.answers = []
        self.view = self.hand.view_hand()

    def undo_and_redo(self) -> None:
        """Let undo lead back through every state, and redo forward again, to the bit."""
        self.view.release((0.0, 0.0))
        self.view.key("Escape")
        self.hand.settle()
        session = self.window.editor.session
        digests = [digest(session)]
        while session.undo() is not None:
            digests.append(digest(session))
        for expected in reversed(digests[:-1]):
            assert session.redo() is not None
            assert digest(session) == expected
        self.n_states += len(digests)

    def close_what_asks(self) -> None:
        """Leave dialogs and menus by Escape."""
        while box := application().activeModalWidget() or application().activePopupWidget():
            QtTest.QTest.keyClick(box, Qt.Key_Escape)
            application().processEvents()


@pytest.mark.campaign
def test_random_events_in_the_window_leave_no_memory_and_every_state_returns(
    tmp_path, monkeypatch, caplog
):
    compiled_kernels()  # numba takes 100 MB, which are no leak
    raised = []
    monkeypatch.setattr(sys, "excepthook", lambda *error: raised.append(error[1]))
    # Files are for other tests; a dialog of the system would wait for its user.
    for name in ("getOpenFileName", "getOpenFileNames", "getSaveFileName"):
        none = [] if name.endswith("s") else ""
        monkeypatch.setattr(QtWidgets.QFileDialog, name, lambda *_, none=none, **__: (none, ""))
    application()
    mesh, state = small()
    save_session(tmp_path / "arm.segdeform", Session(mesh, state=state))
    window = Window(settings_in(tmp_path), Autosaves(tmp_path / "unsaved"))
    hand = AppHand(window)
    window.begin(tmp_path / "arm.segdeform")
    hand.settle()
    anywhere = Anywhere(hand, 7)
    memory = {}
    for k in range(1, COUNTS[-1] + 1):
        anywhere.act()
        raised += [e for e in anywhere.view.failures if not isinstance(e, SegDeformError)]
        anywhere.view.failures.clear()  # their tracebacks keep closed editors
        assert not raised, f"event {k}: " + "".join(traceback.format_exception(raised[0]))
        if k in COUNTS:
            gc.collect()
            memory[k] = round(resident() / 1e6)
            print(f"\n{k} events: {memory[k]} MB", flush=True)
    anywhere.undo_and_redo()
    print(f"{anywhere.n_states} states, undone and redone to the bit; {memory} MB")
    assert memory[COUNTS[-1]] - memory[COUNTS[1]] < 40
    assert not [r for r in caplog.records if r.levelno >= logging.ERROR]
    application().setPalette(QtGui.QPalette())
    delete(window)
