"""Checks of the arguments of a `Deformer`; each raises an error that names the argument."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    as_ids,
    as_points,
    coordinate_text,
    is_number,
    is_whole,
    plain,
)
from ..cages import Cage
from ..checks import require_sequence, shown
from ..errors import ArgumentError, CageError, ConstraintError
from ..mesh import Mesh, SurfacePoint, counted

_FARTHEST = 1e3  # sizes of the mesh
_FARTHEST_OFF = 0.05  # diagonals between a given point and the surface
_ROUNDING = 1e-9  # of the sum of shares
_PULL_RADIUS = 0.15  # diagonals of the mesh
_PINNED_LOCALITY, _ENOUGH = 0.05, 3  # with fewer fixed points, about which the body can turn
LOCALITY, SPREAD = 0.2, 0.5
"""The locality of a pull without pins; and the share of its radius within which it grabs."""
FARTHEST_APART = 20.0
"""Diagonals of the mesh between two targets or fixed vertices, at most.

At this distance volumes are rounded to a few 1e-12 of themselves; the error grows with its cube."""


def check_options(stretch: float, rotation_groups: int) -> None:
    """Raise an ArgumentError unless all are numbers in their range."""
    if not is_number(stretch, 0.0):
        raise ArgumentError(f"stretch must be a number, 0 or more; got {shown(stretch)}")
    if not is_whole(rotation_groups, 1):
        raise ArgumentError(
            f"rotation_groups must be a whole number, 1 or more; got {shown(rotation_groups)}"
        )


def as_lids(lids: object) -> bool | None:
    """Return the option *lids*, or raise an ArgumentError unless it is True, False or None."""
    if lids is not None and not isinstance(lids, bool | np.bool_):
        raise ArgumentError(f"lids must be True, False or None; got {shown(lids)}")
    return None if lids is None else bool(lids)


def check_distance(targets: FloatArray) -> None:
    """Raise a ConstraintError if *targets*, in units of the mesh's size, are absurdly far away."""
    if max(targets.max(initial=0.0), -targets.min(initial=0.0)) > _FARTHEST:
        raise ConstraintError(
            f"a target is {np.abs(targets).max():.0e} mesh sizes away; "
            "check that targets and mesh are in the same unit"
        )


def stacked_cages(cages: Sequence[Cage], cage_vertices: Sequence[ArrayLike]) -> FloatArray:
    """Return *cage_vertices* (m, 3) of all *cages*, or raise a CageError if they do not fit."""
    require_sequence(cage_vertices, "cage_vertices")
    poses = [as_points(vertices, "cage_vertices") for vertices in cage_vertices]
    expected, got = [cage.n_vertices for cage in cages], [len(pose) for pose in poses]
    if got != expected:
        raise CageError(f"cage_vertices must contain {expected} points, cage by cage; got {got}")
    return np.concatenate(poses)


def checked_constraints(
    mesh: Mesh, fixed: ArrayLike, handle: ArrayLike, name: str = "fixed"
) -> tuple[IntArray, IntArray]:
    """Return the vertex numbers of *fixed*, called *name*, and *handle*, or raise an error."""
    try:
        fixed = as_ids(fixed, mesh.n_vertices, name)
        handle = as_ids(handle, mesh.n_vertices, "handle")
    except ValueError as fault:
        raise ConstraintError(str(fault)) from None
    both = np.intersect1d(fixed, handle)
    if len(both):
        shared = counted(len(both), "vertex is", "vertices are")
        raise ConstraintError(
            f"{shared} both {name} and handle (the first is {both[0]}); "
            "remove them from one of the two"
        )
    return fixed, handle


def checked_parts(mesh: Mesh, parts: Mapping[str, ArrayLike] | None) -> Mapping[str, BoolArray]:
    """Return the masks (n,) of *parts*, by name; ConstraintError if one is no set of vertices."""
    found = {}
    given = {} if parts is None else parts
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise ConstraintError(f"parts must be vertices by name; got {shown(parts)}")
    for name, vertices in given.items():
        try:
            ids = as_ids(vertices, mesh.n_vertices, f"parts[{name!r}]")
        except ValueError as fault:
            raise ConstraintError(str(fault)) from None
        found[name] = np.zeros(mesh.n_vertices, dtype=bool)
        found[name][ids] = True
    return found


def checked_vertex(mesh: Mesh, vertex: int) -> int:
    """Return *vertex*; ConstraintError if there is no such vertex."""
    if not is_whole(vertex, 0, mesh.n_vertices - 1):
        last = mesh.n_vertices - 1
        raise ConstraintError(f"vertex must be a whole number, 0 to {last}; got {shown(vertex)}")
    return int(vertex)


def checked_place(
    mesh: Mesh, vertex: int | ArrayLike | SurfacePoint, name: str = "vertex"
) -> SurfacePoint:
    """Return the point of the surface that is a vertex, or nearest to a point (3,) at rest.

    It is called *name* in messages.

    Raises
    ------
    ConstraintError
        If there is no such vertex, or the point is far from the surface.
    """
    if isinstance(vertex, SurfacePoint):
        return _checked_surface_point(mesh, vertex)
    if plain(vertex, name).ndim == 0:
        return SurfacePoint.at_vertex(checked_vertex(mesh, vertex))  # type: ignore[arg-type]
    place = checked_point(vertex, name)
    point = SurfacePoint.nearest(mesh, place)
    apart = float(np.linalg.norm(point.at(mesh.vertices) - place)) / mesh.diagonal
    if apart > _FARTHEST_OFF:
        raise ConstraintError(
            f"{name} is {100 * apart:.3g} % of model size away from the surface; give a point on "
            f"it. The nearest one is at {place_text(mesh, point)}"
        )
    return point


