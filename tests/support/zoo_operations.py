"""The operations on the creatures of the zoo, each of which checks its result.

Operations raise the errors of the package; errors that the filter and the command line only report
become a `ReportedError`.
"""

from __future__ import annotations

import io
from contextlib import redirect_stdout, suppress
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import pyvista as pv
import zoo
from solids import rotation

import vtk_segdeform as sd
from vtk_segdeform.cli.main import main
from vtk_segdeform.errors import MeshError, SegDeformError
from vtk_segdeform.filters.deform_filter import SegmentedCageDeformFilter
from vtk_segdeform.filters.surfaces import surface
from vtk_segdeform.geometry import lids_of
from vtk_segdeform.io import triangles_of
from vtk_segdeform.io.convert import from_polydata, read_polydata, to_polydata, write_mesh
from vtk_segdeform.io.polygons import polydata_of
from vtk_segdeform.mesh import mesh_of


class ReportedError(SegDeformError):
    """An error message of the filter or the command line, neither of which raises."""


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


def as_polydata(vertices, faces):
    """Return any triangles as PolyData."""
    return polydata_of(np.asarray(vertices, float), np.full(len(faces), 3), np.ravel(faces))


def drag_surface(vertices, faces):
    given = as_polydata(vertices, faces)
    session = sd.Session(sd.Surface(given))
    drag_session(session)
    assert session.deformed.n_points == given.n_points
    assert np.array_equal(session.deformed.faces, given.faces)


def drag_session(session):
    mesh = session.mesh
    session.segment(min(2, mesh.n_vertices))
    session.change_options(n_cage_vertices=60)
    session.fit_cages()
    fixed, handle = ends(mesh)
    session.set_fixed(fixed)
    name = session.handles.add(handle)
    dragged(session, {name: bent(mesh, handle)})


def dragged(session, targets):
    """Drag, commit, undo, redo, save and load."""
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
    filtered(as_polydata(vertices, faces))


def filtered(polydata, *, cages=None, **options):
    """Run the filter on *polydata*, and raise the errors that it reports."""
    bend, errors = SegmentedCageDeformFilter(), []
    bend.AddObserver("ErrorEvent", lambda *_: errors.append("an error of VTK"))
    bend._report_error = errors.append  # the only function that reports errors
    bend.SetInputDataObject(0, polydata)
    if cages is not None:
        bend.SetInputDataObject(1, cages)
    if "handle" not in options and polydata.n_points:
        x = np.nan_to_num(np.asarray(polydata.points, float), posinf=0.0)
        used = np.arange(len(x))
        with suppress(MeshError, ValueError):  # a handle of stray points alone is refused
            used = np.unique(triangles_of(polydata)) if polydata.n_cells else used
        used = used if len(used) else np.arange(len(x))
        x = x[used][:, np.ptp(x[used], axis=0).argmax()]
        options["fixed"] = used[x <= x.min() + 0.12 * np.ptp(x)].tolist()
        options["handle"] = used[x >= x.max() - 0.12 * np.ptp(x)].tolist()
    bend.SetNumberOfRegions(options.pop("n_regions", 2))
    bend.SetNumberOfCageVertices(60)
    bend.SetFixed(options.get("fixed", []))
    bend.SetHandle(options.get("handle", []))
    if "targets" in options:
        bend.SetTargets(options["targets"])
    else:
        bend.SetRotationAxis(0, 1, 0)
        bend.SetRotationAngle(15)
    bend.Update()
    if errors:
        raise ReportedError(errors[0])
    bent_surface = pv.wrap(bend.GetOutputDataObject(0))
    # The filter needs no pyvista: VTK cuts its polygons, which are cut otherwise from files.
    own = sd.Surface.of(polydata, mesh_of(*surface(polydata)))
    require_right_surface(own, bent_surface)


def as_off(vertices, faces):
    """Write any triangles to an OFF file."""
    vertices, faces = np.asarray(vertices), np.asarray(faces)
    rows = [" ".join(map(str, row)) for row in np.atleast_2d(vertices).tolist()]
    rows += [" ".join(map(str, [len(row), *row])) for row in np.atleast_2d(faces).tolist() if row]
    Path("zoo.off").write_text("\n".join(["OFF", f"{len(vertices)} {len(faces)} 0", *rows, ""]))


