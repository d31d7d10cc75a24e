"""Regions of their own for fixed parts and rigid handles, so that cages meet them without effort.

A cage around both a fixed part and a limb that bends cannot keep the one in place and move the
other; large position weights then distort the mesh around the border.  So a fixed part becomes a
region, and so does each handle that moves rigidly; all other regions lose these vertices:

    region of a fixed part or handle     its vertices, and those within a margin around them
    other regions                        without these vertices; dropped if nothing is left

Their blend weight is zero at its border, where the clamped region has all the weight, and grows
across the margin: the deformed surface is continuous, and a cage of a few vertices places a fixed
part or a rigid handle exactly, since mean value coordinates reproduce affine maps.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import Mesh
from ..regions import Regions

_MARGIN = 0.1  # around fixed parts, relative to the square root of the area between clamped parts
_HANDLE_MARGIN = 0.05  # around handles
_RINGS = 2  # fewest rings of vertices in a margin
_RIGID = 1e-4  # largest deviation of a handle from an affine map, in diagonals
_EACH = 12  # fewest cage vertices for each region


def clamped(
    regions: Regions,
    *,
    fixed: BoolArray,
    handle: IntArray,
    targets: FloatArray,
    n_cage_vertices: int,
) -> tuple[Regions, BoolArray]:
    """Return *regions* with a region for the fixed parts and for each rigid handle.

    They are returned unchanged if there is no fixed part or handle larger than its margin, or if
    *n_cage_vertices* are too few for more regions.

    Parameters
    ----------
    regions : Regions
        Regions of n vertices.
    fixed, handle : (n,) bool, (k,) int
        Vertices that stay in place, and that move to *targets*.
    targets : (k, 3) float
        Positions of the handle vertices.
    n_cage_vertices : int
        Total number of cage vertices.

    Returns
    -------
    regions : Regions
    rigid : (n,) bool
        The vertices that keep their shape: the fixed ones and those of rigid handles.
    """
    mesh = regions.mesh
    is_handle = np.zeros(mesh.n_vertices, dtype=bool)
    is_handle[handle] = True
    free = ~fixed & ~is_handle
    size = np.sqrt(mesh.face_areas[free[mesh.faces].any(axis=1)].sum())
    parts = _large_parts(mesh, fixed, _MARGIN * size)
    held = np.any(parts, axis=0) if parts else np.zeros_like(fixed)
    rigid = fixed.copy()
    added = [_grown(mesh, held, _MARGIN * size)] if parts else []
    moved = np.zeros_like(mesh.vertices)
    moved[handle] = targets
    for part in _large_parts(mesh, is_handle, _HANDLE_MARGIN * size):
        if _is_affine(mesh, part, moved):
            added.append(_grown(mesh, part, _HANDLE_MARGIN * size))
            held, rigid = held | part, rigid | part
    left = [members & ~held & ~regions.is_carried for members in regions.membership]
    for k in range(len(left) - 1, -1, -1):  # without regions that others cover
        if not (left[k] & ~np.any(left[:k] + left[k + 1 :], axis=0)).any():
            del left[k]
    if not added or not left or _EACH * (len(left) + len(added)) > n_cage_vertices:
        return regions, rigid
    return regions.with_membership(np.array(left + added)), rigid


def _large_parts(mesh: Mesh, members: BoolArray, size: float) -> list[BoolArray]:
    """Return the connected parts of *members* whose area is at least that of a square of *size*."""
    ids = np.flatnonzero(members)
    count, part = csgraph.connected_components(mesh.adjacency[ids][:, ids], directed=False)
    label = np.full(mesh.n_vertices, -1)
    label[ids] = part
    corners = label[mesh.faces]
    inner = (corners >= 0).all(axis=1)
    area = np.bincount(corners[inner, 0], mesh.face_areas[inner], minlength=count)
    return [label == k for k in np.flatnonzero(area >= max(size * size, np.finfo(float).tiny))]


def _grown(mesh: Mesh, members: BoolArray, margin: float) -> BoolArray:
    """Return *members* and all vertices within *margin* of them, at least a few rings."""
    start = np.flatnonzero(members)
    distance = csgraph.dijkstra(
        mesh.adjacency, directed=False, indices=start, min_only=True, limit=margin
    )
    grown = np.isfinite(distance)
    ring = members
    for _ in range(_RINGS):
        ring = ring | (mesh.adjacency @ ring > 0.0)
    return np.asarray(grown | ring)


def _is_affine(mesh: Mesh, part: BoolArray, moved: FloatArray) -> bool:
    """Return whether an affine map takes the vertices of *part* to where they are *moved*."""
    x = mesh.vertices[part] - mesh.vertices[part].mean(axis=0)
    y = moved[part] - moved[part].mean(axis=0)
    away = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return bool(np.abs(away).max() <= _RIGID * mesh.diagonal)
