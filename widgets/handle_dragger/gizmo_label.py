"""A short text, centred at a point of the display, on a pale background."""

from __future__ import annotations

from typing import Any

from vtk_segdeform.pictures import PAPER

from ..scene import Panel, Text


class Label:
    """A text and its background; hidden until `show`.

    Parameters
    ----------
    renderer : vtkRenderer
        The renderer to draw in.
    colour : str
        Of the text, "#RRGGBB".
    """

    def __init__(self, renderer: Any, colour: str) -> None:
        self._background = Panel(renderer, PAPER, opacity=0.7, layer=0)
        self._text = Text(renderer, colour, bold=True, layer=1)
        self.hide()

    def show(self, text: str, size: float, x: float, y: float) -> None:
        """Show *text* of *size* pixels, centred at (x, y)."""
        self._text.set_text(text, size)
        width = self._text.width()
        self._text.place(x - 0.5 * width, y)
        self._background.place(x - 0.5 * width - 2.0, y - 0.5 * size, width + 4.0, size)
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
