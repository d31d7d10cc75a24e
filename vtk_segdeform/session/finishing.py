"""Poses finished on the mesh itself: the finish, and poses dragged on from a finished one.

    finish                        x = the finish of W~ p             `Deformer.finish`
    drag on, with cages p'        x' = W~ p' + R' R^T (x - W~ p)     then the exact volume again

R and R' are the rotations of the surface near each vertex with cages p and p',
`Deformer.rotations`, so that the offset x - W~ p turns with the limbs.  The cages are solved for as
if nothing had been finished, so the next move of a handle continues from where the cages are, and
nothing jumps.  The volume is restored along the normals of the free vertices, by far less than the
offset.

The finish of a pull starts from the mesh that is shown, because it keeps the surface beyond the
reach; any other starts from W~ p, so that the way to it makes no difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray, frozen
from ..deformer import Deformer
from ..mesh import Mesh, new_crossings
from ..progress import Progress
from ..solver import Solution, Status, VolumeConstraint, moved_along, steps_to_volume
from .state import Finished, Pose

_TURNED = 3e-5  # mesh sizes by which shifts must turn before the targets of the cages follow


class FinishedPose(NamedTuple):
    """The result of `Session.finishing`."""

    before: Pose
    """The pose that was finished."""
    pose: Pose
    solution: Solution


@dataclass(frozen=True, eq=False)
class Finish:
    """A pose to finish, and its own deformer; another thread may call ``finish(progress)``."""

    mesh: Mesh
    deformer: Deformer
    pose: Pose
    targets: FloatArray
    """(k, 3) float, of all handles."""
    shifts: FloatArray | None
    """(n, 3) float, as `Finished.shifted`, if the pose was finished before."""
    start: FloatArray
    """(n, 3) float: the mesh that the finish starts from."""

    def __call__(self, progress: Progress | None = None, /) -> FinishedPose:
        """Finish the pose."""
        mesh, deformer, pose = self.mesh, self.deformer, self.pose
        deformer.resume(pose.cage_vertices, self.targets)
        start = Solution(
            vertices=self.start,
            cage_vertices=pose.cage_vertices,
            steps=0,
            status=Status.CONVERGED,
            merits=(),
            errors=lambda _: (0.0, 0.0),
            volume=lambda: 0.0,
            region_volumes=lambda _: np.empty(0),
            crossed=partial(new_crossings, rest=mesh.vertices, faces=mesh.faces),
        )
        solution = deformer.finish(start, progress=progress)
        held = np.union1d(deformer.fixed, deformer.handle)
        shifts = np.zeros((len(held), 3)) if self.shifts is None else self.shifts[held]
        vertices = np.array(solution.vertices)
        for array in (vertices, held, shifts):
            frozen(array)
        finished = Finished(vertices, held, shifts)
        return FinishedPose(pose, Pose(pose.cage_vertices, pose.targets, finished), solution)


def moved_on(
    finished: Finished,
    offset: FloatArray,
    x: FloatArray,
    *,
    turns: FloatArray,
    held: IntArray,
    constraints: tuple[VolumeConstraint, ...],
) -> Finished:
    """Return *x* (n, 3), the mesh of other cages, with the *offset* (n, 3) of a finished pose.

    The offset *turns* by (n, 3, 3).  The *held* vertices do not follow when the volumes are
    restored.
    """
    moved = x + (turns @ offset[:, :, None])[:, :, 0]
    known = np.union1d(finished.held, held)
    shifts = finished.shifted(finished.vertices - offset)[known]
    turned = (turns[known] @ shifts[:, :, None])[:, :, 0]
    if np.abs(turned - shifts).max(initial=0.0) > _TURNED * np.ptp(x, axis=0).max():
        shifts = turned  # else the targets of the cages stay, so that they converge
    if constraints:
        centre = moved.mean(axis=0)
        moved -= centre
        directions = []
        for constraint in constraints:
            normals = constraint.gradient(moved)
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
            normals /= np.where(lengths > 0.0, lengths, 1.0)
            normals[held] = 0.0
            directions.append(normals)
        paths = np.hstack([moved, *directions])
        moved = moved_along(paths, steps_to_volume(constraints, paths)) + centre
    for array in (moved, known, shifts):
        frozen(array)
    return Finished(moved, known, shifts)
