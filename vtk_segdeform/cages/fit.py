"""A cage for every region, made automatically: solid, offset, contour, simplify, clear.

    solid       the region as a solid, and the distance g to it on a grid       `region_solid`
    contour     the surface g = offset: closed and around the region by construction
    simplify    to the wanted number of vertices, topology kept                 `cage_simplify`
    clear       faces that came too near to the solid are pushed away from it
    check       closed, outward, free of self-intersections, around every vertex of the region

A larger offset is an easier cage: slits close, limbs fuse, holes fill, until it is a ball.  So a
cage that fails a check is made again with a larger offset; an ellipsoid, in the end, cannot fail.

The n vertices of a cage of area A are about ``sqrt(A / n)`` apart; that length sets the offset
where none is asked for, because mean value coordinates degrade close to large faces.
"""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray, as_ids, is_number, is_whole
from ..checks import shown
from ..errors import CageError, RegionError
from ..kernels import n_threads, one_blas_thread
from ..mesh import Mesh, distance_to_surface, inside_points, require_mesh
from ..progress import Progress, part, tell
from ..regions import Regions, require_regions
from .cage import MOST_CAGE_VERTICES, Cage, cage_faults
from .contour import contour_surface
from .region_solid import Patch, Skin, SolidField, solid_field
from .simplify import roundness, simplify

_OFFSET = 0.4  # of sqrt(area of the region / vertices of its cage)
_STEP = 0.27  # of the same: about thirty contour vertices for one of the cage
_LARGER = 1.25  # attempt k = 0, 1, ... is made at 1.25^(k (k + 1) / 2) times the offset:
_ATTEMPTS = 8  # 1, 1.25, 2, 4, 9, 28, 108, 517
_ROUND, _NEAR = 0.2, 0.2  # or more: a good cage's worst face; the skin from it, in offsets
_NODES, _NODES_PER_VERTEX = 3e5, 1e3  # of the grid: the larger is the most it may have
_FEWEST = 8  # vertices of a cage
_SHELL = 6  # vertices, at least, of each part of a cage that is in parts
_FLOOR = 12  # vertices that every region gets before the rest is shared out
_CLEARANCE = 0.5  # of the offset: the least distance from the skin that faces are pushed to
_PUSHES, _NEAREST = 30, 200  # rounds; vertices whose distance from the cage is measured
_CLOSEST, _FARTHEST = 1e-12, 1e6  # limits of the offset, in diagonals of the mesh
_MEASURED = 0.25  # of the work: regions are measured
_SIEVE = 16  # one vertex in so many is measured first
_SAMPLES = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6.0  # of a face

_log = logging.getLogger(__name__)


@one_blas_thread()
def fit_cages(
    mesh: Mesh,
    regions: Regions,
    n_vertices: int = 155,
    *,
    offset: float | None = None,
    progress: Progress | None = None,
) -> tuple[Cage, ...]:
    """Return one cage for each region.

    Parameters
    ----------
    mesh : Mesh
        What will be deformed.
    regions : Regions
        Of that mesh, r of them.
    n_vertices : int
        Total number of cage vertices, met exactly; at least 8 for each region, at most 1600.
        Distributed by area and shape: large and long regions get more.
    offset : float, optional
        How far the cages stay from the skin, about, in the mesh's unit.  By default, for each
        region, 0.4 sqrt(area / vertices of its cage).  It is raised where no valid cage is
        found so near.
    progress : callable, optional
        Called with the fraction done and what is going on; may raise `Cancelled`.

    Returns
    -------
    cages : tuple of r Cage
        Each strictly around every vertex of its region.

    Raises
    ------
    CageError
        If *n_vertices* is too small or too large, or *offset* is not positive.
    """
    require_mesh(mesh)
    require_regions(regions, mesh)
    _check_offset(offset, mesh)
    patches, n_regions = [], regions.n_regions
    _require_enough(n_vertices, n_regions)
    tell(progress, 0.0, "measuring regions")
    skin = Skin.of(mesh)
    for r, members in enumerate(regions.membership):
        tell(progress, _MEASURED * r / n_regions, "measuring regions")
        patches.append(Patch.of(skin, members))
    numbers = _share_out(patches, n_vertices)
    cages = []
    for r, (patch, number) in enumerate(zip(patches, numbers, strict=True)):
        ends = _MEASURED + (1.0 - _MEASURED) * np.array([r, r + 1]) / n_regions
        piece = part(progress, *map(float, ends))
        cages.append(_fit(patch, int(number), offset, piece))
    tell(progress, 1.0, "cages ready")
    return tuple(cages)


def fit_cage(
    mesh: Mesh,
    members: ArrayLike,
    n_vertices: int,
    *,
    offset: float | None = None,
    progress: Progress | None = None,
) -> Cage:
    """Return a cage of *n_vertices* around the vertices *members*: a mask (n,), or their numbers.

    As `fit_cages`, which see, for a single region.
    """
    require_mesh(mesh)
    _check_offset(offset, mesh)
    mask = np.zeros(mesh.n_vertices, dtype=bool)
    mask[as_ids(members, mesh.n_vertices, "members")] = True
    if not mask.any():
        raise RegionError("members is empty: a cage needs at least one vertex to hold")
    patch = Patch.of(Skin.of(mesh), mask)
    _require_enough(n_vertices, 1)
    return _fit(patch, n_vertices, offset, progress)


def _require_enough(n_vertices: int, n_regions: int) -> None:
    """Raise a CageError if the total number of cage vertices is too small or too large."""
    fewest, most = _FEWEST * n_regions, MOST_CAGE_VERTICES
    if fewest > most:
        raise CageError(
            f"{n_regions} regions need {fewest} cage vertices, {_FEWEST} each; the limit of the "
            f"solver is {most}: use {most // _FEWEST} regions or fewer (n_regions of segment)"
        )
    if not is_whole(n_vertices, fewest, most):
        raise CageError(
            f"n_vertices must be {fewest} to {most}, at least {_FEWEST} for each of {n_regions} "
            f"regions; got {shown(n_vertices)}"
        )