def place_text(mesh: Mesh, point: SurfacePoint) -> str:
    """Return the coordinates of *point* at rest as text: "0.5,0,2"."""
    return ",".join(coordinate_text(x, mesh.diagonal) for x in point.at(mesh.vertices))


def fault_of_grab(mesh: Mesh, point: SurfacePoint, radius: float) -> str:
    """Return why a pull of this *radius* cannot grab *point*: no vertex is near it; or "".

    If the nearest corner of the face is not within the *radius*, the face is so large that the
    surface cannot follow.  On a cylinder, a box and a plate with edges of 1/3 to 1/31 of their
    length, pulled by 10 % of the diagonal in the middle of an edge, the surface was off its pose
    on a dense mesh by

        distance of the nearest corner, in diagonals   .12-.16  .07-.09  .05-.07  .04-.05  .01-.03
        root mean square / that of the motion          1.3-2.1  .8-1.4   .6-1.2   .5-.9    .1-.6

    so at the default radius, 0.15, by more than it moves.
    """
    x = mesh.vertices
    away = float(np.linalg.norm(x[list(point.corners)] - point.at(x), axis=1).min())
    if away <= radius:
        return ""
    near, most = (100.0 * length / mesh.diagonal for length in (away, radius))
    return (
        f"no vertex is near this point: the nearest one of its face is {near:.3g} % of model size "
        f"away, and the radius of the pull is {most:.3g} %; subdivide the mesh first (segdeform "
        "subdivide), or enlarge the radius"
    )


def _checked_surface_point(mesh: Mesh, point: SurfacePoint) -> SurfacePoint:
    corners = [checked_vertex(mesh, vertex) for vertex in point.corners]
    joined = mesh.adjacency[corners][:, corners].nnz == len(corners) * (len(corners) - 1)
    shares = np.asarray(point.shares, dtype=np.float64)
    is_mean = len(shares) == len(corners) > 0 and bool((shares > 0.0).all())
    if not (joined and len(corners) <= 3 and is_mean and abs(shares.sum() - 1.0) < _ROUNDING):
        raise ConstraintError(
            f"a point of the surface must have positive shares, with the sum 1, of the corners of "
            f"one face; got {shown(point)}"
        )
    return point


def checked_radius(mesh: Mesh, radius: float | None) -> float:
    """Return the *radius* of a pull, by default 15 % of the mesh's diagonal."""
    if radius is None:
        return _PULL_RADIUS * mesh.diagonal
    if not (is_number(radius) and 0.0 < radius < np.inf):
        raise ConstraintError(f"radius must be a positive number or None; got {shown(radius)}")
    return float(radius)


def checked_locality(locality: float | None) -> float | None:
    """Return the *locality* of a pull; ConstraintError unless it is None or from 0 to 1."""
    if locality is not None and not (is_number(locality, 0.0) and locality <= 1.0):
        raise ConstraintError(f"locality must be a number from 0 to 1; got {shown(locality)}")
    return None if locality is None else float(locality)


def checked_limb(limb: int | None) -> int | None:
    """Return *limb*; ConstraintError unless it is a whole number, 0 or more, or None."""
    if limb is not None and not is_whole(limb, 0):
        raise ConstraintError(f"limb must be None or a whole number, 0 or more; got {shown(limb)}")
    return None if limb is None else int(limb)


def checked_hinge(hinge: float) -> float:
    """Return the *hinge* of a pull; ConstraintError unless it is from 0 to 1."""
    if not (is_number(hinge, 0.0) and hinge <= 1.0):
        raise ConstraintError(f"hinge must be a number from 0 to 1; got {shown(hinge)}")
    return float(hinge)


def automatic_locality(n_fixed: int) -> float:
    """Return the locality of a pull if none is given, with *n_fixed* fixed points elsewhere.

    0.2 without any.  Three or more divide the motion among the surface between them: 0.  One or two
    do not keep the body from turning about them: 0.05.
    """
    if n_fixed >= _ENOUGH:
        return 0.0
    return _PINNED_LOCALITY if n_fixed else LOCALITY


def checked_point(to: ArrayLike, name: str = "to") -> FloatArray:
    """Return *to* as a point (3,), checked as *name*; ConstraintError if it is none."""
    array = plain(to, name)
    if array.shape != (3,):
        raise ConstraintError(f"{name} must be a point (3,); got shape {array.shape}")
    try:
        return np.asarray(as_points(array[None], name)[0])
    except ValueError as fault:
        raise ConstraintError(str(fault)) from None


def checked_targets(
    targets: ArrayLike, count: int, name: str = "targets", kind: str = "handle"
) -> FloatArray:
    """Return *targets* of *count* vertices as (count, 3), or raise a ConstraintError.

    Without vertices, any empty sequence is accepted.
    """
    try:
        is_empty = not count and not plain(targets, name).size
        array = np.empty((0, 3)) if is_empty else as_points(targets, name)
    except ValueError as fault:
        raise ConstraintError(str(fault)) from None
    if len(array) != count:
        raise ConstraintError(
            f"{name} must give one point for each of the {count} {kind} vertices; "
            f"got shape {array.shape}"
        )
    return array


def require_together(mesh: Mesh, *places: FloatArray) -> None:
    """Raise a ConstraintError if *places* (k, 3), targets and fixed vertices, are too far apart."""
    given = [points for points in places if len(points)]
    if not given:
        return
    low = np.min([points.min(axis=0) for points in given], axis=0)
    high = np.max([points.max(axis=0) for points in given], axis=0)
    apart = float((high - low).max()) / mesh.diagonal
    if not apart <= FARTHEST_APART:
        raise ConstraintError(
            f"targets and fixed vertices are {apart:.3g} diagonals of the mesh apart; at most "
            f"{FARTHEST_APART:.0f} are allowed; check that both are in the same unit"
        )
