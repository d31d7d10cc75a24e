"""
Carry a grid
============

A grid of hexahedra inside the cactus moves with the surface.

    python examples/carry_a_grid.py FOLDER

writes both grids and a picture of them.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from vtk_segdeform.io import to_polydata

mesh = sd.models.cactus(3000)
surface, height = to_polydata(mesh), mesh.vertices[:, 2]
lattice = pv.ImageData(dimensions=(37, 13, 43), spacing=(0.025, 0.025, 0.025))
lattice.origin = np.array(surface.center) - lattice.center
grid = lattice.cast_to_structured_grid().cast_to_unstructured_grid()
is_inside = grid.select_interior_points(surface)["selected_points"].astype(bool)
grid = grid.extract_cells(is_inside[grid.cells_dict[pv.CellType.HEXAHEDRON]].all(axis=1))

regions = sd.segment(mesh, n_regions=3)
cages = sd.fit_cages(mesh, regions)
foot, tip = np.flatnonzero(height < 0.1), np.flatnonzero(height > 0.9)
deformer = sd.Deformer(mesh, regions, cages, fixed=foot, handle=tip)
pivot = np.array([0.0, 0.0, 0.4])
turn = Rotation.from_euler("y", 40, degrees=True)
solution = deformer.solve(turn.apply(mesh.vertices[tip] - pivot) + pivot)

bent = grid.copy()
bent.points = deformer.carry(grid.points)

sizes = bent.compute_cell_sizes()["Volume"] / grid.compute_cell_sizes()["Volume"]
print(f"{grid.n_cells} hexahedra; smallest volume ratio {sizes.min():.2f}")
if len(sys.argv) > 1:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    grid.save(folder / "grid.vtu")
    bent.save(folder / "bent.vtu")
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), border=False, window_size=(1200, 700))
    plotter.set_background("white")
    for panel, shown in enumerate((grid, bent)):
        plotter.subplot(0, panel)
        plotter.add_mesh(shown, color="aliceblue", show_edges=True)
    plotter.link_views()
    plotter.camera_position = [(0.9, -2.9, 1.1), (0.15, 0.0, 0.45), (0.0, 0.0, 1.0)]
    plotter.camera.zoom(1.3)
    plotter.screenshot(folder / "grids.png")
    plotter.close()
