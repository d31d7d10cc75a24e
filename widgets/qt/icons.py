"""The icons of the toolbar, drawn as SVG on a grid of 20 by 20.

Each icon contains pictures for several pixel ratios, in the colours of the palette.
"""

from __future__ import annotations

import functools
from typing import Any

from qtpy import QtCore, QtGui, QtSvg

SIZE = 20  # pixels at a ratio of 1
_RATIOS = (1.0, 1.5, 2.0, 3.0)
_LINES = {
    "open": "M2.5 16V4.5H7.5L9.5 6.5H15.5V9M2.5 16 5 9H18L15.5 16Z",
    "save": "M10 3V12M6.5 9 10 12.5 13.5 9M3 12.5V16.5H17V12.5",
    "undo": "M7 4 3.5 7.5 7 11M3.5 7.5C9 7.5 16.5 6 16.5 11.5C16.5 15 13 16 9 16",
    "redo": "M13 4 16.5 7.5 13 11M16.5 7.5C11 7.5 3.5 6 3.5 11.5C3.5 15 7 16 11 16",
    "pull": "M2 16.5C7 16.5 7.5 10 10 10C12.5 10 13 16.5 18 16.5M10 8V2.5M7.3 5 10 2.2 12.7 5",
    "regions": "M10 10V2.5M10 10 3.6 13.8M10 10 16.4 13.8",
    "cages": "M10 2.2 17 6V14L10 17.8 3 14V6ZM3 6 10 10 17 6M10 10V17.8",
    "deform": "M2.5 10H17.5M10 2.5V17.5M15.2 7.7 17.7 10 15.2 12.3M4.8 7.7 2.3 10 4.8 12.3"
    "M7.7 4.8 10 2.3 12.3 4.8M7.7 15.2 10 17.7 12.3 15.2",
    "keep_part": "M4.5 9H15.5V17H4.5ZM7 9V6C7 2 13 2 13 6V9",
    "view": "M1.8 10C6 3.6 14 3.6 18.2 10C14 16.4 6 16.4 1.8 10Z",
    "panel": "M2.5 4H17.5V16H2.5ZM12 4V16",
    "help": "M7.4 8C7.4 4.6 12.6 4.6 12.6 7.8C12.6 10 10 9.6 10 11.8",
}
_CIRCLES = {"regions": 7.5, "handles": 7.0, "compare": 7.5, "help": 7.8}  # radii, at the centre
_FILLED = {
    "handles": '<circle cx="10" cy="10" r="2.6"/>',
    "compare": '<path d="M10 2.5A7.5 7.5 0 0 0 10 17.5Z"/>',
    "view": '<circle cx="10" cy="10" r="2.6"/>',
    "help": '<circle cx="10" cy="14.4" r="0.5"/>',
}


def icon(name: str, palette: Any) -> Any:
    """Return the icon of a toolbar button; when checked it has the colour of highlighted text."""
    made, roles, groups = QtGui.QIcon(), QtGui.QPalette.ColorRole, QtGui.QPalette.ColorGroup
    modes, states = QtGui.QIcon.Mode, QtGui.QIcon.State
    for group, role, mode, state in (
        (groups.Active, roles.ButtonText, modes.Normal, states.Off),
        (groups.Active, roles.HighlightedText, modes.Normal, states.On),
        (groups.Disabled, roles.ButtonText, modes.Disabled, states.Off),
        (groups.Disabled, roles.ButtonText, modes.Disabled, states.On),
    ):
        for picture in _pictures(name, palette.color(group, role).name()):
            made.addPixmap(QtGui.QPixmap.fromImage(picture), mode, state)
    return made


@functools.lru_cache(maxsize=128)  # those of a toolbar take 40 ms, and some palettes 2 MB
def _pictures(name: str, colour: str) -> list[Any]:
    """Return the icon in one colour for each pixel ratio, as images: they outlive Qt."""
    drawing, pictures = QtSvg.QSvgRenderer(_svg(name, colour).encode()), []
    for ratio in _RATIOS:
        size = round(SIZE * ratio)
        picture = QtGui.QImage(size, size, QtGui.QImage.Format.Format_ARGB32_Premultiplied)
        picture.setDevicePixelRatio(ratio)
        picture.fill(QtCore.Qt.GlobalColor.transparent)
        painter = QtGui.QPainter(picture)
        drawing.render(painter, QtCore.QRectF(0.0, 0.0, SIZE, SIZE))
        painter.end()
        pictures.append(picture)
    return pictures


def _svg(name: str, colour: str) -> str:
    lines, radius = _LINES.get(name), _CIRCLES.get(name)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE} {SIZE}" stroke="{colour}" '
        'stroke-width="1.5" stroke-linecap="round" stroke-linejoin="round" fill="none">'
        + (f'<path d="{lines}"/>' if lines else "")
        + (f'<circle cx="10" cy="10" r="{radius}"/>' if radius else "")
        + f'<g fill="{colour}">{_FILLED.get(name, "")}</g></svg>'
    )
