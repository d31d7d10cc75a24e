"""Random poses of a body: its limbs bent at their necks, its volume exact.

The parts of a body are those of `segment`; a body without limbs is cut in two.  The root is the
part with the most neighbours, the largest of equal ones; every other part bends about the centre c
of its neck, the border to its parent:

    F_part(x) = F_parent(c + R (x - c))          F_root(x) = x

R is a random rotation about an axis across the part, by at most a given angle.  The ends of the
outermost parts are handles, the middle of the root is fixed, and the solver bends the rest.

A pose with folds or crossings, or one that has not converged, is refused and drawn again.  The k-th
pose depends on the mesh, the seed and k only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csgraph
from scipy.spatial.transform import Rotation

from ..arrays import BoolArray, FloatArray, IntArray, is_number, is_whole
from ..cages import fit_cages, suggested_size
from ..checks import as_flag, shown
from ..deformer import Deformer
from ..errors import ArgumentError, ConstraintError
from ..files import cache_folder
from ..kernels import one_blas_thread, wait_until_compiled
from ..mesh import Mesh
from ..progress import Progress, part, tell
from ..regions import segment
from ..solver import Solution, Status
from .plan import DEGREES, Given

_TIP, _CORE = 0.7, 0.5  # of the distance from the necks, from which a part is a handle, or fixed
_MOST, _MOST_DRAWS = 100_000, 20  # poses, which are all in memory; and draws of each
_EXACT = 1e-9  # relative error of the volume


@dataclass(frozen=True, eq=False)
class RandomPoses:
    """Valid random poses of a mesh."""

    poses: tuple[Solution, ...]
    """All are converged, without folds and crossings, and have the volume of the mesh."""
    refused: float
    """The share of the drawn poses that were refused because they were not."""


class _Joint(NamedTuple):
    """Where a part bends: the number of its parent's joint, or -1; its neck, and its length."""

    parent: int
    centre: FloatArray  # (3,)
    along: FloatArray  # (3,)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The joints of a body, parents first; its ends, each with its joint; its fixed vertices."""

    joints: tuple[_Joint, ...]
    fixed: IntArray
    handle: IntArray
    joint: IntArray  # (k,): of each handle vertex

    @classmethod
    def of(cls, mesh: Mesh, labels: IntArray) -> Skeleton:
        """Return that of the parts *labels* (n,); of one part, of its two halves.

        Raises
        ------
        ConstraintError
            If no part is joined to another.
        """
        if not np.ptp(labels):
            labels = segment(mesh, 2).labels
        i, j = mesh.adjacency.nonzero()
        across = labels[i] != labels[j]
        i, j = i[across], j[across]
        parents = _tree(labels, i, j)
        x, numbers, joints = mesh.vertices, dict[int, int](), list[_Joint]()
        fixed, handle, joint = [], [], [np.zeros(0, dtype=np.int64)]
        for label, parent in parents.items():
            own = labels == label
            at_border = own[i] if parent < 0 else own[i] & (labels[j] == parent)
            neck = np.unique(i[at_border])
            away = _distance(mesh, own, neck)
            if parent < 0:
                fixed.append(np.flatnonzero(own & (away >= _CORE * away.max())))
                continue
            end = np.flatnonzero(own & (away >= _TIP * away.max()))
            centre = x[neck].mean(axis=0)
            numbers[label] = len(joints)
            along = x[end].mean(axis=0) - centre
            joints.append(_Joint(numbers.get(parent, -1), centre, along))
            if label not in parents.values():
                handle.append(end)
                joint.append(np.full(len(end), numbers[label]))
        if not joints:
            raise ConstraintError("random poses require a body with limbs, or in one piece")
        together = np.concatenate(joint)
        return cls(tuple(joints), np.concatenate(fixed), np.concatenate(handle), together)

    def targets(self, vertices: FloatArray, rng: np.random.Generator, angle: float) -> FloatArray:
        """Return random targets (k, 3) of the handle: each joint bent by at most *angle*."""
        found = vertices[self.handle].copy()
        moves: list[tuple[Rotation, FloatArray]] = []
        for parent, centre, along in self.joints:
            axis = np.cross(along, rng.standard_normal(3))
            bend = rng.uniform(-angle, angle) * axis / np.linalg.norm(axis)
            turn = Rotation.from_rotvec(bend)
            shift = centre - turn.apply(centre)
            if parent >= 0:
                before, offset = moves[parent]
                turn, shift = before * turn, before.apply(shift) + offset
            moves.append((turn, shift))
        for number, (turn, shift) in enumerate(moves):
            own = self.joint == number
            if own.any():
                found[own] = turn.apply(found[own]) + shift
        return found


