"""From where the pointer is to the matrix that moves what was grabbed.

    FREE     in the plane that faces the viewer
    ALONG    an axis: where it is met by the plane through it that faces the viewer most
    WITHIN   the plane across an axis
    ABOUT    an axis: the angle around the centre, in the plane across it

Each asks where the line of sight meets a plane.  One that was seen nearly edge-on at the press is
met nowhere in particular: there pixels are counted instead.  And a line of sight that later runs
along the plane, or misses it beyond the horizon, is tilted towards it.  So whatever the pointer
does, nothing flies away.

The way is measured from the press: a pointer that goes back there takes everything back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vtk_segdeform.arrays import FloatArray

from ..scene import Pointer, Sight
from .gizmo_shapes import Part, Way

_EDGE_ON = 0.2  # sine of the angle at which a plane is seen, below which pixels are counted
_SHALLOW = 0.1  # and to which a line of sight is tilted, later
_SLOW = 0.2  # with shift
_SNAP = np.radians(15.0)  # with control

Place = Callable[[Pointer], FloatArray]


def next_constraint(held: Part, constraint: Part | None, axis: int) -> Part | None:
    """Return what a key for *axis* makes of a *constraint*, while *held* is dragged; None is free.

    A move goes along the axis, then across it, then free; a turn about it, then free.
    """
    ways = (Way.ABOUT,) if held.way is Way.ABOUT else (Way.ALONG, Way.WITHIN)
    choices = [Part(way, axis) for way in ways]
    here = choices.index(constraint) + 1 if constraint in choices else 0
    return choices[here] if here < len(choices) else None


@dataclass(frozen=True, eq=False)
class Grip:
    """What is grabbed, and where."""

    point: FloatArray
    """(3,) float: the point of the world that stays under the pointer."""
    centre: FloatArray
    """(3,) float: what is turned about."""
    axes: FloatArray
    """(3, 3) float: x, y and z as rows, each of length 1."""
    radius: float
    """Of a ring: where it is seen edge-on, as long a way is one radian."""


class Motion:
    """One way of moving what is gripped, from the press on.

    Parameters
    ----------
    sight : Sight
        Its camera may change on the way.
    part : Part
        What is dragged.
    grip : Grip
        As it was at the press.
    press : Pointer
        Where it was.
    """

    def __init__(self, sight: Sight, part: Part, grip: Grip, press: Pointer) -> None:
        self.part = part
        self._centre = grip.centre
        self._axis = (
            -_line_of_sight(sight, grip.centre) if part.axis is None else grip.axes[part.axis]
        )
        self._place = _PLACES[part.way](sight, self._axis, grip, press)
        self._last = self._since = self._place(press)
        self._before = self._amount = np.zeros_like(self._last)
        self._is_slow = False

    @property
    def words(self) -> str:
        """How far it has gone: "30.0°", or a length in the mesh's unit."""
        if self.part.way is Way.ABOUT:
            return f"{np.degrees(self._amount[0]):.1f}°"
        return f"{np.linalg.norm(self._amount):.3g}"

    def _follow(self, pointer: Pointer) -> FloatArray:
        """Return the way from the press to *pointer*, (3,), or for a turn the angle, (1,)."""
        if pointer.shift != self._is_slow:  # what was done slowly and what was not add up
            self._before, self._since = self._so_far(), self._last
            self._is_slow = pointer.shift
        place = self._place(pointer)
        if self.part.way is Way.ABOUT:  # the angle nearest to the last one
            place = place + 2.0 * np.pi * np.round((self._last - place) / (2.0 * np.pi))
        if np.isfinite(place).all():
            self._last = place
        if self.part.way is Way.ABOUT and pointer.control:
            return np.asarray(np.round(self._so_far() / _SNAP) * _SNAP)
        return self._so_far()

    def matrix(self, pointer: Pointer) -> FloatArray:
        """Return the (4, 4) motion from the press to *pointer*: a shift or a turn."""
        amount = self._amount = self._follow(pointer)
        motion = np.eye(4)
        if self.part.way is not Way.ABOUT:
            motion[:3, 3] = amount
            return motion
        R = Rotation.from_rotvec(amount * self._axis).as_matrix()
        motion[:3, :3] = R
        motion[:3, 3] = self._centre - R @ self._centre
        return motion

    def _so_far(self) -> FloatArray:
        share = _SLOW if self._is_slow else 1.0
        return np.asarray(self._before + share * (self._last - self._since))


