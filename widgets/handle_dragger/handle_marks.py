"""The vertices of the handles as dots on the mesh: red, or yellow where a press would take them."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.pictures import COLOURS, HANDLE, rgb
from vtk_segdeform.session import Session

from ..scene import View, Wires

_POINTED_AT = COLOURS[4]
_NO_EDGES = np.empty((0, 2), dtype=np.int64)
_DESIGNED_FOR = 600  # pixels of height; dots are larger in a higher window


class HandleMarks:
    """Dots for every handle of a session; hidden until `show`.

    Parameters
    ----------
    view : View
        Where they are drawn; what the mesh hides is not seen.
    session : Session
        Whose handles.
    """

    def __init__(self, view: View, session: Session) -> None:
        self.view = view
        self.session = session
        self._dots: dict[str, Wires] = {}
        self._pointed_at: str | None = None
        self._is_shown = False
        self._stop = view.before_render(self._size)

    def show(self, shown: bool) -> None:
        """Be seen or not."""
        self._is_shown = shown
        self.rebuild()

    def rebuild(self) -> None:
        """Show the handles that there are now."""
        for dots in self._dots.values():
            self.view.renderer.RemoveActor(dots.actor)
        self._dots = {}
        if self._is_shown:
            for name, ids in self.session.handles.items():
                dots = Wires(self.session.vertices[ids], _NO_EDGES, np.arange(len(ids)))
                self.view.renderer.AddActor(dots.actor)
                self._dots[name] = dots
        self.view.touch()

    def follow(self) -> None:
        """Go where the pose has them."""
        for name, dots in self._dots.items():
            dots.move(self.session.vertices[self.session.handles[name]])

    def point_at(self, name: str | None) -> None:
        """Show the handle *name* as the one that a press would take, or none."""
        if name != self._pointed_at:
            self._pointed_at = name
            self.view.touch()

    def remove(self) -> None:
        """Go out of the view, for good."""
        self._stop()
        self.show(False)

    def _size(self) -> None:
        scale = float(np.clip(self.view.renderer.GetSize()[1] / _DESIGNED_FOR, 0.7, 3.0))
        for name, dots in self._dots.items():
            chosen = name == self._pointed_at
            colour, size = (_POINTED_AT, 6.0) if chosen else (HANDLE, 4.0)
            dots.draw(rgb(colour), line_width=1.0, ball_size=scale * size)
