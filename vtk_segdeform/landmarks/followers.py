"""Files whose points follow a body: other surfaces, points, curves, grids and landmarks.

A file is read once and written again with its points elsewhere; cells and arrays stay, normals and
tangents follow the surface.  Landmarks are written to .csv.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import FloatArray, IntArray
from ..importing import imported
from .files import LANDMARK_SUFFIXES, Landmarks, read_landmarks, write_landmarks

if TYPE_CHECKING:
    import pyvista as pv


@dataclass(frozen=True, eq=False)
class Follower:
    """What a file has; made by `Follower.read`."""

    data: Landmarks | pv.PolyData | pv.UnstructuredGrid

    @classmethod
    def read(cls, path: Path) -> Follower:
        """Read landmarks, or what `io.read_points` reads.

        Raises
        ------
        MeshError
            If it cannot be read.
        """
        if path.suffix.lower() in LANDMARK_SUFFIXES:
            return cls(read_landmarks(path))
        imported("vtk_segdeform.io")  # imports pyvista
        from ..io import read_points

        return cls(read_points(path))

    @property
    def points(self) -> FloatArray:
        """(k, 3) float: its points as they were read."""
        return np.asarray(self.data.points, dtype=np.float64)

    @property
    def drawn(self) -> tuple[FloatArray, IntArray, IntArray]:
        """Points (k, 3), triangles (m, 3) and edges of lines (e, 2); of a grid its surface."""
        if isinstance(self.data, Landmarks):
            none = np.empty((0, 3), dtype=np.int64)
            return self.points, none, none[:, :2]
        imported("vtk_segdeform.io")
        from ..io import drawn_cells

        return drawn_cells(self.data)

    def at(self, points: FloatArray) -> Landmarks | pv.PolyData | pv.UnstructuredGrid:
        """Return a copy of its data with the points at *points* (k, 3)."""
        if isinstance(self.data, Landmarks):
            return replace(self.data, points=points)
        imported("vtk_segdeform.io")
        from ..io import with_points

        return with_points(self.data, points)

    def write(self, path: Path, points: FloatArray) -> None:
        """Write it with its points at *points* (k, 3).

        Raises
        ------
        ArgumentError
            If landmarks are to be written to another file than .csv.
        MeshError
            If the format cannot hold it, or the file cannot be written.
        """
        moved = self.at(points)
        if isinstance(moved, Landmarks):
            write_landmarks(path, moved)
            return
        imported("vtk_segdeform.io")
        from ..io import write_points

        write_points(path, moved)
