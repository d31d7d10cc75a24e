"""The editor in a plotter of yours, beside whatever else is in it.

A recording works in it here instead of a person: keys and a drag, written down as `Recorder`
does.  Run it with the word "show" to work in it yourself.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import vtk_segdeform as sd
from vtk_segdeform.io.convert import to_polydata
from vtk_segdeform.widgets.recording.recording import replay

show = sys.argv[1:] == ["show"]
mesh = to_polydata(sd.models.cactus(1500))
height = mesh.points[:, 2]

plotter = pv.Plotter(off_screen=not show, window_size=(800, 600))
plotter.add_mesh(mesh)  # the editor draws it from now on
plotter.add_mesh(pv.Plane(i_size=1.2, j_size=1.2), color="wheat")
editor = plotter.segdeform.edit(mesh)
session = editor.session
session.set_fixed(height < 0.08)
session.add_handle(height > 0.92, "tip")
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
        "2.0 KeyPress 400 300 key=4",  # drag handles
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
print(f"moved by {moved:.2f}, volume changed by {session.volume_change:.0e} of itself")
plotter.close()
