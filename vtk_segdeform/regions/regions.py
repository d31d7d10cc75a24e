"""Overlapping regions of a mesh, each deformed by its own cage (section 2.2).

In an overlap, the positions that the cages give a vertex are blended by weights that sum to 1 and
fade to zero at the border of each region (`blending`):

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
from ..checks import Described, shown
from ..errors import RegionError
from ..freezing import Frozen, read_only
from ..geometry import Carrying
from ..mesh import Mesh, counted, distance_to_surface, require_mesh
from .blending import blend_weights, border_distance, overlap_weights
from .borders import within_rings

_LEAST_WEIGHT = 1e-3  # of a region at a vertex of a follower
_EQUAL_WEIGHT = 1e-9  # weights that differ by rounding only


class CageSurface(Protocol):
    """An object with the vertices and faces of a cage."""

    @property
    def vertices(self) -> FloatArray:
        """(m, 3) float."""

    @property
    def faces(self) -> IntArray:
        """(k, 3) int."""


@dataclass(frozen=True, eq=False, repr=False)
class Regions(Described, Frozen):
    """Overlapping regions of the vertices of a mesh; every vertex is in at least one.

    Parameters
    ----------
    mesh : Mesh
        The mesh, n vertices.
    membership : (r, n) bool
        One row per region.
    smoothness : float
        The power p of `blending.blend_weights`: 1 fades linearly across an overlap, larger values
        with zero slope at its border.
    carrier : (c,) int, optional
        The components that carry others, as of `geometry.carriers`: a follower is in the regions of
        the nearest points of its carrier, with their weights, whatever its *membership*.
    leader : (c,) int, optional
        The components that others follow in regions of their own: see `segment`.

    Raises
    ------
    RegionError
        If the shape is wrong, a region is empty, or a vertex is in no region, the message lists
        them; or if *carrier* or *leader* does not lead to components that follow none.
    """

    mesh: Mesh
    membership: BoolArray
    smoothness: float = 1.0
    carrier: IntArray | None = None
    leader: IntArray | None = None

    def __post_init__(self) -> None:
        require_mesh(self.mesh)
        membership = plain(self.membership, "membership").copy()
        n = self.mesh.n_vertices
        if membership.dtype != bool or membership.ndim != 2 or membership.shape[1] != n:
            raise RegionError(
                f"membership must be a bool array of shape (regions, {n}); "
                f"got {membership.dtype} of shape {membership.shape}"
            )
        if not (is_number(self.smoothness) and self.smoothness > 0.0):
            raise RegionError(f"smoothness must be a number above 0; got {shown(self.smoothness)}")
        if self.leader is not None:
            leader = _checked_carrier(self.mesh, self.leader, "leader")
            object.__setattr__(self, "leader", leader)
        if self.carrier is not None:
            carrier = _checked_carrier(self.mesh, self.carrier)
            object.__setattr__(self, "carrier", carrier)
            membership[:, self._carrying.is_carried] = False
        _require_complete(membership, self.is_carried)
        object.__setattr__(self, "membership", read_only(membership))
        if self.is_carried.any():
            object.__setattr__(self, "membership", read_only(membership | (self.weights > 0.0)))

    @cached_property
    def _carrying(self) -> Carrying:
        assert self.carrier is not None
        return Carrying(self.mesh, self.carrier)

    @property
    def is_carried(self) -> BoolArray:
        """(n,) bool: the vertices of components that others carry."""
        if self.carrier is None:
            return np.zeros(self.mesh.n_vertices, dtype=bool)
        return self._carrying.is_carried

    @classmethod
    def single(cls, mesh: Mesh) -> Regions:
        """Return one region of all vertices, for the classical method with a single cage."""
        require_mesh(mesh)
        return cls(mesh, np.ones((1, mesh.n_vertices), dtype=bool))

    @classmethod
    def from_masks(cls, mesh: Mesh, masks: ArrayLike) -> Regions:
        """Return the regions of *masks* (r, n) bool."""
        return cls(mesh, np.atleast_2d(plain(masks, "masks")))

    @classmethod
    def from_labels(
        cls,
        mesh: Mesh,
        labels: ArrayLike,
        overlap: int = 4,
        *,
        carrier: IntArray | None = None,
        leader: IntArray | None = None,
    ) -> Regions:
        """Return one region per label, grown so that neighbouring regions overlap.

        Parameters
        ----------
        mesh : Mesh
            n vertices.
        labels : (n,) int
            Any integers; region r has the r-th smallest label.
        overlap : int
            Number of edge rings by which each region grows beyond its label; an overlap is about
            twice as wide.  With 0 there are no overlaps, and the surface may tear at borders.
        carrier : (c,) int, optional
            As of `Regions`; every label must occur on a component that nothing carries.
        leader : (c,) int, optional
            As of `Regions`.

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
        return cls(mesh, masks, carrier=carrier, leader=leader).grow(overlap)

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        vertices, shared = self.mesh.n_vertices, int((self.membership.sum(axis=0) > 1).sum())
        return {
            "regions": f"{self.n_regions:,}",
            "vertices": f"{vertices:,}",
            "in several": f"{shared:,}",
        }

    @property
    def n_regions(self) -> int:
        """Number of regions, r."""
        return len(self.membership)

    @cached_property
    def components(self) -> BoolArray:
        """(r, c) bool: the components of the mesh of which each region has vertices."""
        component = self.mesh.components
        count = int(component.max()) + 1
        if count == 1:
            found = np.ones((self.n_regions, 1), dtype=bool)
        else:
            counts = [np.bincount(component[each], minlength=count) for each in self.membership]
            found = np.array(counts) > 0
        return read_only(found)

    @cached_property
    def border_distance(self) -> FloatArray:
        """(r, n) float: distance along the surface to the border of each region, 0 outside it.

        In the unit of the mesh; infinite where a region has no border.
        """
        return read_only(border_distance(self.mesh, self.membership))

    @cached_property
    def weights(self) -> FloatArray:
        """(r, n) float: the blend weight of each region at each vertex; columns sum to 1.

        Zero outside a region and on its border, except at vertices that are on the border of all
        their regions.
        """
        weights = overlap_weights(self.mesh, self.membership, self.smoothness)
        if self.is_carried.any():
            weights = self._carrying.carried(weights.T).T
            weights = np.where(weights > _LEAST_WEIGHT, weights, 0.0)
            weights /= weights.sum(axis=0)
        return read_only(weights)

    @property
    def labels(self) -> IntArray:
        """(n,) int: the region of largest weight at each vertex; the first of equal ones."""
        ahead = self.weights >= self.weights.max(axis=0) - _EQUAL_WEIGHT
        return np.asarray(np.argmax(ahead, axis=0), dtype=np.int64)

    def label_at(self, vertex: int) -> int:
        """Return the label of one *vertex*; if it is in one region, no weights are computed."""
        if not is_whole(vertex, 0, self.mesh.n_vertices - 1):
            last = self.mesh.n_vertices - 1
            raise RegionError(f"vertex must be from 0 to {last}; got {shown(vertex)}")
        own = np.flatnonzero(self.membership[:, vertex])
        if len(own) == 1:
            return int(own[0])
        weights = self.weights[:, vertex]
        return int(np.argmax(weights >= weights.max() - _EQUAL_WEIGHT))

    def members(self, region: int) -> IntArray:
        """Return the vertices of *region*, sorted."""
        require_region(region, self.n_regions)
        return np.flatnonzero(self.membership[int(region)])

    def grow(self, rings: int) -> Regions:
        """Return the regions grown by *rings* rings of neighbours."""
        if not is_whole(rings, 0):
            raise RegionError(f"rings must be a whole number, 0 or more; got {shown(rings)}")
        membership = self.membership.copy()
        for members in membership:
            members[within_rings(self.mesh.adjacency, np.flatnonzero(members), int(rings))] = True
        return self.with_membership(membership)

    def with_membership(self, membership: BoolArray) -> Regions:
        """Return regions with another *membership* (s, n), otherwise like these."""
        return Regions(self.mesh, membership, self.smoothness, self.carrier, self.leader)


