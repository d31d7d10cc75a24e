"""The vertices of the handles as dots on the mesh, each handle in its own colour.

The highlighted handle is yellow.  Handles may be hidden; their vertices stay where they are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vtk_segdeform.arrays import IntArray
from vtk_segdeform.pictures import COLOURS, rgb
from vtk_segdeform.session import Session

from ..scene import View, Wireframe, handle_colour

_HIGHLIGHT = COLOURS[4]
_NO_EDGES = np.empty((0, 2), dtype=np.int64)
_DOT, _ALONE, _HIGHLIGHTED = 4.0, 9.0, 2.0  # pixels; pins and pulled points stand alone


class HandleMarks:
    """Dots for every handle of a session; hidden until `show`.

    Attributes
    ----------
    hidden : frozenset of str
        The handles that are not shown; takes effect at the next `show`.
    is_shown : callable
        Of vertices (k,): whether any of them is shown; by default all are.
    """

    def __init__(self, view: View, session: Session) -> None:
        self.view = view
        self.session = session
        self._dots: dict[str, Wireframe] = {}
        self._highlighted: str | None = None
        self.hidden: frozenset[str] = frozenset()
        self.is_shown: Callable[[IntArray], bool] = lambda _: True
        self._is_shown = False
        self._stop = view.before_render(self._set_sizes)

    def show(self, shown: bool) -> None:
        """Show the current handles, or hide all."""
        self._is_shown = shown
        self._rebuild()

    def _rebuild(self) -> None:
        for dots in self._dots.values():
            self.view.renderer.RemoveActor(dots.actor)
        self._dots = {}
        if self._is_shown:
            for name, ids in self.session.handles.items():
                if name in self.hidden or not self.is_shown(ids):
                    continue
                dots = Wireframe(self.session.vertices[ids], _NO_EDGES, np.arange(len(ids)))
                self.view.renderer.AddActor(dots.actor)
                self._dots[name] = dots
        self.view.request_render()

    def follow(self) -> None:
        """Move the dots to the current pose."""
        for name, dots in self._dots.items():
            dots.move(self.session.vertices[self.session.handles[name]])

    def highlight(self, name: str | None) -> None:
        """Highlight the handle *name*, or none."""
        if name != self._highlighted:
            self._highlighted = name
            self.view.request_render()

    def remove(self) -> None:
        """Remove the dots from the view permanently."""
        self._stop()
        self.show(False)

    def _set_sizes(self) -> None:
        for name in self.session.handles:
            if name not in self._dots:
                continue
            dots, highlighted = self._dots[name], name == self._highlighted
            colour = rgb(_HIGHLIGHT) if highlighted else handle_colour(self.session, name)
            size = _ALONE if len(self.session.handles[name]) == 1 else _DOT
            size += _HIGHLIGHTED if highlighted else 0.0
            dots.set_style(colour, line_width=1.0, sphere_size=self.view.scale * size)