def drawn(
    deformer: Deformer,
    skeleton: Skeleton,
    seed: int,
    number: int,
    *,
    degrees: float,
    refine: bool = False,
    progress: Progress | None = None,
) -> tuple[Solution, int]:
    """Return the valid pose of this *number*, and how many were drawn for it.

    Raises
    ------
    ConstraintError
        If none of 20 is valid.
    """
    bent = deformer.hold(fixed=skeleton.fixed, handle=skeleton.handle)
    for draw in range(_MOST_DRAWS):
        rng = np.random.default_rng([seed, number, draw])
        targets = skeleton.targets(deformer.mesh.vertices, rng, np.radians(degrees))
        bent.reset()
        solution = bent.solve(targets, progress=progress)
        if refine:
            solution = bent.finish(solution, progress=progress)
        if (
            solution.status is Status.CONVERGED
            and abs(solution.volume_change) <= _EXACT
            and not len(solution.folds())
            and not len(solution.crossings())
        ):
            return solution, draw + 1
    raise ConstraintError(
        f"none of {_MOST_DRAWS} random poses is valid: all have folds or crossings, or have not "
        f"converged; bend by less than {degrees:g} degrees"
    )


@one_blas_thread()
def random_poses(
    mesh: Mesh,
    n: int,
    seed: int = 0,
    *,
    degrees: float = DEGREES,
    refine: bool = False,
    progress: Progress | None = None,
) -> RandomPoses:
    """Return *n* random poses of *mesh*: its limbs bent, its volume exact, no folds or crossings.

    The same to the last bit for the same seed, on the same machine; those of *n* = 5 are the first
    five of *n* = 10.

    Parameters
    ----------
    mesh : Mesh
        Any surface that ``sd.deform`` takes; the poses are those of its mesh.
    n, seed : int
        Number of poses, and seed of all random numbers, 0 or more.
    degrees : float
        Largest angle by which a limb bends.
    refine : bool
        Whether to finish the poses on the mesh itself; see `Deformer.finish`.
    progress : Progress, optional
        Called with the fraction done, 0 to 1, and a text.  It cancels by raising `Cancelled`.

    Returns
    -------
    RandomPoses
        With n `poses`, each a `Solution`, and the share of drawn poses that were `refused`.

    Raises
    ------
    ArgumentError
        If *n*, *seed* or *degrees* are invalid.
    ConstraintError
        If 20 poses in a row are refused.

    Examples
    --------
    >>> import vtk_segdeform as sd
    >>> poses = sd.random_poses(sd.models.random_limbs(600, 1), 2, seed=5).poses
    >>> len(poses), max(abs(pose.volume_change) for pose in poses) < 1e-12
    (2, True)
    """
    if not (is_whole(n, 1, _MOST) and is_whole(seed, 0)):
        raise ArgumentError(
            f"n must be 1 to {_MOST:,}, and seed 0 or more; got {shown(n)} and {shown(seed)}"
        )
    as_flag(refine, "refine")
    if not (is_number(degrees, 0.0)):
        raise ArgumentError(f"degrees must be a number, 0 or more; got {shown(degrees)}")
    own = Given(mesh, 0).mesh
    wait_until_compiled()
    regions = segment(own, progress=part(progress, 0.0, 0.05))
    cages = fit_cages(own, regions, suggested_size(regions), progress=part(progress, 0.05, 0.1))
    deformer = Deformer(
        own, regions, cages, cache=cache_folder(), progress=part(progress, 0.1, 0.2)
    )
    skeleton = Skeleton.of(own, regions.labels)
    found = []
    for k in range(int(n)):
        tell(progress, 0.2 + 0.8 * k / n, f"random pose {k + 1} of {n}")
        found.append(drawn(deformer, skeleton, int(seed), k, degrees=float(degrees), refine=refine))
    count = sum(draws for _, draws in found)
    return RandomPoses(tuple(pose for pose, _ in found), 1.0 - n / count)


def _tree(labels: IntArray, i: IntArray, j: IntArray) -> dict[int, int]:
    """Return the parent of each label, parents first; of a root it is -1.

    The vertices *i* and *j* (k,) are neighbours with different *labels* (n,).
    """
    count = int(labels.max()) + 1
    beside = np.zeros((count, count), dtype=bool)
    beside[labels[i], labels[j]] = True
    parents: dict[int, int] = {}
    sizes = np.bincount(labels, minlength=count)
    for root in map(int, np.lexsort((-sizes, -beside.sum(axis=1)))):
        queue = [] if root in parents else [root]
        parents.setdefault(root, -1)
        for label in queue:
            for other in map(int, np.flatnonzero(beside[label])):
                if other not in parents:
                    parents[other] = label
                    queue.append(other)
    return parents


def _distance(mesh: Mesh, own: BoolArray, sources: IntArray) -> FloatArray:
    """Return the distance (n,) within the part *own* (n,) from *sources*; 0 elsewhere."""
    away, ids = np.zeros(len(own)), np.flatnonzero(own)
    if not len(sources):  # a component of its own
        away[ids] = 1.0
        return away
    inner = mesh.adjacency[ids][:, ids]
    start = np.searchsorted(ids, sources)
    found = csgraph.dijkstra(inner, indices=start, min_only=True)
    away[ids] = np.where(np.isfinite(found), found, 0.0)
    return away
