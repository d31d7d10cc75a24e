"""
A figure that keeps its balance
===============================

A dinosaur bends far to one side.  It would fall over, but for two more constraints: the centroid of
what is enclosed stays above its feet, and the area of its skin grows by 2 % at most.
"""

import numpy as np

import vtk_segdeform as sd

mesh = sd.models.dinosaur(4000)
x, size = mesh.vertices, mesh.diagonal
feet = np.flatnonzero(x[:, 2] < x[:, 2].min() + 0.02 * size)
head = np.flatnonzero(x[:, 2] > x[:, 2].max() - 0.06 * size)
targets = x[head] + size * np.array([0.0, 0.3, -0.08])

# %%
# A coordinate of the centroid is kept by its name, as a volume is, and the area has a bound.

plain = sd.deform(mesh, feet, head, targets)
goals = {"whole": "keep", "centroid x": "keep", "centroid y": "keep", "area": "at most 102%"}
balanced = sd.deform(mesh, feet, head, targets, volumes=goals)

# %%
# All hold to rounding error, as the volume does.


def centroid(vertices: np.ndarray) -> np.ndarray:
    """Return the centroid of what is enclosed."""
    corners = vertices[mesh.faces]
    volumes = np.einsum("ti,ti->t", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2])
    return volumes @ corners.mean(axis=1) * 0.75 / volumes.sum()


def area(vertices: np.ndarray) -> float:
    """Return the area of the surface."""
    a, b, c = np.swapaxes(vertices[mesh.faces], 0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


for name, pose in (("without", plain), ("with", balanced)):
    aside = (centroid(pose.vertices) - centroid(x))[:2] / size
    grown = area(pose.vertices) / area(x) - 1.0
    print(
        f"{name}: centroid aside by {np.linalg.norm(aside):.1e} diagonals, area {grown:+.2%}, "
        f"volume {pose.volume_change:+.0e}, handle off by {pose.handle_error:.0e}"
    )