# Where the pointer has a part, by its way: (3,) away from the grip, or (1,) an angle.


def _free(sight: Sight, axis: FloatArray, grip: Grip, press: Pointer) -> Place:
    del axis, press
    normal = sight.towards_scene
    return lambda pointer: _met(sight, pointer, grip.point, normal) - grip.point


def _along(sight: Sight, axis: FloatArray, grip: Grip, press: Pointer) -> Place:
    line = _line_of_sight(sight, grip.point)
    normal = line - (line @ axis) * axis
    sine = float(np.linalg.norm(normal))
    if sine < _EDGE_ON:  # it points at the viewer: up is away
        away = np.copysign(sight.pixel_at(grip.point), line @ axis) * axis
        return lambda pointer: (pointer.y - press.y) * away
    normal = normal / sine
    return lambda pointer: ((_met(sight, pointer, grip.point, normal) - grip.point) @ axis) * axis


def _within(sight: Sight, axis: FloatArray, grip: Grip, press: Pointer) -> Place:
    if abs(_line_of_sight(sight, grip.point) @ axis) >= _EDGE_ON:
        return lambda pointer: _met(sight, pointer, grip.point, axis) - grip.point
    free = _free(sight, axis, grip, press)
    flat = np.eye(3) - np.outer(axis, axis)
    return lambda pointer: np.asarray(flat @ free(pointer))


def _about(sight: Sight, axis: FloatArray, grip: Grip, press: Pointer) -> Place:
    line = _line_of_sight(sight, grip.centre)
    if abs(line @ axis) < _EDGE_ON:  # what is in front goes with the pointer
        front = np.stack([grip.centre, grip.centre + 0.01 * grip.radius * np.cross(line, axis)])
        here, there = sight.to_display(front)[:, :2]
        onward = (there - here) / np.linalg.norm(there - here)
        angle = sight.pixel_at(grip.centre) / grip.radius  # of one pixel
        return lambda pointer: np.array([(pointer.position - press.position) @ onward * angle])
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    second = np.cross(axis, first)

    def angle_at(pointer: Pointer) -> FloatArray:
        arm = _met(sight, pointer, grip.centre, axis) - grip.centre
        return np.array([np.arctan2(arm @ second, arm @ first)])

    return angle_at


_PLACES: dict[Way, Callable[[Sight, FloatArray, Grip, Pointer], Place]] = {
    Way.FREE: _free,
    Way.ALONG: _along,
    Way.WITHIN: _within,
    Way.ABOUT: _about,
}


def _met(sight: Sight, pointer: Pointer, point: FloatArray, normal: FloatArray) -> FloatArray:
    """Return where the line of sight of *pointer* meets the plane through *point*, (3,)."""
    near, far = sight.ray(pointer)
    parallel = sight.camera.GetParallelProjection()
    eye = near if parallel else np.array(sight.camera.GetPosition())
    direction = (far - near) / np.linalg.norm(far - near)
    towards = np.copysign(1.0, _line_of_sight(sight, point) @ normal) * normal
    slope = float(direction @ towards)
    if slope < _SHALLOW:
        along = direction - slope * towards
        along = along / np.linalg.norm(along)
        slope = _SHALLOW
        direction = np.sqrt(1.0 - slope**2) * along + slope * towards
    return np.asarray(eye + ((point - eye) @ towards) / slope * direction)


def _line_of_sight(sight: Sight, point: FloatArray) -> FloatArray:
    """Return the direction in which *point* is seen, (3,) of length 1."""
    away = np.asarray(point - sight.camera.GetPosition())
    length = float(np.linalg.norm(away))
    if sight.camera.GetParallelProjection() or not length:
        return sight.towards_scene
    return away / length
