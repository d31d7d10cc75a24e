"""
Editor driven by events
=======================

Mouse and key events take the editor from a bare mesh to a bent one: regions are segmented, cages
fitted, the foot and the tip selected by rectangles, and the tip is dragged and then rotated by the
ring of its gizmo.

    python examples/editor_by_itself.py FOLDER

writes pictures.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import vtk_segdeform as sd
from vtk_segdeform.widgets import DeformEditor

mesh = sd.models.cactus(5430 if len(sys.argv) > 1 else 1500)
plotter = pv.Plotter(off_screen=True, window_size=(1000, 700))
plotter.set_background("white")
editor = DeformEditor(plotter, mesh)
editor.On()
plotter.camera_position = [(0.4, -2.4, 0.85), (0.05, 0.0, 0.47), (0.0, 0.0, 1.0)]
plotter.show(interactive=False, auto_close=False)
session = editor.session


def send(name, place=(5, 300), key=None):
    """Send an event of VTK, as a device does, when no background work is running."""
    interactor = plotter.iren.interactor
    while editor.is_busy:
        interactor.InvokeEvent("TimerEvent")
    x, y = (round(float(pixel)) for pixel in place)
    interactor.SetEventInformation(x, y, 0, 0, "\0", 0, key)
    interactor.InvokeEvent(name)


def keys(*names):
    """Press keys, one after the other, and wait for the work that they start."""
    for name in names:
        send("KeyPressEvent", key=name)
    send("MouseMoveEvent")


def drag(places):
    """Press at the first pixel, release at the last."""
    places = list(places)
    send("MouseMoveEvent", places[0])
    send("LeftButtonPressEvent", places[0])
    for place in places[1:]:
        send("MouseMoveEvent", place)
    send("LeftButtonReleaseEvent", places[-1])
    for _ in range(80):  # time to converge
        send("TimerEvent", places[-1])


def around(vertices):
    """Return two corners of a rectangle around some vertices, in pixels."""
    pixels = editor.view.to_display(session.vertices[vertices])[:, :2]
    return pixels.min(axis=0) - 3.0, pixels.max(axis=0) + 3.0


def picture(name):
    """Save a screenshot, if a folder is given."""
    if len(sys.argv) > 1:
        Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
        plotter.screenshot(f"{sys.argv[1]}/{name}.png")


height = mesh.vertices[:, 2]
keys("g", "f", "2")
picture("editor-cages")
keys("3", "t", "v", "s")  # a rectangle with X-ray, for fixed vertices
drag(around(height < 0.08))
keys("d")  # for the handle
drag(around(height > 0.92))
keys("4", "o")

gizmo = editor.widgets.dragger.gizmo
(centre,) = editor.view.to_display(gizmo.centre[None])[:, :2]
drag(centre + t * np.array([170.0, -75.0]) for t in np.linspace(0.0, 1.0, 20))
(centre,) = editor.view.to_display(gizmo.centre[None])[:, :2]
radius = 1.15 * gizmo.radius / editor.view.pixel_at(gizmo.centre)
drag(centre + radius * np.array([np.cos(t), np.sin(t)]) for t in np.linspace(2.2, 1.0, 16))
picture("editor-volume")
keys("h")
picture("editor-help")

moved = np.linalg.norm(session.vertices - mesh.vertices, axis=1).max()
print(f"largest displacement: {moved:.2f}, volume change: {session.volume_change:.0e}")
plotter.close()
