"""A large mesh in motion: some 18,000 of its vertices in their exact places, and faces between.

Each of them stands for the part of the surface that is nearest to it: a Voronoi cell along edges.
Such cells are even, so that hardly a face between three of them is thin or folded over.  Normals
and colours are means over the cell: those of one vertex would spread its noise, or its speck of a
pattern, over the whole of it.

Another thread computes the cells, and until then there are none.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform import sizes
from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.geometry import VertexNormals, decimated, faces_between, voronoi_cells
from vtk_segdeform.io import polydata_of
from vtk_segdeform.mesh import Mesh

_Made = TypeVar("_Made")
_PATIENCE = 0.01  # seconds until it is clear that something does not exist yet
_MOST = 8  # vertices of a cell for its mean: the noise of a single one is a third
_pool = ThreadPoolExecutor(1)


class _Soon(Generic[_Made]):
    """What another thread makes of a mesh, once: called, None as long as it is not finished."""

    def __init__(self, make: Callable[[Mesh], _Made]) -> None:
        self._make = make
        self._made: WeakKeyDictionary[Mesh, Future[_Made]] = WeakKeyDictionary()

    def __call__(self, mesh: Mesh) -> _Made | None:
        future = self._made.get(mesh)
        if future is None:
            future = self._made[mesh] = _pool.submit(self._make, mesh)
            wait([future], _PATIENCE)
        return future.result() if future.done() else None


class Cells:
    """The cells of *mesh*.

    Attributes
    ----------
    centres : (k,) int
        The vertices that are drawn.
    sampled : (s,) int
        Vertices for the means, a few of each cell.
    mean : (k, s) sparse
        Maps their values to the means of cells.
    faces : (m, 3) int
        Triangles between centres, with the orientation of the mesh.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.centres, cell = voronoi_cells(mesh, sizes.DRAFT_POINTS, np.random.default_rng(0))
        order, size = np.argsort(cell, kind="stable"), np.bincount(cell)
        rank = np.arange(len(order)) - np.repeat(np.cumsum(size) - size, size)
        self.sampled = order[rank % np.repeat(-(-size // _MOST), size) == 0]
        row = cell[self.sampled]
        shares = (1.0 / np.bincount(row)[row]).astype(np.float32)
        self.mean = sparse.coo_array((shares, (row, np.arange(len(row))))).tocsr()
        # A face may be folded over all the same, which light would show as a dark speck.
        faces, x = faces_between(cell, mesh.faces), mesh.vertices
        normals = self.mean @ VertexNormals(mesh).of(x)[self.sampled]
        a, b, c = x[self.centres][faces.T]
        folded = (np.cross(b - a, c - a) * normals[faces].sum(axis=1)).sum(axis=1) < 0.0
        self.faces = np.where(folded[:, None], faces[:, ::-1], faces)


decimated_soon = _Soon(lambda mesh: decimated(mesh, sizes.DECIMATED_POINTS))
"""The decimated mesh of segmentation and binding, which usually exists already."""
cells_soon = _Soon(Cells)


class DecimatedSurface:
    """The decimated mesh as an actor; invisible at first."""

    def __init__(self, mesh: Mesh, cells: Cells, surface: Any) -> None:
        self._cells, n_faces = cells, len(cells.faces)
        self._normals_of = VertexNormals(mesh).subset(cells.sampled)
        x = mesh.vertices[cells.centres]
        self._polydata = polydata_of(x, np.full(n_faces, 3), cells.faces.ravel())
        self._points: NDArray[np.float64] = vtk_to_numpy(self._polydata.GetPoints().GetData())
        self._normals = np.zeros(x.shape, dtype=np.float32)
        self._normal_array = numpy_to_vtk(self._normals)
        self._normal_array.SetName("Normals")
        self._polydata.GetPointData().SetNormals(self._normal_array)
        self._mapper = vtkPolyDataMapper()
        self._mapper.SetInputData(self._polydata)
        self._mapper.SetResolveCoincidentTopologyToPolygonOffset()
        self.actor = vtkActor()
        self.actor.SetMapper(self._mapper)
        self.actor.SetProperty(surface)
        self.actor.PickableOff()
        self.actor.VisibilityOff()
        self.set_colours(None)

    def update(self, x: FloatArray) -> None:
        """Show the pose *x* (n, 3)."""
        self._points[:] = x[self._cells.centres]
        normals = self._cells.mean @ self._normals_of(x)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        self._normals[:] = normals / np.where(length > 0.0, length, 1.0)
        self._polydata.GetPoints().GetData().Modified()
        self._polydata.GetPoints().Modified()
        self._normal_array.Modified()

    def set_colours(self, colours: NDArray[np.uint8] | None) -> None:
        """Set the colours (n, 3) of the vertices of the mesh, or none."""
        self._mapper.SetScalarVisibility(colours is not None)
        if colours is not None:
            means = self._cells.mean @ colours[self._cells.sampled].astype(np.float32)
            array = numpy_to_vtk(np.rint(means).astype(np.uint8), deep=True)
            array.SetName("colours")
            self._polydata.GetPointData().SetScalars(array)
