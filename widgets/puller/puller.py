"""Pulling the surface at any point; it follows at every move.

A press grabs the surface under the pointer and moves it in the view plane.  A ring on the surface
shows the radius.

    x, y, z     while pulling: constrain to the axis; again: to the plane perpendicular to it;
                again: no constraint
    shift       pull slowly
    escape, right button        cancel

A press with Shift that does not move pins the point, or removes the pin there.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from vtk_segdeform.checks import require
from vtk_segdeform.pictures import INK, rgb
from vtk_segdeform.session import Session

from ..handle_dragger import FREE, Grip, LiveSolve, Motion, Part, next_constraint
from ..picking import Hit, Picker
from ..region_selector import BrushRing
from ..scene import Gesture, Phase, Pointer, SurfaceDisplay, Widget

_RADIUS = 0.15  # the initial radius, in diagonals of the mesh
_CLICK_TOLERANCE = 3.0  # pixels; a press that moves less does not pull


class Puller(Widget):
    """Pulls the surface of a session at any point.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to work in.  Call `remove` before its window closes.
    session : Session
        The session to edit.  It can be pulled once it has cages.
    surface : SurfaceDisplay, optional
        The displayed mesh of the session; by default the widget adds its own.
    """

    def __init__(self, view: Any, session: Session, surface: SurfaceDisplay | None = None) -> None:
        super().__init__(view, session)
        if surface is not None:
            require(surface, SurfaceDisplay, "surface")
        self._own_surface = surface is None
        self._surface = SurfaceDisplay(self.view, session) if surface is None else surface
        self._picker = Picker(self._surface)
        self._ring = BrushRing(self._surface)
        self._radius = _RADIUS * session.mesh.diagonal
        self._locality: float | None = None
        self._constraint: Part | None = None  # set by keys during the gesture
        self._live = LiveSolve(self.view, session, self.cancel)

    @property
    def radius(self) -> float:
        """The radius of the pulled surface, in the mesh's unit."""
        return self._radius

    @radius.setter
    def radius(self, radius: float) -> None:
        self._radius = radius

    @property
    def locality(self) -> float | None:
        """How local a pull is, 0 to 1; None decides it by pins.  See `Session.pull`."""
        return self._locality

    @locality.setter
    def locality(self, locality: float | None) -> None:
        self._locality = locality

    def Off(self) -> None:  # noqa: N802 - VTK's word
        """Stop handling events and refining; finish an ongoing gesture."""
        try:
            super().Off()
        finally:
            self._live.pause()
            self._ring.hide()

    def remove(self) -> None:
        """Remove the widget from the view permanently."""
        self.Off()
        self._live.remove()
        self._ring.remove()
        if self._own_surface:
            self._surface.remove()

    # Events.
    def on_hover(self, pointer: Pointer) -> None:
        """Show the ring."""
        self._draw_ring(self._picker.hit(pointer))

    def on_press(self, press: Pointer) -> Gesture | None:
        """Pull the surface under the pointer, as soon as the session is prepared."""
        hit = self._picker.hit(press)
        return None if hit is None else self._pull(hit, press)

    def on_key(self, key: str, pointer: Pointer) -> bool:
        """Change the axis or plane constraint of the running pull."""
        axis = "xyz".find(key.lower()) if len(key) == 1 else -1
        if not self.is_grabbing or axis < 0 or pointer.control:
            return False
        self._constraint = next_constraint(FREE, self._constraint, axis)
        self._send(Phase.MOVE, "InteractionEvent")
        return True

    def _pull(self, hit: Hit, press: Pointer) -> Gesture:
        session = self.session
        while not session.is_bound:
            if (yield).phase is not Phase.MOVE:
                return
        session.commit()  # keeps an unfinished drag from elsewhere out of our undo step
        self._live.pause()
        start = np.array(session.vertices[hit.vertex])
        grip = Grip(hit.point, hit.point, np.eye(3), self.radius)
        motion = Motion(self.view, FREE, grip, press)
        self._constraint = None
        has_moved = committed = False
        pull = partial(session.pull, hit.vertex, radius=self.radius, locality=self.locality)
        try:
            while (pointer := (yield)).phase is Phase.MOVE:
                if has_moved and not session.is_dragging:
                    return  # a commit, undo or redo from elsewhere has ended the pull
                if motion.part != (self._constraint or FREE):
                    motion = Motion(self.view, self._constraint or FREE, grip, press)
                matrix = motion.matrix(pointer)
                distance = float(np.linalg.norm(pointer.position - press.position))
                if has_moved or distance > _CLICK_TOLERANCE:
                    has_moved = True
                    self._ring.hide()
                    self._live.solve(partial(pull, start + matrix[:3, 3]))
            if pointer.phase is Phase.RELEASE:
                session.commit("pull")
                committed = True
        finally:
            if not committed:  # last, as listeners of the session may raise
                session.revert()
            self._live.resume()

    def _draw_ring(self, hit: Hit | None) -> None:
        if hit is None:
            self._ring.hide()
        else:
            distances = self._picker.distances([hit], self.radius)
            self._ring.draw(distances, self.radius, rgb(INK))
