"""A short text, centred at a point of the display, on a plate."""

from __future__ import annotations

from typing import Any

from vtk_segdeform.pictures import INK, PAPER

from ..scene import Panel, Text


class Label:
    """A text and its background; hidden until `show`.

    Parameters
    ----------
    renderer : vtkRenderer
        The renderer to draw in.
    colour : str
        Of the text, "#RRGGBB".
    dark : bool
        A dark plate with a margin, as that of the amount of a pull, or else a pale one.
    """

    def __init__(self, renderer: Any, colour: str, *, dark: bool = False) -> None:
        plate, opacity = (INK, 0.88) if dark else (PAPER, 0.7)
        self._margin = (0.5, 0.25) if dark else (0.15, 0.0)  # in ems: beside the text, above it
        self._background = Panel(renderer, plate, opacity=opacity, layer=0)
        self._text = Text(renderer, colour, bold=True, layer=1)
        self.hide()

    def show(self, text: str, size: float, x: float, y: float) -> None:
        """Show *text* of *size* pixels, centred at (x, y)."""
        self._text.set_text(text, size)
        width = self._text.width()
        self._text.place(x - 0.5 * width, y)
        beside, above = size * self._margin[0], size * self._margin[1]
        corner = x - 0.5 * width - beside, y - 0.5 * size - above
        self._background.place(*corner, width + 2.0 * beside, size + 2.0 * above)
        self._text.show(True)
        self._background.show(True)

    def hide(self) -> None:
        """Hide the text and its background."""
        self._text.show(False)
        self._background.show(False)

    def remove(self) -> None:
        """Remove the label from the renderer permanently."""
        self._text.remove()
        self._background.remove()
