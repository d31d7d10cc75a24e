"""A grid of hexahedra inside the cactus rides along while its skin is bent.

Run it with a folder's name to have both grids written there.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from vtk_segdeform.io.convert import to_polydata

mesh = sd.models.cactus(3000)
skin, height = to_polydata(mesh), mesh.vertices[:, 2]
lattice = pv.ImageData(dimensions=(37, 13, 43), spacing=(0.025, 0.025, 0.025))
lattice.origin = np.array(skin.center) - lattice.center
grid = lattice.cast_to_structured_grid().cast_to_unstructured_grid()
is_inside = grid.select_interior_points(skin)["selected_points"].astype(bool)
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
print(f"{grid.n_cells} hexahedra, the most squeezed to {sizes.min():.2f} of itself")
if len(sys.argv) > 1:
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    grid.save(f"{sys.argv[1]}/grid.vtu")
    bent.save(f"{sys.argv[1]}/bent.vtu")
