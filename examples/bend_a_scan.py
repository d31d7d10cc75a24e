"""
Bend a scan with holes
======================

A surface as scanners and modellers write them: quads, with a seam of doubled points where its
texture begins and ends, open at both ends, with holes. It is bent as it is; the result has the same
points, cells and arrays, and the volume under lids over the holes is preserved.

    python examples/bend_a_scan.py FOLDER

writes both surfaces and a picture.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import vtk_segdeform as sd

# A tube of 32 by 60 quads. Its first and last column of points are at the same places.
u, v = np.meshgrid(np.linspace(0, 1, 33), np.linspace(0, 1, 61))
angle = 2 * np.pi * (u % 1.0)
radius = 0.3 + 0.03 * np.cos(12 * np.pi * v)
grid = pv.StructuredGrid(radius * np.cos(angle), -radius * np.sin(angle), 3.0 * v)
scan = grid.extract_surface(algorithm=None, pass_pointid=False, pass_cellid=False)
scan.active_texture_coordinates = np.stack([u.T.ravel(), v.T.ravel()], axis=1)
scan.point_data["temperature"] = 20.0 + scan.points[:, 2]
for place in ([0.0, -0.3, 2.2], [-0.2, -0.2, 1.0]):
    centres = scan.cell_centers().points
    scan = scan.remove_cells(np.linalg.norm(centres - place, axis=1) < 0.17)

surface = sd.Surface(scan)
for workaround in surface.workarounds:
    print(workaround)

height = scan.points[:, 2]
foot, tip = np.flatnonzero(height < 0.2), np.flatnonzero(height > 2.8)
angle, pivot = np.radians(60), [0.0, 0.0, 1.5]
turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
vertices, targets = surface.targets_at(tip, (scan.points[tip] - pivot) @ turn.T + pivot)

solution = sd.deform(surface.mesh, surface.vertices_at(foot), vertices, targets)
bent = surface.moved(solution.vertices)
print(f"relative volume change under lids {solution.volume_change:+.1e}")
print(f"{bent.n_points} points, {bent.n_cells} cells, arrays {', '.join(bent.point_data.keys())}")

if len(sys.argv) > 1:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    scan.save(folder / "scan.vtp")
    bent.save(folder / "bent.vtp")
    plotter = pv.Plotter(shape=(1, 2), off_screen=True, border=False, window_size=(720, 480))
    plotter.set_background("white", all_renderers=True)
    for column, shown in enumerate((scan, bent)):
        plotter.subplot(0, column)
        plotter.add_mesh(
            shown, color="#f0d9b5", show_edges=True, backface_params={"color": "#3d6b8f"}
        )
    plotter.link_views()
    plotter.camera_position = [(-1.4, -6.0, 3.2), (0.35, 0.0, 1.45), (0.0, 0.0, 1.0)]
    plotter.screenshot(folder / "scan-and-bent.png")
    plotter.close()
