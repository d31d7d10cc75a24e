"""Automatic cages around regions.

    solid       distance g to the region as a solid, on a grid                  `region_solid`
    contour     surface g = offset: closed and around the region by construction
    simplify    to the requested number of vertices, preserving topology        `simplify`
    clear       move faces that are too close to the solid away from it
    check       closed, outward, no self-intersections, around every vertex of the region

A larger offset gives a simpler cage: slits close, limbs merge and holes fill, until it is a ball.
So a cage that fails a check is built again with a larger offset; the last resort is an ellipsoid,
which is always valid.

The n vertices of a cage of area A are about ``sqrt(A / n)`` apart; the default offset is
proportional to that length, because mean value coordinates degrade close to large faces.

A large mesh is decimated first, far more finely than its cages; only the last check is on the mesh
itself.
"""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage
from scipy.spatial import cKDTree

from .. import sizes
from ..arrays import BoolArray, FloatArray, IntArray, as_ids, is_number, is_whole
from ..checks import shown
from ..errors import CageError, RegionError
from ..geometry import decimated
from ..kernels import nearest, one_blas_thread
from ..mesh import Mesh, distance_to_surface, inside_points, require_mesh
from ..progress import Progress, part, tell
from ..regions import Regions, require_regions
from .cage import MOST_CAGE_VERTICES, Cage, cage_faults, encloses_region
from .contour import contour_surface
from .region_solid import STEPS_PER_OFFSET, Patch, SolidField, Surface, solid_field
from .simplify import roundness, simplify

_OFFSET_SHARE = 0.4  # of sqrt(area of the region / vertices of its cage)
_ATTEMPTS = 8  # attempt k has 1.25^(k (k + 1) / 2) times the offset: 1, 1.25, 2, 4 ... 517
_GOOD_QUALITY = 0.2  # least roundness of faces, and least distance in offsets, of a good cage
_FEWEST = 8  # vertices of a cage, and of each component of a cage with several
_SUGGESTED, _SUGGESTED_EACH = 155, 30  # cage vertices in total, and for each part; half alone
_LEAST_OFFSET, _MOST_OFFSET = 1e-12, 1e6  # limits of the offset, in diagonals of the mesh
# Barycentric coordinates of samples of a face.
_SAMPLES = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6.0

_log = logging.getLogger(__name__)


def suggested_size(regions: Regions) -> int:
    """Return a total number of cage vertices for *regions*, at least 155.

    30 for each region that is a part of something, such as a limb, and 15 for one that bends by
    itself, such as one of many stones.
    """
    has = regions.components
    is_part = (has & (has.sum(axis=0) > 1)).any(axis=1)
    size = _SUGGESTED_EACH * is_part.sum() + _SUGGESTED_EACH // 2 * (~is_part).sum()
    return int(min(max(_SUGGESTED, size), MOST_CAGE_VERTICES))


@one_blas_thread()
def fit_cages(
    mesh: Mesh,
    regions: Regions,
    n_vertices: int = 155,
    *,
    offset: float | None = None,
    progress: Progress | None = None,
) -> tuple[Cage, ...]:
    """Fit one cage around each region.

    Parameters
    ----------
    mesh : Mesh
        The mesh to be deformed.
    regions : Regions
        r regions of that mesh.
    n_vertices : int
        Exact total number of cage vertices; at least 8 for each region, at most 1600.
        Distributed by area and shape: large and long regions get more.
    offset : float, optional
        Approximate distance of the cages from the surface, in the unit of the mesh.  By default,
        0.4 sqrt(area / vertices of its cage) for each region.  It is increased where no valid
        cage is found at that distance.
    progress : callable, optional
        Called with the fraction done and a text; may raise `Cancelled`.

    Returns
    -------
    cages : tuple of r Cage
        Every vertex of a region is strictly inside its cage.

    Raises
    ------
    CageError
        If *n_vertices* is too small or too large, or *offset* is not positive.
    """
    require_mesh(mesh)
    require_regions(regions, mesh)
    if regions.mesh is not mesh:
        regions = Regions(mesh, regions.membership)
    _check_offset(offset, mesh)
    n_regions = regions.n_regions
    require_cage_vertices(n_vertices, n_regions)
    tell(progress, 0.0, "measuring regions")
    shape, membership = mesh, regions.membership
    cluster = None
    if mesh.n_vertices > sizes.DECIMATED:
        shape, kept, cluster = decimated(mesh, sizes.DECIMATED_POINTS)
        membership = membership[:, kept]
        for members, some in zip(membership, regions.membership, strict=True):
            members[cluster[some]] = True
    patches = _patches(shape, membership, part(progress, 0.0, 0.25))
    numbers = _distributed(patches, n_vertices)
    cages, fitting = [], part(progress, 0.25, 1.0)
    for r, (patch, number) in enumerate(zip(patches, numbers, strict=True)):
        piece = part(fitting, r / n_regions, (r + 1) / n_regions)
        cage = _fit(patch, int(number), offset, piece)
        if cluster is not None and not encloses_region(cage, regions, r):
            patch = Patch.of(Surface.of(mesh), regions.membership[r])
            cage = _fit(patch, int(number), offset, piece)
        cages.append(cage)
    tell(progress, 1.0, "cages ready")
    return tuple(cages)


