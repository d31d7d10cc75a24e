"""Cages and mean value coordinates, compared with other programs.

    cages         `fit_cages`, libigl's progressive hulls, gpytoolbox's lazy_cage
    coordinates   `mean_value_coordinates`, VTK's interpolator and its vtkDeformPointSet

A cage is valid if it is closed, two-manifold, free of self-intersections, and encloses the mesh.
The ratio of its volume to that of the mesh measures how tight it is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMeanValueCoordinatesInterpolator
from vtkmodules.vtkFiltersGeneral import vtkDeformPointSet

from ..arrays import FloatArray, IntArray
from ..cages import Cage, cage_faults, fit_cages, mean_value_coordinates
from ..errors import MissingDependencyError, SegDeformError
from ..geometry import signed_volume
from ..io import polydata_of
from ..mesh import Mesh, winding_number
from ..models import cactus
from ..progress import Progress
from ..regions import Regions
from .measuring import run_in, timed
from .scale import Scale
from .sections import Cell, Section, Table

CAGE_COLUMNS = ("program", "vertices", "seconds", "volume / mesh", "valid", "outside")
WEIGHT_COLUMNS = ("program", "seconds", "us per point", "largest difference")
_SAMPLE = 2000  # points for VTK's interpolator, which takes one call from Python for each
Surface = tuple[FloatArray, IntArray]


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table of cages and one of coordinates for each size."""
    section = Section("Cages and mean value coordinates")
    for k, size in enumerate(scale.cage_sizes):
        mesh, rows = cactus(size), list[tuple[Cell, ...]]()
        for name, make in MAKERS.items():
            if progress:
                progress(k / len(scale.cage_sizes), f"{name}: cage of {size} vertices")
            try:
                surface, seconds = run_in(
                    scale.own_process, timed_cage, make, mesh, scale.n_cage_vertices
                )
            except (SegDeformError, RuntimeError, ValueError, IndexError) as fault:
                section.skipped.append(f"{name}, {size} vertices: {fault}")
                continue
            rows.append(cage_row(name, mesh, surface, seconds))
        title = f"one cage of {scale.n_cage_vertices} vertices around {size}"
        section.tables.append(Table(CAGE_COLUMNS, rows, title))
        section.tables.append(_coordinates(mesh, scale.n_cage_vertices))
    section.text.append(
        "*Outside* is the number of mesh vertices outside the cage. "
        "vtkMeanValueCoordinatesInterpolator computes the weights of one point per call, so its "
        "time includes that of Python. vtkDeformPointSet does not store weights, so its time is "
        "spent again for every pose."
    )
    return section


def ours(mesh: Mesh, n_vertices: int) -> Surface:
    """Return the cage of `fit_cages`."""
    (cage,) = fit_cages(mesh, Regions.single(mesh), n_vertices)
    return cage.vertices, cage.faces


def progressive_hulls(mesh: Mesh, n_vertices: int) -> Surface:
    """Return libigl's cage; a closed surface of n vertices has 2 n - 4 faces."""
    try:
        from igl.copyleft import progressive_hulls as simplified
    except ImportError as fault:
        raise MissingDependencyError(
            f"libigl with its copyleft modules is not installed ({fault})"
        ) from None
    faces = np.asfortranarray(mesh.faces.astype(np.int32))
    vertices, triangles, *_ = simplified(
        np.asfortranarray(mesh.vertices), faces, 2 * n_vertices - 4
    )
    return np.asarray(vertices), np.asarray(triangles, dtype=np.int64)


def lazy_cage(mesh: Mesh, n_vertices: int) -> Surface:
    """Return gpytoolbox's cage."""
    try:
        from gpytoolbox.copyleft import lazy_cage as caged
    except ImportError as fault:
        raise MissingDependencyError(f"gpytoolbox is not installed ({fault})") from None
    faces = mesh.faces.astype(np.int32)
    vertices, triangles = caged(np.array(mesh.vertices), faces, num_faces=2 * n_vertices - 4)
    return np.asarray(vertices), np.asarray(triangles, dtype=np.int64)


