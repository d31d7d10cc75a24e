"""A slender round bar that can be wound up, and the measure of its twist."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.mesh import Mesh

SIDES, RINGS, HEIGHT = 10, 31, 9.0


def bar() -> Mesh:
    """Return a round bar along z, of SIDES vertices in each of RINGS rings."""
    i, k = np.arange(SIDES), np.arange(RINGS - 1)[:, None] * SIDES
    angle = 2.0 * np.pi * i / SIDES
    ring = 0.5 * np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1)
    x = (ring + np.linspace(0.0, HEIGHT, RINGS)[:, None, None] * [0.0, 0.0, 1.0]).reshape(-1, 3)
    a, b = (k + i).ravel(), (k + (i + 1) % SIDES).ravel()
    sides = [np.stack([a, b, b + SIDES], axis=1), np.stack([a, b + SIDES, a + SIDES], axis=1)]
    fan = np.stack([np.zeros(SIDES - 2, dtype=int), i[1:-1], i[2:]], axis=1)
    return Mesh(x, np.concatenate([*sides, fan[:, ::-1], fan + SIDES * (RINGS - 1)]))


BAR = bar()


def twist(x: np.ndarray) -> np.ndarray:
    """Return the angle about z in which each ring is turned, in degrees, without jumps."""
    rest, now = (each.reshape(RINGS, SIDES, 3) for each in (BAR.vertices, x))
    now = now - now.mean(axis=1, keepdims=True)
    along, across = (rest * now)[..., :2].sum(axis=(1, 2)), np.cross(rest, now)[..., 2].sum(axis=1)
    return np.degrees(np.unwrap(np.arctan2(across, along)))
