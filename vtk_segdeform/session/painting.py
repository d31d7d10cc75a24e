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
from .poses import Poses
from .state import State
from .timeline import Timeline


def with_regions(state: State, regions: Regions, names: naming.Names = ()) -> State:
    """Return *state* at rest with other *regions*; itself if they are the same.

    The cages remain if each of them still encloses its region; otherwise all are removed.
    """
    old = state.regions
    cages: tuple[Cage, ...] = ()
    if old is not None:
        same = np.array_equal(old.membership, regions.membership)
        if same and old.smoothness == regions.smoothness and _same_carrier(old, regions):
            return state
        cages = state.cages if _still_fit(old, regions, state.cages) else ()
    return replace(state, regions=regions, cages=cages, region_names=names).at_rest()


def _same_carrier(old: Regions, new: Regions) -> bool:
    """Return whether the same components carry or lead others in both."""
    pairs = (old.carrier, new.carrier), (old.leader, new.leader)
    return all(
        one is other if one is None or other is None else np.array_equal(one, other)
        for one, other in pairs
    )


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


class Painting:
    """Edits of the regions of a session, which keep their names.

    The pose is reset, and the cages are kept if each still encloses its region.
    """

    def __init__(self, history: Timeline, poses: Poses) -> None:
        self._history, self._poses = history, poses

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the regions; unnamed ones are "region 1", "region 2", ... by number."""
        regions = self._history.state.regions
        return tuple(map(self.name, range(0 if regions is None else regions.n_regions)))

    def name(self, region: int) -> str:
        """Return the name of a region, also of one that does not exist yet."""
        return naming.region_name(self._names, region)

    def paint(self, region: int, vertices: ArrayLike, *, subtract: bool = False) -> None:
        """Add *vertices*, ids or a mask, to a region, or with *subtract* remove them.

        If *region* equals the number of regions, a new region is added.  If there are no regions
        yet, the first one is created and contains all vertices.

        Raises
        ------
        RegionError
            If there is no such region, it would become empty, or a vertex would be in no region.
        """
        regions, name = self._regions, self.name(region)
        membership, count = regions.membership, regions.n_regions
        mask = _mask(regions.mesh, vertices)
        if not as_flag(subtract, "subtract") and is_whole(region, count, count) and mask.any():
            membership = np.vstack([membership, mask])
        else:
            region = _checked(regions, region)
            membership = membership.copy()
            membership[region] = (
                membership[region] & ~mask if subtract else membership[region] | mask
            )
            uncovered = np.flatnonzero(~membership.any(axis=0))
            if len(uncovered):
                raise RegionError(
                    f"{len(uncovered)} of these vertices (the first is {uncovered[0]}) are only in "
                    f"{name}; add them to another region first"
                )
            if not membership[region].any():
                raise RegionError(
                    f"{name} would become empty; merge it with another region instead"
                )
        self._step(f"paint {name}", membership, self._names)

    def merge(self, which: Sequence[int]) -> None:
        """Merge two or more regions into the first of them, which keeps the first name.

        Raises
        ------
        RegionError
            If there is no such region, or *which* has fewer than two.
        """
        regions = self._regions
        require_sequence(which, "which")
        numbers = sorted({_checked(regions, region) for region in which})
        if len(numbers) < 2:
            raise RegionError(f"merging requires two or more regions; got {shown(which)}")
        membership = regions.membership.copy()
        membership[numbers[0]] = membership[numbers].any(axis=0)
        names = naming.merged(self._names, numbers)
        self._step("merge regions", np.delete(membership, numbers[1:], axis=0), names)

    def split(
        self, region: int, vertices: ArrayLike | None = None, *, overlap: int | None = None
    ) -> None:
        """Split a region in two.

        The first part keeps the name.  The second comes last; next to "arm" it is "arm 2".

        Parameters
        ----------
        region : int
            The region.
        vertices : (k,) int or (n,) bool, optional
            The second part; vertices outside the region are ignored.  By default the region is
            split half way between its two ends, measured along the surface.
        overlap : int, optional
            Edge rings by which both parts grow across the border, within the region.  By default a
            tenth of their width, as in `segment`, and at least 2.

        Raises
        ------
        RegionError
            If there is no such region, or a part would be empty.
        """
        regions, name = self._regions, self.name(region)
        region = _checked(regions, region)
        mesh, whole = regions.mesh, regions.membership[region]
        second = _far_half(mesh, whole) if vertices is None else _mask(mesh, vertices) & whole
        first = whole & ~second
        if not first.any() or not second.any():
            raise RegionError(
                f"{name} cannot be split: {'all' if second.any() else 'none'} "
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
        names = naming.split(self._names, region, regions.n_regions)
        self._step(f"split {name}", np.vstack([membership, second & whole]), names)

    def rename(self, region: int, name: str) -> None:
        """Rename a region; "" removes its name.

        Painting, merging and splitting keep names; `segment` and `set_regions` remove them.

        Raises
        ------
        RegionError
            If there is no such region, *name* is the name of another region, or it is not printable
            text of at most 80 characters.
        """
        state, count = self._history.state, len(self.names)
        if not is_whole(region, 0, count - 1):
            raise RegionError(
                f"there is no region {shown(region)}; there are {count}, numbered from 0"
            )
        names = naming.renamed(self._names, int(region), name)
        self._history.step(f"rename {self.name(region)}", replace(state, region_names=names))

    @property
    def _regions(self) -> Regions:
        return self._history.state.regions or Regions.single(self._poses.mesh)

    @property
    def _names(self) -> naming.Names:
        return self._history.state.region_names

    def _step(self, label: str, membership: BoolArray, names: naming.Names) -> None:
        after = self._regions.with_membership(membership)
        self._history.step(label, with_regions(self._history.state, after, names))


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
