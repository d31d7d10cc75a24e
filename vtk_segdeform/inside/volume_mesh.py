"""`VolumeMesh`: a mesh of cells, the surface around them, and its poses.

    grid, file  -->  VolumeMesh  --surface-->  Surface, which is deformed
    grid, file  <--moved, write--  VolumeMesh  <--pose--  vertices of the surface (n, 3)

The surface has all points of the grid, with the faces that one cell has only.  So vertices, point
arrays and selections are numbered as in the grid, and inner points are in no face.  Cells of
surfaces and lines, such as boundary patches, are kept and move with their points.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from ..arrays import BoolArray, FloatArray, IntArray, as_points
from ..checks import all_of, as_path, as_text, require, shown
from ..errors import ArgumentError, MeshError
from ..freezing import Frozen
from ..io import Surface, follow, polydata_of
from ..progress import Progress
from .cells import KINDS, Corners
from .untangling import inner_points
from .volume_files import read_volume_file, write_volume_file

_VOXEL, _HEXAHEDRON = 11, 12
_AS_HEXAHEDRON = [0, 1, 3, 2, 4, 5, 7, 6]
_FLAT_KINDS = range(10)  # VTK's types of vertices, lines and surfaces
_LINEAR = "use linear cells, such as of grid.linear_copy()"


@dataclass(frozen=True, eq=False, repr=False)
class VolumePose(Frozen):
    """Where the points of a volume mesh are, and how good its cells are there."""

    points: FloatArray
    """(p, 3) float: all points; those of the surface exactly where it is."""
    smallest_before: float
    """The smallest scaled Jacobian of the cells at rest; 1 at best, 0 or less if inverted."""
    smallest: float
    """The same in this pose."""
    inverted: IntArray
    """(k,) int: cells that are inverted, as numbered in the grid."""
    without_inner_points: IntArray
    """(j,) int: those of them with all points on the surface, which determines them."""

    def summary(self) -> str:
        """Return this in one line."""
        text = f"smallest scaled Jacobian {self.smallest:.3f} ({self.smallest_before:.3f} at rest)"
        if not len(self.inverted):
            return f"{text}, no cell inverted"
        text += f", {len(self.inverted):,} inverted"
        if len(self.without_inner_points):
            text += f", {len(self.without_inner_points):,} of them with all points on the surface"
        return f"{text}: move less, or refine the mesh there"


class VolumeMesh:
    """A mesh of tetrahedra, hexahedra, wedges and pyramids whose surface is deformed.

    Parameters
    ----------
    mesh : pyvista.UnstructuredGrid or meshio.Mesh
        Not changed.  Its cells share their points; `pyvista.UnstructuredGrid.clean` merges doubled
        ones.  Voxels become hexahedra.

    Raises
    ------
    ArgumentError
        If it is something else.
    MeshError
        If it has no such cells or has others, such as quadratic ones and polyhedra, or its surface
        cannot be deformed.

    Examples
    --------
    >>> import pyvista as pv
    >>> blocks = VolumeMesh(pv.ImageData(dimensions=(3, 3, 3)).cast_to_unstructured_grid())
    >>> blocks.surface.mesh.n_vertices, blocks.grid.n_points
    (26, 27)
    >>> blocks.pose(1.5 * blocks.surface.mesh.vertices).points[13]
    array([1.5, 1.5, 1.5])
    """

    def __init__(self, mesh: Any) -> None:
        self._given = mesh
        self.grid: pv.UnstructuredGrid = _grid_of(mesh)
        """The cells, to be read only."""
        points = np.array(self.grid.points, dtype=np.float64)
        if not np.isfinite(points).all():
            raise MeshError("the mesh has points that are not finite")
        self.corners = Corners.of(points, _groups(self.grid))
        """The corners of its cells, and its boundary."""
        polydata = polydata_of(points, self.corners.sizes, self.corners.faces)
        polydata.GetPointData().ShallowCopy(self.grid.GetPointData())
        for name, ids in self.patches.items():
            if name not in polydata.point_data:
                mask = np.zeros(len(points), dtype=np.uint8)
                mask[ids] = 1
                polydata.point_data[name] = mask
        self.surface = Surface(polydata)
        """Its surface, with all points of the grid; `patches` are point arrays."""

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> VolumeMesh:
        """Read the mesh of a .vtu, .vtk, .msh or .mesh file; the last two need meshio.

        Raises
        ------
        MeshError
            If the file cannot be read, or is of no such mesh.
        MissingDependencyError
            If meshio is not installed.
        """
        found = volume_of(as_path(path))
        if found is None:
            raise MeshError(f"{path}: has no cells of a volume mesh")
        return found

    @cached_property
    def patches(self) -> dict[str, IntArray]:
        """The points (k,) of named groups of cells of a ``meshio.Mesh``, such as of Gmsh."""
        found: dict[str, IntArray] = {}
        given = self._given
        if isinstance(given, pv.UnstructuredGrid):
            return found
        for name, rows in given.cell_sets.items():
            if not name.startswith("gmsh:"):
                parts = [
                    np.ravel(block.data[row])
                    for block, row in zip(given.cells, rows, strict=True)
                    if row is not None
                ]
                found[name] = np.unique(np.concatenate(parts)).astype(np.int64)
        tags = given.cell_data.get("gmsh:physical", [])
        for name, (tag, dimension) in given.field_data.items():
            parts = [
                np.ravel(block.data[np.asarray(own) == tag])
                for block, own in zip(given.cells, tags, strict=False)
                if block.dim == dimension
            ]
            if parts:
                found.setdefault(name, np.unique(np.concatenate(parts)).astype(np.int64))
        return found

    def pose(self, vertices: ArrayLike, *, progress: Progress | None = None) -> VolumePose:
        """Return all points for the mesh of `surface` at *vertices* (n, 3).

        Those of the surface are exactly there; for the others see `untangling`.  It is not always
        possible to turn all cells back: not where the surface crosses itself, and not where a cell
        has all its points on the surface.

        Parameters
        ----------
        vertices : (n, 3) float
            `Solution.vertices`.
        progress : Progress, optional
            Called before every step; may raise `Cancelled`.
        """
        x = as_points(vertices, "vertices", self.surface.mesh.n_vertices)
        start = np.asarray(self.surface.moved(x).points, dtype=np.float64)
        rest, corners = self._rest, self.corners
        points = inner_points(corners, rest, start, self._is_inner, progress=progress)
        before, after = (
            corners.scaled_jacobians(each, self.grid.n_cells) for each in (rest, points)
        )
        inverted = np.flatnonzero(after <= 0.0)
        has_inner = np.zeros(self.grid.n_cells, dtype=bool)
        has_inner[corners.cell[self._is_inner[corners.points[:, 0]]]] = True
        return VolumePose(
            points,
            float(before.min()),
            float(after.min()),
            inverted,
            inverted[~has_inner[inverted]],
        )

    @property
    def at_rest(self) -> VolumePose:
        """The pose of what was given."""
        return self.pose(self.surface.mesh.vertices)

    def moved(
        self,
        pose: VolumePose,
        *,
        turn: Sequence[str] = (),
        push: Sequence[str] = (),
        displacement: str | None = None,
    ) -> Any:
        """Return what was given in a *pose*: a grid, or a ``meshio.Mesh``.

        Cells, arrays and their order are the same; points become float64.

        Parameters
        ----------
        pose : VolumePose
            Of `pose`.
        turn, push : sequence of str
            Point or cell arrays of vectors or tensors that turn with the inside, such as fibres, or
            are pushed forward with it; others stay as they are.
        displacement : str, optional
            The name of a point array to add: how far each point has moved, (p, 3).
        """
        require(pose, VolumePose, "pose")
        points = as_points(pose.points, "points of the pose", self.grid.n_points)
        turn, push = all_of(turn, str, "turn"), all_of(push, str, "push")
        moved = self.grid.copy()
        moved.points = points.copy()
        if turn or push:
            corners = self.corners
            gradients = corners.gradients(self._rest, points, self.grid.n_cells)
            follow(moved, self.grid, turn=turn, push=push, gradients=gradients)
        names = {*turn, *push}
        if displacement is not None:
            moved.point_data[as_text(displacement, "displacement")] = points - self._rest
            names.add(displacement)
        if isinstance(self._given, pv.UnstructuredGrid):
            return moved
        mesh = copy.deepcopy(self._given)
        mesh.points = points.copy()
        ends = np.cumsum([len(block.data) for block in mesh.cells])[:-1]
        for name in names:
            if name in moved.point_data:
                mesh.point_data[name] = np.array(moved.point_data[name])
            if name in mesh.cell_data:
                mesh.cell_data[name] = np.split(np.array(moved.cell_data[name]), ends)
        return mesh

    def write(self, path: str | os.PathLike[str], pose: VolumePose, **fields: Any) -> None:
        """Write `moved`, with its options *fields*, to a .vtu, .vtk, .msh or .mesh file.

        MeshError if the file cannot be written.
        """
        write_volume_file(as_path(path), self.moved(pose, **fields))

    @cached_property
    def _rest(self) -> FloatArray:
        return np.array(self.grid.points, dtype=np.float64)

    @cached_property
    def _is_inner(self) -> BoolArray:
        inner = np.zeros(self.grid.n_points, dtype=bool)
        inner[self.corners.points] = True
        inner[self.corners.faces] = False
        return inner


def volume_of(mesh: Any) -> VolumeMesh | None:
    """Return the volume mesh that *mesh* is, or that the file at a path has; None if none.

    MeshError if its cells cannot be deformed; the message names the file.
    """
    is_path = isinstance(mesh, str | os.PathLike)
    given = read_volume_file(Path(mesh)) if is_path else mesh
    if not _has_cells(given):
        return None
    try:
        return VolumeMesh(given)
    except MeshError as fault:
        raise (MeshError(f"{mesh}: {fault}") if is_path else fault) from None


def _has_cells(mesh: Any) -> bool:
    """Return whether *mesh* is a grid or a ``meshio.Mesh`` with cells of three dimensions."""
    if isinstance(mesh, pv.UnstructuredGrid):
        return any(_dimension(kind) == 3 for kind in np.unique(mesh.celltypes).tolist())
    if type(mesh).__module__.partition(".")[0] != "meshio":
        return False
    return any(getattr(block, "dim", 0) == 3 for block in getattr(mesh, "cells", ()))


def _dimension(kind: int) -> int:
    return int(pv.CellType(kind).dimension)


def _grid_of(mesh: Any) -> pv.UnstructuredGrid:
    if isinstance(mesh, pv.UnstructuredGrid):
        grid = mesh.copy(deep=False)
    elif _has_cells(mesh):
        plain = copy.copy(mesh)
        plain.cell_sets = {}  # pyvista would turn those of *mesh* itself into cell arrays
        grid = pv.from_meshio(plain)
    else:
        raise ArgumentError(
            f"mesh must be a pyvista.UnstructuredGrid or a meshio.Mesh of cells; got {shown(mesh)}"
        )
    kinds = set(np.unique(grid.celltypes).tolist())
    if refused := sorted(kinds - {*KINDS, *_FLAT_KINDS, _VOXEL}):
        names = ", ".join(pv.CellType(kind).name for kind in refused)
        raise MeshError(f"cells of the types {names} cannot be deformed; {_LINEAR}")
    if not kinds & {*KINDS, _VOXEL}:
        raise MeshError("the mesh has no tetrahedra, hexahedra, wedges or pyramids")
    if _VOXEL not in kinds:
        return grid
    starts, corners = _rows(grid)
    types, corners = np.array(grid.celltypes), corners.copy()
    rows = starts[types == _VOXEL][:, None] + np.arange(8)
    corners[rows] = corners[rows[:, _AS_HEXAHEDRON]]
    types[types == _VOXEL] = _HEXAHEDRON
    made = pv.UnstructuredGrid()
    made.points = grid.points
    made.SetCells(
        pv.convert_array(types),
        pv.CellArray.from_arrays(np.append(starts, len(corners)), corners),
    )
    made.GetPointData().ShallowCopy(grid.GetPointData())
    made.GetCellData().ShallowCopy(grid.GetCellData())
    made.GetFieldData().ShallowCopy(grid.GetFieldData())
    return made


def _rows(grid: pv.UnstructuredGrid) -> tuple[IntArray, IntArray]:
    """Return where each cell begins in the list of corners, (m,), and this list."""
    cells = grid.GetCells()
    starts = pv.convert_array(cells.GetOffsetsArray())[:-1]
    return starts.astype(np.int64), pv.convert_array(cells.GetConnectivityArray()).astype(np.int64)


def _groups(grid: pv.UnstructuredGrid) -> list[tuple[int, IntArray, IntArray]]:
    """Return for each type of cells its number, the cells (k,), and their points (k, v)."""
    types = np.asarray(grid.celltypes)
    starts, corners = _rows(grid)
    found = []
    for kind, meaning in KINDS.items():
        cells = np.flatnonzero(types == kind)
        if len(cells):
            count = 1 + max(map(max, meaning.faces))
            ids = corners[starts[cells][:, None] + np.arange(count)]
            found.append((kind, cells, ids))
    return found
