"""From the pointer to the motion of the grabbed point: moved, turned, or one after the other."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import FloatArray

from ..handle_dragger import FREE, Grip, Kind, Motion, NumberEntry, Part, next_constraint
from ..scene import Pointer, Projection

TURN = Part(Kind.ROTATION)  # about the line of sight


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
        return self._constraint or (TURN if self.is_turning else FREE)

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

    def toggle_turning(self, pointer: Pointer, turned: FloatArray) -> None:
        """Turn instead of moving from now on, or the other way round; the motion so far stays.

        *turned* (3, 3) is the rotation of the surface around the point since the press; see
        `Session.turned`.
        """
        self._base_shift = self._shift
        self._base_turn = self._turn if self.has_turned else turned
        self.is_turning = not self.is_turning
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
        self._shift = self._base_shift if self.is_turning else self._base_shift + matrix[:3, 3]
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

    def _begin(self) -> None:
        place = self._point + self._base_shift
        radius = self._arm * self._projection.pixel_at(place)
        grip = Grip(place, place, np.eye(3), radius, self._step, has_arm=False)
        self._motion = Motion(self._projection, self.part, grip, self._start)
