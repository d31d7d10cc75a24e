"""A few letters centred at a place of the display, on a pale ground that sets them off."""

from __future__ import annotations

from typing import Any

from vtk_segdeform.pictures import PAPER

from ..scene import Panel, Words


class Label:
    """Letters and the ground they are on; hidden until `say`.

    Parameters
    ----------
    renderer : vtkRenderer
        Where they are drawn, over all else.
    colour : str
        Of the letters, "#RRGGBB".
    """

    def __init__(self, renderer: Any, colour: str) -> None:
        self._ground = Panel(renderer, PAPER, opacity=0.7, layer=0)
        self._words = Words(renderer, colour, bold=True, layer=1)
        self.hide()

    def say(self, text: str, size: float, x: float, y: float) -> None:
        """Say *text* in letters of *size* pixels, its middle at (x, y)."""
        self._words.say(text, size)
        width = self._words.width()
        self._words.place(x - 0.5 * width, y)
        self._ground.place(x - 0.5 * width - 2.0, y - 0.5 * size, width + 4.0, size)
        self._words.show(True)
        self._ground.show(True)

    def hide(self) -> None:
        """Be not seen."""
        self._words.show(False)
        self._ground.show(False)

    def remove(self) -> None:
        """Go out of the renderer, for good."""
        self._words.remove()
        self._ground.remove()
