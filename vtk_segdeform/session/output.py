"""A session's surface in its pose as PolyData and as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import FloatArray
from ..checks import as_text
from ..geometry import local_volume_change
from ..importing import imported
from ..mesh import Mesh
from .state import State

if TYPE_CHECKING:
    import pyvista as pv

    from ..io import Surface


def deformed(
    mesh: Mesh, surface: Surface | None, vertices: FloatArray, displacement: str | None = None
) -> pv.PolyData:
    """Return *surface*, or else *mesh*, with its mesh at *vertices* (n, 3).

    *displacement* is the name of a point array to add.
    """
    if surface is not None:
        return surface.moved(vertices, displacement=displacement)
    imported("vtk_segdeform.io")  # imports pyvista
    from ..io import to_polydata

    moved = to_polydata(mesh.with_vertices(vertices))
    if displacement is not None:
        moved.point_data[as_text(displacement, "displacement")] = vertices - mesh.vertices
    return moved


def write_deformed(
    path: str | Path,
    mesh: Mesh,
    surface: Surface | None,
    vertices: FloatArray,
    *,
    displacement: str | None,
) -> None:
    """Write `deformed` to a mesh file, as `write_mesh` does."""
    imported("vtk_segdeform.io")  # imports pyvista
    from ..io import write_mesh

    write_mesh(path, deformed(mesh, surface, vertices, displacement))


def layers(
    mesh: Mesh, surface: Surface | None, state: State, vertices: FloatArray
) -> dict[str, pv.PolyData]:
    """Return the surface and its cages as PolyData, in the pose of *state*, at *vertices* (n, 3).

    "mesh" is `deformed` with vertices of handles selected, as the array "selection", and the region
    of each vertex as "quality", unless it has a quality.  "local volume change" is the same surface
    with that as its quality, if there is a pose.  "cage 1", "cage 2" ... follow.
    """
    imported("vtk_segdeform.io")  # imports pyvista
    from ..io import polydata_of

    def at_points(values: Any) -> Any:
        return values if surface is None else surface.at_points(values)

    own = deformed(mesh, surface, vertices).copy(deep=False)
    found = {"mesh": own}
    if state.handles:
        selection = np.zeros(mesh.n_vertices, dtype=np.uint8)
        selection[state.handle] = 1
        own.point_data["selection"] = at_points(selection)
    if state.regions is not None and "quality" not in own.point_data:
        own.point_data["quality"] = at_points(state.regions.labels.astype(np.float64))
    if state.pose is not None:
        change = deformed(mesh, surface, vertices).copy(deep=False)
        change.clear_data()
        change.point_data["quality"] = at_points(local_volume_change(mesh, vertices))
        found["local volume change"] = change
    for k, (cage, places) in enumerate(zip(state.cages, state.cage_vertices, strict=True), 1):
        counts = np.full(cage.n_faces, 3)
        found[f"cage {k}"] = polydata_of(places, counts, cage.faces.ravel())
    return found
