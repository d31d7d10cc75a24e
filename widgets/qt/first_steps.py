"""The first steps, in a box over the view: pin, pull, done.

They are shown once to each user who has not seen them, in applications that ask for it, until a
click on them, Escape, or the first pull.  Pictures of the view lack them.
"""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtWidgets

from ..editor import DeformEditor
from ..panel import first_steps
from ..scene import Stop

Qt = QtCore.Qt
_KEY = "first steps seen"
_MARGIN = 8  # pixels


class FirstSteps(QtWidgets.QLabel):
    """The box, hidden until `begin`.

    Parameters
    ----------
    view : QWidget
        The widget of the view, over which it is drawn.
    editor : DeformEditor
        The editor in the view.
    settings : QSettings, optional
        Where it is stored that the user has seen it.  Without it, `begin` does nothing.
    """

    def __init__(self, view: Any, editor: DeformEditor, settings: Any = None) -> None:
        steps = (f"<b>{card.title}</b> {card.sentence}" for card in first_steps())
        super().__init__("<br>".join(steps), view)
        self._view, self._editor, self._settings = view, editor, settings
        self._stop: Stop = lambda: None
        self.setAccessibleName("First steps")
        self.setAutoFillBackground(True)
        self.setMargin(_MARGIN)
        self.move(_MARGIN, _MARGIN)
        # The press that closes it may be the first pull.
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()
        view.installEventFilter(self)

    def begin(self) -> None:
        """Show the box if the user has not seen it yet."""
        if self._settings is not None and not self._settings.value(_KEY, False, type=bool):
            self.show()

    def dismiss(self) -> None:
        """Hide the box, and do not show it to this user again."""
        if self.isHidden():
            return
        self.hide()
        if self._settings is not None:
            self._settings.setValue(_KEY, True)
            self._settings.sync()

    def showEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Wait for a pull."""
        super().showEvent(event)
        self._stop = self._editor.controller.messages.on_change(self._follow)

    def hideEvent(self, event: Any) -> None:  # noqa: N802
        """Unsubscribe from the editor."""
        super().hideEvent(event)
        self._stop()

    def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802
        """Dismiss the box at a click on it, which the view receives too, and at Escape."""
        kinds = QtCore.QEvent.Type
        if watched is self._view and not self.isHidden():
            if event.type() == kinds.MouseButtonPress and self.geometry().contains(event.pos()):
                self.dismiss()
            elif event.type() == kinds.KeyPress and event.key() == Qt.Key.Key_Escape:
                self.dismiss()
                return True
        return bool(super().eventFilter(watched, event))

    def _follow(self) -> None:
        """Dismiss the box at a pull."""
        if self._editor.session.is_dragging or self._editor.widgets.puller.waiting.is_active:
            self.dismiss()
