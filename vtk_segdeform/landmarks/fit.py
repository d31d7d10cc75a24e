"""A body fitted to landmarks: what bends is bent, and the rest is growth.

The map of a point q of the body at rest has two parts, turned along with each other,

    x(q) = B(q) + R(q) s(q)

B is the pose to which springs from the landmarks to their targets pull the body, R its rotations
there, and s the thin-plate spline through what the springs leave, R_i^T (u_i - B(a_i)).  So hard
landmarks are at their targets, and detail is turned by R and scaled by the gradient of s.

Springs that are infinitely soft leave all of the motion to the spline, which is then that of the
landmarks alone: a body that grows smoothly.  Stiff ones leave nothing: a body that keeps its
lengths.  In between soft springs bend limbs, which costs little energy, and do not stretch them.
How stiff they are is decided by cross-validation: landmarks are left out, group by group, and the
best stiffness is the one that predicts them with the smallest errors.  Square roots of errors are
added, so that a tip, which nothing can predict, does not decide.  With few landmarks this is a
matter of chance, so the best one is found for many samples of them, drawn with replacement
(bagging), and the map is the mean of those of each stiffness, weighted by how often it was best.
Where all samples agree, as on what grows, that is a single one.  Where they do not, each map is
off in another direction, and their mean by less.

Before, the body is brought to its targets by a similarity, whose scale is the median of that of
the distances from landmarks to their nearest ones, which hardly change when a body bends.

Source
------
L. Breiman, "Bagging predictors", Machine Learning 24(2), 1996.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray, as_numbers, as_points
from ..checks import as_flag
from ..deformer import Deformer, SpringBody, SpringPose, checked_goals, regions_and_cages
from ..errors import ArgumentError, ConstraintError
from ..geometry import rigid_fit
from ..kernels import one_blas_thread
from ..mesh import Mesh, new_crossings, require_mesh
from ..progress import Progress, part, tell
from .semilandmarks import checked_slides, slid
from .spline import CENTRES, Compact, Spline, smoothing_of

STIFFNESS = (1e-2, 0.1, 1.0, 10.0, 100.0)
"""Of the springs that are compared, in units of the shape energy: with the first hardly anything
moves, with the last they hold.  0, the spline alone, is compared as well."""
LEAST_PAIRS = 3
"""Of a fit: fewer do not tell how a body is turned."""
_GROUPS = 12  # of landmarks that are left out, at most
_DRAWS = 1000  # of samples of the landmarks: shares are exact to 1.6 %
_BOUND, _TESTED, _FITTED, _APART = 0.3, 0.75, 0.85, 0.9  # of the progress
_Map: TypeAlias = Callable[[FloatArray | None], FloatArray]
_WORDS = {0: "", 1: "at least ", -1: "at most "}


@dataclass(frozen=True, eq=False)
class LandmarkFit:
    """A body fitted to k landmarks; made by `fit_landmarks`.

    Lengths are in the unit of the targets.
    """

    vertices: FloatArray
    """(n, 3) float: the vertices of the mesh, fitted."""
    targets: FloatArray
    """(k, 3) float: of landmarks that slide, where they have slid to."""
    residuals: FloatArray
    """(k, 3) float: from where the landmarks are now to their targets."""
    left_out: FloatArray
    """(k,) float: the distance of each from its target when it is left out, with its group of at
    most a twelfth of them, by the same shares.  Of more than 200 landmarks so many are tested,
    which are spread over the body; the others have NaN."""
    left_out_spline: FloatArray
    """(k,) float: the same of the thin-plate spline alone."""
    shares: Mapping[float, float]
    """The share of samples of the landmarks that each stiffness of springs predicts best, which is
    its share in the fit.  0: the spline alone, nothing is bent."""
    volume_change: float
    """(V - V0) / V0 of `vertices`, signed; 0 if nothing is enclosed."""
    _map: Callable[[FloatArray], FloatArray] = field(repr=False)
    _mesh: Mesh = field(repr=False)

    @property
    def stiffness(self) -> float:
        """The one with the largest share."""
        return max(self.shares, key=self.shares.__getitem__)

    def moved(self, points: ArrayLike) -> FloatArray:
        """Return other points (q, 3), given at rest, moved along: near the body, or inside it."""
        return self._map(as_points(points, "points"))

    def crossings(self) -> IntArray:
        """Return the faces (c,) that cross or touch others, and did not at rest."""
        return new_crossings(self.vertices, rest=self._mesh.vertices, faces=self._mesh.faces)


@one_blas_thread()
def fit_landmarks(
    mesh: Mesh,
    source: ArrayLike,
    target: ArrayLike,
    *,
    uncertainty: ArrayLike = 0.0,
    slides: Sequence[tuple[ArrayLike, Mesh | ArrayLike]] = (),
    volume: str | float = "free",
    avoid_contact: bool = False,
    n_regions: int | None = None,
    n_cage_vertices: int | None = None,
    progress: Progress | None = None,
) -> LandmarkFit:
    """Return *mesh* grown and bent so that its landmarks are at their targets.

    Parameters
    ----------
    mesh : Mesh
        n vertices, such as those of an atlas.
    source : (k, 3) float
        Three or more landmarks on the mesh or near it, not only at vertices.
    target : (k, 3) float
        Where they are to be, such as in a patient; the size of the body may be another one.
    uncertainty : float or (k,) float
        Standard deviation of each coordinate of a target, in their unit; 0: it is met exactly.
    slides : sequence of (landmarks, curve or surface), optional
        Landmarks, by their numbers, whose targets slide along a surface, a `Mesh`, or along a
        curve, (m, 3) points in order, to where the spline through all of them bends least.  Their
        targets are first moved to the nearest points; those of NaN begin where the others lead.
    volume : str or float
        "free", "keep", or a goal such as "+5%" or a number, as of "whole" of `Deformer`; of an open
        surface that under lids.  The landmarks are then met as nearly as the cages can.
    avoid_contact : bool
        Separate parts and shells that cross in the fit and do not at rest, such as two organs, or a
        sleeve and the arm in it.  Vertices next to landmarks stay; these take precedence.
        `LandmarkFit.crossings` tells what still crosses.
    n_regions, n_cage_vertices : int, optional
        As of `deform`.
    progress : Progress, optional
        Called with the fraction done, 0 to 1, and a text.  It cancels by raising `Cancelled`.

    Returns
    -------
    LandmarkFit

    Raises
    ------
    ArgumentError
        If there are fewer than three pairs, an uncertainty is negative, arrays do not fit, *slides*
        are no pairs of landmarks and what they slide along, landmarks or targets are all at one
        place, or the body would be turned inside out, such as with left and right swapped.
    CageError
        If a landmark is too far from the mesh.
    ConstraintError
        If *volume* is no goal, or the mesh encloses none.

    Examples
    --------
    An affine motion of landmarks moves all of the body.

    >>> import vtk_segdeform as sd
    >>> mesh = sd.models.sphere(200)
    >>> fit = sd.fit_landmarks(mesh, mesh.vertices[::20], mesh.vertices[::20] * [1.0, 1.0, 1.5])
    >>> fit.stiffness, round(float(abs(fit.vertices - mesh.vertices * [1.0, 1.0, 1.5]).max()), 6)
    (0.0, 0.0)
    """
    require_mesh(mesh)
    a = as_points(source, "source")
    tracks = checked_slides(slides, len(a))
    u = _targets(target, len(a), [ids for ids, _ in tracks])
    if len(a) < LEAST_PAIRS:
        raise ArgumentError(f"source must have {LEAST_PAIRS} landmarks or more; got {len(a)}")
    sigma = as_numbers(uncertainty, "uncertainty")
    if sigma.shape not in ((), (len(a),)) or not (np.isfinite(sigma) & (sigma >= 0.0)).all():
        raise ArgumentError(f"uncertainty must be one or {len(a)} numbers, 0 or more")
    u = slid(a, u, tracks)
    _require_extent(a, u)
    goal = checked_goals({"whole": volume})["whole"]
    avoid_contact = as_flag(avoid_contact, "avoid_contact")
    body = SpringBody(
        mesh,
        n_regions=n_regions,
        n_cage_vertices=n_cage_vertices,
        progress=part(progress, 0.0, _BOUND),
    )
    if goal is not None and not body.enclosed.has_volume:
        raise ConstraintError("volume must be 'free': the mesh encloses none")
    fitting = _Fitting(body, a, u, np.broadcast_to(sigma, len(a)))
    off = fitting.left_out(part(progress, _BOUND, _TESTED))
    how_often = _shares_best(np.linalg.norm(off, axis=2))
    every = zip((0.0, *STIFFNESS), how_often.tolist(), strict=True)
    shares = {stiffness: share for stiffness, share in every if share}
    tell(progress, _TESTED, "moving the body")
    move = fitting.map_of(shares)
    x = move(None)
    frame = body.problem.frame
    alike = frame.about_origin(x / fitting.scale)  # of about the size at rest
    if body.enclosed.has_volume and body.enclosed.relative(alike) <= -1.0:
        raise ArgumentError(
            "the targets turn the body inside out, as a mirror image does: exchange left and right "
            "landmarks, or mirror the mesh first"
        )
    maps: list[Callable[[FloatArray], FloatArray]] = [move]
    held = np.unique(cKDTree(x).query(move(a))[1])
    if avoid_contact:
        tell(progress, _FITTED, "separating what crosses")
        x, along = body.separated(x, held, fitting.scale)
        maps.append(along)
    if goal is not None:
        tell(progress, _APART, "reaching the volume")
        text = f"{_WORDS[goal.bound]}{goal.target(body.enclosed.target)!r}"
        grown = mesh.with_vertices(x)
        parts = regions_and_cages(grown, n_regions, n_cage_vertices)
        goals = {"whole": text}
        deformer = Deformer(
            grown, *parts, handle=held, volumes=goals, avoid_contact=avoid_contact
        )  # fmt: skip
        x = np.array(deformer.solve(x[held]).vertices)
        maps.append(deformer.carry)

    def to(points: FloatArray) -> FloatArray:
        for each in maps:
            points = each(points)
        return points

    tell(progress, 1.0, "fitted")
    change = body.enclosed.relative(frame.about_origin(x))
    left_out, by_spline = np.linalg.norm([np.tensordot(how_often, off, 1), off[0]], axis=2)
    return LandmarkFit(
        x, u, u - to(a), left_out, by_spline, shares, change, _map=to, _mesh=mesh
    )  # fmt: skip


def _targets(target: ArrayLike, count: int, slides: Sequence[IntArray]) -> FloatArray:
    """Return the checked targets (k, 3); NaN in rows of sliding landmarks that begin nowhere."""
    given = as_numbers(target, "target")
    sliding = np.concatenate([np.zeros(0, dtype=np.int64), *slides])
    free = np.zeros(count, dtype=bool)
    if given.shape == (count, 3):
        free[sliding] = np.isnan(given[sliding]).any(axis=1)
    if not free.any():
        return as_points(given, "target", count)
    if count - np.count_nonzero(free) < LEAST_PAIRS:
        raise ArgumentError(f"target must have {LEAST_PAIRS} landmarks or more that are not NaN")
    found = as_points(np.where(free[:, None], 0.0, given), "target", count)
    found[free] = np.nan
    return found


def _require_extent(a: FloatArray, u: FloatArray) -> None:
    """Raise ArgumentError if landmarks *a* (k, 3) or targets *u* (k, 3) are all at one place."""
    for name, points in {"landmarks": a, "targets": u}.items():
        if (points == points[0]).all():
            raise ArgumentError(f"the {name} are all at one place")


class _Fitting:
    """The landmarks *a* of a body, their targets *u*, (k, 3) each, and deviations *sigma* (k,).

    The targets are brought to the body by the inverse of the similarity.
    """

    def __init__(self, body: SpringBody, a: FloatArray, u: FloatArray, sigma: FloatArray) -> None:
        self._body, self._a, self._points = body, a, body.attach(a)
        self._few = few = _spread(a)
        smoothing = smoothing_of(a[few], u[few], sigma[few])
        self._spline = Spline(a[few], smoothing)
        self._splits = []
        self._alone = np.full(a.shape, np.nan)
        group = np.arange(len(few)) % _GROUPS
        for number in range(min(_GROUPS, len(few))):
            stays, left = group != number, few[group == number]
            kept, spline = few[stays], Spline(a[few[stays]], smoothing[stays])
            self._splits.append((kept, left, spline))
            self._alone[left] = spline.at(a[left], u[kept]) - u[left]
        self.scale = _scale_between(a[few], u[few])
        self._rotation, self._shift = rigid_fit(self.scale * a[few], u[few])
        self._u = (u - self._shift) @ self._rotation / self.scale
        self._sigma = sigma / self.scale

    def left_out(self, progress: Progress | None) -> FloatArray:
        """Return how far each landmark is from its target if left out, (1 + stiffness, k, 3)."""
        found = np.full((1 + len(STIFFNESS), *self._a.shape), np.nan)
        found[0] = self._alone
        for number, (kept, left, spline) in enumerate(self._splits):
            tell(progress, number / len(self._splits), "leaving out landmarks")
            for row, pose in zip(found[1:], self._poses(kept, STIFFNESS), strict=True):
                x, r, back = self._left(pose)
                off = x[left] + _turned(r[left], spline.at(self._a[left], back[kept]))
                row[left] = self.scale * (off - self._u[left]) @ self._rotation.T
        return found

    def map_of(self, shares: Mapping[float, float]) -> _Map:
        """Return the map of points (q, 3), or of the vertices (n, 3) for None.

        It is the mean of those of each stiffness with these *shares*.
        """
        a, few, rest = self._a, self._few, self._body.problem.mesh.vertices
        upto = [k for k in STIFFNESS if k <= max(shares)]
        every = dict(zip(upto, self._poses(few, upto), strict=True))
        poses, weights = [every.get(k) for k in shares], list(shares.values())
        back = np.hstack([self._u - a if p is None else self._left(p)[2] for p in poses])
        compact = None
        if len(few) < len(a):
            more = back - self._spline.at(a, back[few])
            more[few] = 0.0
            compact = Compact(a, more, self._sigma)

        def move(points: FloatArray | None) -> FloatArray:
            at = rest if points is None else points
            grown = self._spline.at(at, back[few])
            if compact is not None:
                grown += compact.at(at)
            on = self._body.attach(at) if every and points is not None else None
            x = np.zeros_like(at)
            for share, pose, s in zip(weights, poses, np.hsplit(grown, len(poses)), strict=True):
                if pose is None:
                    x += share * (at + s)
                else:
                    middle, r = pose.surface() if on is None else pose.at(on)
                    x += share * (middle + _turned(r, s))
            return np.asarray(self.scale * x @ self._rotation.T + self._shift)

        return move

    def _poses(self, kept: IntArray, stiffness: Sequence[float]) -> Iterator[SpringPose]:
        """Yield the poses that springs of the landmarks *kept* pull the body to."""
        return self._body.poses(self._points, kept, self._u[kept], stiffness)

    def _left(self, pose: SpringPose) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where landmarks are, their rotations, and what is left to the targets, at rest."""
        x, r = pose.at(self._points)
        return x, r, _turned(np.swapaxes(r, 1, 2), self._u - x)


