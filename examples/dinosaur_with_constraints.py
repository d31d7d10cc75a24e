"""
A rigid head, sliding feet, and symmetry
========================================

A dinosaur stretches its neck.  Its head is rigid, its feet slide on the ground, and what happens
on one side of its plane of symmetry is mirrored on the other side.
"""

import numpy as np

import vtk_segdeform as sd
from vtk_segdeform.geometry import rigid_fit

mesh = sd.models.dinosaur(4000)
x, size = mesh.vertices, mesh.diagonal
ground = x[:, 2].min()

# %%
# Stiffness is relative to that of other vertices, and infinite where the body is rigid.

snout = int(np.argmax(x[:, 0]))
head = np.linalg.norm(x - x[snout], axis=1) < 0.1 * size
stiffness = np.where(head, np.inf, 1.0)
feet = np.flatnonzero(x[:, 2] < ground + 0.02 * size)

solution = sd.pull(
    mesh,
    snout,
    x[snout] + size * np.array([0.1, 0.0, 0.05]),
    stiffness=stiffness,
    slides=[sd.Slide(feet, "plane", direction=(0, 0, 1))],
    radius=size,
    symmetry="y",
)

# %%
# A pull with such constraints ends with a finish, after which they hold to rounding error.

moved = solution.vertices
turn, shift = rigid_fit(x[head], moved[head])
off_rigid = np.abs(x[head] @ turn.T + shift - moved[head]).max() / size
off_ground = np.abs(moved[feet, 2] - x[feet, 2]).max() / size
along_ground = np.linalg.norm((moved - x)[feet], axis=1).max() / size
print(f"volume change: {solution.volume_change:.0e}")
print(f"head from rigid, in diagonals: {off_rigid:.0e}")
print(f"feet from the ground: {off_ground:.0e}")
print(f"feet along the ground: {along_ground:.0%}")