MAKERS: dict[str, Callable[[Mesh, int], Surface]] = {
    "fit_cages": ours,
    "libigl progressive hulls": progressive_hulls,
    "gpytoolbox lazy_cage": lazy_cage,
}


def timed_cage(make: Callable[[Mesh, int], Surface], mesh: Mesh, n: int) -> tuple[Surface, float]:
    """Return a cage and its seconds, excluding imports."""
    make(cactus(500), 60)
    return timed(lambda: make(mesh, n))


def cage_row(name: str, mesh: Mesh, surface: Surface, seconds: float) -> tuple[Cell, ...]:
    """Return one row, under `CAGE_COLUMNS`."""
    vertices, faces = surface
    used = np.unique(faces)
    vertices, faces = vertices[used], np.searchsorted(used, faces)
    faults = cage_faults(vertices, faces)
    outside = int((winding_number(mesh.vertices, vertices, faces) < 0.5).sum())
    ratio = signed_volume(vertices, faces) / signed_volume(mesh.vertices, mesh.faces)
    valid = "; ".join(faults) or ("does not enclose the mesh" if outside else "yes")
    return name, len(vertices), seconds, ratio, valid, outside


def _coordinates(mesh: Mesh, n_vertices: int) -> Table:
    (cage,) = fit_cages(mesh, Regions.single(mesh), n_vertices)
    x, n = np.array(mesh.vertices), mesh.n_vertices
    weights, seconds = timed(lambda: mean_value_coordinates(x, cage.vertices, cage.faces))
    sample = x[:: max(1, n // _SAMPLE)]
    by_vtk, t_vtk = timed(lambda: _interpolated(sample, cage))
    error = float(np.abs(by_vtk - weights[:: max(1, n // _SAMPLE)]).max())
    moved = cage.vertices * [1.0, 1.2, 0.9] + 0.1 * cage.vertices[:, [2, 0, 1]]
    pose, t_deform = timed(lambda: _deformed(x, cage, moved))
    pose_error, each = float(np.abs(pose - weights @ moved).max()), t_vtk / len(sample)
    rows: list[tuple[Cell, ...]] = [
        ("mean_value_coordinates", seconds, 1e6 * seconds / n, 0.0),
        ("vtkMeanValueCoordinatesInterpolator", n * each, 1e6 * each, error),
        ("vtkDeformPointSet", t_deform, 1e6 * t_deform / n, pose_error),
    ]
    title = f"mean value coordinates of {n} points in a cage of {cage.n_vertices} vertices"
    return Table(WEIGHT_COLUMNS, rows, title)


def _interpolated(points: FloatArray, cage: Cage) -> FloatArray:
    """Return VTK's weights (k, m)."""
    surface = polydata_of(cage.vertices, np.full(cage.n_faces, 3), cage.faces.ravel())
    solver, corners = vtkMeanValueCoordinatesInterpolator(), surface.GetPolys()
    out = np.empty((len(points), cage.n_vertices))
    for row, point in zip(out, points, strict=True):
        solver.ComputeInterpolationWeights(point, surface.GetPoints(), corners, row)
    return out


def _deformed(points: FloatArray, cage: Cage, moved: FloatArray) -> FloatArray:
    """Return *points* deformed by vtkDeformPointSet."""
    sides = np.full(cage.n_faces, 3)
    control = polydata_of(cage.vertices.copy(), sides, cage.faces.ravel())
    deform = vtkDeformPointSet()
    deform.SetInputData(
        polydata_of(points, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    )
    deform.SetControlMeshData(control)
    deform.InitializeWeightsOn()
    deform.Update()
    vtk_to_numpy(control.GetPoints().GetData())[:] = moved
    control.GetPoints().Modified()
    control.Modified()
    deform.Update()
    return np.array(vtk_to_numpy(deform.GetOutput().GetPoints().GetData()), dtype=np.float64)