def _shares_best(errors: FloatArray) -> FloatArray:
    """Return the share of samples of the landmarks in which each row of *errors* is best, (r,).

    *errors* (r, k) has NaN for landmarks that were not tested.
    """
    roots = np.sqrt(errors[:, ~np.isnan(errors[0])])
    k = roots.shape[1]
    drawn = np.random.default_rng(0).integers(k, size=(_DRAWS, k))
    best = roots[:, drawn].sum(axis=2).argmin(axis=0)
    return np.asarray(np.bincount(best, minlength=len(errors)) / _DRAWS)


def _turned(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return the *vectors* (k, 3), each turned by its own of *rotations* (k, 3, 3)."""
    return np.asarray(np.einsum("kij,kj->ki", rotations, vectors))


def _spread(points: FloatArray) -> IntArray:
    """Return at most `CENTRES` of *points* (k, 3), each the farthest from those before it."""
    away = np.linalg.norm(points - points.mean(axis=0), axis=1)
    found = [int(away.argmax())]
    away = np.full(len(points), np.inf)
    while len(found) < min(CENTRES, len(points)):
        away = np.minimum(away, np.linalg.norm(points - points[found[-1]], axis=1))
        away[found] = -1.0  # others may be at the same place
        found.append(int(away.argmax()))
    return np.array(found)


def _scale_between(a: FloatArray, u: FloatArray) -> float:
    """Return the median ratio of distances to the nearest landmarks, from *a* to *u* (k, 3)."""
    away, near = (np.asarray(each)[:, 1] for each in cKDTree(a).query(a, 2))
    now = np.linalg.norm(u - u[near], axis=1)
    usable = (away > 0.0) & (now > 0.0)
    return float(np.median(now[usable] / away[usable])) if usable.any() else 1.0
