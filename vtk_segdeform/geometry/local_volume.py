"""Local volume change: where the body under the skin has swollen or been pinched.

The largest ball inside the body that touches the skin at vertex i touches it at another vertex
o(i) as well, on the other side.  The tetrahedra from the triangles around i to o(i) are the flesh
under i, and their volume is

    L_i(x) = sum_{T = (a, b, c) at i} det(x_a - x_o, x_b - x_o, x_c - x_o) / 18
           = sum_{T at i} (x_a - x_o) . N_T / 18,        N_T = (x_b - x_a) x (x_c - x_a)

(a third of each tetrahedron: a triangle has three corners).  The local volume change is

    s_i(x) = sum_j k_ij L_j(x) / sum_j k_ij L_j(rest) - 1

with k a smoothing over the surface about a quarter as wide as the body is thick, which calms
o(i) at edges and in creases.  It is signed and relative: +0.1 has swollen by a tenth.  Being a
quotient of determinants it is 0 under any rigid motion, and det(M) - 1 everywhere under any
affine map M; at a vertex whose flesh turns inside-out it is below -1.

Source
------
The pairs i, o(i): J. Ma, S. W. Bae, S. Choi, "3D medial axis point approximation using nearest
neighbors and the normal field", The Visual Computer 28, 2012 (shrinking balls).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from .. import sizes
from ..arrays import FloatArray, IntArray, as_points
from ..kernels import in_parallel
from ..mesh import Mesh, require_mesh
from .thinning import cells as cells_of
from .thinning import faces_between, unique_edges
from .volume import corner_and_edges, volume_gradient

_MOST_SHRINKS = 30
_NARROWEST = np.cos(np.radians(40.0))  # a ball touching under a smaller angle sees its own skin
_WIDTH = 0.25  # of the median ball's diameter
_MOST_ROUNDS = 100
_REACH = 1.6  # distances of neighbouring cells
_AT_ONCE = 1 << 15  # vertices
_LEAST = 0.05  # share of the mean flesh under which a quotient is not trusted


class LocalVolume:
    """The local volume of a mesh at rest; `change` compares a pose with it.

    Parameters
    ----------
    mesh : Mesh
        The rest shape, n vertices.  Of a large one it is the change of some thousand cells of
        neighbouring vertices, each as one point at their mean, spread over the vertices again.
    """

    def __init__(self, mesh: Mesh) -> None:
        require_mesh(mesh)
        self._shape = mesh.vertices.shape
        points, faces = mesh.vertices, mesh.faces
        self._means: sparse.csr_array | None = None
        self._spread: list[sparse.csr_array] = []
        if mesh.n_vertices > sizes.LOCAL_VOLUME_CELLS:
            _, cells = cells_of(mesh, sizes.LOCAL_VOLUME_POINTS, np.random.default_rng(0))
            between = faces_between(cells, faces)
            if len(between):  # none is left of a heap of crumbs, which have no cells to spare
                self._means, faces = _means(cells), between
                points = self._means @ points
                self._spread = _spread(mesh.vertices, cells, points, _edges(faces, len(points)))
        self._flesh = _Flesh(points, faces)
        self._rest = self._flesh.smoothed(points)
        floor = _LEAST * np.abs(self._rest).mean()
        self._trusted = self._rest > floor

    def change(self, vertices: FloatArray) -> FloatArray:
        """Return s, (n,), of the pose *vertices* (n, 3): 0.1 where the body has swollen by 10 %.

        Vertices over (almost) no flesh at rest, on the rim of a thin plate say, get 0.
        """
        x = as_points(vertices, "vertices", self._shape[0])
        now = self._flesh.smoothed(x if self._means is None else self._means @ x)
        s = np.divide(now - self._rest, self._rest, where=self._trusted, out=np.zeros(len(now)))
        if self._means is None:
            return s
        out = np.empty(len(x))

        def work(first: int, last: int) -> None:
            for k, weights in enumerate(self._spread[first:last], first):
                out[k * _AT_ONCE : (k + 1) * _AT_ONCE] = weights @ s

        in_parallel(work, len(self._spread), 1)
        return out


class _Flesh:
    """L over a closed surface (k, 3), (m, 3), and what smoothes it."""

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        self._faces = faces
        self._opposite, diameter = _opposite_vertices(points, faces)
        n, m = len(points), len(faces)
        corners = faces.ravel(), np.repeat(np.arange(m), 3)
        self._around = sparse.coo_array((np.ones(3 * m), corners), (n, m)).tocsr()
        i, j = _edges(faces, n).T
        joined = sparse.coo_array((np.ones(len(i)), (i, j)), (n, n))
        ring = joined + joined.T + sparse.eye_array(n)
        self._average = (sparse.diags_array(1.0 / ring.sum(axis=1)) @ ring).tocsr()
        edge = float(np.median(np.linalg.norm(points[i] - points[j], axis=1)))
        rounds = (_WIDTH * float(np.median(diameter)) / edge) ** 2
        self._rounds = int(np.clip(round(rounds), 1, _MOST_ROUNDS))

    def smoothed(self, x: FloatArray) -> FloatArray:
        """Return sum_j k_ij L_j(x), (k,)."""
        x = x - x.mean(axis=0)
        a, e, f = corner_and_edges(x, self._faces)
        normals = np.cross(e, f)
        heights = np.einsum("ij,ij->i", a, normals)
        flesh = self._around @ np.column_stack([normals, heights])  # summed at each vertex
        apex = x[self._opposite]
        flesh = np.asarray(flesh[:, 3] - np.einsum("ij,ij->i", apex, flesh[:, :3])) / 18.0
        for _ in range(self._rounds):
            flesh = self._average @ flesh
        return np.asarray(flesh)


def local_volume_change(mesh: Mesh, vertices: FloatArray) -> FloatArray:
    """Return the local volume change (n,) of the pose *vertices* (n, 3) of *mesh*; see above.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    >>> mesh = Mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    >>> local_volume_change(mesh, corners * [1, 1, 1.1]).round(6)
    array([0.1, 0.1, 0.1, 0.1])
    """
    return LocalVolume(mesh).change(vertices)


def _means(cells: IntArray) -> sparse.csr_array:
    """Return (k, n), from vertices to the means of their *cells* (n,)."""
    share = (1.0 / np.bincount(cells))[cells]
    return sparse.coo_array((share, (cells, np.arange(len(cells))))).tocsr()


def _spread(
    x: FloatArray, cells: IntArray, points: FloatArray, edges: IntArray
) -> list[sparse.csr_array]:
    """Return (n, k), from cells at *points* (k, 3) to vertices *x*, some rows at a time.

    Weights sum to one.  Each vertex takes part of the cells within reach that lie at most two
    away from its own along the surface, the nearer the more: so it is smooth, and stays on its
    side of a thin body.
    """
    i, j = edges.T
    reach = _REACH * float(np.median(np.linalg.norm(points[i] - points[j], axis=1)))
    joined = sparse.coo_array((np.ones(len(i)), (i, j)), (len(points), len(points)))
    once = (joined + joined.T + sparse.eye_array(len(points))).tocsr()
    twice = (once @ once).tocsr()
    parts = []
    for start in range(0, len(x), _AT_ONCE):
        own = cells[start : start + _AT_ONCE]
        candidates = twice[own]
        near = candidates.indices
        vertex = np.repeat(np.arange(len(own)), np.diff(candidates.indptr))
        away = np.square(x[start + vertex] - points[near]).sum(axis=1) / reach**2
        weight = (1.0 - away.clip(max=1.0)) ** 2 + 1e-9 * (near == own[vertex])
        weight /= np.bincount(vertex, weight)[vertex]
        some = sparse.csr_array((weight, near, candidates.indptr), candidates.shape)
        some.eliminate_zeros()
        parts.append(some)
    return parts


def _edges(faces: IntArray, n: int) -> IntArray:
    return unique_edges(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), n)


def _opposite_vertices(x: FloatArray, faces: IntArray) -> tuple[IntArray, FloatArray]:
    """Return o (n,) and the diameters (n,) of the inner balls that touch vertices i and o(i)."""
    inward = -volume_gradient(x, faces)
    length = np.linalg.norm(inward, axis=1, keepdims=True)
    inward = np.divide(inward, length, where=length > 0, out=np.zeros_like(inward))
    tree = cKDTree(x)
    radius = np.full(len(x), np.linalg.norm(np.ptp(x, axis=0)))
    opposite = np.asarray(tree.query(x + radius[:, None] * inward)[1], dtype=np.int64)
    active = np.arange(len(x))
    for _ in range(_MOST_SHRINKS):
        centre = x[active] + radius[active, None] * inward[active]
        distance, touched = (np.asarray(found) for found in tree.query(centre))
        chord = x[touched] - x[active]
        square = np.einsum("ij,ij->i", chord, chord)
        height = np.einsum("ij,ij->i", chord, inward[active])
        # The ball through x, tangent there, that reaches the touched vertex.
        smaller = np.divide(square, 2 * height, where=height > 0, out=np.full(len(active), np.inf))
        # Between the two touching points as seen from the new centre.
        spread = 1.0 - 0.5 * square / smaller**2
        keep = (distance < radius[active] * (1 - 1e-9)) & (smaller < radius[active])
        keep &= (touched != active) & (spread < _NARROWEST)
        active, touched, smaller = active[keep], touched[keep], smaller[keep]
        if not len(active):
            break
        radius[active], opposite[active] = smaller, touched
    return opposite, 2.0 * radius
