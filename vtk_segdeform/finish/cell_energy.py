"""The stretch energy over all vertices, with a rotation for the cell of triangles around each.

    E(x) = min_R  sum_i sum_T c_iT A_T |J_T - R_i|^2,      sum_i c_iT = 1 for each triangle T

J_T is the gradient over triangle T of the map from rest to x.  With c_iT = 1/3 at the corners of T
this is the stretch of `energy`, as rigid as possible with spokes and rims.  Here the cells are
larger: the share of a triangle takes k steps of a random walk over the mesh, c = P^k c_0 with

    P_ij = (1 - t) delta_ij + t / degree(j)  if j is a neighbour of i

whose columns sum to 1.  A triangle mesh resists bending only because rotations are shared, the more
the larger the cells.  With cells of radius c it bends like a plate, on the foundation of stiffness
1 / l^2 that holds it to the pose of the cages (`finisher`), and wrinkles where it is compressed by
more than some 2 c / l.  So k t is 0.1 times the vertices per cage vertex, which makes c a third of
the spacing of the cages on any mesh, and l is two: the inner side of a thick body stays smooth in
a bend until it is shorter by a third.  The energy stays a minimum over the rotations, and its
quadratic part is the Laplacian, whatever the cells,

    E(x) = min_R  tr(x^T C x) - 2 sum_i tr(R_i S_i) + tr(X^T C X),     S = P^k K x,     X at rest

    sum_i tr(R_i S_i) = sum_j x_j . l_j,       l = K^T P^kT R

so half the gradient is C x - l.  Far from the vertices that move, all cells are rigid, and have no
energy: `CellEnergy.near` leaves their triangles out.

The bi-Laplacian of the detail (5), whose factor takes ten times as long, is not needed.

Source
------
O. Sorkine, M. Alexa, "As-rigid-as-possible surface modeling", SGP 2007.  I. Chao, U. Pinkall,
P. Sanan, P. Schroeder, "A simple geometric model for elastic deformations", SIGGRAPH 2010.
Z. Levi, C. Gotsman, "Smooth rotation enhanced as-rigid-as-possible mesh animation", IEEE TVCG
21(2), 2015: rotations of neighbours compared with each other, which takes many more iterations.
"""

from __future__ import annotations

import math
from copy import copy
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import IntrinsicTriangulation, area_gradients, closest_rotations
from ..kernels import compiled_kernels, in_parallel, inputs
from ..mesh import Mesh

_CELL = 0.1  # k t, relative to the vertices per cage vertex
_WALK, _ROUNDS = 0.75, 85  # t and k, at most; of more than some 100,000 vertices cells are smaller
_TIMES = 20  # a cell takes as long as the volume of so many faces
_PIECE = 8_000  # cells to a task
_MOST = 0.7  # share of the triangles up to which it pays to leave out the others


