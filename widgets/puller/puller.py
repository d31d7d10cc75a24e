"""Pulling the surface at any point; it follows at every move.

A press grabs the surface under the pointer and moves it in the view plane.  A ring on the surface
shows the radius, and the limb that would move is tinted.  A press on a pin or a pulled point, shown
as dots, grabs that.

    shift + click       pin the point, or remove the pin or pulled point there
    shift + wheel       smaller, larger radius; with control a smaller, larger limb
    while pulling:
    x, y, z     constrain to the axis; again: to the plane perpendicular to it; again: no constraint
    r           turn the limb about its axis, or without one the surface around the point about
                the line of sight; again: that; again: move.  Or about x, y, z
    control     pull in steps of about 1 % of the diagonal, turn in steps of 5 degrees
    shift       pull slowly; with control in finer steps
    a number, enter             pull by exactly that much along the axis, or in the direction so far
    escape, right button        cancel

Long because one widget shows what a press would move, pulls it, turns it and pins it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from vtk_segdeform.arrays import FloatArray, is_number
from vtk_segdeform.checks import require, shown
from vtk_segdeform.deformer import Limb, checked_hinge, checked_limb, checked_locality
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.pictures import PAPER, rgb
from vtk_segdeform.session import Change, Session, SurfacePoint, pulls
from vtk_segdeform.solver import Solution

from ..handle_dragger import Gizmo, LiveSolve, step_of
from ..picking import Hit, Picker
from ..region_selector import BrushRing
from ..scene import Gesture, Phase, Pointer, SurfaceDisplay, Widget
from .limb_tint import LimbTint
from .markers import Markers, marked_vertices
from .pull_motion import PullMotion
from .waiting import Pull, Waiting

_RADIUS = 0.15  # the initial radius, in diagonals of the mesh
_SMALLEST_RADIUS, _LARGEST_RADIUS = 0.005, 1.0  # in diagonals
_GROWTH = 1.1  # factor for one click of the wheel or one key press
_CLICK_TOLERANCE = 3.0  # pixels; a press that moves less does not pull
_BESIDE = 4.0  # pixels beside the surface at which a press still grabs its edge
_RING_THICKNESS = 0.8  # of the ring of a brush
_TOO_COARSE = "No vertex near this point. Enlarge the radius, or subdivide the mesh"
_FIXED = "This point is fixed. Grab another one, or erase fixed vertices in mode 3"
LOCKED = "{} is locked. Clear Lock in the list of handles to move it"
_NO_DIRECTION = "No direction yet. Press X, Y or Z before the number, or drag first"
_NOT_YET = "The last pull is not computed yet. Wait a moment, or press Esc to cancel it"
_PREPARING_LIMBS = "The mesh is not ready yet. Wait until it is prepared"
_PREPARING = "Preparing: the pull starts in a moment"


class Puller(Widget):
    """Pulls the surface of a session at any point; invisible until it is on.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to work in.  Call `remove` before its window closes.
    session : Session
        The session to edit.  It can be pulled once it has cages; a pull that begins earlier waits.
    surface : SurfaceDisplay, optional
        The displayed mesh of the session; by default the widget adds its own.

    Attributes
    ----------
    binds : bool
        Whether the first pull binds the session if need be; otherwise it waits until that is done.
    is_locked, is_hidden : callable
        Of a name: whether a pin or pulled point must not be grabbed, or is not shown; none is.
    says : callable
        Called with a text about a limb that the wheel chose.
    waiting : Waiting
        The pull that waits until the session is ready.
    """

    def __init__(self, view: Any, session: Session, surface: SurfaceDisplay | None = None) -> None:
        super().__init__(view, session)
        if surface is not None:
            require(surface, SurfaceDisplay, "surface")
        self.binds = True
        self.is_locked: Callable[[str], bool] = lambda _: False
        self.is_hidden: Callable[[str], bool] = lambda _: False
        self.says: Callable[[str], object] = lambda _: None
        self._own_surface = surface is None
        self._surface = SurfaceDisplay(self.view, session) if surface is None else surface
        changed = partial(self._invoke, "ModifiedEvent")
        self.waiting = Waiting(self._surface, self._is_ready, self._go_on, changed)
        self._picker = Picker(self._surface)
        self._ring = BrushRing(self._surface)
        self._markers = Markers(self._surface, self._picker, lambda name: self.is_hidden(name))
        self._tint = LimbTint(self._surface, self._limb_of_pull)
        self._gizmo = Gizmo(self.view)
        self._limb: int | None = None
        self._hinge = 0.0
        self._radius = _RADIUS * session.mesh.diagonal
        self._locality: float | None = None
        self._motion: PullMotion | None = None  # of the running gesture
        self._pulled: SurfacePoint | None = None  # by it
        self._live = LiveSolve(self.view, session, self.cancel)
        self._stop_listening = session.on_change(self._changed)

    @property
    def radius(self) -> float:
        """The radius of the pulled surface, in the mesh's unit."""
        return self._radius

    @radius.setter
    def radius(self, radius: float) -> None:
        if not (is_number(radius) and radius > 0.0):
            raise ArgumentError(f"radius must be above 0; got {shown(radius)}")
        diagonal = self.session.mesh.diagonal
        self._radius = float(
            np.clip(radius, _SMALLEST_RADIUS * diagonal, _LARGEST_RADIUS * diagonal)
        )
        self._invoke("ModifiedEvent")

    @property
    def locality(self) -> float | None:
        """How local a pull is, 0 to 1; None decides it by pins.  See `Session.pull`."""
        return self._locality

    @locality.setter
    def locality(self, locality: float | None) -> None:
        self._locality = checked_locality(locality)
        self._invoke("ModifiedEvent")

    @property
    def effective_locality(self) -> float:
        """`locality`, or the value that the pins and fixed vertices lead to."""
        return pulls.locality_of(self.session.state, self._locality)

    @property
    def limb(self) -> int | None:
        """The number of the limb that a pull moves, 0 for the smallest; None is automatic."""
        return self._limb

    @limb.setter
    def limb(self, limb: int | None) -> None:
        self._limb = checked_limb(limb)
        self._invoke("ModifiedEvent")

    @property
    def hinge(self) -> float:
        """Where a pulled limb bends, 0 to 1: along its length, or at its joint only."""
        return self._hinge

    @hinge.setter
    def hinge(self, hinge: float) -> None:
        self._hinge = checked_hinge(hinge)
        self._invoke("ModifiedEvent")

    @property
    def options(self) -> dict[str, Any]:
        """The radius, locality, limb and hinge, as of `Session.pull`."""
        return {
            "radius": self.radius,
            "locality": self.locality,
            "limb": self.limb,
            "hinge": self.hinge,
        }

    def change_limb(self, steps: int) -> str:
        """Let a pull move a larger limb of the point under the pointer, or a smaller one.

        Return which one it is, or why there is none.
        """
        pointer = self.view.pointer(Phase.HOVER)
        point = self._point_at(self._markers.at(pointer), self._hit(pointer))
        if point is None:
            return "Point at the surface to choose a limb"
        limbs = self.session.deformer.limbs(point) if self.session.is_bound else ()
        if not limbs:
            return "No limb here" if self.session.is_bound else _PREPARING_LIMBS
        now, depths = self._limb_of_pull(point), [limb.depth for limb in limbs]
        number = (depths.index(now.depth) if now is not None else -1) + steps
        self.limb = number = min(max(number, 0), len(limbs) - 1)  # a listener may change it
        self._tint.show(point)
        if limbs[number].is_whole:
            return "Limb: whole body"
        return f"Limb: {number + 1} of {len(limbs)}"

    @property
    def turning(self) -> str:
        """What the running pull turns about: "limb", "view" or an axis; "" if it moves."""
        motion = self._motion
        if motion is None or not motion.is_turning:
            return ""
        if motion.turns_limb:
            return "limb"
        return "view" if motion.part.axis is None else "xyz"[motion.part.axis]

    @property
    def is_refining(self) -> bool:
        """Whether a timer refines the pose at present."""
        return self._live.is_refining

    def stop_refining(self) -> None:
        """Leave the current pose as it is, even if it has not converged."""
        self._live.halt()

    def resume_refining(self) -> None:
        """Refine the current pose if it has not converged and the widget is on."""
        if self.GetEnabled():
            self._live.resume()

    @property
    def marked(self) -> tuple[str, ...]:
        """The names of the pins and pulled points."""
        return tuple(marked_vertices(self.session))

    def marker_under_pointer(self) -> str | None:
        """Return the pin or pulled point under the pointer, or None."""
        return self._markers.at(self.view.pointer(Phase.HOVER))

    def reaches(self, rectangle: tuple[float, float, float, float]) -> bool:
        """Return whether a marker is in a *rectangle*: left, bottom, right, top in the window."""
        return self._markers.reaches(rectangle)

    def On(self) -> None:  # noqa: N802 - VTK's word
        """Start handling events, show the pins, and refine a pose that has not converged."""
        if not self.GetEnabled():
            super().On()
            self._markers.show(True)
            self.resume_refining()

    def Off(self) -> None:  # noqa: N802
        """Stop handling events and refining; finish an ongoing gesture."""
        try:
            super().Off()
        finally:
            self.waiting.drop()
            self._live.pause()
            self._markers.show(False)

    def remove(self) -> None:
        """Remove the widget from the view permanently."""
        self.Off()
        self._stop_listening()
        self._gizmo.remove()
        self._markers.remove()
        self._ring.remove()
        if self._own_surface:
            self._surface.remove()

    # Events.
    def on_hover(self, pointer: Pointer) -> None:
        """Highlight the marker under the pointer, or show the ring."""
        inside = self.view.contains(pointer)
        marker = self._markers.at(pointer) if inside else None
        self._markers.highlight(marker)
        hit = self._hit(pointer) if inside and marker is None else None
        self._draw_ring(hit)
        self._tint.follow(self._point_at(marker, hit))

    def _hit(self, pointer: Pointer) -> Hit | None:
        return self._picker.hit(pointer, beside=_BESIDE)

    def _point_at(self, marker: str | None, hit: Hit | None) -> SurfacePoint | None:
        if marker is not None:
            return SurfacePoint.at_vertex(self._markers.vertex(marker))
        return None if hit is None else hit.place

    def _limb_of_pull(self, point: SurfacePoint) -> Limb | None:
        """Return the limb that a pull of *point* would move, if the session is ready."""
        if not self.session.is_bound:
            return None
        locality = self.effective_locality
        return self.session.deformer.limb_of_pull(point, self.radius, locality, self.limb)

    def on_press(self, press: Pointer) -> Gesture | None:
        """Pull the marker or the surface under the pointer; beside it, pass on the press."""
        self.remark = ""
        marker = self._markers.at(press)
        hit = self._hit(press) if marker is None else None
        if self.waiting.has_pull and (marker is not None or hit is not None):
            return self._refuse(_NOT_YET)
        point = self._point_at(marker, hit)
        if point is None:
            return None
        name = pulls.grabbed(self.session.mesh, self.session.state, point, self.radius)
        if name is not None and self.is_locked(name):
            return self._refuse(LOCKED.format(name))
        if np.isin(point.vertex, self.session.fixed):
            return self._refuse(_FIXED)
        can_grab = pulls.can_grab(self.session.mesh, point, self.radius)
        return self._pull(point, press) if can_grab else self._refuse(_TOO_COARSE)

    def on_wheel(self, pointer: Pointer, clicks: int) -> bool:
        """Change the radius, or with Control the limb, over the mesh with Shift held.

        Otherwise pass the wheel to the camera.
        """
        if self.is_grabbing:
            return True  # camera and radius stay the same during a pull
        if not pointer.shift or self._hit(pointer) is None:
            return False
        if pointer.control:
            self.says(self.change_limb(clicks))
        else:
            self._resize(clicks, pointer)
        return True

    def on_key(self, key: str, pointer: Pointer) -> bool:
        """Change the constraint or the kind of the running pull, or type a number.

        During a pull all keys of a number are handled here, whatever else they do.
        """
        motion = self._motion
        if motion is None or pointer.control:
            return False
        axis = "xyz".find(key.lower()) if len(key) == 1 else -1
        if axis >= 0:
            motion.constrain(axis)
        elif key.lower() == "r":
            motion.toggle_turning(pointer, self.session.turned(), self._limb_axis())
        elif motion.entry.is_enter(key):
            return self._live.is_refused or self.finish()
        elif not motion.entry.type(key):
            return False
        self._send(Phase.MOVE, "InteractionEvent")
        self._invoke("ModifiedEvent")  # the hint names what it turns about
        return True

    def _limb_axis(self) -> tuple[FloatArray, FloatArray] | None:
        """Return the joint and the direction of the limb that the running pull moves."""
        limb = None if self._pulled is None else self._limb_of_pull(self._pulled)
        if limb is None or limb.is_whole:
            return None
        return limb.axis(self.session.mesh, self.session.vertices)

    # Gestures.
    def _pull(self, point: SurfacePoint, press: Pointer) -> Gesture:
        """Pull *point*, so that it stays under the pointer."""
        session = self.session
        session.commit()  # keeps an unfinished drag from elsewhere out of our undo step
        self._live.begin()
        start, step = point.at(self._surface.points), step_of(session.mesh.diagonal)
        motion = self._motion = PullMotion(self.view, start, press, self._gizmo.size, step)
        self._pulled = point
        pull = partial(session.pull, point, **self.options)
        to: FloatArray | None = None  # where to pull to, once the pointer has moved
        has_moved = wants = committed = False
        try:
            while (pointer := (yield)).phase is Phase.MOVE:
                if has_moved and not session.is_dragging:
                    return  # a commit, undo or redo from elsewhere has ended the pull
                distance = float(np.linalg.norm(pointer.position - press.position))
                wants = wants or distance > _CLICK_TOLERANCE or bool(motion.entry.text)
                if not wants and motion.part.axis is None and not motion.has_turned:
                    continue
                moves = motion.follow(pointer)
                self._show(motion)
                if not (wants and moves):
                    continue
                to = motion.of(start)
                if self._is_ready():
                    self._solve(partial(pull, to))
                    has_moved = has_moved or session.is_dragging  # not if it was refused
                else:
                    self._live.begin()
                    self.waiting.begin()
                    self.waiting.follow(point, to, self.radius, self.locality)
            if pointer.phase is Phase.RELEASE:
                if to is not None and not has_moved:
                    self._pull_later(partial(pull, to))
                elif to is None and motion.entry.text:
                    self.remark = _NO_DIRECTION
                elif to is None and press.shift:
                    self.toggle_pin(point.vertex)
                session.commit("pull")
                committed = True
        finally:
            self._motion = self._pulled = None
            self._show(None)
            if not self.waiting.has_pull:
                self.waiting.drop()
            if not committed:  # last, as listeners of the session may raise
                session.revert()
            self._live.resume()

    def _refuse(self, remark: str) -> Gesture:
        """Do nothing until the release, and say why."""
        self._ring.hide()
        self._tint.follow(None)
        while (yield).phase is Phase.MOVE:
            pass
        self.remark = remark

    def toggle_pin(self, vertex: int) -> None:
        """Pin a vertex, or remove the pin or pulled point there; `remark` tells which."""
        session, before = self.session, self.effective_locality
        owners = [name for name, ids in session.handles.items() if vertex in ids]
        if owners:
            session.handles.remove(owners[0])
            self.remark = f"Removed {owners[0]}"
        else:
            self.remark = f"Added {session.handles.pin(vertex)}"
        if self.effective_locality != before:
            self.remark += f". Local is now {100.0 * self.effective_locality:.0f} %"

    def _solve(self, pull: Callable[..., Solution]) -> None:
        if self.waiting.is_shown:
            pull()  # until it converges: a pose in between would look like a step back
        self._live.solve(pull)
        self.waiting.hide()

    # Pulls that wait for the session.
    def cancel(self) -> bool:
        """Cancel a running gesture or else a pull that waits; False if there was none."""
        if super().cancel():
            return True
        had_pull = self.waiting.has_pull
        if had_pull:
            self.waiting.drop()
        return had_pull

    def _is_ready(self) -> bool:
        return bool(self.session.cages) and (self.binds or self.session.is_bound)

    def _go_on(self, pull: Pull | None) -> None:
        """Begin the pull that was released, or else continue the gesture."""
        if pull is None:
            self._send(Phase.MOVE, "InteractionEvent")
        else:
            self.remark = ""
            pull()
            self._invoke("EndInteractionEvent")

    def _pull_later(self, pull: Callable[..., Solution]) -> None:
        """Pull once the session is ready, unless another change comes first."""

        def begin() -> None:
            self._solve(pull)
            self.session.commit("pull")
            self._live.resume()

        if self._is_ready():
            begin()
        else:
            self.waiting.begin(begin)
            self.remark = "" if self.waiting.is_shown else _PREPARING

    # Display.
    def _resize(self, clicks: int, pointer: Pointer) -> None:
        self.radius = self.radius * _GROWTH**clicks
        self.on_hover(pointer)

    def _draw_ring(self, hit: Hit | None) -> None:
        if hit is None:
            self._ring.hide()
        else:
            segments = self._picker.ring(hit, self.radius)
            self._ring.draw(segments, rgb(PAPER), thickness=_RING_THICKNESS)

    def _show(self, motion: PullMotion | None) -> None:
        """Show the part of the gizmo and the amount of *motion*, or neither."""
        self._markers.highlight(None)
        self._ring.hide()
        self._tint.follow(None)
        self._gizmo.show_only(None if motion is None else motion.part)
        self._gizmo.place(*(None,) if motion is None else (motion.centre, motion.axes))
        self._gizmo.set_caption("" if motion is None else motion.caption)

    def leave(self) -> None:
        """Show nothing at the pointer until it moves again."""
        self._ring.hide()
        self._tint.follow(None)
        self._markers.highlight(None)

    def _changed(self, change: Change) -> None:
        if not self.GetEnabled():
            return
        if change & (Change.CONSTRAINTS | Change.HISTORY):
            self._markers.show(True)
        if change & Change.POSE:
            self._ring.hide()  # the surface has moved away from it
            if self.waiting.has_pull:
                self.waiting.drop()
