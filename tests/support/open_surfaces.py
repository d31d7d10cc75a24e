"""Surfaces with borders, seams and other faults that need not be repaired before bending."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from solids import icosphere

from vtk_segdeform import Surface
from vtk_segdeform.mesh import Workaround


def polydata(points, triangles) -> pv.PolyData:
    """Return triangles as a PolyData."""
    return pv.PolyData.from_regular_faces(np.asarray(points, dtype=float), np.asarray(triangles))


def bottle(n_holes: int = 12, level: int = 4, radius: float = 0.22) -> pv.PolyData:
    """Return an elongated ball with round holes, spread evenly."""
    points, faces = icosphere(level)
    k = np.arange(n_holes)
    height, turn = 1.0 - (2.0 * k + 1.0) / n_holes, np.pi * (3.0 - np.sqrt(5.0)) * k
    wide = np.sqrt(1.0 - height**2)
    spots = np.stack([wide * np.cos(turn), wide * np.sin(turn), height], axis=1)
    centres = points[faces].mean(axis=1)
    near = np.linalg.norm(centres[:, None] - spots, axis=2) < radius
    kept = faces[~near.any(axis=1)]
    used, kept = np.unique(kept, return_inverse=True)
    return polydata(points[used] * [1.0, 1.0, 1.6], kept.reshape(-1, 3))


def sheet(n: int = 20) -> pv.PolyData:
    """Return a square of 2 n^2 triangles in the plane z = 0."""
    plane = pv.Plane(i_size=2.0, j_size=2.0, i_resolution=n, j_resolution=n).triangulate()
    plane.clear_data()
    return plane


def split_at_seam(level: int = 3) -> pv.PolyData:
    """Return a ball of two halves with doubled points between them."""
    points, faces = icosphere(level)
    upper = points[faces].mean(axis=1)[:, 2] > 0.0
    halves = np.where(upper[:, None], faces, faces + len(points))
    used, halves = np.unique(halves, return_inverse=True)
    return polydata(np.concatenate([points, points])[used], halves.reshape(-1, 3))


class Told(Surface):
    """A surface with one more workaround: a sentence and the given points concerned."""

    def __init__(self, given: pv.PolyData, text: str, points: np.ndarray) -> None:
        super().__init__(given)
        self._told = Workaround(text, points)

    @property
    def workarounds(self) -> tuple[Workaround, ...]:
        return (*super().workarounds, self._told)


def seam() -> Told:
    """Return a ball of two halves whose doubled points are said to be welded."""
    given = split_at_seam()
    surface = Surface(given)
    count = np.bincount(surface.vertex_of)
    points = np.flatnonzero(count[surface.vertex_of] > 1)
    return Told(given, f"welded {len(points)} seam points", points)
