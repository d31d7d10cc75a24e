"""The icons of the toolbar, drawn as paths on a grid of 20 by 20.

Each icon contains pictures for several pixel ratios, in the colours of the palette.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qtpy import QtCore, QtGui

Qt = QtCore.Qt
SIZE = 20  # pixels at a ratio of 1
_RATIOS = (1.0, 1.5, 2.0, 3.0)
_LINE = 1.5

Point = tuple[float, float]


def icon(name: str, palette: Any) -> Any:
    """Return the icon *name* of `NAMES`; when checked it has the colour of highlighted text."""
    made, roles, groups = QtGui.QIcon(), QtGui.QPalette.ColorRole, QtGui.QPalette.ColorGroup
    modes, states = QtGui.QIcon.Mode, QtGui.QIcon.State
    text = palette.color(groups.Active, roles.ButtonText)
    for colour, mode, state in (
        (text, modes.Normal, states.Off),
        (palette.color(groups.Active, roles.HighlightedText), modes.Normal, states.On),
        (palette.color(groups.Disabled, roles.ButtonText), modes.Disabled, states.Off),
        (palette.color(groups.Disabled, roles.ButtonText), modes.Disabled, states.On),
    ):
        for ratio in _RATIOS:
            made.addPixmap(_picture(name, colour, ratio), mode, state)
    return made


def _picture(name: str, colour: Any, ratio: float) -> Any:
    """Return a picture from Qt's cache, or else draw it: windows have the same icons."""
    key = f"segdeform {name} {colour.name(QtGui.QColor.NameFormat.HexArgb)} {ratio}"
    picture = QtGui.QPixmapCache.find(key)
    if picture is None or picture.isNull():
        picture = _drawn(_DRAWINGS[name], colour, ratio)
        QtGui.QPixmapCache.insert(key, picture)
    return picture


def _drawn(draw: Callable[[Any], None], colour: Any, ratio: float) -> Any:
    picture = QtGui.QPixmap(round(SIZE * ratio), round(SIZE * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QtGui.QPainter(picture)
    painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
    caps, joins = Qt.PenCapStyle, Qt.PenJoinStyle
    pen = QtGui.QPen(colour, _LINE, Qt.PenStyle.SolidLine, caps.RoundCap, joins.RoundJoin)
    painter.setPen(pen)
    draw(painter)
    painter.end()
    return picture


def _line(painter: Any, *points: Point, closed: bool = False) -> None:
    path = QtGui.QPainterPath(QtCore.QPointF(*points[0]))
    for point in points[1:]:
        path.lineTo(*point)
    if closed:
        path.closeSubpath()
    painter.drawPath(path)


def _curve(painter: Any, start: Point, *cubics: tuple[Point, Point, Point]) -> None:
    path = QtGui.QPainterPath(QtCore.QPointF(*start))
    for one, two, end in cubics:
        path.cubicTo(*one, *two, *end)
    painter.drawPath(path)


def _circle(painter: Any, centre: Point, radius: float, *, filled: bool = False) -> None:
    painter.setBrush(painter.pen().color() if filled else Qt.BrushStyle.NoBrush)
    painter.drawEllipse(QtCore.QPointF(*centre), radius, radius)
    painter.setBrush(Qt.BrushStyle.NoBrush)


def _open(painter: Any) -> None:
    _line(painter, (2.5, 16), (2.5, 4.5), (7.5, 4.5), (9.5, 6.5), (15.5, 6.5), (15.5, 9))
    _line(painter, (2.5, 16), (5, 9), (18, 9), (15.5, 16), closed=True)


def _save(painter: Any) -> None:
    _line(painter, (10, 3), (10, 12))
    _line(painter, (6.5, 9), (10, 12.5), (13.5, 9))
    _line(painter, (3, 12.5), (3, 16.5), (17, 16.5), (17, 12.5))


def _undo(painter: Any) -> None:
    _line(painter, (7, 4), (3.5, 7.5), (7, 11))
    _curve(painter, (3.5, 7.5), ((9, 7.5), (16.5, 6), (16.5, 11.5)),
           ((16.5, 15), (13, 16), (9, 16)))  # fmt: skip


def _redo(painter: Any) -> None:
    painter.translate(20.0, 0.0)
    painter.scale(-1.0, 1.0)
    _undo(painter)


def _pull(painter: Any) -> None:
    _curve(
        painter, (2, 16.5), ((7, 16.5), (7.5, 10), (10, 10)), ((12.5, 10), (13, 16.5), (18, 16.5))
    )
    _line(painter, (10, 8), (10, 2.5))
    _line(painter, (7.3, 5), (10, 2.2), (12.7, 5))


def _regions(painter: Any) -> None:
    _circle(painter, (10, 10), 7.5)
    _line(painter, (10, 10), (10, 2.5))
    _line(painter, (10, 10), (3.6, 13.8))
    _line(painter, (10, 10), (16.4, 13.8))


def _cages(painter: Any) -> None:
    _line(painter, (10, 2.2), (17, 6), (17, 14), (10, 17.8), (3, 14), (3, 6), closed=True)
    _line(painter, (3, 6), (10, 10), (17, 6))
    _line(painter, (10, 10), (10, 17.8))


def _handles(painter: Any) -> None:
    _circle(painter, (10, 10), 7.0)
    _circle(painter, (10, 10), 2.6, filled=True)


def _deform(painter: Any) -> None:
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):

        def at(along: float, across: float, dx: int = dx, dy: int = dy) -> Point:
            return 10 + along * dx - across * dy, 10 + along * dy + across * dx

        _line(painter, (10, 10), at(7.5, 0))
        _line(painter, at(5.2, -2.3), at(7.7, 0), at(5.2, 2.3))


def _compare(painter: Any) -> None:
    _circle(painter, (10, 10), 7.5)
    path = QtGui.QPainterPath(QtCore.QPointF(10, 2.5))
    path.arcTo(QtCore.QRectF(2.5, 2.5, 15, 15), 90, 180)
    path.closeSubpath()
    painter.fillPath(path, painter.pen().color())


def _view(painter: Any) -> None:
    _curve(
        painter, (1.8, 10), ((6, 3.6), (14, 3.6), (18.2, 10)), ((14, 16.4), (6, 16.4), (1.8, 10))
    )
    _circle(painter, (10, 10), 2.6, filled=True)


def _help(painter: Any) -> None:
    _circle(painter, (10, 10), 7.8)
    _curve(
        painter,
        (7.4, 8),
        ((7.4, 4.6), (12.6, 4.6), (12.6, 7.8)),
        ((12.6, 10), (10, 9.6), (10, 11.8)),
    )
    _circle(painter, (10, 14.4), 0.5, filled=True)


_DRAWINGS: dict[str, Callable[[Any], None]] = {
    "open": _open, "save": _save, "undo": _undo, "redo": _redo, "pull": _pull,
    "regions": _regions, "cages": _cages, "handles": _handles, "deform": _deform,
    "compare": _compare, "view": _view, "help": _help,
}  # fmt: skip
NAMES = tuple(_DRAWINGS)
