"""From the pointer to the motion of the grabbed point: moved, turned, or one after the other.

A limb is turned about its own axis through its joint, anything else about the grabbed point.
"""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import FloatArray

from ..handle_dragger import (
    FREE,
    LIMB,
    TURN,
    Grip,
    Motion,
    NumberEntry,
    Part,
    axes_along,
    next_constraint,
)
from ..scene import Pointer, Projection


class PullMotion:
    """The motion since the press.

    Parameters
    ----------
    projection : Projection
        The camera may move during the pull.
    point : (3,) float
        The grabbed point of the surface, under the pointer.
    press : Pointer
        The position of the press.
    arm : float
        Pixels by which the pointer moves to turn by one radian.
    step : float
        Of translations with Control; see `step_of`.
    """

    def __init__(
        self, projection: Projection, point: FloatArray, press: Pointer, arm: float, step: float
    ) -> None:
        self.entry = NumberEntry()
        self.is_turning = False
        self.has_turned = False
        self._axis: tuple[FloatArray, FloatArray] | None = None  # of the limb, while it turns
        self._projection, self._point, self._arm = projection, point, arm
        self._step = step
        self._constraint: Part | None = None
        # What the finished parts of the motion amount to, and the current part.
        self._base_shift, self._base_turn = np.zeros(3), np.eye(3)
        self._shift, self._turn = self._base_shift, self._base_turn
        self._start = press
        self._begin()

    @property
    def part(self) -> Part:
        """The kind of the current motion and its axis."""
        return self._constraint or self._unconstrained

    @property
    def turns_limb(self) -> bool:
        """Whether the limb is turned about its axis."""
        return self._axis is not None and self._constraint is None

    @property
    def centre(self) -> FloatArray:
        """(3,) float: the centre of the motion: the joint of a turned limb, or `place`."""
        return self._axis[0] if self._axis is not None and self.turns_limb else self.place

    @property
    def axes(self) -> FloatArray:
        """(3, 3) float: the axes of `part`, as rows; z is that of a turned limb."""
        if self._axis is None or not self.turns_limb:
            return np.eye(3)
        return axes_along(self._axis[1])

    @property
    def place(self) -> FloatArray:
        """(3,) float: where the grabbed point is pulled to."""
        return np.asarray(self._point + self._shift)

    @property
    def caption(self) -> str:
        """The amount of the current motion."""
        return self.entry.caption(self._motion)

    def constrain(self, axis: int) -> None:
        """Constrain to the axis 0, 1 or 2, then to the plane perpendicular to it, then not."""
        unconstrained = TURN if self.is_turning else FREE
        self._constraint = next_constraint(unconstrained, self._constraint, axis)
        self._begin()

    def toggle_turning(
        self,
        pointer: Pointer,
        turned: FloatArray,
        axis: tuple[FloatArray, FloatArray] | None = None,
    ) -> None:
        """Turn a limb instead of moving, then turn about the line of sight, then move again.

        The motion so far stays.  *turned* (3, 3) is the rotation of the surface around the point
        since the press; see `Session.turned`.  *axis*, a point and a direction, (3,) each, is that
        of the limb; without one, the first turn is about the line of sight.
        """
        self._base_shift = self._shift
        self._base_turn = self._turn if self.has_turned else turned
        if self._axis is not None:
            self._axis = None
        else:
            self.is_turning = not self.is_turning
            self._axis = axis if self.is_turning else None
        self.has_turned = True
        self._constraint = None
        self.entry = NumberEntry()
        self._start = pointer
        self._begin()

    def follow(self, pointer: Pointer) -> bool:
        """Follow the pointer, or the typed number; return False if that says nothing yet."""
        motion = self._motion
        matrix = self.entry.matrix(motion) if self.entry.text else motion.matrix(pointer)
        if matrix is None or (self.entry.value and np.array_equal(matrix, np.eye(4))):
            return False  # no number yet, or no direction
        self._turn = matrix[:3, :3] @ self._base_turn
        if self.turns_limb:
            place = self._point + self._base_shift
            self._shift = matrix[:3, :3] @ place + matrix[:3, 3] - self._point
        else:
            self._shift = self._base_shift + (0.0 if self.is_turning else matrix[:3, 3])
        return True

    def of(self, start: FloatArray) -> FloatArray:
        """Return where *start* (3,) is pulled to; once turned, a matrix (4, 4) about it."""
        to = start + self._shift
        if not self.has_turned:
            return np.asarray(to)
        matrix = np.eye(4)
        matrix[:3, :3] = self._turn
        matrix[:3, 3] = to - self._turn @ start
        return matrix

    @property
    def _unconstrained(self) -> Part:
        if self._axis is not None:
            return LIMB
        return TURN if self.is_turning else FREE

    def _begin(self) -> None:
        place = self._point + self._base_shift
        radius = self._arm * self._projection.pixel_at(place)
        centre = self.centre if self.turns_limb else place
        grip = Grip(place, centre, self.axes, radius, self._step, has_arm=False)
        self._motion = Motion(self._projection, self.part, grip, self._start)
