"""Moving and rotating handles with the mouse; the mesh follows at every move.

The active handle has a gizmo at its pivot, by default its centre.  The ball moves it in the view
plane, an arrow along an axis, a square in a plane; a ring rotates it, the outer one about the line
of sight.  A press on the vertices of any handle activates that handle and moves it in the view
plane.  A pin or pulled point is moved by a pull, so that the pose around it is kept.

    x, y, z     while moving: constrain to the axis; again: to the plane perpendicular to it;
                again: no constraint.  While rotating: about the axis; again: no constraint
    r           turn the limb about its axis, or without one about the line of sight; again: that;
                again: as before
    control     move in steps of about 1 % of the diagonal, rotate in steps of 5 degrees
    shift       move slowly; with control in finer steps
    a number, enter             move by exactly that much; see `number_entry`
    shift + drag the ball       move the pivot; `reset_pivot_at`, the double click of an editor,
                                puts it back
    escape, right button        cancel

Each move solves once for the current position of the pointer.  While the pointer
rests, and after the release, a timer refines the pose until it has converged; this is part of the
same undo step.

Long because one widget moves its handle by the mouse, by keys and by numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from vtk_segdeform.arrays import FloatArray, IntArray, is_number, is_whole
from vtk_segdeform.checks import as_flag, require, shown
from vtk_segdeform.errors import ArgumentError, ConstraintError
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.session import Change, Session, pulls, require_handle
from vtk_segdeform.solver import Solution

from ..picking import Picker
from ..scene import Gesture, Phase, Pointer, SurfaceDisplay, Widget
from .gizmo import Gizmo
from .gizmo_shapes import FREE, LIMB, TURN, Kind, Part
from .handle_marks import HandleMarks
from .handle_motion import Grip, Motion, axes_along, next_constraint, step_of
from .live_solve import LiveSolve
from .locked_bodies import locked_components
from .number_entry import NumberEntry

_LEAST_FACTOR = 1e-3
_CLICK_TOLERANCE = 3.0  # pixels; smaller movements of a press on a handle do not move it


class HandleDragger(Widget):
    """Moves and rotates the handles of a session; invisible until it is on.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to work in.  Call `remove` before its window closes.
    session : Session
        The session to edit.  Call `Session.bind` beforehand; otherwise the first move does.
    surface : SurfaceDisplay, optional
        The displayed mesh of the session; by default the widget adds its own.

    Attributes
    ----------
    gizmo : Gizmo
        The gizmo of the active handle.
    pulls_with : callable
        Returns the options of `Session.pull` with which pins and pulled points are moved.
    """

    def __init__(self, view: Any, session: Session, surface: SurfaceDisplay | None = None) -> None:
        super().__init__(view, session)
        if surface is not None:
            require(surface, SurfaceDisplay, "surface")
        self._own_surface = surface is None
        self._surface = SurfaceDisplay(self.view, session) if surface is None else surface
        self._picker = Picker(self._surface)
        self._marks = HandleMarks(self.view, session)
        self._marks.is_shown = self._is_on_shown_surface
        self.gizmo = Gizmo(self.view)
        self.pulls_with: Callable[[], dict[str, Any]] = dict
        self._local = False
        self._handle: str | None = None
        self._locked: frozenset[str] = frozenset()
        self._grabbed: Part | None = None  # the part of the running gesture
        self._constraint: Part | None = None  # set by keys during the gesture
        self._motion: Motion | None = None  # of the running gesture, since the press or an R
        self._moved = self._base = np.eye(4)  # by the gesture so far, and before the motion
        self._pressed = FREE  # the part at the press
        self._limb: Grip | None = None  # of the limb, while that is turned
        self._grip: Grip
        self._since: Pointer
        self._entry = NumberEntry()  # of the running gesture
        self._live = LiveSolve(self.view, session, self.cancel)
        self._last_handles = session.handles  # to recognise a renamed handle
        self._update_handle()
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
            self._update_gizmo()

    @property
    def hidden(self) -> frozenset[str]:
        """The handles that are neither shown nor dragged; they keep their place."""
        return self._marks.hidden

    @property
    def locked(self) -> frozenset[str]:
        """The handles that are shown, but not dragged: those on locked bodies as well."""
        return self._locked | self._on_locked_bodies

    def set_hidden(self, name: str, hidden: bool) -> None:
        """Hide or show a handle."""
        require_handle(self.session.handles, name)
        self.finish()
        self._marks.hidden = (
            self.hidden | {name} if as_flag(hidden, "hidden") else (self.hidden - {name})
        )
        self.update()

    def update(self) -> None:
        """Show the handles and the gizmo again, as others of them may be hidden."""
        self._marks.show(bool(self.GetEnabled()) and self.session.state.is_ready)
        self._update_gizmo()

    def set_locked(self, name: str, locked: bool) -> None:
        """Lock or unlock a handle.

        Raises
        ------
        ConstraintError
            If there is no such handle, or the one to be unlocked is on a locked body.
        """
        require_handle(self.session.handles, name)
        self.finish()
        is_locked = as_flag(locked, "locked")
        if name not in self._on_locked_bodies:
            self._locked = self._locked | {name} if is_locked else self._locked - {name}
        elif not is_locked:
            raise ConstraintError(f"The body of {name} is locked. Unlock it in the list of bodies")
        self._update_gizmo()

    @property
    def _on_locked_bodies(self) -> frozenset[str]:
        components, locked = self.session.mesh.components, locked_components(self.session)
        handles = self.session.handles.items() if locked.any() else ()
        return frozenset(name for name, ids in handles if locked[components[ids]].all())

    @property
    def local(self) -> bool:
        """Whether the axes rotate with the handle; otherwise they are those of the world."""
        return self._local

    @local.setter
    def local(self, local: bool) -> None:
        self._local = as_flag(local, "local")
        self._update_gizmo()

    @property
    def is_refining(self) -> bool:
        """Whether a timer refines the pose: while the pointer rests, and after the release."""
        return self._live.is_refining

    def stop_refining(self) -> None:
        """Leave the current pose as it is, even if it has not converged."""
        self._live.halt()

    def resume_refining(self) -> None:
        """Refine the current pose if it has not converged and the widget is on."""
        if self.GetEnabled():
            self._live.resume()

    def On(self) -> None:  # noqa: N802 - VTK's word
        """Start handling events, show the handles, and refine a pose that has not converged."""
        super().On()
        self._marks.show(self.session.state.is_ready)
        self._update_gizmo()
        self.resume_refining()

    def Off(self) -> None:  # noqa: N802
        """Stop handling events and refining; finish an ongoing gesture."""
        try:
            super().Off()
        finally:
            self._live.pause()
            self._marks.show(False)
            self._update_gizmo()

    def remove(self) -> None:
        """Remove the widget from the view permanently."""
        self.Off()
        self._stop_listening()
        self._live.pause()
        self.gizmo.remove()
        self._marks.remove()
        if self._own_surface:
            self._surface.remove()

    # Events.
    def on_hover(self, pointer: Pointer) -> None:
        """Highlight the part of the gizmo, or else the handle, under the pointer."""
        part = self.gizmo.part_at(pointer)
        found = None if part is not None else self._handle_at(pointer)
        self.gizmo.highlight(part)
        self._marks.highlight(None if found is None else found[0])

    def leave(self) -> None:
        """Highlight nothing."""
        self.gizmo.highlight(None)
        self._marks.highlight(None)

    def on_press(self, press: Pointer) -> Gesture | None:
        """Drag the part of the gizmo, or else the handle, under the pointer."""
        part = self.gizmo.part_at(press)
        if part == FREE and press.shift:
            return self._move_pivot(press)
        if part is not None:
            return self._drag(part, None, press)
        found = self._handle_at(press)
        if found is None:
            return None
        self.handle, point = found
        return self._drag(FREE, point, press)

    def on_key(self, key: str, pointer: Pointer) -> bool:
        """Change the axis or plane constraint of the running drag, or type its amount."""
        if self._grabbed is None or pointer.control:
            return False
        axis = "xyz".find(key.lower()) if len(key) == 1 else -1
        if axis >= 0:
            self._constraint = next_constraint(self._grabbed, self._constraint, axis)
            is_same = self._motion is not None and self._motion.part == self._part
            if self._limb is not None or not is_same:
                self._motion = None
        elif key.lower() == "r":
            self._toggle_turning(pointer)
        elif self._entry.is_enter(key):
            return self._live.is_refused or self.finish()
        elif not self._entry.type(key):
            return False
        self._send(Phase.MOVE, "InteractionEvent")
        self._invoke("ModifiedEvent")  # the hint names what it turns about
        return True

    @property
    def turning(self) -> str:
        """What the running drag turns about since an R: "limb", "view" or an axis; "" if not."""
        motion = self._motion
        if motion is None or motion.part.kind is not Kind.ROTATION:
            return ""
        if self._turned_limb is not None:
            return "limb"
        if self._grabbed == self._pressed:
            return ""
        return "view" if motion.part.axis is None else "xyz"[motion.part.axis]

    def _toggle_turning(self, pointer: Pointer) -> None:
        """Turn the limb, then about the line of sight, then go on as at the press.

        The motion so far stays.
        """
        self._base, self._constraint, self._entry = self._moved, None, NumberEntry()
        if self._limb is not None:
            self._grabbed, self._limb = TURN, None
        elif self._grabbed != self._pressed:
            self._grabbed = self._pressed
        else:
            self._limb = self._limb_grip()
            self._grabbed = TURN if self._limb is None else LIMB
        self._motion, self._since = None, pointer
        self._grip = replace(self._own_grip(), has_arm=False)

    def _own_grip(self) -> Grip:
        """Return the grip of the active handle at its pivot."""
        pivot = self.session.handles.pivot(str(self._handle))
        step = step_of(self.session.mesh.diagonal)
        return Grip(pivot, pivot, self._axes, self.gizmo.radius, step)

    def _limb_grip(self) -> Grip | None:
        """Return the grip by which the limb of the active handle turns; None without one."""
        session, number = self.session, self.pulls_with().get("limb") or 0
        vertex = pulls.middle_vertex(session.mesh, session.handles[str(self._handle)])
        limbs = [limb for limb in session.deformer.limbs(vertex) if not limb.is_whole]
        if not limbs:
            return None
        joint, axis = limbs[min(number, len(limbs) - 1)].axis(session.mesh, session.vertices)
        return replace(self._own_grip(), centre=joint, axes=axes_along(axis), has_arm=False)

    def _drag(self, part: Part, point: FloatArray | None, press: Pointer) -> Gesture:
        """Move the active handle by *part* of the gizmo, or by a *point* of its surface."""
        session, name, gizmo = self.session, str(self._handle), self.gizmo
        session.commit()  # keeps an unfinished drag from elsewhere out of our undo step
        self._live.pause()
        assert gizmo.centre is not None  # the press was on the gizmo or on a visible handle
        tolerance = 0.0 if point is None else _CLICK_TOLERANCE
        grip = self._own_grip()
        self._grip, self._since = (grip if point is None else replace(grip, point=point)), press
        self._grabbed = self._pressed = part
        self._constraint, self._limb, self._entry = None, None, NumberEntry()
        self._moved = self._base = base = np.eye(4)
        motion = self._motion = self._begun_motion()
        move = self._mover(name)
        has_moved = committed = False
        sent = reached = 0.0  # angles of a rotation: of the last targets, and of the pose
        try:
            while (pointer := (yield)).phase is Phase.MOVE:
                if name not in session.handles or (has_moved and not session.is_dragging):
                    return  # a commit, undo or redo from elsewhere has ended the drag
                reached = sent if self._live.has_reached() else reached
                if self._motion is not motion:  # a key has ended it
                    if base is self._base:
                        motion.exact(0.0)  # back through the same stops
                        stops = [move(stop @ base) for stop in motion.stops(reached)]
                        self._live.solve_through(stops)
                    base, sent, reached = self._base, 0.0, 0.0
                    motion = self._motion = self._begun_motion()
                entry = self._entry
                matrix = entry.matrix(motion) if entry.text else motion.matrix(pointer)
                distance = float(np.linalg.norm(pointer.position - press.position))
                is_far = distance > tolerance or bool(entry.text)
                if matrix is not None and (has_moved or (is_far and (matrix != np.eye(4)).any())):
                    stops = [move(stop @ base) for stop in motion.stops(reached)]
                    self._live.solve_through(stops)
                    self._moved = matrix @ base
                    self._live.solve(move(self._moved))
                    sent = motion.turn
                    has_moved = has_moved or session.is_dragging  # not if it was refused
                if has_moved or entry.text:
                    gizmo.set_caption(entry.caption(motion))
            if pointer.phase is Phase.RELEASE:
                is_turn = self._part.kind is Kind.ROTATION
                session.commit(f"{'rotate' if is_turn else 'drag'} {name}")
                committed = True
        finally:
            self._grabbed = self._motion = self._limb = None
            gizmo.set_caption("")
            gizmo.show_only(None)
            if not committed:  # last, as listeners of the session may raise
                session.revert()
            self._update_gizmo()
            self._live.resume()

    @property
    def shift(self) -> FloatArray:
        """(3,) float: how far the targets of the active handle are from rest, on average.

        ConstraintError without an active handle; so do the methods that move it.
        """
        name, session = str(self._handle), self.session
        require_handle(session.handles, name)
        return np.asarray(
            (session.targets[name] - session.mesh.vertices[session.handles[name]]).mean(axis=0)
        )

    @property
    def angles(self) -> FloatArray:
        """(3,) float: by how many degrees the running drag has turned about x, y and z."""
        motion, angles = self._motion, np.zeros(3)
        if motion is not None and motion.part.axis is not None and self.turning != "limb":
            angles[motion.part.axis] = np.degrees(motion.turn)
        return angles

    def shift_to(self, axis: int, amount: float) -> None:
        """Move the active handle along x, y or z, *axis* 0 to 2, until its `shift` is *amount*."""
        axis = _checked_axis(axis)
        _require_number(amount, "amount")
        matrix = np.eye(4)
        matrix[axis, 3] = amount - self.shift[axis]
        self._apply("drag", [matrix])

    def rotate(self, axis: int, degrees: float) -> None:
        """Rotate the active handle about its pivot by *degrees*, about *axis* 0 to 2 of its gizmo.

        A turn of more than 90 degrees stops on its way, as the solver turns the shorter way.
        """
        axis = _checked_axis(axis)
        _require_number(degrees, "degrees")
        count = max(1, math.ceil(abs(degrees) / 90.0))
        direction = self._axes[axis]
        turns = [
            Rotation.from_rotvec(np.radians(degrees * k / count) * direction).as_matrix()
            for k in range(1, count + 1)
        ]
        self._apply("rotate", [self._about_pivot(R) for R in turns])

    def scale(self, factor: float) -> None:
        """Scale the active handle about its pivot by a positive *factor*."""
        _require_number(factor, "factor", least=_LEAST_FACTOR)
        self._apply("scale", [self._about_pivot(factor * np.eye(3))])

    def _about_pivot(self, linear: FloatArray) -> FloatArray:
        """Return the map (4, 4) with a *linear* part (3, 3) that keeps the pivot."""
        pivot, matrix = self.session.handles.pivot(str(self._handle)), np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = linear, pivot - linear @ pivot
        return matrix

    def _apply(self, verb: str, stops: list[FloatArray]) -> None:
        """Move the active handle by the last of *stops* (4, 4), through the others, in one step."""
        session, name = self.session, str(self._handle)
        require_handle(session.handles, name)
        self.finish()
        session.commit()
        self._live.pause()
        self._invoke("StartInteractionEvent")
        try:
            move = self._mover(name)
            self._live.solve_through([move(matrix) for matrix in stops[:-1]])
            self._live.solve(move(stops[-1]))
            session.commit(f"{verb} {name}")
        finally:
            self._invoke("EndInteractionEvent")

    def _mover(self, name: str) -> Callable[[FloatArray], Callable[..., Solution]]:
        """Return what moves the handle *name* by a matrix (4, 4) since now."""
        session, ids = self.session, self.session.handles[name]
        if len(ids) > 1 and name not in session.state.pulls:
            return lambda matrix: partial(session.move_handle, name, matrix)
        vertex = pulls.middle_vertex(session.mesh, ids)
        start = session.targets[name][ids == vertex][0]
        pull = partial(session.pull, vertex, **self.pulls_with())

        def moved(matrix: FloatArray) -> Callable[..., Solution]:
            turns = (matrix[:3, :3] != np.eye(3)).any()
            return partial(pull, matrix if turns else start + matrix[:3, 3])

        return moved

    def _move_pivot(self, press: Pointer) -> Gesture:
        """Move the pivot of the active handle in the view plane, in one undo step."""
        session, name, gizmo = self.session, str(self._handle), self.gizmo
        session.commit()
        assert gizmo.centre is not None  # the press was on the gizmo
        start, step = gizmo.centre, step_of(session.mesh.diagonal)
        motion = Motion(self.view, FREE, Grip(start, start, gizmo.axes, gizmo.radius, step), press)
        point, axes = start, gizmo.axes
        gizmo.set_caption("Pivot")
        try:
            while (pointer := (yield)).phase is Phase.MOVE:
                if name not in session.handles:
                    return
                shift = motion.matrix(replace(pointer, shift=False))[:3, 3]  # which is held
                point = start + shift
                gizmo.place(point, axes)
            if pointer.phase is Phase.RELEASE and (point != start).any():
                session.handles.set_pivot(name, point)
        finally:
            gizmo.set_caption("")
            self._update_gizmo()

    def reset_pivot_at(self, pointer: Pointer) -> bool:
        """Reset the pivot of the active handle if it was moved and is at *pointer*; else False."""
        name, session = self._handle or "", self.session
        is_there = self.GetEnabled() and self.gizmo.part_at(pointer) == FREE
        if not is_there or name not in session.state.pivots:
            return False
        session.handles.set_pivot(name, None)
        return True

    def _begun_motion(self) -> Motion:
        """Return the motion from here by the constraint or the part, and show only that part."""
        part = self._part
        self._marks.highlight(None)
        self.gizmo.highlight(part)
        self.gizmo.show_only(part)
        self._update_gizmo()
        return Motion(self.view, part, self._turned_limb or self._grip, self._since)

    @property
    def _part(self) -> Part:
        """The part by which the running gesture moves."""
        part = self._constraint or self._grabbed
        assert part is not None
        return part

    @property
    def _turned_limb(self) -> Grip | None:
        return self._limb if self._constraint is None else None

    def _handle_at(self, pointer: Pointer) -> tuple[str, FloatArray] | None:
        """Return the visible handle at *pointer* and the point of its surface there."""
        hit = self._picker.hit(pointer) if self.session.state.is_ready else None
        if hit is None:
            return None
        owners = (name for name, ids in self.session.handles.items() if hit.vertex in ids)
        name = next(owners, None)
        return None if name is None or self._is_out_of_reach(name) else (name, hit.point)

    def _is_out_of_reach(self, name: str) -> bool:
        is_seen = self._is_on_shown_surface(self.session.handles[name])
        return name in self.hidden or name in self.locked or not is_seen

    def _is_on_shown_surface(self, vertices: IntArray) -> bool:
        only = self._surface.only
        return only is None or bool(only[vertices].any())

    # Display.

    def _changed(self, change: Change) -> None:
        if change & (Change.CONSTRAINTS | Change.HISTORY) and not self.session.is_dragging:
            self._update_handle()  # a pull adds its handle at its first move, but may be cancelled
        if self.GetEnabled():
            if change & (Change.CONSTRAINTS | Change.CAGES):
                self._marks.show(self.session.state.is_ready)
            elif change & Change.POSE:
                self._marks.follow()
            self._update_gizmo()

    def _update_handle(self) -> None:
        """Keep the active handle, even if renamed, unless there is a new one: activate that.

        Instead of a handle that was removed the newest one is active; at first it is the oldest.
        """
        last, now = self._last_handles, self.session.handles
        names = {id(ids): name for name, ids in now.items()}
        known = {id(ids) for ids in last.values()}
        new = [name for name, ids in now.items() if name not in last and id(ids) not in known]
        self._locked, self._marks.hidden = (
            frozenset(names.get(id(last.get(name)), name) for name in some) - set(new)
            for some in (self._locked, self.hidden)
        )
        self._last_handles = now
        if new:
            self._handle = new[-1]
        elif self._handle is None:
            self._handle = next(iter(now), None)
        elif self._handle not in now:
            renamed = names.get(id(last.get(self._handle)))
            self._handle = renamed or (list(now)[-1] if now else None)

    def _update_gizmo(self) -> None:
        """Place the gizmo at the active handle, or hide it."""
        session, name = self.session, self._handle
        is_shown = session.state.is_ready and self.GetEnabled()
        if name is None or not is_shown or self._is_out_of_reach(name):
            self.gizmo.place(None)
            return
        limb = self._turned_limb
        if limb is None:
            self.gizmo.place(session.handles.pivot(name), self._axes)
        else:
            self.gizmo.place(limb.centre, limb.axes)

    @property
    def _axes(self) -> FloatArray:
        """The axes of the active handle, (3, 3) as rows."""
        if not self._local:
            return np.eye(3)
        session, name = self.session, str(self._handle)
        return rigid_fit(session.mesh.vertices[session.handles[name]], session.targets[name])[0].T


def _checked_axis(axis: int) -> int:
    if not is_whole(axis, 0, 2):
        raise ArgumentError(f"axis must be 0, 1 or 2; got {shown(axis)}")
    return int(axis)


def _require_number(value: float, name: str, *, least: float = -math.inf) -> None:
    if not is_number(value, least):
        bound = "" if least == -math.inf else f" of at least {least:g}"
        raise ArgumentError(f"{name} must be a number{bound}; got {shown(value)}")
