"""Painting, merging, splitting and renaming of regions.

Every vertex remains in at least one region, and no region becomes empty: an edit that would
violate this raises an error that says what to do instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, as_ids, is_whole
from ..cages import Cage
from ..checks import as_flag, require_sequence, shown
from ..errors import RegionError
from ..mesh import Mesh
from ..regions import Regions, require_region, usual_overlap, within_rings
from . import naming
from .state import State


def with_regions(state: State, regions: Regions, names: naming.Names = ()) -> State:
    """Return *state* at rest with other *regions*; itself if they are the same.

    The cages remain if each of them still encloses its region; otherwise all are removed.
    """
    old = state.regions
    cages: tuple[Cage, ...] = ()
    if old is not None:
        same = np.array_equal(old.membership, regions.membership)
        if same and old.smoothness == regions.smoothness:
            return state
        cages = state.cages if _still_fit(old, regions, state.cages) else ()
    return replace(state, regions=regions, cages=cages, region_names=names).at_rest()


def _still_fit(old: Regions, new: Regions, cages: Sequence[Cage]) -> bool:
    """Return whether *cages*, which enclose the *old* regions, also enclose the *new* ones."""
    if new.n_regions != old.n_regions:
        return False
    added = new.membership & ~old.membership
    vertices = new.mesh.vertices
    return all(
        bool(cage.contains(vertices[more]).all())
        for cage, more in zip(cages, added, strict=False)
        if more.any()
    )


def renamed(state: State, region: int, name: str) -> tuple[str, State]:
    """Return the label of the step, and *state* with a *region* renamed; "" removes its name.

    Raises
    ------
    RegionError
        If there is no such region, or *name* is invalid or that of another region.
    """
    count = 0 if state.regions is None else state.regions.n_regions
    if not is_whole(region, 0, count - 1):
        raise RegionError(f"there is no region {shown(region)}; there are {count}, numbered from 0")
    names = naming.renamed(state.region_names, int(region), name)
    label = f"rename {naming.region_name(state.region_names, region)}"
    return label, replace(state, region_names=names)


def painted(
    regions: Regions, region: int, vertices: ArrayLike, *, subtract: bool, name: str = ""
) -> Regions:
    """Return *regions* with *vertices* added to or removed from one of them.

    Parameters
    ----------
    regions : Regions
        r regions of n vertices.
    region : int
        In 0..r; r adds a new region.
    vertices : (k,) int or (n,) bool
        May include vertices that are already in the region, or not in it.
    subtract : bool
        Remove the vertices.
    name : str, optional
        The name of the region in error messages.

    Raises
    ------
    RegionError
        If there is no such region, it would become empty, or a vertex would be in no region.
    """
    mesh, count = regions.mesh, regions.n_regions
    mask = _mask(mesh, vertices)
    if not as_flag(subtract, "subtract") and is_whole(region, count, count) and mask.any():
        return Regions(mesh, np.vstack([regions.membership, mask]), regions.smoothness)
    region = _checked(regions, region)
    membership = regions.membership.copy()
    membership[region] = membership[region] & ~mask if subtract else membership[region] | mask
    uncovered = np.flatnonzero(~membership.any(axis=0))
    name = name or f"region {region}"
    if len(uncovered):
        raise RegionError(
            f"{len(uncovered)} of these vertices (the first is {uncovered[0]}) are only in {name}; "
            "add them to another region first"
        )
    if not membership[region].any():
        raise RegionError(f"{name} would become empty; merge it with another region instead")
    return Regions(mesh, membership, regions.smoothness)


def merged(regions: Regions, which: Sequence[int]) -> Regions:
    """Return *regions* with the regions *which* merged into the first of them.

    Raises
    ------
    RegionError
        If there is no such region, or *which* has fewer than two.
    """
    require_sequence(which, "which")
    numbers = sorted({_checked(regions, region) for region in which})
    if len(numbers) < 2:
        raise RegionError(f"merging requires two or more regions; got {shown(which)}")
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
    """Return *regions* with one of them split in two; the second part comes last.

    Parameters
    ----------
    regions : Regions
        r regions of n vertices.
    region : int
        In 0..r-1.
    vertices : (k,) int or (n,) bool, optional
        The second part; vertices outside the region are ignored.  By default the region is split
        half way between its two ends, measured along the surface.
    overlap : int, optional
        Edge rings by which both parts grow across the border, within the region.  By default a
        tenth of their width, as in `segment`, and at least 2.
    name : str, optional
        The name of the region in error messages.

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
            "of its vertices would be in the second part; choose some of them"
        )
    if overlap is None:
        overlap = usual_overlap(np.count_nonzero(whole) / 2)
    elif not is_whole(overlap, 0):
        raise RegionError(f"overlap must be a whole number, 0 or more; got {shown(overlap)}")
    membership = regions.membership.copy()
    for part in (first, second):
        part[within_rings(mesh.adjacency, np.flatnonzero(part), int(overlap))] = True
    membership[region] = first & whole
    return Regions(mesh, np.vstack([membership, second & whole]), regions.smoothness)


def _far_half(mesh: Mesh, whole: BoolArray) -> BoolArray:
    """Return the vertices of *whole* that are closer to one of its ends, along the surface."""
    ids = np.flatnonzero(whole)
    graph = mesh.adjacency[ids][:, ids]
    second = np.zeros(len(whole), dtype=bool)

    def distance_from(start: int) -> FloatArray:
        return np.asarray(csgraph.dijkstra(graph, indices=np.array([start]))[0])

    from_any = distance_from(0)
    if np.isinf(from_any).any():  # several connected parts: separate them
        second[ids[np.isinf(from_any)]] = True
        return second
    from_one_end = distance_from(int(np.argmax(from_any)))
    from_other_end = distance_from(int(np.argmax(from_one_end)))
    second[ids[from_other_end < from_one_end]] = True
    return second


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
