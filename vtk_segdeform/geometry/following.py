"""Components that follow others: a sleeve its arm, a lining its wall, buttons their coat.

A component *follows* another, its *carrier*, if it lies against it or is around it or inside of it:

    against      their gap is at most a tenth of their size, the geometric mean of the radii of two
                 spheres with their areas; of a component smaller than the smallest limb of a
                 segmentation, a speck or a button, a twentieth of the diagonal
    around       the directions u from points of the smaller one to the nearest points of the other
                 go all around at least in a plane.  With the weights w = 1 / gap^4, |sum w u| is
                 less than half of sum w, and the second largest eigenvalue of sum w u u^T at least
                 a fifth of it; or all of one is inside of the other, wherever

Components that are linked so form a tree.  Its root is the largest of them, or each that has fixed
vertices or handles.  Each other one is carried by the one of those nearer to the root to which it
has the smallest gap, relative to the size of that one: a jacket by the shirt, and the shirt by the
body; but the inner wall of a hollow body by the outer one, not by a bubble between them.

Values of a carrier, such as the blend weights of regions, are *carried* to its followers: each
vertex has that of the nearest point of the carrier.  Nearest points of neighbours may be far from
each other, as those of a bone in a limb, so the values x are smoothed along the follower

    (A + D C D) y = A x          A areas, C the Laplacian, with no negative weights

over a length D, the distance of the nearest point from the follower.  Both walls of a sleeve have
the same D, and move together.  y is between the least and the largest x, and of values that sum to
1 the sum stays 1.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import linalg
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray, is_whole
from ..checks import require, shown
from ..errors import ArgumentError
from ..mesh import Mesh, inside_points, nearest_on_triangles

Attach = Mapping[int, "int | str"]
"""For components by number: the number of the carrier, or `FREE`."""

FREE = "free"
SMALL_COMPONENT = 0.0125  # of the whole area; also the smallest limb of a segmentation
_AGAINST = 0.1  # largest gap of components that lie against each other, in their sizes
_NEAR = 0.05  # diagonals: the same of a small component
_AROUND, _WIDE = 0.5, 0.2  # least 1 - |sum w u| / sum w, and share of the second eigenvalue
_POWER = 4  # of the gap, in w
_COMPARED = 32  # components of which all pairs are compared; the others only with these
_SAMPLES = 2_000  # points on a component, at least
_FEW = 64  # the same on a component that is not
_SHORTEST = 1e-9  # diagonals: length of edges that are shorter
_LEAST_AREA = 1e-12  # of a vertex, relative to the largest: of faces without area there is none
_NEAREST = 8  # samples around a point whose faces may contain the nearest point
_R2 = np.array([0.7548776662466927, 0.5698402909980532])  # of Roberts' sequence of even points


class Nearest(NamedTuple):
    """The points of a surface that are nearest to k others."""

    corners: IntArray  # (k, 3), of their faces
    shares: FloatArray  # (k, 3)
    gaps: FloatArray  # (k,)


class _Samples:
    """Points on some faces *which* of a mesh: one or more on each, at least so many in all."""

    def __init__(self, mesh: Mesh, which: IntArray, fewest: int = _SAMPLES) -> None:
        faces, areas = mesh.faces[which], mesh.face_areas[which]
        self._x, self._faces = mesh.vertices, faces
        each = np.ceil(fewest * areas / max(areas.sum(), np.finfo(float).tiny))
        counts = np.maximum(each, 1.0).astype(np.int64)
        self.face = np.repeat(np.arange(len(faces)), counts)
        self.areas = (areas / counts)[self.face]
        number = np.arange(len(self.face)) - np.repeat(np.cumsum(counts) - counts, counts)
        a, b = ((1 / 3 + number[:, None] * _R2) % 1.0).T
        a, b = np.where(a + b > 1.0, 1.0 - a, a), np.where(a + b > 1.0, 1.0 - b, b)
        shares = np.stack([1.0 - a - b, a, b], axis=1)
        self.points = np.einsum("kc,kcj->kj", shares, self._x[faces[self.face]])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points, compact_nodes=False, balanced_tree=False)

    def at(self, near: Nearest) -> FloatArray:
        """Return the positions of the points, (k, 3)."""
        return np.asarray(np.einsum("kc,kcj->kj", near.shares, self._x[near.corners]))

    def nearest(self, points: FloatArray) -> Nearest:
        """Return the nearest points of these faces to *points* (k, 3)."""
        count = min(_NEAREST, len(self.points))
        _, found = self._tree.query(points, np.arange(1, count + 1))
        faces = self._faces[self.face[np.asarray(found).ravel()]]
        shares, gaps = nearest_on_triangles(self._x[faces], np.repeat(points, count, axis=0))
        rows = np.arange(0, len(faces), count)
        best = rows + gaps.reshape(-1, count).argmin(axis=1)
        return Nearest(faces[best], shares[best], gaps[best])


def carriers(
    mesh: Mesh, attach: Attach | None = None, *, roots: IntArray | None = None
) -> IntArray:
    """Return the carrier of each component of *mesh*, (c,) int; its own number if it has none.

    Parameters
    ----------
    mesh : Mesh
        c components.
    attach : mapping of int to int or "free", optional
        The carriers of some components; those that are free have none, and carry only what is
        attached to them here.
    roots : (k,) int, optional
        Other components without carriers.

    Raises
    ------
    ArgumentError
        If *attach* has other keys or values, or components carry each other.
    """
    count = int(mesh.components.max()) + 1
    given = checked_attach(attach, count)
    if count == 1:
        return np.zeros(1, dtype=np.int64)
    area = np.asarray(np.bincount(mesh.components, mesh.vertex_areas), dtype=np.float64)
    extent = _extents(mesh)
    carried_by = {k: int(other) for k, other in given.items() if other != FREE}
    free = given.keys() - carried_by.keys()
    size, links = np.sqrt(area), _links(mesh, area, extent)
    by_gap = sorted(
        (gap / max(size[other], np.finfo(float).tiny), k, other)
        for gap, *ends in links
        for k, other in (ends, ends[::-1])
        if free.isdisjoint(ends) and k not in carried_by
    )
    pairs = [*carried_by.items(), *(pair for _, *pair in by_gap)]
    own = np.arange(count)
    alone = free if roots is None else free | set(roots.tolist()) - carried_by.keys()
    found = np.where(np.isin(own, list(alone)), own, -1)
    for root in np.lexsort((own, -extent)):
        _grow(found, pairs)
        if found[root] < 0 and root not in carried_by:
            found[root] = root
    _grow(found, pairs)
    if (circular := np.flatnonzero(found < 0)).size:
        raise ArgumentError(f"attach must not lead back to a component; got {list(circular)}")
    return found


def towards(carrier: IntArray, roots: IntArray) -> IntArray:
    """Return the *carrier* (c,) of each component in the same trees, but from other *roots* (k,).

    Of a tree with several roots each component follows the nearest; of one without any, none.
    """
    count = len(carrier)
    pairs = np.stack([np.arange(count), carrier])
    one, other = np.hstack([pairs[::-1], pairs])  # of several, the own carrier
    found = np.arange(count)
    known = np.isin(found, roots)
    while (ready := ~known[one] & known[other]).any():
        found[one[ready]] = other[ready]
        known[one[ready]] = True
    return found


def checked_attach(attach: Attach | None, count: int) -> dict[int, int | str]:
    """Return *attach* as a dict; ArgumentError unless it is for *count* components."""
    given = {} if attach is None else dict(require(attach, Mapping, "attach"))
    for k, other in given.items():
        is_carrier = is_whole(other, 0, count - 1) and other != k
        if not is_whole(k, 0, count - 1) or not (is_carrier or other == FREE):
            raise ArgumentError(
                f"attach must map components, 0..{count - 1}, to others or {FREE!r}; "
                f"got {shown(k)}: {shown(other)}"
            )
    return {int(k): other if other == FREE else int(other) for k, other in given.items()}


def _grow(found: IntArray, pairs: Sequence[Sequence[int]]) -> None:
    """Let components without a carrier in *found* (c,) follow others, in the order of *pairs*."""
    while ready := next((pair for pair in pairs if found[pair[0]] < 0 <= found[pair[1]]), None):
        k, other = ready
        found[k] = other


class _Link(NamedTuple):
    """Two components of which one follows the other."""

    gap: float
    one: int
    other: int


def _links(mesh: Mesh, area: FloatArray, extent: FloatArray) -> list[_Link]:
    """Return the links between components, (c,) of *area* and *extent*."""
    of_face = mesh.components[mesh.faces[:, 0]]
    order = np.lexsort((np.arange(len(extent)), -extent))
    large, small = order[:_COMPARED], order[_COMPARED:]
    by_component = np.argsort(of_face, kind="stable")
    ends = np.cumsum(np.bincount(of_face, minlength=len(extent)))[:-1]
    own = np.split(by_component, ends)
    samples = {int(k): _Samples(mesh, own[k]) for k in large}
    size, is_small = np.sqrt(area / (4.0 * np.pi)), area < SMALL_COMPONENT * area.sum()
    found = []

    def most(i: int, j: int) -> float:
        near = _NEAR * mesh.diagonal if is_small[i] else 0.0
        return max(near, _AGAINST * math.sqrt(size[i] * size[j]))

    boxes = {k: (each.points.min(axis=0), each.points.max(axis=0)) for k, each in samples.items()}
    for j, i in itertools.combinations(map(int, large), 2):  # i is the smaller one
        far = most(i, j)
        (low, high), (lower, higher) = boxes[i], boxes[j]
        if (low <= higher + far).all() and (lower <= high + far).all():
            near = samples[j].nearest(samples[i].points)
            gap = _linked(samples[i], samples[j], near, far)
            if gap is None and (low > lower).all() and (high < higher).all():
                one = samples[i].points[:: 1 + len(samples[i].points) // _FEW]
                if inside_points(one, mesh.vertices, mesh.faces[own[j]]).all():
                    gap = float(near.gaps.min())
            found += [] if gap is None else [_Link(gap, i, j)]
    if len(small):
        every = np.concatenate([own[k] for k in large])
        all_large = _Samples(mesh, every)
        for i in map(int, small):
            mine = _Samples(mesh, own[i], _FEW)
            near = all_large.nearest(mine.points)
            j = int(mesh.components[near.corners[near.gaps.argmin(), 0]])
            gap = _linked(mine, all_large, near, most(i, j))
            found += [] if gap is None else [_Link(gap, i, j)]
    return found


def _linked(one: _Samples, other: _Samples, near: Nearest, most: float) -> float | None:
    """Return the gap of *one* to the *other* one, whose nearest points are *near*.

    None if it does not follow it.  With a gap of at most *most* they lie against each other.
    """
    least = float(near.gaps.min())
    if least <= most:
        return least
    u = other.at(near) - one.points
    u /= near.gaps[:, None]
    w = one.areas * (least / near.gaps) ** _POWER
    w /= w.sum()
    wide = np.linalg.eigvalsh((u.T * w) @ u)[1]
    is_around = np.linalg.norm(w @ u) < 1.0 - _AROUND and wide > _WIDE
    return least if is_around else None


def _extents(mesh: Mesh) -> FloatArray:
    """Return the standard deviation of the positions in each component, (c,), rounded."""
    component, areas = mesh.components, mesh.vertex_areas
    x = mesh.vertices - mesh.vertices.mean(axis=0)
    total = np.maximum(np.bincount(component, areas), np.finfo(float).tiny)
    means = np.stack([np.bincount(component, areas * each) / total for each in x.T], axis=1)
    away = x - means[component]
    square = np.bincount(component, areas * np.einsum("ij,ij->i", away, away)) / total
    return np.asarray(np.round(np.sqrt(square) / mesh.diagonal, 9))


class _Step(NamedTuple):
    """The followers of one component."""

    ids: IntArray  # (k,), their vertices
    nearest: Nearest  # of the carrier
    areas: FloatArray  # (k,), A
    smoothing: sparse.csr_array | None  # A + D C D; None where all gaps are narrower than edges


class Carrying:
    """Values carried from components to their followers.

    Parameters
    ----------
    mesh : Mesh
        n vertices, c components.
    carrier : (c,) int
        The `carriers`.
    """

    def __init__(self, mesh: Mesh, carrier: IntArray) -> None:
        self.is_carried: BoolArray = (carrier != np.arange(len(carrier)))[mesh.components]
        self._mesh = mesh
        self._steps: list[_Step] = []
        if not self.is_carried.any():
            return
        of_face, of_vertex = mesh.components[mesh.faces[:, 0]], carrier[mesh.components]
        follows = np.where(carrier[of_face] != of_face, carrier[of_face], -1)
        for k in _from_roots(carrier):
            ids = np.flatnonzero((of_vertex == k) & self.is_carried)
            one, other = (_Samples(mesh, np.flatnonzero(own == k)) for own in (of_face, follows))
            nearest = one.nearest(mesh.vertices[ids])
            gaps = other.nearest(one.at(nearest)).gaps
            areas = mesh.vertex_areas[ids]
            areas = np.maximum(areas, _LEAST_AREA * areas.max())
            self._steps.append(_Step(ids, nearest, areas, _smoothing(mesh, ids, areas, gaps)))

    def carried(self, values: FloatArray) -> FloatArray:
        """Return *values* (n, k) with those of the followers replaced."""
        values = values.copy()
        for ids, nearest, areas, smoothing in self._steps:
            own = np.einsum("kc,kcj->kj", nearest.shares, values[nearest.corners])
            if smoothing is not None:
                own = _solved(smoothing, areas, own)
            values[ids] = own
        return values

    def evened(self, values: FloatArray) -> FloatArray:
        """Return *values* (n, k), at followers nearly the same at vertices that nearly coincide.

        Moved by values with jumps, the needles along a sharp rim would cross each other.
        """
        values = values.copy()
        for ids, _, areas, _ in self._steps:
            among = self._mesh.adjacency[ids][:, ids]
            usual = float(among.data.mean()) if among.nnz else 0.0
            even = _smoothing(self._mesh, ids, areas, np.full(len(ids), usual))
            if even is not None:
                values[ids] = _solved(even, areas, values[ids])
        return values


def _from_roots(carrier: IntArray) -> list[int]:
    """Return the components that carry others, each after its own carrier."""
    own = np.arange(len(carrier))
    layers, known = [own[carrier == own]], carrier == own
    while len(layers[-1]):
        layers.append(own[~known & np.isin(carrier, layers[-1])])
        known[layers[-1]] = True
    ordered = np.concatenate(layers)
    return [int(k) for k in ordered if np.count_nonzero(carrier == k) > (carrier[k] == k)]


def _smoothing(
    mesh: Mesh, ids: IntArray, areas: FloatArray, gaps: FloatArray
) -> sparse.csr_array | None:
    """Return A + D C D of the vertices *ids* (k,), of which *areas* (k,) are A, *gaps* (k,) D."""
    edges = mesh.adjacency[ids][:, ids].tocoo()
    i, j, length = edges.row, edges.col, edges.data
    wide = np.minimum(gaps[i], gaps[j]) > length
    if not wide.any():
        return None
    i, j, length = i[wide], j[wide], np.maximum(length[wide], _SHORTEST * mesh.diagonal)
    weights = gaps[i] * gaps[j] * (areas[i] + areas[j]) / (3.0 * length**2)
    total = np.bincount(i, weights, len(ids))
    off = sparse.coo_array((weights, (i, j)), shape=(len(ids), len(ids)))
    return sparse.csr_array(sparse.diags_array(areas + total) - off)


def _solved(smoothing: sparse.csr_array, areas: FloatArray, values: FloatArray) -> FloatArray:
    """Return y of *values* x, (k, j)."""
    if not np.ptp(values, axis=0).any():
        return values
    factor = linalg.splu(
        smoothing.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    return np.asarray(factor.solve(areas[:, None] * values))
