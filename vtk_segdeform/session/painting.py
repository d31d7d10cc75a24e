"""Regions made from other regions: a few vertices more or less, two made one, one made two.

Every vertex stays in some region all the way, and no region is ever empty: what would break
that is refused, with what to do instead.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, as_ids, is_whole
from ..checks import as_flag, require_sequence, shown
from ..errors import RegionError
from ..mesh import Mesh
from ..regions import Regions, require_region

_OVERLAP = 0.1  # of a new region's width, counted in edges


def painted(
    regions: Regions, region: int, vertices: ArrayLike, *, subtract: bool, name: str = ""
) -> Regions:
    """Return *regions* with *vertices* added to one of them, or taken out of it.

    Parameters
    ----------
    regions : Regions
        r regions of n vertices.
    region : int
        Which, in 0..r; r is a new one.
    vertices : (k,) int or (n,) bool
        Those of them that are in it already, or not in it, do no harm.
    subtract : bool
        Take them out.
    name : str, optional
        What errors call the region.

    Raises
    ------
    RegionError
        If there is no such region, it would be empty, or a vertex would be in no region.
    """
    mesh, count = regions.mesh, regions.n_regions
    mask = _mask(mesh, vertices)
    if not as_flag(subtract, "subtract") and is_whole(region, count, count) and mask.any():
        return Regions(mesh, np.vstack([regions.membership, mask]), regions.smoothness)
    region = _checked(regions, region)
    membership = regions.membership.copy()
    membership[region] = membership[region] & ~mask if subtract else membership[region] | mask
    bare = np.flatnonzero(~membership.any(axis=0))
    name = name or f"region {region}"
    if len(bare):
        raise RegionError(
            f"{len(bare)} of these vertices (the first is {bare[0]}) are in no region but "
            f"{name}; add them to another one first"
        )
    if not membership[region].any():
        raise RegionError(f"{name} would be empty; merge it with another one instead")
    return Regions(mesh, membership, regions.smoothness)


def merged(regions: Regions, which: Sequence[int]) -> Regions:
    """Return *regions* with those in *which* made one, in the place of the first of them.

    Raises
    ------
    RegionError
        If there is no such region, or fewer than two are named.
    """
    require_sequence(which, "which")
    numbers = sorted({_checked(regions, region) for region in which})
    if len(numbers) < 2:
        raise RegionError(f"name two regions or more to merge; got {shown(which)}")
    membership = regions.membership.copy()
    membership[numbers[0]] = membership[numbers].any(axis=0)
    return Regions(regions.mesh, np.delete(membership, numbers[1:], axis=0), regions.smoothness)


def split(
    regions: Regions,
    region: int,
    vertices: ArrayLike | None = None,
    *,
    overlap: int | None = None,
    name: str = "",
) -> Regions:
    """Return *regions* with one of them cut in two; the second part comes last.

    Parameters
    ----------
    regions : Regions
        r regions of n vertices.
    region : int
        Which, in 0..r-1.
    vertices : (k,) int or (n,) bool, optional
        What becomes the second part; those outside the region do not count.  By default the
        region is cut across its length, half way along the surface between its ends.
    overlap : int, optional
        Rings of edges by which both parts grow over the cut, inside the region.  None takes a
        tenth of their width, as `segment` does, at least 2.
    name : str, optional
        What errors call the region.

    Raises
    ------
    RegionError
        If there is no such region, or a part would be empty.
    """
    region = _checked(regions, region)
    mesh, whole = regions.mesh, regions.membership[region]
    second = _far_half(mesh, whole) if vertices is None else _mask(mesh, vertices) & whole
    first = whole & ~second
    if not first.any() or not second.any():
        raise RegionError(
            f"{name or f'region {region}'} cannot be split: {'all' if second.any() else 'none'} "
            "of its vertices would be in the second part; name some of them"
        )
    if overlap is None:
        overlap = max(2, round(_OVERLAP * np.sqrt(np.count_nonzero(whole) / 2)))
    elif not is_whole(overlap, 0):
        raise RegionError(f"overlap must be a whole number, 0 or more; got {shown(overlap)}")
    membership = regions.membership.copy()
    membership[region] = _grown(mesh, first, overlap) & whole
    second = _grown(mesh, second, overlap) & whole
    return Regions(mesh, np.vstack([membership, second]), regions.smoothness)


def _far_half(mesh: Mesh, whole: BoolArray) -> BoolArray:
    """Return the vertices of *whole* nearer to its one end than to its other, as the ant walks."""
    ids = np.flatnonzero(whole)
    graph = mesh.adjacency[ids][:, ids]
    second = np.zeros(len(whole), dtype=bool)

    def walk(end: int) -> FloatArray:
        return np.asarray(csgraph.dijkstra(graph, indices=np.array([end]))[0])

    start = walk(0)
    if np.isinf(start).any():  # not in one piece: cut nothing, part the pieces
        second[ids[np.isinf(start)]] = True
        return second
    from_end = walk(int(np.argmax(start)))
    from_other = walk(int(np.argmax(from_end)))
    second[ids[from_other < from_end]] = True
    return second


def _grown(mesh: Mesh, mask: BoolArray, rings: int) -> BoolArray:
    mask = mask.copy()
    i, j = mesh.edges.T
    for _ in range(int(rings)):
        touched = mask[i] != mask[j]
        if not touched.any():
            break
        mask[i[touched]] = mask[j[touched]] = True
    return mask


def _mask(mesh: Mesh, vertices: ArrayLike) -> BoolArray:
    try:
        ids = as_ids(vertices, mesh.n_vertices, "vertices")
    except ValueError as fault:
        raise RegionError(str(fault)) from None
    mask = np.zeros(mesh.n_vertices, dtype=bool)
    mask[ids] = True
    return mask


def _checked(regions: Regions, region: int) -> int:
    require_region(region, regions.n_regions)
    return int(region)
