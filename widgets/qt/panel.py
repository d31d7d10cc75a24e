"""The panel beside the view: a toolbar, the parts of the current mode, status and history.

The toolbar and the status may be moved out of the panel.

    DeformPanel(editor)

The editor updates its messages after every change of the session, the mode, a tool or a job.  The
panel subscribes to them and refreshes all its parts together, a moment later.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import partial
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from vtk_segdeform.session import Change

from ..editor import DeformEditor, Keys, key_cap
from ..panel import all_sections, menu, sections
from ..scene import Pointer
from .controls import shortcut, stopper, using
from .history import HistoryPart
from .sections import SectionBox
from .status import StatusPart
from .toolbar import Toolbar
from .view_menu import context_menu

Qt = QtCore.Qt
_DELAY = 30  # milliseconds; longer than between two moves of a drag
_WIDTH = 40  # letters
_ENTER = Qt.Key.Key_Return, Qt.Key.Key_Enter
_SHORTCUTS = ("undo", "redo", "cancel")  # work in the panel, too, with Ctrl or Alt, or as Escape


class DeformPanel(QtWidgets.QWidget):
    """A panel for an editor; disabled when the editor is removed.

    Parameters
    ----------
    editor : DeformEditor
        The editor to show and control.
    parent : QWidget, optional
        The parent widget.

    Attributes
    ----------
    boxes : dict of str to SectionBox
        The box of each section, by its name.
    controls : dict of str to QWidget
        The controls in them, by the names of fields and tables.
    toolbar : Toolbar
        The toolbar.
    status : StatusPart
        The status.
    history : HistoryPart
        The history.
    """

    deformed = QtCore.Signal()
    """The pose has changed; emitted at every move of a drag."""
    regions_changed = QtCore.Signal()
    """`Session.regions` or their names have changed."""
    session_changed = QtCore.Signal(object)
    """Another session was opened; emits that session."""
    error = QtCore.Signal(str)
    """An error was shown; emits its message."""

    def __init__(self, editor: DeformEditor, parent: Any = None) -> None:
        super().__init__(parent)
        self.editor = editor
        press = using(editor)
        self.toolbar, self.status = Toolbar(editor, press), StatusPart(editor, press)
        self.history = HistoryPart(editor, press)
        self.boxes = {each.name: SectionBox(each, press) for each in all_sections(editor)}
        self.controls = {
            name: control for box in self.boxes.values() for name, control in box.controls.items()
        }
        self._keys: Keys | None = None  # as shown
        self._shortcuts: list[Any] = []
        self._build()
        self._delay = QtCore.QTimer(self)
        self._delay.setSingleShot(True)
        self._delay.setInterval(_DELAY)
        self._delay.timeout.connect(self.refresh)
        self._stops: list[Callable[[], None]] = [
            editor.controller.messages.on_change(self._messages_changed),
            editor.view.on_failure(lambda _: self.error.emit(editor.controller.messages.error)),
        ]
        self._stop_session: list[Callable[[], None]] = []
        editor.controller.show_menu = self._show_menu
        self._follow()
        # Unsubscribe before Qt deletes the widgets.
        self.destroyed.connect(stopper(self._stops, self._stop_session))
        self.refresh()

    @property
    def is_up_to_date(self) -> bool:
        """Whether no refresh is due."""
        return not self._delay.isActive()

    def refresh(self) -> None:
        """Update all visible parts."""
        editor, busy = self.editor, self.editor.is_busy
        for each in (self, self.toolbar, self.status):  # which may be beside the panel
            each.setEnabled(editor.GetEnabled())
        if editor.keys is not self._keys:
            self._show_keys(editor.keys)
        if busy:
            self._return_focus()  # a disabled control would swallow keys
        self._inside.setEnabled(not busy)
        self.toolbar.refresh()
        self.status.refresh()
        self.history.refresh()
        if busy:  # the job owns the session
            return
        shown = {section.name: section for section in sections(editor)}
        for name, box in self.boxes.items():
            box.setVisible(name in shown)
            if name in shown:
                box.draw(shown[name], editor.keys)

    def stop(self) -> None:
        """Unsubscribe from the editor and disable the panel, permanently."""
        stopper(self._stops, self._stop_session)()
        self._delay.stop()
        self.editor.controller.show_menu = lambda _: None
        for each in (self, self.toolbar, self.status):
            each.setEnabled(False)

    def _show_menu(self, _: Pointer) -> None:
        """Show the menu of the right button at the pointer."""
        fields, press = menu(self.editor), using(self.editor)
        context_menu(self, fields, self.editor.keys, press).popup(QtGui.QCursor.pos())

    def _build(self) -> None:
        self._inside = QtWidgets.QWidget()
        inside = QtWidgets.QVBoxLayout(self._inside)
        inside.setContentsMargins(0, 0, 0, 0)
        for box in self.boxes.values():
            inside.addWidget(box)
        inside.addStretch(1)
        area = QtWidgets.QScrollArea()
        area.setWidget(self._inside)
        area.setWidgetResizable(True)
        area.setFrameShape(QtWidgets.QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(self.toolbar)
        layout.addWidget(area, 3)
        layout.addWidget(self.status)
        layout.addWidget(self.history, 1)
        # The widest part fits beside a scroll bar.
        widest = max(box.minimumSizeHint().width() for box in self.boxes.values())
        widest += area.verticalScrollBar().sizeHint().width() + 2 * layout.contentsMargins().left()
        letters = _WIDTH * self.fontMetrics().averageCharWidth()
        self.setMinimumWidth(max(widest, letters))
        self._with_shortcuts = self.toolbar, area, self.status, self.history
        self._focused: Any = None  # the last widget outside that had the focus
        QtWidgets.QApplication.instance().focusChanged.connect(self._focus_changed)
        for field in self._inside.findChildren(QtWidgets.QAbstractSpinBox):
            field.installEventFilter(self)
        for table in self._inside.findChildren(QtWidgets.QTreeWidget):
            table.itemDelegate().closeEditor.connect(self._return_focus)

    def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
        """Return the focus after Enter in a field, so that keys act on the view again."""
        if event.type() == QtCore.QEvent.Type.KeyPress and event.key() in _ENTER:
            QtCore.QTimer.singleShot(0, self._return_focus)  # once the field has used the key
        return bool(super().eventFilter(watched, event))

    def keyPressEvent(self, event: Any) -> None:  # noqa: N802
        """Pass keys that no control uses to the view, if that had the focus before."""
        with contextlib.suppress(RuntimeError):  # it was deleted meanwhile
            if hasattr(self._focused, "GetRenderWindow"):
                QtWidgets.QApplication.sendEvent(self._focused, event)
                return
        super().keyPressEvent(event)

    def _focus_changed(self, old: Any, new: Any) -> None:
        is_near = old is not None and old.window() == self.window()  # no menu and no popup
        if is_near and self.isAncestorOf(new) and not self.isAncestorOf(old):
            self._focused = old

    def _return_focus(self, *_: object) -> None:
        """Give the focus of a field back to what had it before the panel, usually the view."""
        with contextlib.suppress(RuntimeError):  # it was deleted meanwhile
            if self._focused is not None and self._inside.isAncestorOf(self.window().focusWidget()):
                self._focused.setFocus()

    def _escape(self, name: str) -> None:
        self._return_focus()
        self.editor.run(name)

    def _show_keys(self, keys: Keys) -> None:
        """Use some of the *keys* in the panel, too."""
        self._keys = keys
        while self._shortcuts:
            self._shortcuts.pop().deleteLater()
        for name in _SHORTCUTS:
            for key in keys[name].keys:
                do = partial(self._escape if key == "escape" else self.editor.run, name)
                if key == "escape" or key.startswith(("ctrl+", "alt+")):
                    self._shortcuts += [
                        shortcut(key_cap(key), part, do) for part in self._with_shortcuts
                    ]

    # Events.

    def _messages_changed(self) -> None:
        if self.editor.session is not self._session:
            self._follow()
            self.session_changed.emit(self._session)
        if not self._delay.isActive():
            self._delay.start()

    def _follow(self) -> None:
        """Subscribe to the current session, and to no other one."""
        self._session, widgets = self.editor.session, self.editor.widgets
        for stop in self._stop_session:
            stop()
        tag = widgets.selector.AddObserver("ModifiedEvent", lambda *_: self._messages_changed())
        self._stop_session[:] = [
            self._session.on_change(self._session_changed),
            lambda: widgets.selector.RemoveObserver(tag),
        ]

    def _session_changed(self, change: Change) -> None:
        if change & Change.POSE:
            self.deformed.emit()
        if change & (Change.REGIONS | Change.NAMES):
            self.regions_changed.emit()
