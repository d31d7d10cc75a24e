"""A large mesh in motion: some 12,000 of its vertices in their exact places, and faces between.

The decimated mesh is that of segmentation and binding, so it usually exists already.  Otherwise
another thread computes it, and until then there is none.  Its normals are those of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform import sizes
from vtk_segdeform.arrays import FloatArray, IntArray
from vtk_segdeform.geometry import VertexNormals, decimated
from vtk_segdeform.io import polydata_of
from vtk_segdeform.mesh import Mesh

_PATIENCE = 0.01  # seconds until it is clear that the decimated mesh does not exist yet


@dataclass(frozen=True, eq=False)
class _Shape:
    """The vertices (k,) of a mesh that are drawn, faces between them, and their normals."""

    kept: IntArray
    faces: IntArray
    normals: FloatArray  # (k, 3), at rest
    normals_of: Callable[[FloatArray], FloatArray]  # in a pose (n, 3)

    @classmethod
    def of(cls, mesh: Mesh) -> _Shape:
        """Return the shape of a large *mesh*."""
        coarse, kept, _ = decimated(mesh, sizes.DECIMATED_POINTS)
        normals_of = VertexNormals(mesh).subset(kept)
        faces, x, normals = coarse.faces, mesh.vertices[kept], normals_of(mesh.vertices)
        # Clusters may fold a face over, which light would show as a black dot.
        a, b, c = (x[corner] for corner in faces.T)
        folded = (np.cross(b - a, c - a) * normals[faces].sum(axis=1)).sum(axis=1) < 0.0
        faces = np.where(folded[:, None], faces[:, ::-1], faces)
        return cls(kept, faces, normals, normals_of)


class DecimatedSurface:
    """The decimated mesh as an actor; invisible at first."""

    def __init__(self, mesh: Mesh, shape: _Shape, surface: Any) -> None:
        self._kept, self._normals_of = shape.kept, shape.normals_of
        corners = np.full(len(shape.faces), 3), shape.faces.ravel()
        self._polydata = polydata_of(mesh.vertices[self._kept], *corners)
        self._points: NDArray[np.float64] = vtk_to_numpy(self._polydata.GetPoints().GetData())
        self._normals = np.array(shape.normals, dtype=np.float32)
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


class Decimating:
    """Makes the `DecimatedSurface` of *mesh*, without waiting for it."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._thread: Thread | None = None
        self._shapes: list[_Shape] = []  # one, once the thread has made it

    def result(self, surface: Any) -> DecimatedSurface | None:
        """Return the surface; None if it is not finished yet."""
        if self._thread is None:
            self._thread = Thread(target=self._work, daemon=True)
            self._thread.start()
            self._thread.join(_PATIENCE)
        if self._thread.is_alive():
            return None
        if not self._shapes:
            self._work()  # and raise what it raised
        return DecimatedSurface(self._mesh, self._shapes[0], surface)

    def _work(self) -> None:
        self._shapes.append(_Shape.of(self._mesh))