def _patches(mesh: Mesh, membership: BoolArray, progress: Progress | None) -> list[Patch]:
    """Return the patch of each region, *membership* (r, n)."""
    patches, surface = [], Surface.of(mesh)
    for r, members in enumerate(membership):
        tell(progress, r / len(membership), "measuring regions")
        patches.append(Patch.of(surface, members))
    return patches


def fit_cage(
    mesh: Mesh,
    members: ArrayLike,
    n_vertices: int,
    *,
    offset: float | None = None,
    progress: Progress | None = None,
) -> Cage:
    """Fit a cage of *n_vertices* around the vertices *members*, a mask (n,) or vertex indices.

    The other arguments are those of `fit_cages`.
    """
    require_mesh(mesh)
    _check_offset(offset, mesh)
    mask = np.zeros(mesh.n_vertices, dtype=bool)
    mask[as_ids(members, mesh.n_vertices, "members")] = True
    if not mask.any():
        raise RegionError("members is empty; a cage must enclose at least one vertex")
    patch = Patch.of(Surface.of(mesh), mask)
    require_cage_vertices(n_vertices, 1)
    return _fit(patch, n_vertices, offset, progress)


def require_cage_vertices(n_vertices: int, n_regions: int, name: str = "n_vertices") -> None:
    """Raise a CageError if the total of cage vertices, called *name*, is too small or too large."""
    fewest, most = _FEWEST * n_regions, MOST_CAGE_VERTICES
    if fewest > most:
        raise CageError(
            f"{n_regions} regions need {fewest} cage vertices, {_FEWEST} each; the limit of the "
            f"solver is {most}: use {most // _FEWEST} regions or fewer (n_regions of segment)"
        )
    if not is_whole(n_vertices, fewest, most):
        raise CageError(
            f"{name} must be {fewest} to {most}, at least {_FEWEST} for each of {n_regions} "
            f"regions; got {shown(n_vertices)}"
        )


def _check_offset(offset: float | None, mesh: Mesh) -> None:
    if offset is None:
        return
    if not (is_number(offset) and offset > 0.0):
        raise CageError(f"offset must be a positive length; got {shown(offset)}")
    if not _LEAST_OFFSET <= offset / mesh.diagonal <= _MOST_OFFSET:
        raise CageError(
            f"offset must be {_LEAST_OFFSET:.0e} to {_MOST_OFFSET:.0e} diagonals of the mesh, "
            f"of length {mesh.diagonal:.3g}; got {shown(offset)}"
        )