def _check_offset(offset: float | None, mesh: Mesh) -> None:
    if offset is None:
        return
    if not (is_number(offset) and offset > 0.0):
        raise CageError(f"offset must be a positive length; got {shown(offset)}")
    if not _CLOSEST <= offset / mesh.diagonal <= _FARTHEST:
        raise CageError(
            f"offset must be {_CLOSEST:.0e} to {_FARTHEST:.0e} diagonals of the mesh, of length "
            f"{mesh.diagonal:.3g}; got {shown(offset)}"
        )


def _share_out(patches: list[Patch], n_vertices: int) -> IntArray:
    """Return how many vertices each cage gets: *n_vertices* together.

    A fixed edge length would ask for vertices in proportion to the area, a fixed number of edges
    around a limb for as many on a small one as on a large one: the root of the area is between.
    The root of length over width gives long regions, which bend, their share.
    """
    area = np.array([patch.area for patch in patches])
    spread = np.array([patch.spread for patch in patches])
    need = np.sqrt(area * spread.sum(axis=1) / spread[:, 1:].sum(axis=1))
    share = np.round(need / need.sum(), 9)  # equal regions, equal numbers
    floor = min(_FLOOR, n_vertices // len(patches))
    ends = np.rint((n_vertices - floor * len(patches)) * np.cumsum(share) / share.sum())
    return np.asarray(floor + np.diff(ends, prepend=0.0).astype(np.int64))


def _fit(patch: Patch, n: int, offset: float | None, progress: Progress | None) -> Cage:
    """Return the first good cage, or the better of the first two that are merely valid."""
    length = float(np.sqrt(patch.area / n))
    offset = _OFFSET * length if offset is None else offset
    valid: list[tuple[float, FloatArray, IntArray]] = []
    for attempt in range(_ATTEMPTS):
        doing = f"a cage of {n} vertices, attempt {attempt + 1}"
        tell(progress, attempt / _ATTEMPTS, doing)
        larger = _LARGER ** (attempt * (attempt + 1) / 2)
        nodes = max(_NODES, _NODES_PER_VERTEX * n)
        field = solid_field(patch, offset * larger, _STEP * length * larger, most_nodes=nodes)
        tell(progress, (attempt + 0.5) / _ATTEMPTS, doing)
        if _SHELL * field.n_shells > n:
            fault = f"it falls into {field.n_shells} parts"
            continue
        share = part(progress, (attempt + 0.5) / _ATTEMPTS, (attempt + 0.8) / _ATTEMPTS)
        contour = contour_surface(field.smooth, field.offset)
        vertices, faces = simplify(*contour, n, progress=share, message=doing)
        tell(progress, (attempt + 0.8) / _ATTEMPTS, doing)
        vertices = _cleared(vertices, faces, field)
        tell(progress, (attempt + 0.9) / _ATTEMPTS, doing)
        fault = _fault(vertices, faces, field, n)
        if fault:
            continue
        quality = _quality(vertices, faces, field)
        valid.append((quality, field.grid.to_points(vertices) + patch.skin.centre, faces))
        if quality >= 1.0 or len(valid) == 2:
            break
    if valid:
        return Cage(*max(valid, key=lambda cage: cage[0])[1:])
    _log.warning("no cage of %d vertices fits a region (%s); an ellipsoid holds it", n, fault)
    vertices, faces = patch.ellipsoid(n)
    return Cage(vertices + patch.skin.centre, faces)


def _fault(vertices: FloatArray, faces: IntArray, field: SolidField, n: int) -> str:
    """Tell what keeps the surface from being a cage of the region with *n* vertices."""
    if len(vertices) != n:
        return f"it has {len(vertices)} vertices, not {n}"
    faults = cage_faults(vertices, faces)
    if not faults and not inside_points(field.members, vertices, faces).all():
        return "part of the region is outside"
    return "; ".join(faults)


def _cleared(vertices: FloatArray, faces: IntArray, field: SolidField) -> FloatArray:
    """Return *vertices* moved until the faces keep clear of the solid.

    Samples of the faces that are too near ask for a move away from the solid; a vertex makes the
    mean of the moves that its faces ask for.
    """
    vertices = vertices.copy()
    slope = [np.gradient(field.smooth, axis=axis) for axis in range(3)]
    least = _CLEARANCE * field.offset
    for _ in range(_PUSHES):
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
            asked = weight * np.repeat(away[axis], 3)
            moves = np.bincount(corner, asked, minlength=len(vertices))
            vertices[:, axis] += moves / np.maximum(total, 1e-9)
    return vertices


def _quality(vertices: FloatArray, faces: IntArray, field: SolidField) -> float:
    """Return 1 or more for a cage without needles that nowhere comes close to the skin."""
    tree = cKDTree((_SAMPLES @ vertices[faces]).reshape(-1, 3))
    x, enough = field.members, np.inf
    if len(x) > _SIEVE * _NEAREST:  # so many of a few are as near as the last one wanted, or nearer
        few, _ = tree.query(x[::_SIEVE], workers=n_threads())
        enough = np.partition(few, _NEAREST)[_NEAREST] * (1.0 + 1e-12)
    gap, _ = tree.query(x, distance_upper_bound=enough, workers=n_threads())
    nearest = x[np.argsort(gap, kind="stable")[:_NEAREST]]
    skin = distance_to_surface(nearest, vertices, faces).min() / field.offset
    return float(min(roundness(vertices, faces).min() / _ROUND, skin / _NEAR))
