"""
Editor in a plotter
===================

The editor in a PyVista plotter, next to other meshes. Here a program uses its session, and the
editor shows the result.

    python examples/editor_in_a_plotter.py show

opens the window for you instead.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import vtk_segdeform as sd
from vtk_segdeform.io import to_polydata
from vtk_segdeform.widgets import Mode

show = sys.argv[1:] == ["show"]
mesh = to_polydata(sd.models.cactus(1500))
height = mesh.points[:, 2]

plotter = pv.Plotter(off_screen=not show, window_size=(800, 600))
plotter.add_mesh(mesh)  # the editor hides this actor and draws the mesh itself
plotter.add_mesh(pv.Plane(i_size=1.2, j_size=1.2), color="wheat")
editor = plotter.segdeform.edit(mesh)
session = editor.session
session.set_fixed(height < 0.08)
session.handles.add(height > 0.92, "tip")
plotter.camera_position = "xz"
plotter.camera.zoom(1.4)
plotter.show(interactive=show, auto_close=False)  # with "show", until the window is closed

if not show:
    session.segment(3)
    session.fit_cages()
    editor.mode = Mode.DEFORM
    session.drag({"tip": session.vertices[session.handles["tip"]] + [0.3, 0.0, -0.1]})
    session.commit()
    if len(sys.argv) > 1:
        Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
        plotter.screenshot(f"{sys.argv[1]}/editor.png")

moved = np.linalg.norm(session.vertices - session.mesh.vertices, axis=1).max()
print(f"largest displacement: {moved:.2f}, volume change: {session.volume_change:.0e}")
plotter.close()
