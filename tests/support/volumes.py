"""Volume meshes made at run time: tapered bars of every kind of cell, and their bends."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from vtk_segdeform.arrays import FloatArray, IntArray

TYPES = {"tetra": 10, "hexahedron": 12, "wedge": 13, "pyramid": 14}
# The other kinds of cells that a hexahedron is divided into; "pyramid" adds its centre, 8.
PARTS = {
    "hexahedron": [(0, 1, 2, 3, 4, 5, 6, 7)],
    "wedge": [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)],
    "tetra": [
        (0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6),
    ],
    "pyramid": [
        (0, 1, 2, 3, 8), (4, 7, 6, 5, 8), (0, 4, 5, 1, 8), (1, 5, 6, 2, 8), (2, 6, 7, 3, 8),
        (3, 7, 4, 0, 8),
    ],
}  # fmt: skip


def bar(kind: str, across: int = 4, along: int = 14, taper: float = 0.3) -> pv.UnstructuredGrid:
    """Return a bar of cells, 1 by 1 by 4, that becomes thinner along z."""
    lattice = pv.ImageData(dimensions=(across + 1, across + 1, along + 1))
    lattice.spacing = (1.0 / across, 1.0 / across, 4.0 / along)
    blocks = lattice.cast_to_structured_grid().cast_to_unstructured_grid()
    points = np.array(blocks.points, dtype=float) - [0.5, 0.5, 0.0]
    points[:, :2] *= 1.0 - taper * points[:, 2:] / 4.0
    cells = np.asarray(blocks.cells_dict[12])
    if kind == "pyramid":
        middles = len(points) + np.arange(len(cells))
        points = np.concatenate([points, points[cells].mean(axis=1)])
        cells = np.concatenate([cells, middles[:, None]], axis=1)
    parts = np.concatenate([cells[:, part] for part in PARTS[kind]])
    grid = pv.UnstructuredGrid({TYPES[kind]: parts}, points)
    grid.cell_data["number"] = np.arange(grid.n_cells)
    grid.cell_data["fibre"] = np.tile([0.0, 0.0, 1.0], (grid.n_cells, 1))
    grid.point_data["height"] = points[:, 2].copy()
    return grid


def ends(points: FloatArray, degrees: float) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the fixed points and the handle of a `bar`, and where a bend takes the latter."""
    fixed, handle = np.flatnonzero(points[:, 2] < 0.3), np.flatnonzero(points[:, 2] > 3.7)
    turn, pivot = Rotation.from_euler("y", degrees, degrees=True), np.array([0.0, 0.0, 2.0])
    return fixed, handle, turn.apply(points[handle] - pivot) + pivot


def bent(grid: pv.UnstructuredGrid, degrees: float) -> tuple[sd.VolumeMesh, FloatArray]:
    """Return a bar as a `VolumeMesh`, and its surface bent (n, 3)."""
    volume = sd.VolumeMesh(grid)
    mesh = volume.surface.mesh
    return volume, sd.deform(mesh, *ends(mesh.vertices, degrees), n_regions=2).vertices
