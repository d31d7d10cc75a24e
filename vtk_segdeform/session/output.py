"""A session's surface in its pose as PolyData and as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..arrays import FloatArray
from ..importing import imported
from ..mesh import Mesh

if TYPE_CHECKING:
    import pyvista as pv

    from ..io import Surface


def deformed(mesh: Mesh, surface: Surface | None, vertices: FloatArray) -> pv.PolyData:
    """Return *surface*, or else *mesh*, with its mesh at *vertices* (n, 3)."""
    if surface is not None:
        return surface.moved(vertices)
    imported("vtk_segdeform.io")  # imports pyvista
    from ..io import to_polydata

    return to_polydata(mesh.with_vertices(vertices))


def write_deformed(
    path: str | Path, mesh: Mesh, surface: Surface | None, vertices: FloatArray
) -> None:
    """Write `deformed` to a mesh file, as `write_mesh` does."""
    imported("vtk_segdeform.io")  # imports pyvista
    from ..io import write_mesh

    if surface is not None:
        surface.write(path, vertices)
    else:
        write_mesh(path, mesh.with_vertices(vertices))
