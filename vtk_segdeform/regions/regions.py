"""Overlapping regions of a mesh, each of which will be moved by a cage of its own (section 2.2).

A vertex may lie in several regions.  Where it does, the positions that their cages give it are
blended by weights that sum to 1 and fade to zero at each region's own border (`blending`):

    x_i = sum_r w_ri x_ri        w_ri >= 0,  sum_r w_ri = 1,  w_ri = 0 outside region r       (3)

n is the number of vertices, r counts regions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray, is_number, is_whole, plain
from ..checks import shown
from ..errors import RegionError
from ..freezing import Frozen
from ..mesh import Mesh, require_mesh
from .blending import border_distance, distance_to_triangles, shares

_EQUAL = 1e-9  # weights that differ by rounding only


class CageSurface(Protocol):
    """Anything with the surface of a cage."""

    @property
    def vertices(self) -> FloatArray:
        """(m, 3) float."""

    @property
    def faces(self) -> IntArray:
        """(k, 3) int."""


@dataclass(frozen=True, eq=False)
class Regions(Frozen):
    """Which vertices belong to which regions; every vertex to at least one.

    Parameters
    ----------
    mesh : Mesh
        The mesh the regions lie on, n vertices.
    membership : (r, n) bool
        One row per region.
    smoothness : float
        The power p of `blending.shares`: 1 fades linearly across an overlap, 2 leaves zero with a
        horizontal tangent.

    Raises
    ------
    RegionError
        If the shape is wrong, a region is empty, or a vertex lies in no region; says which.
    """

    mesh: Mesh
    membership: BoolArray
    smoothness: float = 1.0

    def __post_init__(self) -> None:
        require_mesh(self.mesh)
        membership = plain(self.membership, "membership").copy()
        n = self.mesh.n_vertices
        if membership.dtype != bool or membership.ndim != 2 or membership.shape[1] != n:
            raise RegionError(
                f"membership must be a bool array of shape (regions, {n}); "
                f"got {membership.dtype} of shape {membership.shape}"
            )
        empty = np.flatnonzero(~membership.any(axis=1))
        if len(empty):
            raise RegionError(
                f"{len(empty)} regions hold no vertex: {_some(empty)}; leave them out"
            )
        bare = np.flatnonzero(~membership.any(axis=0))
        if len(bare):
            raise RegionError(
                f"{len(bare)} vertices lie in no region: {_some(bare)}; add them to a region"
            )
        if not (is_number(self.smoothness) and self.smoothness > 0.0):
            raise RegionError(f"smoothness must be a number above 0; got {shown(self.smoothness)}")
        membership.flags.writeable = False
        object.__setattr__(self, "membership", membership)

    @classmethod
    def single(cls, mesh: Mesh) -> Regions:
        """Return one region that holds everything: the classical method with a single cage."""
        require_mesh(mesh)
        return cls(mesh, np.ones((1, mesh.n_vertices), dtype=bool))

    @classmethod
    def from_masks(cls, mesh: Mesh, masks: ArrayLike) -> Regions:
        """Return the regions that (r, n) bool *masks* describe, as they are."""
        return cls(mesh, np.atleast_2d(plain(masks, "masks")))

    @classmethod
    def from_labels(cls, mesh: Mesh, labels: ArrayLike, overlap: int = 4) -> Regions:
        """Return one region for each label, grown over its neighbours so that they overlap.

        Parameters
        ----------
        mesh : Mesh
            n vertices.
        labels : (n,) int
            Any integers; region r is the r-th smallest of those that occur.
        overlap : int
            By how many rings of edges each region grows beyond its label, so that two neighbours
            share about twice as many.  With 0, none overlap and the surface may tear at a border.

        Raises
        ------
        RegionError
            If *labels* is not one integer per vertex.

        Examples
        --------
        >>> from vtk_segdeform.mesh import Mesh
        >>> corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> tetrahedron = Mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        >>> Regions.from_labels(tetrahedron, [7, 7, 7, 9], overlap=0).membership.astype(int)
        array([[1, 1, 1, 0],
               [0, 0, 0, 1]])
        """
        require_mesh(mesh)
        if not is_whole(overlap, 0):
            raise RegionError(f"overlap must be a whole number, 0 or more; got {shown(overlap)}")
        array = plain(labels, "labels")
        if array.shape != (mesh.n_vertices,) or array.dtype.kind not in "iu":
            raise RegionError(
                f"labels must be one integer for each of the {mesh.n_vertices} vertices; "
                f"got {array.dtype} of shape {array.shape}"
            )
        masks = array == np.unique(array)[:, None]
        return cls(mesh, masks).grow(overlap)

    @property
    def n_regions(self) -> int:
        """Number of regions, r."""
        return len(self.membership)

    @cached_property
    def border_distance(self) -> FloatArray:
        """(r, n) float: distance along the surface to the region's border; 0 outside of it.

        In the mesh's unit; infinite where a region has no border.
        """
        return _read_only(border_distance(self.mesh, self.membership))

    @cached_property
    def weights(self) -> FloatArray:
        """(r, n) float: the share of each region at each vertex; columns sum to 1.

        Zero outside a region and on its border, except at vertices that no other region can take.
        """
        return _read_only(shares(self.membership, self.border_distance, self.smoothness))

    @property
    def labels(self) -> IntArray:
        """(n,) int: the region that weighs most at each vertex; the first of (almost) equals."""
        ahead = self.weights >= self.weights.max(axis=0) - _EQUAL
        return np.asarray(np.argmax(ahead, axis=0), dtype=np.int64)

    def members(self, region: int) -> IntArray:
        """Return the numbers of the vertices in *region*, in order."""
        require_region(region, self.n_regions)
        return np.flatnonzero(self.membership[int(region)])

    def grow(self, rings: int) -> Regions:
        """Return the same regions, each with *rings* more rings of neighbours."""
        if not is_whole(rings, 0):
            raise RegionError(f"rings must be a whole number, 0 or more; got {shown(rings)}")
        membership = self.membership.copy()
        graph, (i, j) = self.mesh.adjacency, self.mesh.edges.T
        for members in membership:
            border = members[i] != members[j]
            last = np.unique(np.where(members[i[border]], i[border], j[border]))
            for _ in range(int(rings)):
                near = graph[last].indices
                last = np.unique(near[~members[near]])
                if not len(last):
                    break
                members[last] = True
        return Regions(self.mesh, membership, self.smoothness)


def require_regions(regions: object, mesh: Mesh) -> None:
    """Raise a RegionError unless *regions* are `Regions` over as many vertices as *mesh* has."""
    if not isinstance(regions, Regions):
        raise RegionError(
            f"regions must be Regions; got {shown(regions)}. Create them with segment(mesh) or "
            "Regions.from_masks(mesh, masks)"
        )
    if regions.mesh.n_vertices != mesh.n_vertices:
        raise RegionError(
            f"these regions belong to a mesh of {regions.mesh.n_vertices} vertices, "
            f"this one has {mesh.n_vertices}; create new ones"
        )


def require_region(region: int, count: int) -> None:
    """Raise a RegionError unless *region* is one of 0..count-1."""
    if not is_whole(region, 0, count - 1):
        raise RegionError(f"region must be one of 0..{count - 1}; got {shown(region)}")


def cage_distance_weights(regions: Regions, cages: Sequence[CageSurface]) -> FloatArray:
    """Return the weights (4) as printed: d is the distance in space to each region's cage.

    For comparison only: these weights jump at the border of a region (see `blending`).

    Parameters
    ----------
    regions : Regions
        r regions of n vertices.
    cages : sequence of r cages
        The cage of each region.

    Returns
    -------
    weights : (r, n) float
        Columns sum to 1; zero outside each region, and positive on its border.
    """
    if len(cages) != regions.n_regions:
        raise RegionError(
            f"cages must hold one cage for each of the {regions.n_regions} regions; "
            f"got {len(cages)}"
        )
    distance = np.zeros(regions.membership.shape)
    for r, cage in enumerate(cages):
        inside = regions.members(r)
        points = regions.mesh.vertices[inside]
        distance[r, inside] = distance_to_triangles(points, cage.vertices, cage.faces)
    return shares(regions.membership, distance)


def _read_only(array: FloatArray) -> FloatArray:
    array.flags.writeable = False
    return array


def _some(numbers: IntArray) -> str:
    """Name the first few of *numbers*."""
    shown = ", ".join(str(number) for number in numbers[:8])
    return shown + (", ..." if len(numbers) > 8 else "")
