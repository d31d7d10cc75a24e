"""
A pull
======

One call pulls the arm of a cactus outward. The arm follows, the rest stays, and the volume is
preserved exactly.
"""

import numpy as np

import vtk_segdeform as sd

mesh = sd.models.cactus()
tip = int(np.argmax(mesh.vertices[:, 0]))  # the outermost point
to = mesh.vertices[tip] + [0.1, 0.0, 0.1]

solution = sd.pull(mesh, tip, to)

moved = np.linalg.norm(solution.vertices - mesh.vertices, axis=1)
print(f"volume change: {solution.volume_change:.0e}")
print(f"vertices that moved by 1 % of the diagonal: {np.mean(moved > 0.01 * mesh.diagonal):.0%}")