class CellEnergy:
    """E(x) of the triangles of a mesh, or of some of them.

    Made by `CellEnergy.of`.

    Parameters
    ----------
    rest : (n, 3) float
        All vertices at rest.
    faces : (m, 3) int
        Triangles of the intrinsic triangulation.
    cotangents : (m, 3) float
        Of their corners.
    gradients : (m, 3, 3) float
        See `geometry.area_gradients`.
    graph : (n, n) sparse
        With an entry for each pair of neighbours in the mesh.
    order : (n,) int
        The vertices in an order in which neighbours are near each other.
    rounds, share : int, float
        k and t.
    """

    def __init__(
        self,
        rest: FloatArray,
        faces: IntArray,
        cotangents: FloatArray,
        gradients: FloatArray,
        graph: sparse.csr_array,
        order: IntArray,
        rounds: int,
        share: float,
    ) -> None:
        self._given = rest, faces, cotangents, gradients, graph, order
        self._rounds, self._share = rounds, share
        inside = np.zeros(len(rest), dtype=bool)
        inside[faces] = True
        self._own = order[inside[order]]  # its vertices, in the order of all rows below
        number = np.zeros(len(rest), dtype=np.int64)
        number[self._own] = np.arange(len(self._own))
        n, corners = len(self._own), number[faces]
        i, j = np.repeat(corners, 3, axis=1).ravel(), np.tile(corners, 3).ravel()
        thirds = np.repeat(gradients[:, None] / 3.0, 3, axis=1).reshape(-1, 3)
        columns = [_local_laplacians(cotangents).ravel(), *thirds.T]
        entries = [sparse.coo_array((each, (i, j)), (n, n)).tocsr() for each in columns]
        self._starts, self._at = entries[0].indptr, entries[0].indices
        self._weights = np.stack([each.data for each in entries], axis=1)  # C_ij, k_ij
        numbers = np.arange(len(self._at))
        back = sparse.csr_array((numbers, self._at, self._starts), (n, n)).T.tocsr()
        self._transposed = self._weights[back.data, 1:]  # k_ji
        self._graph = graph[self._own][:, self._own]
        self._shares = 1.0 / np.maximum(np.diff(self._graph.indptr), 1)
        x = rest[self._own] - rest[self._own].mean(axis=0)
        self.constant = float(np.vdot(x, entries[0] @ x))
        self._rooms: tuple[FloatArray, ...] | None = None

    @classmethod
    def of(
        cls, mesh: Mesh, per_cage: float = 0.0, stiffness: FloatArray | None = None
    ) -> CellEnergy:
        """Return the energy of *mesh*, with so many vertices *per_cage* vertex.

        On its intrinsic triangulation, whose triangles have the *stiffness* (n,) of their corners.
        """
        surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
        cotangents, gradients = surface.cotangents, area_gradients(surface)
        if stiffness is not None:
            factors = stiffness[surface.faces].mean(axis=1)
            cotangents = cotangents * factors[:, None]
            gradients = gradients * factors[:, None, None]
        given = mesh.vertices, surface.faces, cotangents, gradients
        order = reverse_cuthill_mckee(mesh.adjacency, symmetric_mode=True).astype(np.int64)
        walk = _CELL * per_cage
        rounds = min(math.ceil(walk / _WALK), _ROUNDS)
        share = min(walk / max(rounds, 1), _WALK)
        return cls(*given, mesh.adjacency, order, rounds, share)

    def near(self, moving: BoolArray) -> CellEnergy:
        """Return the energy near the vertices that are *moving* (n,), for one thread.

        It changes by the same amount, and has the same gradient at these vertices.
        """
        rest, faces, cotangents, gradients, graph, order = self._given
        near = moving.astype(float)
        for _ in range(2 * self._rounds + 2):  # with all cells that affect the forces there
            near = np.minimum(near + graph @ near, 1.0)
        some: BoolArray = np.asarray((near > 0.0)[faces].all(axis=1))
        if not 0 < np.count_nonzero(some) <= _MOST * len(some):
            own = copy(self)
            own._rooms = None
            return own
        chosen = faces[some], cotangents[some], gradients[some]
        return CellEnergy(rest, *chosen, graph, order, self._rounds, self._share)

    @property
    def laplacian(self) -> sparse.csr_array:
        """C, (n, n), of these triangles."""
        n = len(self._given[0])
        rows = np.repeat(self._own, np.diff(self._starts))
        return sparse.coo_array((self._weights[:, 0], (rows, self._own[self._at])), (n, n)).tocsr()

    def value_and_slope(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return E at *x* (n, 3), and half its gradient (n, 3)."""
        terms, forces = self._terms_and_forces(np.take(x, self._own, axis=0))
        slope = np.zeros_like(x)
        slope[self._own] = forces
        return float(terms.sum()) + self.constant, slope

    def _terms_and_forces(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x . (C x - 2 l) and C x - l of the a vertices at *x*, (a,) and (a, 3)."""
        if kernels := compiled_kernels(_TIMES * len(x)):
            return self._compiled_terms_and_forces(kernels, x)
        n, ones = len(x), np.ones(len(x))
        laplacian, *fans = (self._matrix(column) for column in self._weights.T)
        sums = np.stack([fan @ x for fan in fans], axis=1).reshape(n, 9)
        sums = self._spread(sums, self._shares, ones)
        cells = closest_rotations(sums.reshape(n, 3, 3)).reshape(n, 9)
        cells = self._spread(cells, ones, self._shares)
        fans = [self._matrix(column) for column in self._transposed.T]
        turned = cells.reshape(n, 3, 3)
        load = np.asarray(sum(fan @ turned[:, :, axis] for axis, fan in enumerate(fans)))
        forces = laplacian @ x - load
        return np.einsum("ij,ij->i", x, forces - load), forces

    def _spread(self, values: FloatArray, given: FloatArray, taken: FloatArray) -> FloatArray:
        """Return v after k rounds of (1 - t) v_i + t taken_i sum of given_j v_j, j beside i."""
        graph = sparse.csr_array(
            (np.ones(len(self._graph.indices)), self._graph.indices, self._graph.indptr),
            self._graph.shape,
        )
        for _ in range(self._rounds):
            joined = graph @ (given[:, None] * values)
            values = (1.0 - self._share) * values + self._share * taken[:, None] * joined
        return values

    def _compiled_terms_and_forces(
        self, kernels: Any, x: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        n = len(x)
        if self._rooms is None:  # of large arrays, new pages take as long as all of this
            self._rooms = np.empty((2, n, 9)), np.empty((n, 3)), np.empty(n)
        (cells, other), forces, terms = self._rooms
        (x,) = inputs(x)
        links = inputs(self._starts, self._at)
        graph = inputs(self._graph.indptr, self._graph.indices)
        degrees, ones = inputs(self._shares, np.ones(n))

        def run(kernel: Any, *given: Any) -> None:
            in_parallel(partial(kernel, *given), n, _PIECE)

        def spread(given: FloatArray, taken: FloatArray) -> None:
            nonlocal cells, other
            for _ in range(self._rounds):
                run(kernels.spread_cells, other, *inputs(cells), *graph, given, taken, self._share)
                cells, other = other, cells

        def turn(start: int, stop: int) -> None:
            some = cells[start:stop].reshape(-1, 3, 3)
            kernels.rotations(*inputs(some), other[start:stop].reshape(-1, 3, 3))

        run(kernels.cell_sums, cells, forces, x, *links, *inputs(self._weights))
        spread(degrees, ones)
        in_parallel(turn, n, _PIECE)
        cells, other = other, cells
        spread(ones, degrees)
        turned, transposed = inputs(cells, self._transposed)
        run(kernels.cell_forces, forces, terms, x, turned, *links, transposed)
        return terms, forces

    def _matrix(self, entries: FloatArray) -> sparse.csr_array:
        n = len(self._own)
        return sparse.csr_array((entries, self._at, self._starts), (n, n))


def _local_laplacians(cotangents: FloatArray) -> FloatArray:
    """Return the part of C of each triangle, (m, 3, 3)."""
    half = 0.5 * cotangents
    local = np.empty((len(half), 3, 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        local[:, a, a] = half[:, b] + half[:, c]
        local[:, b, c] = local[:, c, b] = -half[:, a]
    return local
