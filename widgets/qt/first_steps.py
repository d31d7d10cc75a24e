"""The first steps, as three cards over the view: pin, pull, done.

They are shown once to each user who has not seen them, in applications that ask for it, until a
click on them, Escape, or the first pull.  Pictures of the view lack them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor
from ..panel import first_steps

Qt = QtCore.Qt
_KEY = "first steps seen"
_SIZE = 44, 32  # pixels of a drawing
_LETTERS, _WORD_LETTERS = 14, 5  # of a line in a card, at most, and in a brief one
_SAMPLES = 2000  # points of the surface that the cards avoid
_MOST = 0.1  # share of the surface that complete cards may cover; otherwise they are brief
_MARGIN = 8
_CUBE = 100  # pixels at the right end, for the orientation cube
_ACCENT = "#2f7fc1"
_OPACITY = 0.9


class FirstSteps(QtWidgets.QWidget):
    """The three cards, hidden until `begin`.

    Parameters
    ----------
    view : QWidget
        The widget of the view, which they are drawn over.
    editor : DeformEditor
        The editor in the view; the cards avoid its surface.
    settings : QSettings, optional
        Where it is stored that the user has seen them.  Without it, `begin` does nothing.
    """

    def __init__(self, view: Any, editor: DeformEditor, settings: Any = None) -> None:
        super().__init__(view)
        self._view, self._editor, self._settings = view, editor, settings
        self.setAccessibleName("First steps")
        self.setToolTip("Click to close (Esc)")
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self._cards = [
            _Card(self, _DRAWINGS[card.name], card.title, card.sentence) for card in first_steps()
        ]
        self._stop: Callable[[], None] = _nothing
        self.hide()
        view.installEventFilter(self)

    def begin(self) -> None:
        """Show the cards if the user has not seen them yet."""
        if self._settings is not None and not self._settings.value(_KEY, False, type=bool):
            self.show()

    def dismiss(self) -> None:
        """Hide the cards, and do not show them to this user again."""
        if self.isHidden():
            return
        self.hide()
        self._stop()
        if self._settings is not None:
            self._settings.setValue(_KEY, True)
            self._settings.sync()

    def mousePressEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Dismiss the cards, and leave the press to the view: it may be the first pull."""
        self.dismiss()
        place = event.globalPosition().toPoint() if hasattr(event, "globalPosition") else None
        place = event.globalPos() if place is None else place  # of Qt 5
        press = QtGui.QMouseEvent(
            event.type(),
            QtCore.QPointF(self._view.mapFromGlobal(place)),
            QtCore.QPointF(place),
            event.button(),
            event.buttons(),
            event.modifiers(),
        )
        QtWidgets.QApplication.sendEvent(self._view, press)

    def showEvent(self, event: Any) -> None:  # noqa: N802
        """Place the cards, and wait for a pull."""
        super().showEvent(event)
        self._place()
        self.raise_()
        self._stop()
        self._stop = self._editor.controller.messages.on_change(self._follow)

    def hideEvent(self, event: Any) -> None:  # noqa: N802
        """Unsubscribe from the editor."""
        super().hideEvent(event)
        self._stop()

    def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802
        """Follow the size of the view; dismiss the cards when Escape is pressed there."""
        if watched is self._view and not self.isHidden():
            kinds = QtCore.QEvent.Type
            if event.type() == kinds.Resize:
                self._place()
            elif event.type() == kinds.KeyPress and event.key() == Qt.Key.Key_Escape:
                self.dismiss()
                return True
        return bool(super().eventFilter(watched, event))

    def changeEvent(self, event: Any) -> None:  # noqa: N802
        """Update the layout after a change of font."""
        super().changeEvent(event)
        if event.type() == QtCore.QEvent.Type.FontChange:
            self._place()

    def _follow(self) -> None:
        """Dismiss the cards at a pull."""
        if self._editor.session.is_dragging or self._editor.widgets.puller.waiting.is_active:
            self.dismiss()

    def _place(self) -> None:
        """Put the cards where they hide least of the body; without sentences in a small view."""
        body = self._body()
        for is_brief in (False, True):
            for card in self._cards:
                card.set_brief(is_brief)
            place = min(self._places(is_brief), key=lambda cards: _covered(cards, body))
            if _covered(place, body) <= _MOST * len(body):
                break
        shape = QtGui.QRegion()
        for card, rectangle in zip(self._cards, place, strict=True):
            card.setGeometry(rectangle)
            shape = shape.united(QtGui.QRegion(rectangle))
        around = shape.boundingRect()
        for card in self._cards:
            card.move(card.pos() - around.topLeft())
        self.setGeometry(around.translated(_MARGIN, _MARGIN))
        self.setMask(shape.translated(-around.topLeft()))  # the view receives clicks between them

    def _places(self, is_brief: bool) -> list[list[Any]]:
        """Return the possible rectangles of the cards: a column, and rows where there is room."""
        letters = _WORD_LETTERS if is_brief else _LETTERS
        width = _SIZE[0] + 3 * _MARGIN + letters * self.fontMetrics().averageCharWidth()
        height = max(card.heightForWidth(width) for card in self._cards)
        height = max(height, _SIZE[1] + _MARGIN)
        right, down = width + _MARGIN, height + _MARGIN
        starts = [(0, 0, 0, down)]
        if 3 * right <= self._view.width() - _CUBE:
            starts.append((0, 0, right, 0))
        if 3 * right + _MARGIN <= self._view.width():
            starts.append((0, self._view.height() - down - _MARGIN, right, 0))
        return [
            [QtCore.QRect(x + k * dx, y + k * dy, width, height) for k in range(3)]
            for x, y, dx, dy in starts
        ]

    def _body(self) -> NDArray[np.float64]:
        """Return points (k, 2) of the surface, in pixels of this widget."""
        x = self._editor.session.vertices
        points = self._editor.view.to_display(x[:: max(1, len(x) // _SAMPLES)])[:, :2]
        points = points / self._view.devicePixelRatioF()
        points[:, 1] = self._view.height() - points[:, 1]
        return np.asarray(points - _MARGIN)


class _Card(QtWidgets.QWidget):
    """A drawing, a word and a sentence."""

    def __init__(self, parent: Any, draw: Callable[[Any], None], word: str, sentence: str) -> None:
        super().__init__(parent)
        self._draw = draw
        self._word, self._sentence = f"<b>{word}</b>", sentence
        words = self._words = QtWidgets.QLabel()
        words.setWordWrap(True)
        self.set_brief(False)
        layout = QtWidgets.QHBoxLayout(self)
        layout.setContentsMargins(_MARGIN, _MARGIN, _MARGIN, _MARGIN)
        layout.setSpacing(0)
        layout.addSpacing(_SIZE[0] + _MARGIN)
        layout.addWidget(words, 1)

    def set_brief(self, is_brief: bool) -> None:
        """Leave the sentence to the tooltip, or not."""
        self._words.setText(self._word if is_brief else f"{self._word}<br>{self._sentence}")
        self.setToolTip(f"{self._sentence} Click to close (Esc)" if is_brief else "")

    def paintEvent(self, event: Any) -> None:  # noqa: N802, ARG002 - Qt's name
        """Draw the card."""
        palette, roles = self.palette(), QtGui.QPalette.ColorRole
        painter = QtGui.QPainter(self)
        painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
        fill, line = palette.color(roles.Base), palette.color(roles.Text)
        fill.setAlphaF(_OPACITY)
        line.setAlphaF(0.25)
        painter.setPen(line)
        painter.setBrush(fill)
        painter.drawRoundedRect(QtCore.QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), 6, 6)
        painter.translate(_MARGIN, 0.5 * (self.height() - _SIZE[1]))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(_pen(palette.color(roles.Text)))
        self._draw(painter)
        painter.end()


def _nothing() -> None:
    pass


def _covered(cards: list[Any], points: NDArray[np.float64]) -> int:
    """Return how many of the *points* (k, 2) the rectangles contain."""
    return sum(_inside(card, points) for card in cards)


def _inside(card: Any, points: NDArray[np.float64]) -> int:
    """Return how many of the *points* (k, 2) are in a rectangle."""
    low, high = (card.left(), card.top()), (card.right(), card.bottom())
    return int(np.all((points >= low) & (points <= high), axis=1).sum())


def _pen(colour: Any) -> Any:
    caps, joins = Qt.PenCapStyle, Qt.PenJoinStyle
    return QtGui.QPen(colour, 2.0, Qt.PenStyle.SolidLine, caps.RoundCap, joins.RoundJoin)


def _surface(painter: Any, height: float) -> None:
    """Draw a surface with a bump of this *height*."""
    path = QtGui.QPainterPath(QtCore.QPointF(2.0, 28.0))
    path.cubicTo(12.0, 28.0, 14.0, 28.0 - height, 20.0, 28.0 - height)
    path.cubicTo(26.0, 28.0 - height, 28.0, 28.0, 38.0, 28.0)
    painter.drawPath(path)


def _pin(painter: Any) -> None:
    _surface(painter, 6.0)
    painter.setPen(_pen(QtGui.QColor(_ACCENT)))
    painter.setBrush(QtGui.QColor(_ACCENT))
    painter.drawEllipse(QtCore.QPointF(20.0, 8.0), 4.0, 4.0)
    painter.drawLine(QtCore.QPointF(20.0, 12.0), QtCore.QPointF(20.0, 21.0))


def _pull(painter: Any) -> None:
    _surface(painter, 14.0)
    painter.setPen(_pen(QtGui.QColor(_ACCENT)))
    painter.drawPolyline([QtCore.QPointF(x, y) for x, y in ((15, 7), (20, 2), (25, 7))])
    painter.drawLine(QtCore.QPointF(20.0, 2.0), QtCore.QPointF(20.0, 11.0))


def _done(painter: Any) -> None:
    _surface(painter, 20.0)
    painter.setPen(_pen(QtGui.QColor(_ACCENT)))
    painter.drawPolyline([QtCore.QPointF(x, y) for x, y in ((28, 7), (32, 11), (40, 2))])


_DRAWINGS = {"pin": _pin, "pull": _pull, "done": _done}
