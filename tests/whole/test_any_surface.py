"""Any surface is bent as it is: what was given and what comes back differ in coordinates only.

Seventy surfaces of `any_surface` are bent through a session and compared with what was given, cell
by cell and array by array.  Doubled points still coincide, the volume is the same wherever there is
one, and a surface whose mesh is that of a clean original has the pose of the original.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import pyvista as pv
from any_surface import SPECIMENS, Specimen
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere, rotation
from zoo_operations import bent, ends, require_right

import vtk_segdeform as sd
from vtk_segdeform.io.polygons import polygons_of

NAMED = {each.name: each for each in SPECIMENS}
TURN = rotation([0.0, 1.0, 0.0], 0.5)
EACH = pytest.mark.parametrize("specimen", SPECIMENS, ids=[each.name for each in SPECIMENS])


@cache
def surface_of(name: str) -> sd.Surface:
    return sd.Surface(NAMED[name].make())


@cache
def bent_session(name: str) -> sd.Session:
    """Return a session of a surface, bent in one cage around all of it."""
    return bent_in_a_box(surface_of(name))


def bent_in_a_box(subject: sd.Surface | sd.Mesh) -> sd.Session:
    """Return a session bent by 30 degrees, with a cage that depends on the bounding box only."""
    session = sd.Session(subject)
    mesh = session.mesh
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    cage_points, cage_faces = icosphere(1)
    extent = np.maximum(high - low, 0.2 * mesh.diagonal)  # a sheet is flat
    middle = 0.5 * (low + high)  # unlike the mean of vertices the same to the last bit
    cage = cage_points / np.ptp(cage_points, axis=0) * 2.4 * extent + middle
    session.set_regions(sd.Regions.single(mesh))
    session.set_cages([sd.Cage(cage, cage_faces)])
    fixed, handle = ends(mesh)
    drag(session, fixed, handle, (mesh.vertices[handle] - middle) @ TURN.T + middle)
    return session


@cache
def fitted_session(name: str) -> sd.Session:
    """Return a session of a surface, bent in two regions with cages of few vertices."""
    session = sd.Session(surface_of(name))
    mesh = session.mesh
    session.segment(min(2, mesh.n_vertices))
    session.change_options(n_cage_vertices=30 * session.regions.n_regions)
    session.fit_cages()
    fixed, handle = ends(mesh)
    drag(session, fixed, handle, bent(mesh, handle, 30.0))
    return session


def drag(session: sd.Session, fixed, handle, targets) -> None:
    session.set_fixed(np.setdiff1d(fixed, handle))
    session.handles.add(handle, "end")
    session.drag({"end": targets}, max_steps=8)
    session.commit()


FITTED = {"Moebius strip", "soup of everything, flipped"}
OFTEN = {*FITTED, *list(NAMED)[::5]}  # bent in `make test`


def bent_often(specimen: Specimen, session_of=bent_session, often=OFTEN):
    """Return a row of `parametrize`: the specimen and its session; the rare in the campaign."""
    fitted = ", fitted" if session_of is fitted_session else ""
    marks = () if specimen.name in often else pytest.mark.campaign
    return pytest.param(specimen, session_of, id=specimen.name + fitted, marks=marks)


BENT = pytest.mark.parametrize(
    ("specimen", "session_of"),
    [bent_often(each) for each in SPECIMENS]
    + [bent_often(each, fitted_session, FITTED) for each in SPECIMENS],
)


# Comparison of what was given and what comes back.


def same_values(one, two) -> bool:
    """Return whether two arrays have the same type, shape and values, bit by bit."""
    one, two = np.asarray(one), np.asarray(two)
    return (one.dtype, one.shape, one.tobytes()) == (two.dtype, two.shape, two.tobytes())


def differences(given: pv.PolyData, moved: pv.PolyData) -> list[str]:
    """Return all that differs apart from coordinates and the values of normals."""
    found = [
        what for what in ("n_points", "n_cells") if getattr(given, what) != getattr(moved, what)
    ]
    for what in ("verts", "lines", "faces", "strips"):
        if not same_values(getattr(given, what), getattr(moved, what)):
            found.append(what)
    for kind in ("point_data", "cell_data", "field_data"):
        one, two = getattr(given, kind), getattr(moved, kind)
        if list(one.keys()) != list(two.keys()):
            found.append(f"names of {kind}: {list(one.keys())}, {list(two.keys())}")
            continue
        normals = {"Normals", "NormalCorners", getattr(one, "active_normals_name", None)}
        for name in one.keys():  # noqa: SIM118 - not a dict
            a, b = np.asarray(one[name]), np.asarray(two[name])
            alike = (
                (a.dtype, a.shape) == (b.dtype, b.shape) if name in normals else same_values(a, b)
            )
            if not alike:
                found.append(f"{kind}[{name!r}]")
        for active in ("scalars", "vectors", "normals", "texture_coordinates"):
            name = f"active_{active}_name"
            if kind != "field_data" and getattr(one, name, None) != getattr(two, name, None):
                found.append(f"{kind}.{name}")
    return found


def groups(keys) -> np.ndarray:
    """Return a number for each row, the same for equal rows; NaN equal nothing."""
    return np.unique(np.asarray(keys), axis=0, return_inverse=True, equal_nan=False)[1].reshape(-1)


def used_points(surface: pv.PolyData) -> np.ndarray:
    """Return the points that polygons and strips use."""
    return np.unique(polygons_of(surface)[1])


# At rest.


@EACH
def test_every_surface_has_a_mesh_and_at_rest_it_is_what_was_given(specimen: Specimen):
    given = specimen.make()
    surface = sd.Surface(given)
    again = surface.moved(surface.mesh.vertices)
    assert differences(given, again) == []
    assert_array_equal(np.asarray(again.points, given.points.dtype), given.points)
    assert differences(specimen.make(), given) == []  # which is not changed
    if specimen.borders is not None:
        assert len(surface.mesh.borders) == specimen.borders
        assert surface.mesh.is_closed == (specimen.borders == 0)


def by_position(mesh: sd.Mesh) -> np.ndarray:
    """Return the triangles as sorted positions (m, 9), each from its lowest corner."""
    order = np.lexsort((mesh.vertices + 0.0).T[::-1])
    rank = np.empty(mesh.n_vertices, int)
    rank[order] = np.arange(mesh.n_vertices)
    faces = rank[mesh.faces]
    first = faces.argmin(axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    return (mesh.vertices + 0.0)[order][faces[np.lexsort(faces.T[::-1])]].reshape(-1, 9)


CLEAN = [each for each in SPECIMENS if each.clean is not None]


@pytest.mark.parametrize("specimen", CLEAN, ids=[each.name for each in CLEAN])
def test_the_mesh_is_that_of_the_clean_original(specimen: Specimen):
    mesh = surface_of(specimen.name).mesh
    assert_array_equal(by_position(mesh), by_position(sd.Mesh(*specimen.clean())))


# Bent.


@BENT
def test_bent_it_differs_in_coordinates_and_normals_only(specimen: Specimen, session_of):
    session = session_of(specimen.name)
    given, moved = surface_of(specimen.name).given, session.deformed
    assert differences(given, moved) == []
    assert np.isfinite(session.vertices).all()
    used = used_points(given)
    change = np.linalg.norm(moved.points[used] - given.points[used], axis=1)
    assert np.isfinite(change).all()
    assert change.max() > 0.02 * session.mesh.diagonal
    undefined = ~np.isfinite(given.points)
    assert_array_equal(~np.isfinite(moved.points), undefined)
    # Points that follow one vertex and were equal are still equal, and so are those of seams.
    follows = np.column_stack([given.points + 0.0, surface_of(specimen.name).vertex_of])[used]
    before, after = groups(follows), groups(moved.points[used] + 0.0)
    assert len(np.unique(np.stack([before, after]), axis=1).T) == before.max() + 1
    # What a file with triangles would show has no new gap: working vertices at the same place.
    if specimen in CLEAN:
        assert groups(given.points[used] + 0.0).max() == before.max() == session.mesh.n_vertices - 1


@BENT
def test_bent_it_has_its_volume_where_it_encloses_one(specimen: Specimen, session_of):
    session = session_of(specimen.name)
    require_right(session.mesh, session.vertices)


@cache
def bent_original(clean) -> sd.Session:
    return bent_in_a_box(sd.Mesh(*clean()))


@pytest.mark.parametrize(("specimen", "session_of"), [bent_often(each) for each in CLEAN])
def test_the_pose_is_that_of_the_clean_original_to_rounding(specimen: Specimen, session_of):
    session, original = session_of(specimen.name), bent_original(specimen.clean)
    mesh = session.mesh
    order, other = (np.lexsort((m.vertices + 0.0).T) for m in (mesh, original.mesh))
    far = np.abs(mesh.vertices).max() / mesh.diagonal
    atol = mesh.diagonal * (3e-7 + 1e-12 * far)
    assert_allclose(session.vertices[order], original.vertices[other], atol=atol)


# Normals.

SMOOTH = [
    "texture seam",
    "quadrilaterals with normals",
    "inside out, with normals",
    "seam with normals and fins",
]


@pytest.mark.parametrize("name", [*SMOOTH, "split normals", "cylinder with sharp edges"])
def test_normals_turn_with_a_rigid_motion(name: str):
    """Each keeps its side, splits and smoothing, whatever the order and orientation of faces."""
    surface = surface_of(name)
    turn = rotation([1.0, 2.0, 3.0], 0.7)
    moved = surface.moved(surface.mesh.vertices @ turn.T)
    before, after = (np.asarray(x.point_data["Normals"], float) for x in (surface.given, moved))
    assert_allclose(np.linalg.norm(after, axis=1), 1.0, atol=1e-6)
    cosines = np.einsum("ij,ij->i", before @ turn.T, after)
    assert cosines.min() > 0.9, f"{np.degrees(np.arccos(cosines.min())):.0f} degrees"
    key = np.column_stack([surface.given.points, np.round(before, 5)]) + 0.0
    where = groups(key)  # one place and one normal: still one normal
    for pick in np.unique(where):
        assert np.ptp(after[where == pick], axis=0).max() < 1e-5
    if "Normals" in surface.given.cell_data:
        faces = surface.given.cell_data["Normals"] @ turn.T
        assert_allclose(moved.cell_data["Normals"], faces, atol=1e-5)


# Ids of what was given.


@EACH
def test_values_at_given_points_and_at_vertices_are_inverse(specimen: Specimen):
    surface = surface_of(specimen.name)
    values = np.random.default_rng(0).normal(size=surface.mesh.n_vertices)
    assert_array_equal(surface.at_vertices(surface.at_points(values)), values)
    some = np.arange(surface.given.n_points) % 3 == 0
    at_vertex = (surface.given.points == surface.mesh.vertices[surface.vertex_of]).all(axis=1)
    assert_array_equal(surface.vertices_at(some), np.unique(surface.vertex_of[some & at_vertex]))
