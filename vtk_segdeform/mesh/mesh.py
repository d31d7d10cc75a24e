"""`Mesh`: an oriented triangle mesh, closed or with borders.

The paper deforms closed two-manifolds (section 3.2).  A `Mesh` may also have borders, and edges
with three or more faces.  The *boundary* of its faces, the sum of their directed edges, is empty
exactly if the mesh encloses a volume; otherwise lids over it can (`geometry`).

`Mesh` rejects everything that a flip or a removal of faces would correct; `find_faults` lists such
faults, `repair` corrects them in the mesh, and `Surface` deforms any polygons without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from ..arrays import FloatArray, IntArray, as_ids, as_points, bounds_of, frozen
from ..checks import Described, require, shown
from ..errors import ArgumentError, MeshError
from ..freezing import Frozen, read_only
from ..kernels import in_parallel
from .edges import components, edge_keys
from .faults import Search, as_soup, find_faults
from .grouping import begins
from .loops import loops_of
from .topology import HalfEdges
from .triangles import corner_columns, cross, norm

_PIECE = 20_000  # faces per task; their data fit into the cache
_OF_VTK = {"vtkPolyData", "vtkUnstructuredGrid", "vtkMultiBlockDataSet"}
_BITS = 32  # of the second vertex in the number of an edge


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Mesh(Described, Frozen):
    """An oriented triangle mesh, closed or with borders; immutable.

    Parameters
    ----------
    vertices : (n, 3) float
        In any length unit.
    faces : (m, 3) int
        Counter-clockwise seen from outside.  Every vertex is in a face.

    Raises
    ------
    ValueError
        If an array has the wrong shape or type.
    MeshError
        If the mesh has faults, such as neighbouring faces of opposite orientation; the message
        counts each.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> mesh.n_faces, len(mesh.edges), mesh.components, mesh.is_closed
    (4, 6, array([0, 0, 0, 0]), True)
    >>> Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2]]).borders
    (array([2, 1, 3]),)
    >>> Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    Traceback (most recent call last):
    ...
    vtk_segdeform.errors.MeshError: not an oriented mesh: 3 inconsistently oriented edges
    (0-2, 0-3, 2-3); see find_faults, repair and Surface
    """

    vertices: FloatArray
    faces: IntArray

    def __init__(self, vertices: ArrayLike, faces: ArrayLike | None = None) -> None:
        if faces is None:
            line = _made_with(vertices)
            got = shown(vertices)
            raise ArgumentError(
                f"vertices must be points (n, 3), followed by faces (m, 3); got {got}. {line}"
            )
        self._set(Search(*as_soup(vertices, faces)))

    @classmethod
    def of(cls, search: Search) -> Mesh:
        """Return the mesh of the triangles of a *search*, if it finds no faults."""
        mesh = object.__new__(cls)
        mesh._set(require(search, Search, "search"))
        return mesh

    def _set(self, search: Search) -> None:
        if search.faults:
            faults = ", ".join(map(str, search.faults))
            raise MeshError(f"not an oriented mesh: {faults}; see find_faults, repair and Surface")
        self.__setstate__({"vertices": search.points.copy(), "faces": search.triangles.copy()})
        self.__dict__["is_two_manifold"] = search.is_two_manifold
        self.__dict__["boundary"] = read_only(search.half_edges.net_boundary)
        if search.n_components == 1:
            self.__dict__["components"] = read_only(np.zeros(self.n_vertices, dtype=np.int64))

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        size = " x ".join(f"{length:.3g}" for length in np.ptp(self.bounds, axis=0))
        borders = "none" if self.is_closed else f"{len(self.borders):,}"
        return {
            "vertices": f"{self.n_vertices:,}",
            "faces": f"{self.n_faces:,}",
            "borders": borders,
            "size": size,
        }

    @property
    def n_vertices(self) -> int:
        """Number of vertices, n."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles, m."""
        return len(self.faces)

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box diagonal, the reference length of tolerances."""
        low, high = self.bounds
        return float(np.linalg.norm(high - low))

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) float: the smallest and the largest coordinates."""
        return read_only(bounds_of(self.vertices))

    @property
    def is_closed(self) -> bool:
        """Whether the faces enclose a volume: every edge has as many of them on both sides."""
        return not len(self.boundary)

    @cached_property
    def is_two_manifold(self) -> bool:
        """Whether the mesh is a closed two-manifold."""
        return find_faults(self.vertices, self.faces).is_two_manifold

    @cached_property
    def boundary(self) -> IntArray:
        """(b, 2) int: the boundary of the faces: directed edges that have no opposite.

        An edge with k more faces in one direction occurs k times.  Every vertex has as many edges
        that begin there as end there.
        """
        return read_only(HalfEdges(self.faces, self.n_vertices).net_boundary)

    @cached_property
    def borders(self) -> tuple[IntArray, ...]:
        """The boundary as loops: the vertices (k,) of each, in order, faces on the left."""
        return read_only(tuple(loops_of(self.boundary)))

    @cached_property
    def edges(self) -> IntArray:
        """(e, 2) int: the edges, smaller vertex first, in lexicographic order."""
        # An edge that is not in the boundary has faces in both directions.
        (a, b, c), (one, other) = self.faces.T.copy(), self.boundary.T
        forth = [
            (tail[tail < head] << _BITS) + head[tail < head]
            for tail, head in ((a, b), (b, c), (c, a))
        ]
        keys = np.concatenate([*forth, edge_keys(one, other, 1 << _BITS)])
        keys.sort()
        keys = keys[begins(keys)]
        return read_only(np.stack([keys >> _BITS, keys & ((1 << _BITS) - 1)], axis=1))

    @cached_property
    def adjacency(self) -> sparse.csr_array:
        """(n, n) symmetric sparse: edge lengths between neighbouring vertices."""
        least = np.finfo(float).tiny  # csgraph reads a zero as "no edge"
        at = self._edge_numbers
        i, j = self.edges.T
        each = np.linalg.norm(self.vertices[i] - self.vertices[j], axis=1)
        length = np.maximum(each, least)[at.data - 1]
        lengths = sparse.csr_array((length, at.indices, at.indptr), at.shape)
        for array in (lengths.data, lengths.indices, lengths.indptr):
            frozen(array)
        return lengths

    @cached_property
    def _edge_numbers(self) -> sparse.csr_array:
        """(n, n) symmetric sparse: 1 + the edge index between neighbouring vertices."""
        i, j = self.edges.T
        numbers = np.arange(1, len(i) + 1, dtype=np.int32)
        # In this order the neighbours of each vertex are sorted already.
        ends = np.concatenate([j, i], dtype=np.int32), np.concatenate([i, j], dtype=np.int32)
        both = np.concatenate([numbers, numbers]), ends
        return sparse.coo_array(both, shape=(self.n_vertices,) * 2).tocsr()

    @cached_property
    def components(self) -> IntArray:
        """(n,) int: the connected component of each vertex, numbered from 0."""
        return read_only(components(self.n_vertices, self.faces))

    @cached_property
    def face_areas(self) -> FloatArray:
        """(m,) float: areas of the triangles."""
        areas = np.empty(self.n_faces)

        def work(start: int, stop: int) -> None:
            a, b, c = corner_columns(self.vertices, self.faces[start:stop])
            areas[start:stop] = 0.5 * norm(cross(b - a, c - a))

        in_parallel(work, self.n_faces, _PIECE, blas=False)
        frozen(areas)
        return areas

    @cached_property
    def vertex_areas(self) -> FloatArray:
        """(n,) float: a third of the area of the triangles at each vertex."""
        thirds, n = self.face_areas / 3.0, self.n_vertices
        a, b, c = (np.bincount(corner, thirds, n) for corner in self.faces.T)
        areas = np.asarray(a + b + c, dtype=np.float64)
        frozen(areas)
        return areas

    def of_components(self, which: ArrayLike) -> tuple[Mesh, IntArray]:
        """Return the mesh of some components, and its vertices (k,) in this one.

        *which* are their numbers, or a mask (c,); at least one.
        """
        count = int(self.components.max()) + 1
        chosen = np.zeros(count, dtype=bool)
        chosen[as_ids(which, count, "which")] = True
        if not chosen.any():
            raise MeshError("which is empty; a mesh has at least one component")
        kept = chosen[self.components]
        number = np.cumsum(kept) - 1
        part = object.__new__(Mesh)
        faces = number[self.faces[kept[self.faces[:, 0]]]]
        part.__setstate__({"vertices": self.vertices[kept], "faces": faces})
        part.__dict__["boundary"] = read_only(number[self.boundary[kept[self.boundary[:, 0]]]])
        return part, np.flatnonzero(kept)

    def with_vertices(self, vertices: ArrayLike) -> Mesh:
        """Return a mesh with the same triangles and other positions (n, 3).

        The positions must be finite; a pose may intersect or invert itself.
        """
        points = as_points(vertices, "vertices", self.n_vertices)
        posed = object.__new__(Mesh)
        posed.__setstate__({"vertices": points.copy(), "faces": self.faces})
        # The same for every pose: pass on the cached values.
        for name in (
            "is_two_manifold",
            "boundary",
            "borders",
            "edges",
            "components",
            "_edge_numbers",
        ):
            if name in self.__dict__:
                posed.__dict__[name] = self.__dict__[name]
        return posed


