"""Rectangles and words over a picture, placed in pixels from the lower left of a renderer.

They are drawn over everything else in their renderer.  The letters are those of VTK's own Arial.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - without the two nothing flat is drawn
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D, vtkTextActor

from vtk_segdeform.pictures import rgb

_DOTS_PER_INCH = 72.0  # at which a letter of size 12 is 12 pixels high


class Panel:
    """A rectangle of one colour.

    Parameters
    ----------
    renderer : vtkRenderer
        Where it is drawn.
    colour : str
        "#RRGGBB".
    opacity : float
        0 to 1.
    layer : int
        Of two that overlap, the one of the higher layer is seen.
    """

    def __init__(self, renderer: Any, colour: str, *, opacity: float = 1.0, layer: int = 0) -> None:
        self._renderer = renderer
        self._corners = vtkPoints()
        self._corners.SetNumberOfPoints(4)
        square = vtkCellArray()
        square.InsertNextCell(4, [0, 1, 2, 3])
        self._shape = vtkPolyData()
        self._shape.SetPoints(self._corners)
        self._shape.SetPolys(square)
        mapper = vtkPolyDataMapper2D()
        mapper.SetInputData(self._shape)
        self._actor = vtkActor2D()
        self._actor.SetMapper(mapper)
        self._actor.SetLayerNumber(layer)
        self._actor.PickableOff()
        self._actor.GetProperty().SetOpacity(opacity)
        self.colour(colour)
        renderer.AddViewProp(self._actor)

    def colour(self, colour: str) -> None:
        """Take another colour, "#RRGGBB"."""
        self._actor.GetProperty().SetColor(*(rgb(colour) / 255.0))

    def place(self, x: float, y: float, width: float, height: float) -> None:
        """Reach from (x, y), the lower left corner, *width* to the right and *height* up."""
        right, top = x + width, y + height
        corners = np.array([[x, y, 0], [right, y, 0], [right, top, 0], [x, top, 0]], dtype=float)
        self._corners.SetData(numpy_to_vtk(corners, deep=True))
        self._shape.Modified()

    def show(self, shown: bool) -> None:
        """Be seen or not."""
        self._actor.SetVisibility(shown)

    def remove(self) -> None:
        """Go out of the renderer, for good."""
        self._renderer.RemoveViewProp(self._actor)


class Words:
    """Text, of one line or more.

    Parameters
    ----------
    renderer : vtkRenderer
        Where it is drawn.
    colour : str
        "#RRGGBB".
    bold : bool
        Or of the usual weight.
    typed : bool
        As by a typewriter: brackets and commas are told apart better.
    layer : int
        As of a `Panel`.
    """

    def __init__(
        self,
        renderer: Any,
        colour: str,
        *,
        bold: bool = False,
        typed: bool = False,
        layer: int = 1,
    ) -> None:
        self._renderer = renderer
        self._actor = vtkTextActor()
        self._actor.SetTextScaleModeToNone()
        self._actor.SetLayerNumber(layer)
        self._actor.PickableOff()
        style = self._actor.GetTextProperty()
        style.SetColor(*(rgb(colour) / 255.0))
        style.SetBold(bold)
        if typed:
            style.SetFontFamilyToCourier()
        style.SetVerticalJustificationToCentered()
        renderer.AddViewProp(self._actor)

    @property
    def text(self) -> str:
        """What it says."""
        return str(self._actor.GetInput() or "").replace(r"\$", "$")

    def say(self, text: str, size: float) -> None:
        """Say *text* in letters of *size*, the pixels from line to line, about."""
        dots = self._renderer.GetRenderWindow().GetDPI() or _DOTS_PER_INCH
        self._actor.GetTextProperty().SetFontSize(max(6, round(size * _DOTS_PER_INCH / dots)))
        self._actor.SetInput(text.replace("$", r"\$"))  # else VTK takes what is between two for TeX

    def place(self, x: float, y: float) -> None:
        """Begin at *x*, with the middle of the text's height at *y*."""
        self._actor.SetPosition(x, y)

    def width(self) -> float:
        """Return how many pixels the text is wide."""
        if not self.text:
            return 0.0
        box = [0.0] * 4
        self._actor.GetBoundingBox(self._renderer, box)
        return box[1] - box[0] + 1.0

    def show(self, shown: bool) -> None:
        """Be seen or not."""
        self._actor.SetVisibility(shown)

    def remove(self) -> None:
        """Go out of the renderer, for good."""
        self._renderer.RemoveViewProp(self._actor)