def _distributed(patches: list[Patch], n_vertices: int) -> IntArray:
    """Return the number of vertices of each cage, *n_vertices* in total.

    A fixed edge length would need numbers proportional to the area, a fixed number of edges around
    a limb the same number for small and large limbs; the square root of the area is in between.
    The square root of length over width gives long regions, which bend, more vertices.
    """
    area = np.array([patch.area for patch in patches])
    spread = np.array([patch.spread for patch in patches])
    length = np.maximum(spread.sum(axis=1), np.finfo(float).tiny)
    width = np.maximum(spread[:, 1:].sum(axis=1), 1e-3 * length)
    need = np.sqrt(area * length / width)
    floor = min(3 * _FEWEST // 2, n_vertices // len(patches))
    share = np.round(need / need.sum(), 9)  # equal regions get equal numbers
    ends = np.rint((n_vertices - floor * len(patches)) * np.cumsum(share) / share.sum())
    return np.asarray(floor + np.diff(ends, prepend=0.0).astype(np.int64))


def _fit(patch: Patch, n: int, offset: float | None, progress: Progress | None) -> Cage:
    """Return the first good cage, or the better one of the first two valid ones."""
    length = float(np.sqrt(patch.area / n))
    offset = _OFFSET_SHARE * length if offset is None else offset
    valid: list[tuple[float, FloatArray, IntArray]] = []
    for attempt in range(_ATTEMPTS):
        message = f"fitting a cage of {n} vertices, attempt {attempt + 1}"
        tell(progress, attempt / _ATTEMPTS, message)
        larger = 1.25 ** (attempt * (attempt + 1) / 2)
        step, nodes = _OFFSET_SHARE * length * larger / STEPS_PER_OFFSET, max(3e5, 1e3 * n)
        field = solid_field(patch, offset * larger, step, most_nodes=nodes)
        tell(progress, (attempt + 0.5) / _ATTEMPTS, message)
        if _FEWEST * field.n_shells > n:
            fault = f"it has {field.n_shells} components"
            continue
        share = part(progress, (attempt + 0.5) / _ATTEMPTS, (attempt + 0.8) / _ATTEMPTS)
        contour = contour_surface(field.smooth, field.offset)
        vertices, faces = simplify(*contour, n, progress=share, message=message)
        tell(progress, (attempt + 0.8) / _ATTEMPTS, message)
        vertices = _cleared(vertices, faces, field)
        tell(progress, (attempt + 0.9) / _ATTEMPTS, message)
        fault = _fault(vertices, faces, field, n)
        if fault:
            continue
        quality = _quality(vertices, faces, field)
        valid.append((quality, field.grid.to_points(vertices) + patch.surface.centre, faces))
        if quality >= 1.0 or len(valid) == 2:
            break
    if valid:
        return Cage(*max(valid, key=lambda cage: cage[0])[1:])
    _log.warning(
        "no valid cage of %d vertices found for a region (%s); using an ellipsoid instead", n, fault
    )
    vertices, faces = patch.ellipsoid(n)
    return Cage(vertices + patch.surface.centre, faces)


def _fault(vertices: FloatArray, faces: IntArray, field: SolidField, n: int) -> str:
    """Return why the surface is not a valid cage of the region with *n* vertices; "" if it is."""
    if len(vertices) != n:
        return f"it has {len(vertices)} vertices, not {n}"
    faults = cage_faults(vertices, faces)
    if not faults and not inside_points(field.members, vertices, faces).all():
        return "part of the region is outside"
    return "; ".join(faults)


def _cleared(vertices: FloatArray, faces: IntArray, field: SolidField) -> FloatArray:
    """Return *vertices* moved until all faces are clear of the solid.

    Samples of the faces that are too close require a move along the gradient of the distance; a
    vertex moves by the weighted mean over the samples of its faces.
    """
    vertices = vertices.copy()
    slope = [np.gradient(field.smooth, axis=axis) for axis in range(3)]
    least = 0.5 * field.offset
    for _ in range(30):
        at = (_SAMPLES @ vertices[faces]).reshape(-1, 3).T
        distance = ndimage.map_coordinates(field.distance, at, order=1)
        near = np.flatnonzero(distance < least)
        if not len(near):
            break
        away = np.stack([ndimage.map_coordinates(s, at[:, near], order=1) for s in slope])
        away *= (1.1 * least - distance[near]) / np.maximum(np.linalg.norm(away, axis=0), 1e-9)
        face, sample = np.divmod(near, len(_SAMPLES))
        corner, weight = faces[face].ravel(), _SAMPLES[sample].ravel()
        total = np.bincount(corner, weight, minlength=len(vertices))
        for axis in range(3):
            required = weight * np.repeat(away[axis], 3)
            moves = np.bincount(corner, required, minlength=len(vertices))
            vertices[:, axis] += moves / np.maximum(total, 1e-9)
    return vertices


def _quality(vertices: FloatArray, faces: IntArray, field: SolidField) -> float:
    """Return the quality of a cage, 1 or more if no face is a needle or close to the surface."""
    tree = cKDTree((_SAMPLES @ vertices[faces]).reshape(-1, 3))
    gap = nearest(tree, field.members)[0][:, 0]
    closest = field.members[np.argsort(gap, kind="stable")[:200]]
    clearance = distance_to_surface(closest, vertices, faces).min() / field.offset
    return float(min(roundness(vertices, faces).min(), clearance) / _GOOD_QUALITY)
