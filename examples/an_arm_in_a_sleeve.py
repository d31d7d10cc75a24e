"""
An arm in a sleeve
==================

Components without fixed vertices and handles follow what they lie against, are around or inside
of: here a sleeve and a bead on it follow an arm, which alone is bent. ``attach`` says otherwise.

    python examples/an_arm_in_a_sleeve.py FOLDER

writes a picture.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

import vtk_segdeform as sd

# The sleeve: a closed profile, swept around the arm.
inner, outer, around = 0.23, 0.27, np.linspace(0, 2 * np.pi, 40, endpoint=False)
up = np.linspace(0.4, 1.2, 25)
radius = np.concatenate([np.full(25, outer), np.full(25, inner)])
heights = np.concatenate([up, up[::-1]])
rings = np.stack([np.outer(radius, np.cos(around)), np.outer(radius, np.sin(around))], axis=2)
rings = np.dstack([rings, np.repeat(heights[:, None], 40, axis=1)])
number = np.arange(rings.shape[0] * 40).reshape(-1, 40)
a, b = number, np.roll(number, -1, axis=1)
c, d = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
sleeve = np.concatenate([np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)])

arm = sd.models.bar(size=(0.3, 0.3, 1.6), divisions=(8, 8, 40))
bead = sd.models.sphere(200, radius=0.06)
pieces = [
    (arm.vertices - arm.vertices.mean(axis=0) + [0.0, 0.0, 0.8], arm.faces),
    (rings.reshape(-1, 3), sleeve.reshape(-1, 3)),
    (bead.vertices + [outer + 0.065, 0.0, 0.9], bead.faces),
]
starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
mesh = sd.Mesh(
    np.concatenate([vertices for vertices, _ in pieces]),
    np.concatenate([faces + start for (_, faces), start in zip(pieces, starts, strict=False)]),
)

height, is_arm = mesh.vertices[:, 2], mesh.components == 0
foot, hand = np.flatnonzero(is_arm & (height < 0.15)), np.flatnonzero(is_arm & (height > 1.45))
angle, pivot = np.radians(60), [0.0, 0.0, 0.8]
turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
targets = (mesh.vertices[hand] - pivot) @ turn.T + pivot

solutions = {}
for name, attach in (("follow", {}), ("free", {1: "free", 2: "free"})):
    solution = solutions[name] = sd.deform(mesh, foot, hand, targets, attach=attach)
    moved = np.linalg.norm(solution.vertices - mesh.vertices, axis=1)
    print(f"{name}: the sleeve moves by up to {moved[mesh.components == 1].max():.2f}", end=", ")
    print(f"{len(solution.crossings())} faces cross, volume change {solution.volume_change:+.0e}")
    if len(sys.argv) > 1:
        path = Path(sys.argv[1]) / f"sleeve-{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        plotter = pv.Plotter(off_screen=True, window_size=(360, 480))
        plotter.set_background("white")
        shown = pv.PolyData.from_regular_faces(solution.vertices, mesh.faces)
        owner = mesh.components[mesh.faces[:, 0]]
        for component, color in enumerate(("#f0d9b5", "#3d6b8f", "#d55e00")):
            part = shown.extract_cells(np.flatnonzero(owner == component))
            plotter.add_mesh(part, color=color, show_edges=True, edge_opacity=0.3)
        plotter.view_vector((0.2, -1.0, 0.25), viewup=(0, 0, 1))
        plotter.screenshot(path)
        plotter.close()
