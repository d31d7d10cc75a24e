"""A large mesh in motion: some 12,000 of its vertices in their exact places, and faces between.

The decimated mesh is that of segmentation and binding, so it usually exists already.  Otherwise
another thread computes it, and until then there is none.  Its normals are those of the mesh.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform import sizes
from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.geometry import VertexNormals, decimated
from vtk_segdeform.io import polydata_of
from vtk_segdeform.mesh import Mesh

Decimated = tuple[Mesh, IntArray, IntArray]
"""As `decimated` returns it."""
_PATIENCE = 0.01  # seconds until it is clear that the decimated mesh does not exist yet
_pool = ThreadPoolExecutor(1)
_made: WeakKeyDictionary[Mesh, Future[Decimated]] = WeakKeyDictionary()


def decimated_soon(mesh: Mesh) -> Decimated | None:
    """Return the decimated *mesh*, which another thread makes; None if it is not finished yet."""
    future = _made.get(mesh)
    if future is None:
        future = _made[mesh] = _pool.submit(decimated, mesh, sizes.DECIMATED_POINTS)
        wait([future], _PATIENCE)
    return future.result() if future.done() else None


class DecimatedSurface:
    """The decimated mesh as an actor; invisible at first."""

    def __init__(self, mesh: Mesh, found: Decimated, surface: Any) -> None:
        coarse, self._kept, _ = found
        self._normals_of = VertexNormals(mesh).subset(self._kept)
        faces, x, normals = coarse.faces, mesh.vertices[self._kept], self._normals_of(mesh.vertices)
        # Clusters may fold a face over, which light would show as a black dot.
        a, b, c = (x[corner] for corner in faces.T)
        folded = (np.cross(b - a, c - a) * normals[faces].sum(axis=1)).sum(axis=1) < 0.0
        faces = np.where(folded[:, None], faces[:, ::-1], faces)
        self._polydata = polydata_of(x, np.full(len(faces), 3), faces.ravel())
        self._points: NDArray[np.float64] = vtk_to_numpy(self._polydata.GetPoints().GetData())
        self._normals = np.array(normals, dtype=np.float32)
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
        self._points[:] = x[self._kept]
        self._normals[:] = self._normals_of(x)
        self._polydata.GetPoints().GetData().Modified()
        self._polydata.GetPoints().Modified()
        self._normal_array.Modified()

    def set_colours(self, colours: NDArray[np.uint8] | None) -> None:
        """Set the colours (n, 3) of the vertices of the mesh, or none."""
        self._mapper.SetScalarVisibility(colours is not None)
        if colours is not None:
            array = numpy_to_vtk(colours[self._kept], deep=True)
            array.SetName("colours")
            self._polydata.GetPointData().SetScalars(array)
