"""From the pointer to the rigid motion of the dragged handle.

    FREE        moves in the plane that faces the viewer
    AXIS        moves along the axis, tracked in the plane through it that faces the viewer most
    PLANE       moves in the plane perpendicular to the axis
    ROTATION    rotates by the angle about the centre in the plane perpendicular to the axis

Each intersects the line of sight with a plane.  If that plane is seen nearly edge-on at the press,
the intersection is ill-conditioned, and pixels are counted instead.  If the line of sight later
becomes nearly parallel to the plane, or misses it, it is tilted towards the plane.  The handle
therefore never jumps far away.

Motions are measured from the press: when the pointer returns there, so does the handle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vtk_segdeform.arrays import FloatArray

from ..scene import Pointer, Projection
from .gizmo_shapes import Kind, Part

_EDGE_ON = 0.2  # sine of the angle of a plane to the line of sight below which pixels are counted
_FACE_ON = 0.9  # the same sine, above which a ring grabbed at its centre is turned by its top
_LEAST_SLOPE = 0.1  # sine of the angle to which a line of sight is tilted during the drag
_SLOW_FACTOR = 0.2  # with Shift, also of the steps
_LARGEST_TURN = 0.5 * np.pi  # radians, between two stops of a far rotation
_TURN_STEP = 5.0  # degrees, with Control
_MOVE_STEP = 0.01  # of the diagonal, with Control, rounded to 1, 2 or 5 times a power of ten
_ROUND = np.array([1.0, 2.0, 5.0, 10.0])

Tracker = Callable[[Pointer], FloatArray]
"""Returns the displacement (3,) of the grip, or an angle (1,), for a position of the pointer."""


def next_constraint(grabbed: Part, constraint: Part | None, axis: int) -> Part | None:
    """Return the constraint after a key for *axis* is pressed while *grabbed* is dragged.

    A translation is constrained to the axis, then to the plane perpendicular to it, then not at
    all (None); a rotation to the axis, then not at all.
    """
    kinds = (Kind.ROTATION,) if grabbed.kind is Kind.ROTATION else (Kind.AXIS, Kind.PLANE)
    choices = [Part(kind, axis) for kind in kinds]
    following = choices.index(constraint) + 1 if constraint in choices else 0
    return choices[following] if following < len(choices) else None


def axes_along(z: FloatArray) -> FloatArray:
    """Return axes (3, 3) as rows, of which the last is *z*, (3,) of length 1."""
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def step_of(diagonal: float) -> float:
    """Return the step of translations with Control: 1 % of *diagonal*, rounded to 1, 2 or 5.

    >>> [step_of(diagonal) for diagonal in (1.0, 2.4, 430.0, 800.0)]
    [0.01, 0.02, 5.0, 10.0]
    """
    power = math.floor(math.log10(_MOVE_STEP * diagonal) + 1e-9)
    ratios = np.abs(np.log(_MOVE_STEP * diagonal / (_ROUND * 10.0**power)))
    return float(f"{_ROUND[ratios.argmin()]:.0f}e{power}")


@dataclass(frozen=True, eq=False)
class Grip:
    """The grabbed point, and the gizmo, at the press."""

    point: FloatArray
    """(3,) float: the world point that stays under the pointer."""
    centre: FloatArray
    """(3,) float: the centre of rotation."""
    axes: FloatArray
    """(3, 3) float: x, y and z as rows, each of length 1."""
    radius: float
    """Of a ring; where pixels are counted, a pointer motion of this length rotates by a radian."""
    step: float
    """Of translations with Control; see `step_of`."""
    has_arm: bool = True
    """Whether the pointer rotates about the centre; if it is pressed there, pixels are counted."""


class Motion:
    """The motion by one part of the gizmo since the press."""

    def __init__(self, projection: Projection, part: Part, grip: Grip, press: Pointer) -> None:
        self.part = part
        self._centre = grip.centre
        self._axis = (
            -_line_of_sight(projection, grip.centre) if part.axis is None else grip.axes[part.axis]
        )
        self._track = _TRACKERS[part.kind](projection, self._axis, grip, press)
        # The displacement is *_base* plus the pointer's motion since *_start*, slowed by Shift.
        self._last = self._start = self._track(press)
        self._base = self._applied = np.zeros_like(self._last)
        self._is_slow = self._is_stepped = False
        self._step, self._grid = _TURN_STEP, np.eye(1)
        if part.kind is not Kind.ROTATION:
            self._step, self._grid = grip.step, _grid(projection, part, grip.axes)
        self._direction = np.ones(1) if part.kind is Kind.ROTATION else np.zeros(3)
        if part.kind is Kind.AXIS:
            self._direction = self._axis

    @property
    def amount(self) -> str:
        """The size of the motion as text: "30.0°", or a length in the mesh's unit.

        Along an axis it is signed, as the number that `exact` takes.  With Control the step
        follows: "0.25, step 0.05".
        """
        if self.part.kind is Kind.ROTATION:
            amount, unit = f"{np.degrees(self._applied[0]):.1f}°", "°"
        elif self.part.kind is Kind.AXIS:
            amount, unit = f"{self._applied @ self._axis + 0.0:.3g}", ""
        else:
            amount, unit = f"{np.linalg.norm(self._applied):.3g}", ""
        return f"{amount}, step {self._current_step:.3g}{unit}" if self._is_stepped else amount

    def matrix(self, pointer: Pointer) -> FloatArray:
        """Return the translation or rotation from the press to *pointer* as a (4, 4) matrix."""
        displacement = self._follow(pointer)
        length = float(np.linalg.norm(displacement))
        if length and self.part.kind in (Kind.FREE, Kind.PLANE):
            self._direction = displacement / length
        return self._by(displacement)

    @property
    def turn(self) -> float:
        """The angle of a rotation in radians, whole turns included; 0 of a translation."""
        return float(self._applied[0]) if self.part.kind is Kind.ROTATION else 0.0

    def stops(self, since: float) -> list[FloatArray]:
        """Return rotations (4, 4) between the angle *since* and the current one.

        A matrix has no turns, and the solver turns a handle the shorter way.  So where the angles
        are half a turn or more apart, the handle stops in between.
        """
        ahead = self.turn - since
        count = (
            math.ceil(abs(ahead) / _LARGEST_TURN) if abs(ahead) > 2.0 * _LARGEST_TURN - 1e-6 else 1
        )
        return [self._matrix(np.array([since + k / count * ahead])) for k in range(1, count)]

    def exact(self, amount: float) -> FloatArray:
        """Return the motion by *amount* in the current direction as a (4, 4) matrix.

        A rotation is by *amount* degrees.  Without a direction yet, nothing moves.
        """
        self._is_stepped = False
        factor = np.radians(amount) if self.part.kind is Kind.ROTATION else amount
        return self._by(factor * self._direction)

    def _by(self, displacement: FloatArray) -> FloatArray:
        self._applied = displacement
        return self._matrix(displacement)

    def _matrix(self, displacement: FloatArray) -> FloatArray:
        motion = np.eye(4)
        if self.part.kind is not Kind.ROTATION:
            motion[:3, 3] = displacement
            return motion
        R = Rotation.from_rotvec(displacement * self._axis).as_matrix()
        motion[:3, :3] = R
        motion[:3, 3] = self._centre - R @ self._centre
        return motion

    def _follow(self, pointer: Pointer) -> FloatArray:
        """Return the displacement (3,) from the press to *pointer*, or the angle (1,)."""
        if pointer.shift != self._is_slow:  # the slow and the fast parts of the path add up
            self._base, self._start = self._displacement(), self._last
            self._is_slow = pointer.shift
        tracked = self._track(pointer)
        if self.part.kind is Kind.ROTATION:  # the equivalent angle nearest to the last one
            tracked = tracked + 2.0 * np.pi * np.round((self._last - tracked) / (2.0 * np.pi))
        if np.isfinite(tracked).all():
            self._last = tracked
        self._is_stepped = pointer.control
        return self._stepped(self._displacement()) if pointer.control else self._displacement()

    def _displacement(self) -> FloatArray:
        return np.asarray(self._base + self._factor * (self._last - self._start))

    def _stepped(self, displacement: FloatArray) -> FloatArray:
        """Return *displacement* rounded to whole steps along each direction of the grid."""
        step = self._current_step
        if self.part.kind is Kind.ROTATION:
            step = np.radians(step)
        return np.asarray(step * np.round(self._grid @ displacement / step) @ self._grid)

    @property
    def _current_step(self) -> float:
        return self._factor * self._step

    @property
    def _factor(self) -> float:
        return _SLOW_FACTOR if self._is_slow else 1.0


def _grid(projection: Projection, part: Part, axes: FloatArray) -> FloatArray:
    """Return the directions (k, 3) along which a translation by *part* is stepped."""
    if part.axis is not None:
        is_grid = (np.arange(3) == part.axis) == (part.kind is Kind.AXIS)
        return np.asarray(axes[is_grid])
    right = np.cross(projection.view_direction, projection.camera.GetViewUp())
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, projection.view_direction)])


# One tracker for each kind of motion.


def _track_view_plane(
    projection: Projection, axis: FloatArray, grip: Grip, press: Pointer
) -> Tracker:
    del axis, press
    normal = projection.view_direction
    return lambda pointer: _intersection(projection, pointer, grip.point, normal) - grip.point


def _track_axis(projection: Projection, axis: FloatArray, grip: Grip, press: Pointer) -> Tracker:
    line = _line_of_sight(projection, grip.point)
    normal = line - (line @ axis) * axis
    sine = float(np.linalg.norm(normal))
    if sine < _EDGE_ON:  # the axis is along the line of sight: up moves away from the viewer
        per_pixel = np.copysign(projection.pixel_at(grip.point), line @ axis) * axis
        return lambda pointer: (pointer.y - press.y) * per_pixel
    normal = normal / sine

    def track(pointer: Pointer) -> FloatArray:
        offset = _intersection(projection, pointer, grip.point, normal) - grip.point
        return np.asarray((offset @ axis) * axis)

    return track


def _track_plane(projection: Projection, axis: FloatArray, grip: Grip, press: Pointer) -> Tracker:
    if abs(_line_of_sight(projection, grip.point) @ axis) >= _EDGE_ON:
        return lambda pointer: _intersection(projection, pointer, grip.point, axis) - grip.point
    in_view = _track_view_plane(projection, axis, grip, press)
    to_plane = np.eye(3) - np.outer(axis, axis)
    return lambda pointer: np.asarray(to_plane @ in_view(pointer))


def _track_angle(projection: Projection, axis: FloatArray, grip: Grip, press: Pointer) -> Tracker:
    line = _line_of_sight(projection, grip.centre)
    if not grip.has_arm or abs(line @ axis) < _EDGE_ON:  # the front of the ring follows the pointer
        direction = np.array([np.copysign(1.0, line @ axis), 0.0])  # seen face-on: its top
        if abs(line @ axis) < _FACE_ON:
            front = grip.centre + 0.01 * grip.radius * np.outer([0.0, 1.0], np.cross(line, axis))
            start, end = projection.to_display(front)[:, :2]
            direction = (end - start) / np.linalg.norm(end - start)
        per_pixel = projection.pixel_at(grip.centre) / grip.radius
        return lambda pointer: np.array(
            [(pointer.position - press.position) @ direction * per_pixel]
        )
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    second = np.cross(axis, first)

    def track(pointer: Pointer) -> FloatArray:
        arm = _intersection(projection, pointer, grip.centre, axis) - grip.centre
        return np.array([np.arctan2(arm @ second, arm @ first)])

    return track


_TRACKERS: dict[Kind, Callable[[Projection, FloatArray, Grip, Pointer], Tracker]] = {
    Kind.FREE: _track_view_plane,
    Kind.AXIS: _track_axis,
    Kind.PLANE: _track_plane,
    Kind.ROTATION: _track_angle,
}


def _intersection(
    projection: Projection, pointer: Pointer, point: FloatArray, normal: FloatArray
) -> FloatArray:
    """Return the intersection (3,) of the line of sight with the plane through *point*."""
    eye, direction = projection.line_of_sight(pointer)
    towards = np.copysign(1.0, _line_of_sight(projection, point) @ normal) * normal
    slope = float(direction @ towards)
    if slope < _LEAST_SLOPE:
        along = direction - slope * towards
        along = along / np.linalg.norm(along)
        slope = _LEAST_SLOPE
        direction = np.sqrt(1.0 - slope**2) * along + slope * towards
    return np.asarray(eye + ((point - eye) @ towards) / slope * direction)


def _line_of_sight(projection: Projection, point: FloatArray) -> FloatArray:
    """Return the direction from the camera to *point*, (3,) of length 1."""
    offset = np.asarray(point - projection.camera.GetPosition())
    length = float(np.linalg.norm(offset))
    if projection.camera.GetParallelProjection() or not length:
        return projection.view_direction
    return offset / length