def commanded(*words):
    """Run the command line, and raise the errors that it prints."""
    with redirect_stdout(io.StringIO()) as printed:
        try:
            code = main(["--debug", *words])
        except MeshError as missed:  # it has a result nevertheless
            if "written, but a handle misses its target" not in str(missed):
                raise
            code = 0
    if code:
        raise ReportedError(printed.getvalue())


def check_command(vertices, faces):
    as_off(vertices, faces)
    commanded("check", "zoo.off")


def deform_command(vertices, faces):
    as_off(vertices, faces)
    x = np.nan_to_num(np.asarray(vertices, float)).reshape(-1, 3)
    axis = "xyz"[np.ptp(x, axis=0).argmax() if len(x) else 0]
    words = ["deform", "zoo.off", "-o", "bent.off", "--fixed", f"{axis}<12%", "--handle"]
    words += [f"{axis}>88%", "--rotate", "y,15", "--regions", "2", "--cage-vertices", "60"]
    commanded(*words)
    require_right_surface(sd.Surface.read("zoo.off"), read_polydata("bent.off"))


OPERATIONS = {
    "find_faults": check_faults, "repair": repair, "Mesh": check_mesh, "segment": segment,
    "fit_cages": fit, "Deformer": solve, "deform": deform, "Session": drag,
    "Surface": drag_surface, "filter": pipeline,
    "segdeform check": check_command, "segdeform deform": deform_command,
}  # fmt: skip
OF_SURFACES = {"Surface", "filter", "segdeform check", "segdeform deform"}
TAKE_ANY_ARRAYS = OPERATIONS.keys() - OF_SURFACES


# Operations on regions, overlaps, cages, selections, targets, numbers and surfaces of VTK.


@lru_cache(maxsize=1)
def scene():
    """Return the body in one tight cage."""
    mesh = sd.Mesh(*zoo.body())
    return mesh, sd.Regions.single(mesh), (sd.Cage(*zoo.ball()),)


def regions_only(masks):
    mesh = scene()[0]
    regions = sd.Regions.from_masks(mesh, masks)
    assert np.allclose(regions.weights.sum(axis=0), 1.0, atol=1e-12)
    assert not regions.weights[~regions.membership].any()


def regions_in_a_deformer(masks):
    mesh = scene()[0]
    regions = sd.Regions.from_masks(mesh, masks)
    cages = sd.fit_cages(mesh, regions, 30 * regions.n_regions)
    deformer = sd.Deformer(mesh, regions, cages, fixed=zoo.LEFT, handle=zoo.RIGHT)
    require_solved(deformer, bent(mesh, zoo.RIGHT))


def regions_in_a_session(masks):
    session = sd.Session(scene()[0])
    session.set_regions(sd.Regions.from_masks(session.mesh, masks))
    session.change_options(n_cage_vertices=30 * session.regions.n_regions)
    session.fit_cages()
    session.set_fixed(zoo.LEFT)
    dragged(session, {session.handles.add(zoo.RIGHT): bent(session.mesh, zoo.RIGHT)})


def overlap_of_labels(rings):
    mesh = scene()[0]
    regions = sd.Regions.from_labels(mesh, (mesh.vertices[:, 0] > 0).astype(int), rings)
    regions_in_a_deformer(regions.membership)


def overlap_of_segments(rings):
    mesh = scene()[0]
    regions_in_a_deformer(sd.segment(mesh, 2, overlap=rings).membership)


def overlap_of_a_split_region(rings):
    session = sd.Session(scene()[0])
    session.painting.split(0, overlap=rings)
    regions_only(session.regions.membership)


def require_solved(deformer, targets):
    solution = deformer.solve(targets)
    require_right(deformer.mesh, solution.vertices)
    require_met(solution)


