"""
With and without the volume constraint
======================================

Figure 7 of the paper: without the constraint, a bar that is bent by 120 degrees loses a quarter of
its volume.

    python examples/with_and_without_volume.py FOLDER

writes pictures.
"""

import sys
from pathlib import Path

import numpy as np

import vtk_segdeform as sd

mesh = sd.models.bar(size=(0.2, 0.2, 1.0), divisions=(8, 8, 40))
height = mesh.vertices[:, 2]
foot, tip = np.flatnonzero(height < 0.05), np.flatnonzero(height > 0.95)
regions = sd.segment(mesh, n_regions=3)
cages = sd.fit_cages(mesh, regions, n_vertices=155)

angle, pivot = np.radians(120), [0.0, 0.0, 0.4]
turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
targets = (mesh.vertices[tip] - pivot) @ turn.T + pivot

changes = {}
for preserve in (True, False):
    deformer = sd.Deformer(mesh, regions, cages, fixed=foot, handle=tip, preserve_volume=preserve)
    solution = deformer.solve(targets)
    changes[preserve] = solution.volume_change
    name = "with" if preserve else "without"
    print(f"{name} the constraint: relative volume change {solution.volume_change:+.1e}")
    if len(sys.argv) > 1:
        from vtk_segdeform.pictures import picture_before_after

        path = Path(sys.argv[1]) / f"{name}-the-constraint.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        picture_before_after(path, mesh, solution.vertices, fixed=foot, handle=tip)
