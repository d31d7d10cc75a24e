"""Making cages, and binding to them, beside other programs that do one of the two.

    cages         `fit_cages`, libigl's progressive hulls, gpytoolbox's lazy_cage
    coordinates   `mean_value_coordinates`, VTK's interpolator and its vtkDeformPointSet

A cage is valid if it is closed, two-manifold, does not cross itself, and has the whole mesh inside.
It is the tighter, the less volume it has beside the mesh's.
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
from .measuring import called, timed
from .scale import Scale
from .sections import Cell, Section, Table

CAGE_COLUMNS = ("program", "vertices", "seconds", "volume / mesh", "valid", "outside")
WEIGHT_COLUMNS = ("program", "seconds", "us per point", "largest difference")
_SAMPLE = 2000  # points that VTK's interpolator is asked for, one call from Python each
Surface = tuple[FloatArray, IntArray]


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table of cages and one of coordinates for each size."""
    section = Section("Making cages, and binding to them")
    for k, size in enumerate(scale.cage_sizes):
        mesh, rows = cactus(size), list[tuple[Cell, ...]]()
        for name, make in MAKERS.items():
            if progress:
                progress(k / len(scale.cage_sizes), f"{name}: a cage of {size} vertices")
            try:
                surface, seconds = called(
                    scale.own_process, made, make, mesh, scale.n_cage_vertices
                )
            except (SegDeformError, RuntimeError, ValueError, IndexError) as fault:
                section.absent.append(f"{name}, {size} vertices: {fault}")
                continue
            rows.append(cage_row(name, mesh, surface, seconds))
        title = f"one cage of {scale.n_cage_vertices} vertices around {size}"
        section.tables.append(Table(CAGE_COLUMNS, rows, title))
        section.tables.append(_coordinates(mesh, scale.n_cage_vertices))
    section.words.append(
        "*Outside* counts mesh vertices. vtkMeanValueCoordinatesInterpolator gives the weights of "
        "one point a call, so part of its time is Python's; vtkDeformPointSet keeps no weights, so "
        "it takes its time again for every pose."
    )
    return section


def ours(mesh: Mesh, n_vertices: int) -> Surface:
    """Return the cage of `fit_cages`."""
    (cage,) = fit_cages(mesh, Regions.single(mesh), n_vertices)
    return cage.vertices, cage.faces


def progressive_hulls(mesh: Mesh, n_vertices: int) -> Surface:
    """Return libigl's cage; n vertices close with 2 n - 4 faces."""
    try:
        from igl.copyleft import progressive_hulls as simplified
    except ImportError as fault:
        raise MissingDependencyError(f"libigl with copyleft parts is not there ({fault})") from None
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
        raise MissingDependencyError(f"gpytoolbox is not there ({fault})") from None
    faces = mesh.faces.astype(np.int32)
    vertices, triangles = caged(np.array(mesh.vertices), faces, num_faces=2 * n_vertices - 4)
    return np.asarray(vertices), np.asarray(triangles, dtype=np.int64)


MAKERS: dict[str, Callable[[Mesh, int], Surface]] = {
    "fit_cages": ours,
    "libigl progressive hulls": progressive_hulls,
    "gpytoolbox lazy_cage": lazy_cage,
}


def made(make: Callable[[Mesh, int], Surface], mesh: Mesh, n: int) -> tuple[Surface, float]:
    """Return a cage and its seconds; imports of the program are not counted."""
    make(cactus(500), 60)
    return timed(lambda: make(mesh, n))


def cage_row(name: str, mesh: Mesh, surface: Surface, seconds: float) -> tuple[Cell, ...]:
    """Return one row, under `CAGE_COLUMNS`."""
    vertices, faces = surface
    used = np.unique(faces)
    vertices, faces = vertices[used], np.searchsorted(used, faces)
    faults = cage_faults(vertices, faces)
    outside = int((winding_number(mesh.vertices, vertices, faces) < 0.5).sum())
    share = signed_volume(vertices, faces) / signed_volume(mesh.vertices, mesh.faces)
    words = "; ".join(faults) or ("yes" if not outside else "closed, but not around the mesh")
    return name, len(vertices), seconds, share, words, outside


def _coordinates(mesh: Mesh, n_vertices: int) -> Table:
    (cage,) = fit_cages(mesh, Regions.single(mesh), n_vertices)
    x, n = np.array(mesh.vertices), mesh.n_vertices
    weights, seconds = timed(lambda: mean_value_coordinates(x, cage.vertices, cage.faces))
    sample = x[:: max(1, n // _SAMPLE)]
    asked, t_vtk = timed(lambda: _interpolated(sample, cage))
    off = float(np.abs(asked - weights[:: max(1, n // _SAMPLE)]).max())
    moved = cage.vertices * [1.0, 1.2, 0.9] + 0.1 * cage.vertices[:, [2, 0, 1]]
    pose, t_deform = timed(lambda: _deformed(x, cage, moved))
    off_posed, each = float(np.abs(pose - weights @ moved).max()), t_vtk / len(sample)
    rows: list[tuple[Cell, ...]] = [
        ("mean_value_coordinates", seconds, 1e6 * seconds / n, 0.0),
        ("vtkMeanValueCoordinatesInterpolator", n * each, 1e6 * each, off),
        ("vtkDeformPointSet", t_deform, 1e6 * t_deform / n, off_posed),
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
    """Return *points* as vtkDeformPointSet moves them with the cage."""
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