def cage_only(vertices, faces):
    cage = sd.Cage(vertices, faces)
    cage.require_encloses(scene()[0].vertices, "vertices")
    sd.Deformer(*scene()[:2], [cage])  # which checks that it is not too large


def cage_in_a_deformer(vertices, faces):
    mesh, regions, _ = scene()
    cages = [sd.Cage(vertices, faces)]
    deformer = sd.Deformer(mesh, regions, cages, fixed=zoo.LEFT, handle=zoo.RIGHT)
    require_solved(deformer, bent(mesh, zoo.RIGHT))


def cage_in_a_session(vertices, faces):
    mesh, regions, _ = scene()
    session = sd.Session(mesh)
    session.set_regions(regions)
    session.set_cages([sd.Cage(vertices, faces)])
    session.set_fixed(zoo.LEFT)
    dragged(session, {session.handles.add(zoo.RIGHT): bent(mesh, zoo.RIGHT)})


def cage_in_the_filter(vertices, faces):
    cage = as_polydata(vertices, faces)
    filtered(to_polydata(scene()[0]), cages=cage)


def selection_in_a_deformer(fixed, handle):
    mesh = scene()[0]
    deformer = sd.Deformer(*scene(), fixed=fixed, handle=handle)
    require_solved(deformer, bent(mesh, deformer.handle, 5.0))


def selection_changed_later(fixed, handle):
    deformer = sd.Deformer(*scene()).hold(fixed=fixed, handle=handle)
    require_solved(deformer, deformer.mesh.vertices[deformer.handle])


def selection_in_deform(fixed, handle):
    mesh = scene()[0]
    try:
        targets = bent(mesh, np.asarray(handle) if len(handle) else np.zeros(0, int), 5.0)
    except IndexError:  # the handle has bad indices, which must be refused
        targets = np.zeros((1, 3))
    solution = sd.deform(mesh, fixed, handle, targets, n_regions=1, n_cage_vertices=40)
    require_right(mesh, solution.vertices)
    require_met(solution)


def selection_in_a_session(fixed, handle):
    mesh, regions, cages = scene()
    session = sd.Session(mesh)
    session.set_regions(regions)
    session.set_cages(cages)
    session.set_fixed(fixed)
    name = session.handles.add(handle)
    dragged(session, {name: bent(mesh, session.handles[name], 5.0)})


def selection_in_the_filter(fixed, handle):
    filtered(to_polydata(scene()[0]), n_regions=1, fixed=fixed, handle=handle)


def targets_in_a_deformer(targets):
    deformer = sd.Deformer(*scene(), fixed=zoo.LEFT, handle=zoo.RIGHT)
    try:
        require_solved(deformer, targets)
    finally:  # it continues to work after an error
        require_solved(deformer, deformer.mesh.vertices[zoo.RIGHT])


def targets_in_deform(targets):
    mesh = scene()[0]
    options = {"n_regions": 1, "n_cage_vertices": 40}
    solution = sd.deform(mesh, zoo.LEFT, zoo.RIGHT, targets, **options)
    require_right(mesh, solution.vertices)
    require_met(solution)


def session_of_the_scene():
    mesh, regions, cages = scene()
    session = sd.Session(mesh)
    session.set_regions(regions)
    session.set_cages(cages)
    session.set_fixed(zoo.LEFT)
    session.handles.add(zoo.RIGHT, "right")
    return session


def unchanged_if_refused(session, change):
    before = session.state
    try:
        change()
    except SegDeformError:
        assert session.state is before
        raise


def targets_in_a_session(targets):
    session = session_of_the_scene()
    unchanged_if_refused(session, lambda: dragged(session, {"right": targets}))


def targets_without_names(targets):
    dragged(session_of_the_scene(), targets)


def targets_in_the_filter(targets):
    selection = {"fixed": zoo.LEFT, "handle": zoo.RIGHT}
    filtered(to_polydata(scene()[0]), n_regions=1, targets=targets, **selection)


def motion_of_a_handle(matrix):
    session = session_of_the_scene()
    unchanged_if_refused(session, lambda: require_met(session.move_handle("right", matrix)))
    require_right(session.mesh, session.vertices)


