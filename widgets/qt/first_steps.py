"""The first steps, as three cards over the view: pin, pull, done.

They are shown once to each user who has not seen them, in applications that ask for it, until a
click on them, Escape, or the first pull.  Pictures of the view lack them.
"""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtGui, QtSvg, QtWidgets

from ..editor import DeformEditor
from ..panel import first_steps
from ..scene import Stop

Qt = QtCore.Qt
_KEY = "first steps seen"
_MARGIN = 8  # pixels
_LETTERS = 14  # of a line, about
_SIZE = 44, 32  # pixels of a drawing
# The surface of a drawing, and what happens to it.
_DRAWINGS = {
    "pin": (
        "M2 28C12 28 14 22 20 22C26 22 28 28 38 28",
        "M20 12V21M16 8a4 4 0 1 0 8 0a4 4 0 1 0-8 0",
    ),
    "pull": ("M2 28C12 28 14 14 20 14C26 14 28 28 38 28", "M20 11V2M15 7 20 2 25 7"),
    "done": ("M2 28C12 28 14 8 20 8C26 8 28 28 38 28", "M28 7 32 11 40 2"),
}
_ACCENT = "#2f7fc1"
_STYLE = """.QFrame {
    background: palette(base); border: 1px solid palette(mid); border-radius: 6px; }"""


class FirstSteps(QtWidgets.QWidget):
    """The cards, hidden until `begin`.

    Parameters
    ----------
    view : QWidget
        The widget of the view, over which they are drawn.
    editor : DeformEditor
        The editor in the view.
    settings : QSettings, optional
        Where it is stored that the user has seen them.  Without it, `begin` does nothing.
    """

    def __init__(self, view: Any, editor: DeformEditor, settings: Any = None) -> None:
        super().__init__(view)
        self._view, self._editor, self._settings = view, editor, settings
        self._stop: Stop = lambda: None
        self.setAccessibleName("First steps")
        self.setStyleSheet(_STYLE)
        # The press that closes them may be the first pull.
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        column = QtWidgets.QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        for card in first_steps():
            frame, drawing = QtWidgets.QFrame(), QtWidgets.QLabel()
            drawing.setPixmap(self._drawn(card.name))
            words = QtWidgets.QLabel(f"<b>{card.title}</b><br>{card.sentence}")
            words.setWordWrap(True)
            words.setFixedWidth(_LETTERS * self.fontMetrics().averageCharWidth())
            row = QtWidgets.QHBoxLayout(frame)
            row.setContentsMargins(_MARGIN, _MARGIN, _MARGIN, _MARGIN)
            row.addWidget(drawing)
            row.addWidget(words)
            column.addWidget(frame)
        self.move(_MARGIN, _MARGIN)
        self.hide()
        view.installEventFilter(self)

    def _drawn(self, name: str) -> Any:
        (wide, high), ratio = _SIZE, self.devicePixelRatioF()
        ink = self.palette().color(QtGui.QPalette.ColorRole.Text).name()
        svg = f'<svg viewBox="0 0 {wide} {high}" stroke-width="2" fill="none">' + "".join(
            f'<path d="{path}" stroke="{colour}" stroke-linecap="round" stroke-linejoin="round"/>'
            for path, colour in zip(_DRAWINGS[name], (ink, _ACCENT), strict=True)
        )
        picture = QtGui.QPixmap(round(wide * ratio), round(high * ratio))
        picture.setDevicePixelRatio(ratio)
        picture.fill(Qt.GlobalColor.transparent)
        painter = QtGui.QPainter(picture)
        drawing = QtSvg.QSvgRenderer(f"{svg}</svg>".encode())
        drawing.render(painter, QtCore.QRectF(0.0, 0.0, wide, high))
        painter.end()
        return picture

    def begin(self) -> None:
        """Show the cards if the user has not seen them yet."""
        if self._settings is not None and not self._settings.value(_KEY, False, type=bool):
            self.show()

    def dismiss(self) -> None:
        """Hide the cards, and do not show them to this user again."""
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
        """Dismiss the cards at a click on them, which the view receives too, and at Escape."""
        kinds = QtCore.QEvent.Type
        if watched is self._view and not self.isHidden():
            if event.type() == kinds.MouseButtonPress and self.geometry().contains(event.pos()):
                self.dismiss()
            elif event.type() == kinds.KeyPress and event.key() == Qt.Key.Key_Escape:
                self.dismiss()
                return True
        return bool(super().eventFilter(watched, event))

    def _follow(self) -> None:
        """Dismiss the cards at a pull."""
        if self._editor.session.is_dragging or self._editor.widgets.puller.waiting.is_active:
            self.dismiss()
