"""Bodies with limbs whose mirror image in x = 0 is the body itself, to the last bit."""

from __future__ import annotations

import numpy as np
from solids import icosphere

from vtk_segdeform.mesh import Mesh

# Where limbs point, how long they are in radii of the trunk, and how slender.
_TORSO = [
    ((0.9, 0.1, 0.3), 1.1, 20.0),
    ((0.4, -0.1, -0.9), 0.9, 25.0),
    ((0.0, 0.2, 1.0), 0.6, 12.0),
]
_CRAB = [
    ((0.8, 0.6, 0.1), 1.0, 25.0),
    ((0.95, -0.3, 0.0), 0.8, 30.0),
    ((0.0, -1.0, 0.2), 0.5, 8.0),
]


def torso(level: int = 3) -> Mesh:
    """Return a trunk with arms, legs and a head."""
    return limbed(_TORSO, level)


def crab(level: int = 3) -> Mesh:
    """Return a flat body with claws, legs and a tail."""
    body = limbed(_CRAB, level)
    return body.with_vertices(body.vertices * [1.0, 1.0, 0.5])


def limbed(limbs, level: int) -> Mesh:
    """Return a sphere with bumps in the directions of *limbs* and their mirror images."""
    d, faces = icosphere(level)
    radius = np.ones(len(d))
    for towards, length, slender in limbs:
        c = np.array(towards) / np.linalg.norm(towards)
        both = (
            np.exp(slender * (np.einsum("ij,j->i", d, side) - 1.0)) for side in (c, c * [-1, 1, 1])
        )
        radius = radius + length * np.add(*both)
    return Mesh(radius[:, None] * d, faces)