def cage_moved(vertices):
    session = session_of_the_scene()
    unchanged_if_refused(session, lambda: session.move_cage(0, vertices))
    require_volume_change(session)
    session.commit()
    session.undo()
    assert np.array_equal(session.vertices, session.mesh.vertices)


def require_volume_change(session):
    """Check that a pose is finite and that the session reports its volume."""
    assert np.isfinite(session.vertices).all()
    now, rest = volume(session.mesh, session.vertices), volume(session.mesh)
    assert abs(session.volume_change - (now - rest) / rest) <= 1e-12


def number_of_regions(value):
    sd.segment(scene()[0], value)


def number_of_cage_vertices(value):
    sd.fit_cages(*scene()[:2], value)


def offset_of_cages(value):
    sd.fit_cages(*scene()[:2], 40, offset=value)


def smoothness_of_regions(value):
    sd.Regions(scene()[0], scene()[1].membership, value)


def distance_of_welding(value):
    sd.repair(*zoo.body(), weld_distance=value)


def largest_hole(value):
    sd.repair(*zoo.body(), largest_hole=value)


def option_of_a_deformer(value, name):
    sd.Deformer(*scene(), **{name: value}).solve(np.zeros((0, 3)))


def option_of_a_session(value, name):
    sd.Session(scene()[0]).change_options(**{name: value})


def steps_of_a_drag(value):
    session = session_of_the_scene()
    session.drag({"right": bent(session.mesh, zoo.RIGHT)}, max_steps=value)


def named(operation, name):
    """Return *operation* for one option, with its name."""
    run = partial(operation, name=name)
    run.__name__ = f"{operation.__name__}: {name}"
    return run


def polydata_to_mesh(polydata):
    assert volume(from_polydata(polydata)) >= 0


def polydata_in_the_filter(polydata):
    filtered(polydata)


def polydata_in_a_file(polydata):
    write_mesh("zoo.vtp", polydata)
    commanded("check", "zoo.vtp")


def polydata_deformed(polydata):
    write_mesh("zoo.vtp", polydata)
    options = ["--fixed", "x<12%", "--handle", "x>88%", "--rotate", "y,15", "--regions", "1"]
    commanded("deform", "zoo.vtp", "-o", "bent.vtp", *options, "--cage-vertices", "40")
    require_right_surface(sd.Surface.read("zoo.vtp"), read_polydata("bent.vtp"))


OTHERS = {
    "regions": (zoo.REGIONS, [regions_only, regions_in_a_deformer, regions_in_a_session]),
    "overlaps": (zoo.OVERLAPS, [overlap_of_labels, overlap_of_segments, overlap_of_a_split_region]),
    "cages": (zoo.CAGES, [cage_only, cage_in_a_deformer, cage_in_a_session, cage_in_the_filter]),
    "cage poses": (zoo.CAGE_POSES, [cage_moved]),
    "selections": (zoo.SELECTIONS, [
        selection_in_a_deformer, selection_changed_later, selection_in_deform,
        selection_in_a_session, selection_in_the_filter,
    ]),
    "targets": (zoo.TARGETS, [
        targets_in_a_deformer, targets_in_deform, targets_in_a_session, targets_without_names,
        targets_in_the_filter,
    ]),
    "motions": (zoo.MOTIONS, [motion_of_a_handle]),
    "numbers": (zoo.NUMBERS, [
        number_of_regions, number_of_cage_vertices, offset_of_cages, smoothness_of_regions,
        distance_of_welding, largest_hole, steps_of_a_drag,
        *(named(option_of_a_deformer, name) for name in (
            "stretch", "tolerance", "max_steps", "rotation_groups",
        )),
        *(named(option_of_a_session, name) for name in (
            "n_cage_vertices", "offset", "stretch", "rotation_groups",
        )),
    ]),
    "PolyData": (zoo.POLYDATA, [
        polydata_to_mesh, polydata_in_the_filter, polydata_in_a_file, polydata_deformed,
    ]),
}  # fmt: skip
TAKE_PAIRS = {"cages", "selections"}
