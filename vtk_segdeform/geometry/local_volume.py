"""Local volume change: expansion and compression of the body below each vertex.

The largest ball inside the body that touches the surface at vertex i also touches it at another
vertex o(i), on the opposite side.  A body is a component with its cavities; another component that
reaches into it, such as a hat, does not count.  The tetrahedra from the triangles around i to o(i)
have the volume

    L_i(x) = sum_{T = (a, b, c) at i} det(x_a - x_o, x_b - x_o, x_c - x_o) / 18
           = sum_{T at i} (x_a - x_o) . N_T / 18,        N_T = (x_b - x_a) x (x_c - x_a)

(a third of each tetrahedron, since a triangle has three corners).  The local volume change is

    s_i(x) = sum_j k_ij L_j(x) / sum_j k_ij L_j(rest) - 1

with k a smoothing over the surface about a quarter as wide as the body is thick, because o(i)
varies irregularly at edges and in creases.  s is signed and relative: +0.1 is an expansion by 10 %.
A part of the mesh that encloses nothing, such as an open sheet (`lids`), has no local volume, and
s is 0 there.  As a quotient of determinants s is 0 under any rigid motion, and det(M) - 1 under any
affine map M; it is below -1 where the tetrahedra are inverted.

Source
------
The pairs i, o(i): J. Ma, S. W. Bae, S. Choi, "3D medial axis point approximation using nearest
neighbors and the normal field", The Visual Computer 28, 2012 (shrinking balls).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .. import sizes
from ..arrays import BoolArray, FloatArray, IntArray, as_points
from ..kernels import ROWS_AT_ONCE, in_parallel, nearest
from ..mesh import Mesh, cross_rows, require_mesh
from .lids import lids_of
from .sampling import faces_between, unique_edges, voronoi_cells
from .volume import corner_and_edges, outer_components, volume_gradient

_MOST_COSINE = np.cos(np.radians(40.0))  # at a smaller angle both points are on one side


class LocalVolume:
    """Local volume of a mesh at rest; `change` compares a pose with it.

    Parameters
    ----------
    mesh : Mesh
        The rest shape, n vertices.  For a large mesh the change is computed at the means of some
        thousand cells of neighbouring vertices and interpolated to the vertices.
    """

    _means: sparse.csr_array | None
    _interpolation: list[sparse.csr_array]

    def __init__(self, mesh: Mesh) -> None:
        require_mesh(mesh)
        self._shape = mesh.vertices.shape
        encloses = lids_of(mesh).encloses
        self._inside: IntArray | None = None
        if not encloses.all():
            mesh, self._inside = _part(mesh, encloses[mesh.components])
        self._means, self._interpolation = None, []
        if not encloses.any():
            return
        points, faces = mesh.vertices, mesh.faces
        if mesh.n_vertices > sizes.LOCAL_VOLUME_CELLS:
            _, cells = voronoi_cells(mesh, sizes.LOCAL_VOLUME_POINTS, np.random.default_rng(0))
            between = faces_between(cells, faces)
            if len(between):  # none is left if every component is smaller than a cell
                self._means, faces = _means(cells), between
                points = self._means @ points
                self._interpolation = _interpolation(
                    mesh.vertices, cells, points, _edges(faces, len(points))
                )
        self._volumes = _Volumes(points, faces)
        self._rest = self._volumes.smoothed(points)
        self._reliable = self._rest > 0.05 * np.abs(self._rest).mean()

    @property
    def is_defined(self) -> bool:
        """Whether any part of the mesh encloses a volume; else s is 0 everywhere."""
        return self._inside is None or bool(len(self._inside))

    def change(self, vertices: FloatArray) -> FloatArray:
        """Return s, (n,), of the pose *vertices* (n, 3): 0.1 where the body expanded by 10 %.

        It is 0 at vertices with almost no volume at rest, such as on the rim of a thin plate, and
        on open sheets.
        """
        x = as_points(vertices, "vertices", self._shape[0])
        if self._inside is None:
            return self._change(x)
        out = np.zeros(len(x))
        if len(self._inside):
            out[self._inside] = self._change(x[self._inside])
        return out

    def _relative(self, points: FloatArray) -> FloatArray:
        now = self._volumes.smoothed(points)
        return np.divide(now - self._rest, self._rest, where=self._reliable, out=np.zeros(len(now)))

    def _change(self, x: FloatArray) -> FloatArray:
        s = self._relative(x if self._means is None else self._means @ x)
        if self._means is None:
            return s
        out = np.empty(len(x))

        def work(first: int, last: int) -> None:
            for k, weights in enumerate(self._interpolation[first:last], first):
                out[k * ROWS_AT_ONCE : (k + 1) * ROWS_AT_ONCE] = weights @ s

        in_parallel(work, len(self._interpolation), 1)
        return out


class _Volumes:
    """The smoothed volumes L over a surface, *points* (k, 3) and *faces* (m, 3)."""

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        self._faces = faces
        _, self._opposite, diameter = inner_balls(points, faces)
        n, m = len(points), len(faces)
        corners = faces.ravel(), np.repeat(np.arange(m), 3)
        self._around = sparse.coo_array((np.ones(3 * m), corners), (n, m)).tocsr()
        i, j = _edges(faces, n).T
        joined = sparse.coo_array((np.ones(len(i)), (i, j)), (n, n))
        ring = joined + joined.T + sparse.eye_array(n)
        self._average = (sparse.diags_array(1.0 / ring.sum(axis=1)) @ ring).tocsr()
        edge = float(np.median(np.linalg.norm(points[i] - points[j], axis=1)))
        rounds = (0.25 * float(np.median(diameter)) / edge) ** 2
        self._rounds = int(np.clip(round(rounds), 1, 100))

    def smoothed(self, x: FloatArray) -> FloatArray:
        """Return sum_j k_ij L_j(x), (k,)."""
        x = x - x.mean(axis=0)
        a, e, f = corner_and_edges(x, self._faces)
        normals = cross_rows(e, f)
        heights = np.einsum("ij,ij->i", a, normals)
        sums = self._around @ np.column_stack([normals, heights])  # over the faces at a vertex
        apex = x[self._opposite]
        volumes = np.asarray(sums[:, 3] - np.einsum("ij,ij->i", apex, sums[:, :3])) / 18.0
        for _ in range(self._rounds):
            volumes = np.asarray(self._average @ volumes)
        return np.asarray(volumes)


def local_volume_change(mesh: Mesh, vertices: FloatArray) -> FloatArray:
    """Return the local volume change of the pose *vertices* (n, 3) of *mesh*, (n,).

    +0.1 is an expansion by 10 %, -0.1 a compression; see `LocalVolume` for many poses.

    Examples
    --------
    >>> import numpy as np
    >>> corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    >>> mesh = Mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    >>> local_volume_change(mesh, corners * [1, 1, 1.1]).round(6)
    array([0.1, 0.1, 0.1, 0.1])
    """
    return LocalVolume(mesh).change(vertices)


def _part(mesh: Mesh, inside: BoolArray) -> tuple[Mesh, IntArray]:
    """Return the components of *mesh* whose vertices are *inside* (n,), and their vertices (k,).

    If there are none, the mesh is returned as it is.
    """
    ids = np.flatnonzero(inside)
    if not len(ids):
        return mesh, ids
    place = np.cumsum(inside) - 1
    return Mesh(mesh.vertices[ids], place[mesh.faces[inside[mesh.faces[:, 0]]]]), ids


def _means(cells: IntArray) -> sparse.csr_array:
    """Return the matrix from vertices to the means of their *cells* (n,), (k, n)."""
    share = (1.0 / np.bincount(cells))[cells]
    return sparse.coo_array((share, (cells, np.arange(len(cells))))).tocsr()


def _interpolation(
    x: FloatArray, cells: IntArray, points: FloatArray, edges: IntArray
) -> list[sparse.csr_array]:
    """Return the matrix from cells at *points* (k, 3) to vertices *x*, (n, k), in blocks of rows.

    Rows sum to 1.  A vertex interpolates the cells within reach that are at most two cells away
    along the surface, with weights that decrease with distance: the result is smooth, and not
    mixed between the two sides of a thin body.
    """
    i, j = edges.T
    reach = 1.6 * float(np.median(np.linalg.norm(points[i] - points[j], axis=1)))
    joined = sparse.coo_array((np.ones(len(i)), (i, j)), (len(points), len(points)))
    once = (joined + joined.T + sparse.eye_array(len(points))).tocsr()
    twice = (once @ once).tocsr()
    parts = []
    for start in range(0, len(x), ROWS_AT_ONCE):
        own = cells[start : start + ROWS_AT_ONCE]
        candidates = twice[own]
        near = candidates.indices
        vertex = np.repeat(np.arange(len(own)), np.diff(candidates.indptr))
        distance2 = np.square(x[start + vertex] - points[near]).sum(axis=1) / reach**2
        weight = (1.0 - distance2.clip(max=1.0)) ** 2 + 1e-9 * (near == own[vertex])
        weight /= np.bincount(vertex, weight)[vertex]
        some = sparse.csr_array((weight, near, candidates.indptr), candidates.shape)
        some.eliminate_zeros()
        parts.append(some)
    return parts


def _edges(faces: IntArray, n: int) -> IntArray:
    return unique_edges(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), n)


def inner_balls(x: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return the inward normals (n, 3), o (n,) and the diameters (n,) of the inner balls.

    They are the largest balls inside each body that touch vertices i and o(i).
    """
    inward = -volume_gradient(x, faces)
    length = np.linalg.norm(inward, axis=1, keepdims=True)
    inward = np.divide(inward, length, where=length > 0, out=np.zeros_like(inward))
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    away = 4.0 * size * _bodies(x, faces)  # a fourth coordinate keeps searches in one body
    tree = cKDTree(np.hstack([x, away]))
    radius = np.full(len(x), size)
    active = opposite = np.arange(len(x))
    for turn in range(30):
        centre = x[active] + radius[active, None] * inward[active]
        places = np.hstack([centre, away[active]])
        distances, indices = nearest(tree, places)
        distance, touched = distances[:, 0], indices[:, 0]
        if not turn:
            opposite = touched
        chord = x[touched] - x[active]
        square = np.einsum("ij,ij->i", chord, chord)
        height = np.einsum("ij,ij->i", chord, inward[active])
        # The ball that is tangent at x and passes through the touched vertex.
        smaller = np.divide(square, 2 * height, where=height > 0, out=np.full(len(active), np.inf))
        # Cosine between the two touching points as seen from the new centre.
        spread = 1.0 - 0.5 * square / smaller**2
        keep = (distance < radius[active] * (1 - 1e-9)) & (smaller < radius[active])
        keep &= (touched != active) & (spread < _MOST_COSINE)
        active, touched, smaller = active[keep], touched[keep], smaller[keep]
        if not len(active):
            break
        radius[active], opposite[active] = smaller, touched
    return inward, opposite, 2.0 * radius


def _bodies(x: FloatArray, faces: IntArray) -> IntArray:
    """Return the number of the body of each vertex, (n, 1), or (n, 0) if there is only one."""
    links = np.ones(2 * len(faces)), faces[:, [0, 1, 1, 2]].reshape(-1, 2).T
    graph = sparse.coo_array(links, (len(x), len(x)))
    count, component = connected_components(graph, directed=False)
    a, e, f = corner_and_edges(x - x.mean(axis=0), faces)
    determinants = np.einsum("ij,ij->i", a, cross_rows(e, f))
    volumes = np.bincount(component[faces[:, 0]], determinants, count).astype(np.float64)
    bodies = outer_components(x, component.astype(np.int64), volumes)[component]
    return bodies[:, None] if bodies.any() else np.empty((len(x), 0), dtype=np.int64)
