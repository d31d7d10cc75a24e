"""What a frame costs after the pose is known: normals by VTK, and drawing off the screen."""

from __future__ import annotations

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersCore import vtkTriangleMeshPointNormals
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow

from ..arrays import FloatArray
from ..canvas import require_offscreen
from ..formats.polygons import polydata_of
from ..mesh import Mesh
from .measuring import median_seconds

_SIZE = (800, 600)  # pixels


def drawing_seconds(mesh: Mesh, pose: FloatArray, repeats: int) -> tuple[float, float]:
    """Return the seconds for the normals of *pose* (n, 3), and for drawing it with new normals.

    Raises
    ------
    MissingDependencyError
        If nothing can be rendered here.
    """
    require_offscreen()
    surface = polydata_of(pose.copy(), np.full(mesh.n_faces, 3), mesh.faces.ravel())
    points = vtk_to_numpy(surface.GetPoints().GetData())
    normals = vtkTriangleMeshPointNormals()
    normals.SetInputData(surface)

    def shade() -> None:
        points[:] = pose
        surface.GetPoints().Modified()
        normals.Update()

    shading = median_seconds(shade, repeats)
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(normals.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    renderer = vtkRenderer()
    renderer.AddActor(actor)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetSize(*_SIZE)
    window.AddRenderer(renderer)

    def draw() -> None:
        shade()
        window.Render()

    try:
        return shading, max(median_seconds(draw, repeats) - shading, 0.0)
    finally:
        window.Finalize()
