"""
Bend a solid
============

A horn of hexahedra is bent by its tip. Its surface is solved as any other, the inside follows, and
fibres in its cells turn with it.

    python examples/bend_a_solid.py FOLDER

writes the bent grid and a picture of both, cut open.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd

# A square bar whose cross-sections become discs, thinner towards the tip.
lattice = pv.ImageData(dimensions=(11, 11, 41), spacing=(0.2, 0.2, 0.1), origin=(-1.0, -1.0, 0.0))
solid = lattice.cast_to_structured_grid().cast_to_unstructured_grid()
square, z = solid.points[:, :2], solid.points[:, 2:]
round_ = square * np.sqrt(1.0 - 0.5 * square[:, ::-1] ** 2)
solid.points = np.hstack([round_ * (0.6 - 0.1 * z), z])
solid.cell_data["fibre"] = np.tile([0.0, 0.0, 1.0], (solid.n_cells, 1))

height = solid.points[:, 2]
foot, tip = np.flatnonzero(height < 0.05), np.flatnonzero(height > 3.65)
pivot = np.array([0.0, 0.0, 2.0])
turn = Rotation.from_euler("y", 60, degrees=True)
targets = turn.apply(solid.points[tip] - pivot) + pivot

volume = sd.VolumeMesh(solid)
solution = sd.deform(solid, foot, tip, targets)
print(f"volume change {solution.volume_change:.0e}; {solution.inside.summary()}")
bent = volume.moved(solution.inside, turn=["fibre"], displacement="moved by")

if len(sys.argv) > 1:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    bent.save(folder / "bent.vtu")
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), border=False, window_size=(1200, 700))
    plotter.set_background("white")
    is_back = solid.cell_centers().points[:, 1] > 0.0
    for panel, grid in enumerate((solid, bent)):
        plotter.subplot(0, panel)
        plotter.add_mesh(grid.extract_cells(is_back), color="aliceblue", show_edges=True)
    plotter.link_views()
    plotter.camera_position = [(2.5, -8.0, 4.0), (0.5, 0.0, 1.9), (0.0, 0.0, 1.0)]
    plotter.screenshot(folder / "solids.png")
    plotter.close()
