"""Handles dragged and turned by the mouse; the mesh follows at every move.

The active handle has a gizmo at its middle.  Its ball drags in the plane of the view, its arrows
along an axis, its squares in a plane, its rings turn, the outermost about the line of sight.  A
press on the vertices of any handle makes that one active, and drags it in the plane of the view.

    x, y, z     while dragging: along that axis; again: across it; again: as before
                while turning: about that axis; again: as before
    shift       slowly
    control     turns by 15 degrees at a time
    escape, right button        back to the pose before the press

One move is one solve, for where the pointer is now, of about 20 ms.  While the pointer rests, and
after the release, a timer goes on until the pose has converged: it belongs to the same undo step.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.checks import as_flag, require
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.session import Change, Session, require_handle

from ..picking import Picker
from ..scene import Gesture, Phase, Pointer, SurfaceDisplay, Widget
from .gizmo import Gizmo
from .gizmo_shapes import FREE, Part, Way
from .handle_marks import HandleMarks
from .handle_motion import Grip, Motion, next_constraint
from .live_solve import LiveSolve

_SLACK = 3.0  # pixels that a hand may tremble when it clicks on a handle


class HandleDragger(Widget):
    """Drags and turns the handles of a session; there is nothing to see until it is on.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it lives.  Call `remove` before its window closes.
    session : Session
        Whose handles.  Bind it ahead, or the first move has to wait for that.
    surface : SurfaceDisplay, optional
        The mesh, of the same session; without it there is one of its own.

    Attributes
    ----------
    gizmo : Gizmo
        What is grabbed.
    """

    def __init__(self, view: Any, session: Session, surface: SurfaceDisplay | None = None) -> None:
        super().__init__(view, session)
        if surface is not None:
            require(surface, SurfaceDisplay, "surface")
        self._own_surface = surface is None
        self._surface = SurfaceDisplay(self.view, session) if surface is None else surface
        self._picker = Picker(self._surface)
        self._marks = HandleMarks(self.view, session)
        self.gizmo = Gizmo(self.view)
        self._local = False
        self._handle: str | None = None
        self._held: Part | None = None  # what the gesture in hand has grabbed
        self._constraint: Part | None = None  # what keys have made of it
        self._live = LiveSolve(self.view, session, self.cancel)
        self._names = session.handles  # as last seen, to know one that is renamed
        self._choose()
        self._stop_listening = session.on_change(self._changed)

    @property
    def handle(self) -> str | None:
        """The active handle, or None."""
        return self._handle

    @handle.setter
    def handle(self, name: str | None) -> None:
        if name is not None:
            require_handle(self.session.handles, name)
        if name != self._handle:
            self.finish()
            self._handle = name
            self._place()

    @property
    def local(self) -> bool:
        """Whether the axes are turned with the handle; else they are those of the world."""
        return self._local

    @local.setter
    def local(self, local: bool) -> None:
        self._local = as_flag(local, "local")
        self._place()

    @property
    def refine_while_resting(self) -> bool:
        """Whether a timer goes on solving while the pointer rests, and after the release."""
        return self._live.refines

    @refine_while_resting.setter
    def refine_while_resting(self, refines: bool) -> None:
        self._live.refines = as_flag(refines, "refine_while_resting")
        if self.GetEnabled():
            self._live.go_on()

    @property
    def is_refining(self) -> bool:
        """Whether that timer is running."""
        return self._live.is_refining

    def On(self) -> None:  # noqa: N802 - VTK's word
        """Listen to the view and show the handles; refine a pose that has not converged."""
        super().On()
        self._marks.show(self.session.is_ready)
        self._place()
        self._live.go_on()

    def Off(self) -> None:  # noqa: N802
        """Stop listening and solving; an ongoing gesture is finished."""
        try:
            super().Off()
        finally:
            self._live.rest()
            self._marks.show(False)
            self._place()

    def remove(self) -> None:
        """Take everything out of the view, for good."""
        self.Off()
        self._stop_listening()
        self._live.remove()
        self.gizmo.remove()
        self._marks.remove()
        if self._own_surface:
            self._surface.remove()

    # What the mouse and the keyboard do.

    def hovers(self, pointer: Pointer) -> None:
        """Show what a press would take."""
        part = self.gizmo.under(pointer)
        found = None if part is not None else self._handle_under(pointer)
        self.gizmo.point_at(part)
        self._marks.point_at(None if found is None else found[0])

    def begins(self, press: Pointer) -> Gesture | None:
        """Drag the part of the gizmo, or else the handle, that is under the pointer."""
        part = self.gizmo.under(press)
        if part is not None:
            return self._drag(part, None, press)
        found = self._handle_under(press)
        if found is None:
            return None
        self.handle, point = found
        return self._drag(FREE, point, press)

    def types(self, key: str, pointer: Pointer) -> bool:
        """Bind the drag in hand to an axis, to the plane across it, or to nothing."""
        axis = "xyz".find(key.lower()) if len(key) == 1 else -1
        if self._held is None or axis < 0 or pointer.control:
            return False
        self._constraint = next_constraint(self._held, self._constraint, axis)
        self._send(Phase.MOVE, "InteractionEvent")
        return True

    def _drag(self, part: Part, point: FloatArray | None, press: Pointer) -> Gesture:
        """Move the active handle by *part* of the gizmo, or by a *point* of itself."""
        session, name, gizmo = self.session, str(self._handle), self.gizmo
        session.commit()  # what somebody else has left in hand is not ours to take back
        self._live.rest()
        assert gizmo.centre is not None  # there is something to grab
        slack = 0.0 if point is None else _SLACK
        point = gizmo.centre if point is None else point
        grip = Grip(point, gizmo.centre, gizmo.axes, gizmo.radius)
        motion = self._take(part, grip, press)
        self._held, self._constraint = part, None
        has_moved = kept = False
        try:
            while (pointer := (yield)).phase is Phase.MOVE:
                if name not in session.handles or (has_moved and not session.is_dragging):
                    return  # a step, undo or redo has ended the drag
                if motion.part != (self._constraint or part):
                    motion = self._take(self._constraint or part, grip, press)
                matrix = motion.matrix(pointer)
                away = float(np.linalg.norm(pointer.position - press.position))
                if has_moved or (away > slack and (matrix != np.eye(4)).any()):
                    has_moved = True
                    self._live.solve(partial(session.move_handle, name, matrix))
                    gizmo.say(motion.words)
            if pointer.phase is Phase.RELEASE:
                session.commit(f"{'turn' if part.way is Way.ABOUT else 'drag'} {name}")
                kept = True
        finally:
            self._held = None
            gizmo.say("")
            gizmo.show_only(None)
            if not kept:  # after all that, as listeners of the session may raise
                session.revert()
            self._live.go_on()

    def _take(self, part: Part, grip: Grip, press: Pointer) -> Motion:
        """Go on with *part*, as if it had been grabbed at the press."""
        self._marks.point_at(None)
        self.gizmo.point_at(part)
        self.gizmo.show_only(part)
        return Motion(self.view, part, grip, press)

    def _handle_under(self, pointer: Pointer) -> tuple[str, FloatArray] | None:
        """Return the handle that is seen at *pointer*, and the point of it."""
        hit = self._picker.hit(pointer) if self.session.is_ready else None
        if hit is None:
            return None
        owners = (name for name, ids in self.session.handles.items() if hit.vertex in ids)
        name = next(owners, None)
        return None if name is None else (name, hit.point)

    # What is seen.

    def _changed(self, change: Change) -> None:
        if change & Change.CONSTRAINTS:
            self._choose()
        if self.GetEnabled():
            if change & (Change.CONSTRAINTS | Change.CAGES):
                self._marks.show(self.session.is_ready)
            elif change & Change.POSE:
                self._marks.follow()
            self._place()

    def _choose(self) -> None:
        """Keep the active handle, also under another name; or else take the first, or none."""
        before, now = self._names.get(self._handle or ""), self.session.handles
        self._names = now
        if self._handle not in now:
            same = (name for name, ids in now.items() if ids is before)
            self._handle = next(same, next(iter(now), None))

    def _place(self) -> None:
        """Put the gizmo where the active handle is."""
        session, name = self.session, self._handle
        if name is None or not session.is_ready or not self.GetEnabled():
            self.gizmo.place(None)
            return
        ids = session.handles[name]
        axes = np.eye(3)
        if self._local:
            axes = rigid_fit(session.mesh.vertices[ids], session.targets[name])[0].T
        self.gizmo.place(session.vertices[ids].mean(axis=0), axes)