def require_mesh(mesh: object) -> None:
    """Raise a MeshError that says how to make a `Mesh` unless *mesh* is one."""
    if not isinstance(mesh, Mesh):
        kind = type(mesh).__name__
        if kind == Mesh.__name__:
            kind = f"{type(mesh).__module__.partition('.')[0]}.{kind}"
        raise MeshError(f"mesh must be a Mesh; got {kind}. {_made_with(mesh)}")


def _made_with(mesh: object) -> str:
    line = conversion_of(mesh) or "Mesh(vertices, faces), read_mesh(path) or Surface(polydata)"
    return f"Make one with {line}.mesh"


def conversion_of(mesh: object) -> str:
    """Return the line that makes a `Surface` of a *mesh* of another library; "" if none does.

    Its class is recognised by name, so that no library is imported.

    >>> class Trimesh:
    ...     __module__ = "trimesh.base"
    >>> conversion_of(Trimesh())
    'Surface(mesh)'
    """
    classes = type(mesh).__mro__
    kinds = {each.__name__ for each in classes}
    full = {f"{str(each.__module__).partition('.')[0]}.{each.__name__}" for each in classes}
    if kinds & _OF_VTK or full & {"trimesh.Trimesh", "meshio.Mesh"}:
        return "Surface(mesh)"
    if "vtkDataSet" in kinds:
        return "Surface(pyvista.wrap(mesh).extract_surface(algorithm=None))"
    return "Surface(mesh.to_mesh())" if "trimesh.Scene" in full else ""
