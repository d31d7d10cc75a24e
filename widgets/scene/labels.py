"""Rectangles and text, placed in pixels from the lower left corner of a renderer.

They are drawn over everything else in their renderer.  The font is DejaVu of
matplotlib, which pyvista requires, or else VTK's own, whose brackets look like parentheses.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - both are required to draw in 2D
from vtkmodules.vtkCommonCore import VTK_FONT_FILE
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import (
    vtkActor2D,
    vtkPolyDataMapper2D,
    vtkTextActor,
)

from vtk_segdeform.pictures import rgb

from .wireframe import cells_of, points_of

_DOTS_PER_INCH = 72.0  # the resolution at which font size 12 is 12 pixels


class Panel:
    """A rectangle of one colour, "#RRGGBB"; higher layers are drawn over lower ones."""

    def __init__(self, renderer: Any, colour: str, *, opacity: float = 1.0, layer: int = 0) -> None:
        self._renderer = renderer
        self._shape = vtkPolyData()
        self._shape.SetPoints(points_of(np.zeros((4, 3))))
        self._shape.SetPolys(cells_of(np.arange(4)[None]))
        mapper = vtkPolyDataMapper2D()
        mapper.SetInputData(self._shape)
        self._actor = vtkActor2D()
        self._actor.SetMapper(mapper)
        self._actor.SetLayerNumber(layer)
        self._actor.PickableOff()
        self._actor.GetProperty().SetOpacity(opacity)
        self.set_colour(colour)
        renderer.AddViewProp(self._actor)

    def set_colour(self, colour: str) -> None:
        """Set the colour, "#RRGGBB"."""
        self._actor.GetProperty().SetColor(*(rgb(colour) / 255.0))

    def place(self, x: float, y: float, width: float, height: float) -> None:
        """Set the lower left corner (x, y), the width and the height."""
        right, top = x + width, y + height
        corners = np.array([[x, y, 0], [right, y, 0], [right, top, 0], [x, top, 0]], dtype=float)
        self._shape.SetPoints(points_of(corners))

    def show(self, shown: bool) -> None:
        """Show or hide the rectangle."""
        self._actor.SetVisibility(shown)

    def remove(self) -> None:
        """Remove the rectangle from the renderer permanently."""
        self._renderer.RemoveViewProp(self._actor)


class Text:
    """Text of one line or more; *monospace* has letters of one width, and layers as `Panel`."""

    def __init__(
        self,
        renderer: Any,
        colour: str,
        *,
        bold: bool = False,
        monospace: bool = False,
        layer: int = 1,
    ) -> None:
        self._renderer = renderer
        self._actor = vtkTextActor()
        self._actor.SetTextScaleModeToNone()
        self._actor.SetLayerNumber(layer)
        self._actor.PickableOff()
        style = self._actor.GetTextProperty()
        style.SetColor(*(rgb(colour) / 255.0))
        set_font(style, bold=bold, monospace=monospace)
        style.SetVerticalJustificationToCentered()
        renderer.AddViewProp(self._actor)

    @property
    def text(self) -> str:
        """The text that is shown."""
        return str(self._actor.GetInput() or "").replace(r"\$", "$")

    def set_text(self, text: str, size: float) -> None:
        """Show *text*; *size* is about the distance from line to line, in pixels."""
        dots = self._renderer.GetRenderWindow().GetDPI() or _DOTS_PER_INCH
        self._actor.GetTextProperty().SetFontSize(max(6, round(size * _DOTS_PER_INCH / dots)))
        self._actor.SetInput(text.replace("$", r"\$"))  # VTK reads text between two $ as TeX

    def place(self, x: float, y: float) -> None:
        """Set the left end *x* and the vertical centre *y*."""
        self._actor.SetPosition(x, y)

    def width(self) -> float:
        """Return the width of the text in pixels."""
        return self._extent(0)

    def height(self) -> float:
        """Return the height of the text in pixels."""
        return self._extent(1)

    def _extent(self, axis: int) -> float:
        if not self.text:
            return 0.0
        box = [0.0] * 4
        self._actor.GetBoundingBox(self._renderer, box)
        return box[2 * axis + 1] - box[2 * axis] + 1.0

    def show(self, shown: bool) -> None:
        """Show or hide the text."""
        self._actor.SetVisibility(shown)

    def remove(self) -> None:
        """Remove the text from the renderer permanently."""
        self._renderer.RemoveViewProp(self._actor)


def set_font(style: Any, *, bold: bool = False, monospace: bool = False) -> None:
    """Set the font of a vtkTextProperty to that of `Text`."""
    path = _font_file(bold, monospace)
    style.SetBold(bold and not path)
    if path:
        style.SetFontFamily(VTK_FONT_FILE)
        style.SetFontFile(path)
    elif monospace:
        style.SetFontFamilyToCourier()


@cache
def _font_file(bold: bool, monospace: bool) -> str:
    """Return the path of a font, or "" without matplotlib, which is not imported."""
    found = find_spec("matplotlib")
    if found is None or not found.submodule_search_locations:
        return ""
    name = f"DejaVuSans{'Mono' * monospace}{'-Bold' * bold}.ttf"
    path = Path(found.submodule_search_locations[0]) / "mpl-data" / "fonts" / "ttf" / name
    return str(path) if path.is_file() else ""
