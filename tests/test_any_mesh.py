"""`deform`, `pull` and `segment` of whatever holds a surface, and `edit`, return its own kind."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere

import vtk_segdeform as sd
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.io import to_polydata
from vtk_segdeform.session import Session
from vtk_segdeform.widgets.hosting import edited, session_of

VERTICES, FACES = icosphere(2)
TOP, BOTTOM = int(VERTICES[:, 2].argmax()), int(VERTICES[:, 2].argmin())
HEIGHT = VERTICES[:, 2].copy()
TO = VERTICES[TOP] + [0.1, 0.0, 0.4]
pytestmark = pytest.mark.usefixtures("bound_once")


def polydata() -> pv.PolyData:
    surface = to_polydata(sd.Mesh(VERTICES, FACES))
    surface.point_data["height"] = HEIGHT
    return surface


def trimesh():
    library = pytest.importorskip("trimesh")
    mesh = library.Trimesh(VERTICES, FACES, process=False, metadata={"made by": object()})
    mesh.vertex_attributes["height"] = HEIGHT
    return mesh


def meshio():
    library = pytest.importorskip("meshio")
    return library.Mesh(
        VERTICES, [("triangle", FACES)], point_data={"height": HEIGHT}, cell_sets={"some": [[3]]}
    )


KINDS = {
    "Mesh": lambda: sd.Mesh(VERTICES, FACES),
    "PolyData": polydata,
    "trimesh": trimesh,
    "meshio": meshio,
    "pair": lambda: (VERTICES, FACES),
}
AS_POLYDATA = {
    "grid": lambda: polydata().cast_to_unstructured_grid(),
    "blocks": lambda: pv.MultiBlock({"ball": polydata()}),
    "Surface": lambda: sd.Surface(polydata()),
}
ALL = KINDS | AS_POLYDATA


def points_of(mesh):
    """Return the points of a mesh of any kind."""
    if isinstance(mesh, tuple):
        return mesh[0]
    return mesh.points if hasattr(mesh, "points") else mesh.vertices


def heights_of(mesh):
    """Return its array "height", if its kind has arrays."""
    arrays = getattr(mesh, "point_data", getattr(mesh, "vertex_attributes", {}))
    return arrays.get("height", HEIGHT)


@pytest.fixture(scope="module")
def expected():
    return sd.pull(sd.Mesh(VERTICES, FACES), TOP, TO, n_regions=1, pins=[BOTTOM])


@pytest.mark.parametrize("name", [*ALL, "path"])
def test_a_pull_keeps_the_numbers_and_the_kind(name, expected, tmp_path):
    if name == "path":
        given = tmp_path / "ball.vtp"
        polydata().save(given)
    else:
        given = ALL[name]()
    solution = sd.pull(given, TOP, TO, n_regions=1, pins=[BOTTOM])
    assert isinstance(solution, sd.Solution)
    assert type(solution.mesh) is (type(given) if name in KINDS else pv.PolyData)
    assert solution.status is sd.Status.CONVERGED
    assert abs(solution.volume_change) < 1e-12
    assert_allclose(points_of(solution.mesh), expected.vertices, atol=1e-9)
    assert_array_equal(heights_of(solution.mesh), HEIGHT)
    if name in KINDS:
        assert_array_equal(points_of(given), VERTICES)
    if name == "trimesh":
        assert solution.mesh.metadata.keys() == {"made by"}
        assert "height" in solution.mesh.vertex_attributes
    if name == "meshio":
        assert "height" in solution.mesh.point_data
        assert solution.mesh.cell_sets == given.cell_sets == {"some": [[3]]}
    again = pickle.loads(pickle.dumps(solution))
    assert_array_equal(points_of(again.mesh), points_of(solution.mesh))


@pytest.mark.parametrize("name", ALL)
def test_an_edited_mesh_is_of_the_kind_that_was_given(name):
    given = ALL[name]()
    kind = type(given) if name in KINDS else pv.PolyData
    back = edited(given, session_of(given))
    assert type(back) is kind
    assert_array_equal(points_of(back), VERTICES)
    assert_array_equal(heights_of(back), HEIGHT)
    other = edited(given, Session(sd.Surface(icosphere(1))))  # opened in the window instead
    assert type(other) is kind
    assert len(points_of(other)) == 18


def test_a_primitive_of_trimesh_becomes_a_plain_mesh():
    library = pytest.importorskip("trimesh")
    sphere = library.primitives.Sphere(subdivisions=2)
    solution = sd.pull(sphere, 0, sphere.vertices[0] * 1.3, n_regions=1)
    assert type(solution.mesh) is library.Trimesh
    assert_array_equal(solution.mesh.vertices, solution.vertices)


def seamed() -> pv.PolyData:
    """Return a cube whose edges are seams: two or three points at one place."""
    return pv.Cube(clean=False).triangulate().subdivide(3)


def test_points_are_numbered_as_given():
    cube = seamed()
    assert sd.Surface(cube).mesh.n_vertices < cube.n_points
    height = cube.points[:, 2]
    low, high = height < -0.45, np.flatnonzero(height > 0.45)[::-1]
    targets = cube.points[high] + [0.2, 0.0, 0.0]
    on_way = cube.points[high] + [0.1, 0.0, 0.0]
    solution = sd.deform(
        cube, low, high, targets, n_regions=1, through=[on_way], stiffness=np.where(low, 2.0, 1.0),
        parts={"top": height > 0.0}, slides=[sd.Slide(np.flatnonzero(np.abs(height) < 0.01))],
    )  # fmt: skip
    assert_allclose(solution.mesh.points[high], targets, atol=1e-6)
    assert_allclose(solution.mesh.points[low], cube.points[low], atol=1e-6)
    corner = int(np.flatnonzero((cube.points == 0.5).all(axis=1))[-1])
    to = cube.points[corner] + 0.1
    pulled = sd.pull(cube, corner, to, n_regions=1, pins=low).mesh
    assert_allclose(pulled.points[corner], to, atol=1e-6)
    assert_allclose(pulled.points[low], cube.points[low], atol=1e-4)  # as a pull holds its pins


def test_a_point_in_no_face_cannot_be_grabbed_and_numbers_are_checked():
    cube = seamed()
    cube.points = np.vstack([cube.points, [[3.0, 3.0, 3.0]]])
    with pytest.raises(ConstraintError, match=r"point 486 is in none"):
        sd.pull(cube, 486, [0, 0, 0])
    with pytest.raises(ConstraintError, match=r"stiffness must have shape \(487,\); got \(486,\)"):
        sd.pull(cube, 0, [0, 0, 0], stiffness=np.ones(486))
    with pytest.raises(ValueError, match="pins must"):
        sd.pull(cube, 0, [0, 0, 0], pins=[487])


def test_regions_of_any_mesh_are_those_of_its_mesh():
    assert_array_equal(
        sd.segment(polydata(), 2).labels, sd.segment(sd.Mesh(VERTICES, FACES), 2).labels
    )


def test_functions_can_be_sent_to_other_processes():
    for function in (sd.deform, sd.pull, sd.segment):
        assert pickle.loads(pickle.dumps(function)) is function
