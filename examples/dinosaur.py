"""
Dinosaur
========

Figure 8 of the paper: two handles in one solve. The head goes down and the tail up, the feet are
fixed, and the volume is preserved.

    python examples/dinosaur.py FOLDER

writes pictures.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd

mesh = sd.models.dinosaur(4000)
x, _, height = mesh.vertices.T
feet = np.flatnonzero(height < 0.12)
head = np.flatnonzero((x > 0.6) & (height > 0.8))
tail = np.flatnonzero(x < -0.95)


def rotated(vertices, axis, degrees, pivot):
    """Return some vertices, rotated about an axis through *pivot*."""
    turn = Rotation.from_euler(axis, degrees, degrees=True)
    return turn.apply(mesh.vertices[vertices] - pivot) + pivot


session = sd.Session(mesh)
session.segment(6)
session.change_options(n_cage_vertices=240)
session.fit_cages()
session.set_fixed(feet)
session.handles.add(head, "head")
session.handles.add(tail, "tail")
solution = session.drag(
    {
        "head": rotated(head, "y", 60, [0.4, 0.0, 0.55]),
        "tail": rotated(tail, "y", 40, [-0.5, 0.0, 0.4]),
    }
)
session.commit("graze")

print(f"{session.regions.n_regions} regions, {solution.steps} steps: {solution.status}")
print(f"volume change: {session.volume_change:.0e}")
if len(sys.argv) > 1:
    from vtk_segdeform.pictures import picture_before_after, picture_regions_and_cages

    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    regions, both = session.regions, np.concatenate([head, tail])
    picture_regions_and_cages(
        folder / "dinosaur-cages.png", mesh, regions.membership, session.cages
    )
    picture_before_after(folder / "dinosaur.png", mesh, session.vertices, fixed=feet, handle=both)
