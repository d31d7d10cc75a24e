"""
Bend the cactus
===============

The top turns by 60 degrees. The ribs rotate with the surface, and the volume is preserved exactly.
"""

import numpy as np
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd

mesh = sd.models.cactus()
height = mesh.vertices[:, 2]
foot, tip = np.flatnonzero(height < 0.08), np.flatnonzero(height > 0.92)

regions = sd.segment(mesh, n_regions=3)  # the trunk and two arms, overlapping
cages = sd.fit_cages(mesh, regions, n_vertices=155)  # one coarse cage around each
deformer = sd.Deformer(mesh, regions, cages, fixed=foot, handle=tip)

turn, pivot = Rotation.from_euler("y", 60, degrees=True), [0.0, 0.0, 0.4]
solution = deformer.solve(turn.apply(mesh.vertices[tip] - pivot) + pivot)

print(f"volume change: {solution.volume_change:.0e}")
print(f"handle error: {solution.handle_error:.0e} of the diagonal")
print(f"{solution.steps} steps: {solution.status}")
