"""Time to render a pose: normals and off-screen drawing."""

from __future__ import annotations

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow

from ..arrays import FloatArray
from ..geometry import VertexNormals
from ..io import polydata_of
from ..mesh import Mesh
from ..pictures import require_offscreen
from .measuring import median_seconds

_SIZE = (800, 600)  # pixels


def drawing_seconds(mesh: Mesh, pose: FloatArray, repeats: int) -> tuple[float, float]:
    """Return the seconds to compute the normals of *pose* (n, 3), and to render it.

    Raises
    ------
    MissingDependencyError
        If off-screen rendering fails.
    """
    require_offscreen()
    surface = polydata_of(pose.copy(), np.full(mesh.n_faces, 3), mesh.faces.ravel())
    points = vtk_to_numpy(surface.GetPoints().GetData())
    maker = VertexNormals(mesh)
    normals = maker.of(pose)
    array = numpy_to_vtk(normals)
    surface.GetPointData().SetNormals(array)

    def shade() -> None:
        maker.of(pose, normals)

    shading = median_seconds(shade, repeats)
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(surface)
    actor = vtkActor()
    actor.SetMapper(mapper)
    renderer = vtkRenderer()
    renderer.AddActor(actor)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetSize(*_SIZE)
    window.AddRenderer(renderer)

    def draw() -> None:
        points[:] = pose
        for changed in (surface.GetPoints().GetData(), surface.GetPoints(), array):
            changed.Modified()
        window.Render()

    try:
        return shading, median_seconds(draw, repeats)
    finally:
        window.Finalize()
