"""The operations on the creatures of the zoo, each of which checks its result.

Operations raise the errors of the package; those that the filter only reports become a
`ReportedError`.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pyvista as pv
from solids import rotation

import vtk_segdeform as sd
from vtk_segdeform.errors import MeshError, SegDeformError
from vtk_segdeform.filters.deform_filter import SegmentedCageDeformFilter
from vtk_segdeform.filters.surfaces import surface
from vtk_segdeform.geometry import lids_of
from vtk_segdeform.io import polydata_of, triangles_of
from vtk_segdeform.mesh import mesh_of


class ReportedError(SegDeformError):
    """A report of faults, or an error message of the filter, which does not raise."""


def triangles(soup):
    """Return triangles as PolyData."""
    vertices, faces = soup
    return polydata_of(np.asarray(vertices, float), np.full(len(faces), 3), np.ravel(faces))


def volume(mesh, vertices=None):
    """Return the volume of a mesh with its lids in extended precision; 0 if it encloses none."""
    lids = lids_of(mesh)
    faces = lids.closed(mesh)
    x = lids.extension @ (mesh.vertices if vertices is None else np.asarray(vertices))
    x = np.asarray(x, dtype=np.longdouble)
    a, b, c = (x - x.mean(axis=0))[faces.T]
    return (a * np.cross(b, c)).sum() / 6


def require_right(mesh, vertices, digits=1e-12):
    """Check that *vertices* are a pose of *mesh* with its volume."""
    assert vertices.shape == mesh.vertices.shape
    assert np.isfinite(vertices).all()
    rest, now = volume(mesh), volume(mesh, vertices)
    # Coordinates are rounded relative to their distance from the origin, and so is the volume.
    far = np.abs(vertices).max()
    rounding = 4 * np.finfo(float).eps * far * mesh.face_areas.sum()
    assert abs(now - rest) <= max(digits * abs(rest), rounding)


def require_right_surface(surface, bent_surface):
    """Check that *bent_surface* is a pose of what was given, with its volume."""
    given = surface.given
    assert np.array_equal(bent_surface.faces, given.faces)
    assert np.array_equal(bent_surface.strips, given.strips)
    vertices = np.full_like(surface.mesh.vertices, np.nan)
    there = (surface.mesh.vertices[surface.vertex_of] == given.points).all(axis=1)
    vertices[surface.vertex_of[there]] = np.asarray(bent_surface.points, float)[there]
    require_right(surface.mesh, vertices)


def require_met(solution):
    """Check that handles are at their targets, or that the status says they are not."""
    assert solution.handle_error <= 1e-3 or solution.status is not sd.Status.CONVERGED


def ends(mesh):
    """Return the vertices at both ends of *mesh* along its longest side."""
    extent = np.ptp(mesh.vertices, axis=0)
    x = mesh.vertices[:, extent.argmax()]
    x = (x - x.min()) / np.ptp(x)
    return np.flatnonzero(x <= 0.12), np.flatnonzero(x >= 0.88)


def bent(mesh, handle, degrees=20.0):
    """Return targets: the handle rotated about the centre, and slightly shifted."""
    axis = np.eye(3)[(np.ptp(mesh.vertices, axis=0).argmax() + 1) % 3]
    middle = mesh.vertices.mean(axis=0)
    x = (mesh.vertices[handle] - middle) @ rotation(axis, np.radians(degrees)).T
    return x + middle + 0.02 * mesh.diagonal


def fitted(mesh):
    """Return two regions, or one, and cages of 60 vertices."""
    regions = sd.segment(mesh, min(2, mesh.n_vertices))
    return regions, sd.fit_cages(mesh, regions, 60)


# Operations on triangles.


def check_faults(vertices, faces):
    report = sd.find_faults(vertices, faces)
    if not report.ok:
        raise ReportedError(str(report))


def repair(vertices, faces):
    repaired = sd.repair(vertices, faces)
    if not repaired.report.ok:
        raise ReportedError(str(repaired.report))
    assert volume(sd.Mesh(repaired.vertices, repaired.faces)) >= 0


def check_mesh(vertices, faces):
    mesh = sd.Mesh(vertices, faces)
    assert volume(mesh) >= 0
    assert np.isfinite(sd.local_volume_change(mesh, mesh.vertices)).all()


def segment(vertices, faces):
    mesh = sd.Mesh(vertices, faces)
    for n_regions in (None, 1, 3):
        regions = sd.segment(mesh, n_regions)
        assert np.allclose(regions.weights.sum(axis=0), 1.0, atol=1e-12)
        assert n_regions in (None, regions.n_regions)


def fit(vertices, faces):
    mesh = sd.Mesh(vertices, faces)
    regions, cages = fitted(mesh)
    for members, cage in zip(regions.membership, cages, strict=True):
        sd.Cage(cage.vertices, cage.faces).require_encloses(mesh.vertices[members], "members")
    assert sum(cage.n_vertices for cage in cages) == 60


def solve(vertices, faces):
    mesh = sd.Mesh(vertices, faces)
    fixed, handle = ends(mesh)
    deformer = sd.Deformer(mesh, *fitted(mesh), fixed=fixed, handle=handle)
    for degrees in (20.0, -30.0):
        solution = deformer.solve(bent(mesh, handle, degrees))
        require_right(mesh, solution.vertices)
        require_met(solution)


def deform(vertices, faces):
    mesh = sd.Mesh(vertices, faces)
    fixed, handle = ends(mesh)
    solution = sd.deform(mesh, fixed, handle, bent(mesh, handle), n_regions=1, n_cage_vertices=40)
    require_right(mesh, solution.vertices)
    require_met(solution)


def drag(vertices, faces):
    drag_session(sd.Session(sd.Mesh(vertices, faces)))


def drag_surface(vertices, faces):
    given = triangles((vertices, faces))
    session = sd.Session(sd.Surface(given))
    drag_session(session)
    assert session.deformed.n_points == given.n_points
    assert np.array_equal(session.deformed.faces, given.faces)


def drag_session(session):
    """Drag, commit, undo, redo, save and load."""
    mesh = session.mesh
    session.segment(min(2, mesh.n_vertices))
    session.change_options(n_cage_vertices=60)
    session.fit_cages()
    fixed, handle = ends(mesh)
    session.set_fixed(fixed)
    targets = {session.handles.add(handle): bent(mesh, handle)}
    for max_steps in (3, None):
        require_met(session.drag(targets, max_steps=max_steps))
        require_right(session.mesh, session.vertices)
    session.commit()
    there = session.vertices.copy()
    session.undo()
    assert np.array_equal(session.vertices, session.mesh.vertices)
    session.redo()
    assert np.array_equal(session.vertices, there)
    sd.save_session("zoo.segdeform", session)
    assert np.array_equal(sd.load_session("zoo.segdeform").vertices, there)


def pipeline(vertices, faces):
    """Run the filter, and raise the errors that it reports."""
    polydata = triangles((vertices, faces))
    bend, errors = SegmentedCageDeformFilter(), []
    bend.AddObserver("ErrorEvent", lambda *_: errors.append("an error of VTK"))
    bend._report_error = errors.append  # the only function that reports errors
    bend.SetInputDataObject(0, polydata)
    fixed, handle = [], []
    if polydata.n_points:
        x = np.nan_to_num(np.asarray(polydata.points, float), posinf=0.0)
        used = np.arange(len(x))
        with suppress(MeshError, ValueError):  # a handle of stray points alone is refused
            used = np.unique(triangles_of(polydata)) if polydata.n_cells else used
        used = used if len(used) else np.arange(len(x))
        x = x[used][:, np.ptp(x[used], axis=0).argmax()]
        fixed = used[x <= x.min() + 0.12 * np.ptp(x)].tolist()
        handle = used[x >= x.max() - 0.12 * np.ptp(x)].tolist()
    bend.SetNumberOfRegions(2)
    bend.SetNumberOfCageVertices(60)
    bend.SetFixed(fixed)
    bend.SetHandle(handle)
    bend.SetRotationAxis(0, 1, 0)
    bend.SetRotationAngle(15)
    bend.Update()
    if errors:
        raise ReportedError(errors[0])
    bent_surface = pv.wrap(bend.GetOutputDataObject(0))
    # The filter needs no pyvista: VTK cuts its polygons, which are cut otherwise from files.
    own = sd.Surface.of(polydata, mesh_of(*surface(polydata)))
    require_right_surface(own, bent_surface)


OPERATIONS = {
    "find_faults": check_faults, "repair": repair, "Mesh": check_mesh, "segment": segment,
    "fit_cages": fit, "Deformer": solve, "deform": deform, "Session": drag,
    "Surface": drag_surface, "filter": pipeline,
}  # fmt: skip
OF_SURFACES = {"Surface", "filter"}
TAKE_ANY_ARRAYS = OPERATIONS.keys() - OF_SURFACES