def _require_complete(membership: BoolArray, is_carried: BoolArray) -> None:
    """Raise a RegionError if a region is empty, or a vertex that is not carried in none."""
    empty = np.flatnonzero(~membership.any(axis=1))
    if len(empty):
        raise RegionError(
            f"{counted(len(empty), 'region has', 'regions have')} no vertices: {_some(empty)}; "
            "leave out empty regions"
        )
    uncovered = np.flatnonzero(~membership.any(axis=0) & ~is_carried)
    if len(uncovered):
        raise RegionError(
            f"{counted(len(uncovered), 'vertex is', 'vertices are')} in no region: "
            f"{_some(uncovered)}; add every vertex to a region"
        )


def _checked_carrier(mesh: Mesh, carrier: ArrayLike, name: str = "carrier") -> IntArray:
    """Return the *carrier* of each component of *mesh*; RegionError if one has no root."""
    found, count = plain(carrier, name), int(mesh.components.max()) + 1
    is_valid = found.shape == (count,) and found.dtype.kind in "iu"
    if is_valid and ((found >= 0) & (found < count)).all():
        at = found.astype(np.int64)
        for _ in range(count.bit_length()):
            at = at[at]
        if (found[at] == at).all():
            return read_only(found.astype(np.int64))
    raise RegionError(
        f"{name} must be one of 0..{count - 1} for each of {count} components, and lead to one "
        f"that is its own; got {shown(carrier)}"
    )


def usual_overlap(n_vertices: float) -> int:
    """Return edge rings by which a region of *n_vertices* grows: a tenth of its width, at least 2.

    So overlaps are equally wide on coarse and fine meshes.
    """
    return max(2, round(0.1 * float(np.sqrt(n_vertices))))


def require_regions(regions: object, mesh: Mesh) -> None:
    """Raise a RegionError unless *regions* are `Regions` with as many vertices as *mesh*."""
    if not isinstance(regions, Regions):
        raise RegionError(
            f"regions must be Regions; got {shown(regions)}. Create them with segment(mesh) or "
            "Regions.from_masks(mesh, masks)"
        )
    if regions.mesh.n_vertices != mesh.n_vertices:
        raise RegionError(
            f"the regions belong to a mesh of {regions.mesh.n_vertices} vertices, but this mesh "
            f"has {mesh.n_vertices}; create regions of this mesh"
        )


def require_region(region: int, count: int) -> None:
    """Raise a RegionError unless *region* is one of 0..count-1."""
    if not is_whole(region, 0, count - 1):
        raise RegionError(f"region must be one of 0..{count - 1}; got {shown(region)}")


def cage_distance_weights(regions: Regions, cages: Sequence[CageSurface]) -> FloatArray:
    """Return the weights (4) as printed, with d the distance in space to the cage of each region.

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
            f"cages must be one cage for each of the {regions.n_regions} regions; got {len(cages)}"
        )
    distance = np.zeros(regions.membership.shape)
    for r, cage in enumerate(cages):
        inside = regions.members(r)
        points = regions.mesh.vertices[inside]
        distance[r, inside] = distance_to_surface(points, cage.vertices, cage.faces)
    return blend_weights(regions.membership, distance)


def _some(numbers: IntArray) -> str:
    """Return the first few of *numbers* as text."""
    shown = ", ".join(str(number) for number in numbers[:8])
    return shown + (", ..." if len(numbers) > 8 else "")
