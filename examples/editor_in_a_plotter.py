"""
Editor in a plotter
===================

The editor in a PyVista plotter, next to other meshes. A recording of keys and a drag works it here.

    python examples/editor_in_a_plotter.py show

opens the window for you instead.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import vtk_segdeform as sd
from vtk_segdeform.io import to_polydata
from vtk_segdeform.widgets import replay

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
    x, y, _ = editor.view.to_display(session.vertices[session.handles["tip"]].mean(axis=0)[None])[0]
    path = [f"MouseMove {x + dx:.0f} {y - dx / 3:.0f}" for dx in np.linspace(0.0, 100.0, 11)]
    recording = [
        "vtk_segdeform recording 1",
        "0.0 KeyPress 400 300 key=g",  # auto-segment
        "1.0 KeyPress 400 300 key=f",  # fit cages
        "2.0 KeyPress 400 300 key=4",  # deform
        f"3.0 {path[0]}",
        f"3.1 {path[0].replace('MouseMove', 'LeftButtonPress')}",
        *(f"3.{k + 10} {place}" for k, place in enumerate(path[1:])),
        f"4.0 {path[-1].replace('MouseMove', 'LeftButtonRelease')}",
    ]
    replay(plotter, recording, busy=lambda: editor.is_busy)
    if len(sys.argv) > 1:
        Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
        plotter.screenshot(f"{sys.argv[1]}/editor.png")

moved = np.linalg.norm(session.vertices - session.mesh.vertices, axis=1).max()
print(f"largest displacement: {moved:.2f}, volume change: {session.volume_change:.0e}")
plotter.close()
