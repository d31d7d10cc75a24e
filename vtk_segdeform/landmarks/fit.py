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
stiffness is used that predicts them with the smallest errors.  Square roots of errors are added, so
that a tip, which nothing can predict, does not decide.

Before, the body is brought to its targets by a similarity, whose scale is the median of that of
the distances from landmarks to their nearest ones, which hardly change when a body bends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

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
_BOUND, _TESTED, _FITTED, _APART = 0.3, 0.75, 0.85, 0.9  # of the progress
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
    most a twelfth of them, by the chosen stiffness.  Of more than 200 landmarks so many are tested,
    which are spread over the body; the others have NaN."""
    left_out_spline: FloatArray
    """(k,) float: the same of the thin-plate spline alone."""
    stiffness: float
    """Of the springs that predict landmarks best; 0: the spline alone, nothing is bent."""
    volume_change: float
    """(V - V0) / V0 of `vertices`, signed; 0 if nothing is enclosed."""
    _map: Callable[[FloatArray], FloatArray] = field(repr=False)
    _mesh: Mesh = field(repr=False)

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
    errors = fitting.left_out(part(progress, _BOUND, _TESTED))
    best = int(np.nansum(np.sqrt(errors), axis=1).argmin())
    stiffness = (0.0, *STIFFNESS)[best]
    tell(progress, _TESTED, "moving the body")
    move = fitting.map_of(stiffness)
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
    tested = errors[best], errors[0]
    return LandmarkFit(x, u, u - to(a), *tested, stiffness, change, _map=to, _mesh=mesh)


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
        self._alone = np.full(len(a), np.nan)
        group = np.arange(len(few)) % _GROUPS
        for number in range(min(_GROUPS, len(few))):
            stays, left = group != number, few[group == number]
            kept, spline = few[stays], Spline(a[few[stays]], smoothing[stays])
            self._splits.append((kept, left, spline))
            self._alone[left] = np.linalg.norm(spline.at(a[left], u[kept]) - u[left], axis=1)
        self.scale = _scale_between(a[few], u[few])
        self._rotation, self._shift = rigid_fit(self.scale * a[few], u[few])
        self._u = (u - self._shift) @ self._rotation / self.scale
        self._sigma = sigma / self.scale

    def left_out(self, progress: Progress | None) -> FloatArray:
        """Return the distance of each landmark from its target if left out, (1 + stiffness, k)."""
        found = np.full((1 + len(STIFFNESS), len(self._a)), np.nan)
        found[0] = self._alone
        for number, (kept, left, spline) in enumerate(self._splits):
            tell(progress, number / len(self._splits), "leaving out landmarks")
            for row, pose in zip(found[1:], self._poses(kept, STIFFNESS), strict=True):
                x, r, back = self._left(pose)
                x = x[left] + _turned(r[left], spline.at(self._a[left], back[kept]))
                row[left] = self.scale * np.linalg.norm(x - self._u[left], axis=1)
        return found

    def map_of(self, stiffness: float) -> Callable[[FloatArray | None], FloatArray]:
        """Return the map of points (q, 3), or of the vertices (n, 3) for None."""
        a, few, pose, back = self._a, self._few, None, self._u - self._a
        if stiffness:
            upto = [k for k in STIFFNESS if k <= stiffness]
            *_, pose = self._poses(few, upto)
            *_, back = self._left(pose)
        rest, compact = self._body.problem.mesh.vertices, None
        if len(few) < len(a):
            more = back - self._spline.at(a, back[few])
            more[few] = 0.0
            compact = Compact(a, more, self._sigma)

        def move(points: FloatArray | None) -> FloatArray:
            at = rest if points is None else points
            grown = self._spline.at(at, back[few])
            if compact is not None:
                grown += compact.at(at)
            x = at + grown
            if pose is not None:
                x, r = pose.surface() if points is None else pose.at(self._body.attach(points))
                x = x + _turned(r, grown)
            return np.asarray(self.scale * x @ self._rotation.T + self._shift)

        return move

    def _poses(self, kept: IntArray, stiffness: Sequence[float]) -> Iterator[SpringPose]:
        """Yield the poses that springs of the landmarks *kept* pull the body to."""
        return self._body.poses(self._points, kept, self._u[kept], stiffness)

    def _left(self, pose: SpringPose) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where landmarks are, their rotations, and what is left to the targets, at rest."""
        x, r = pose.at(self._points)
        return x, r, _turned(np.swapaxes(r, 1, 2), self._u - x)


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
