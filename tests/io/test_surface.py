"""`Surface`: any PolyData becomes a mesh, and the differences are told with their places."""

from __future__ import annotations

import numpy as np
import organs
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import rotation, torus

import vtk_segdeform as sd
from vtk_segdeform.errors import ArgumentError, ConstraintError, MeshError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io.polygons import polydata_of
from vtk_segdeform.mesh import Kind


def surface_of(points, *polygons):
    counts = np.array([len(polygon) for polygon in polygons])
    return polydata_of(np.asarray(points, float), counts, np.concatenate(polygons))


def texts(surface):
    return [str(each) for each in surface.workarounds]


def test_a_cube_with_seams_is_welded_and_each_workaround_says_where():
    surface = sd.Surface(pv.Cube(clean=False))
    assert surface.mesh.is_two_manifold
    assert signed_volume(surface.mesh.vertices, surface.mesh.faces) == pytest.approx(1.0)
    (welded,) = surface.workarounds
    assert (welded.kind, welded.count, welded.text) == (
        Kind.COINCIDENT, 24, "welded 24 seam points",
    )  # fmt: skip
    assert_array_equal(welded.points, np.arange(24))
    assert_array_equal(surface.mesh.vertices[surface.vertex_of], surface.given.points)
    assert len(surface.vertices_at(np.arange(4))) == 4


def test_all_that_differs_is_told():
    vertices, faces = torus(12, 8)
    n = len(vertices)
    left = np.delete(faces, [0, 100], axis=0)
    turned = left.copy()
    turned[7] = turned[7, ::-1]
    fin = [*faces[50, :2], n]
    points = np.append(vertices, [[9.0, 9.0, 9.0], [8.0, 8.0, 8.0]], axis=0)
    surface = sd.Surface(surface_of(points, *turned, turned[3], [5, 5, 6], fin))
    assert texts(surface) == [
        "flipped 1 face", "ignored 1 duplicate face", "ignored 1 degenerate face",
        "1 point is in no face", "3 holes", "1 edge with three or more faces",
    ]  # fmt: skip
    places = {each.kind: each.points for each in surface.workarounds}
    assert_array_equal(places[Kind.TURNED_EDGE], np.sort(left[7]))
    assert_array_equal(places[Kind.DUPLICATE_FACE], np.sort(left[3]))
    assert_array_equal(places[Kind.UNREFERENCED], [n + 1])
    assert_array_equal(places[Kind.NON_MANIFOLD_EDGE], np.sort(fin[:2]))
    assert_array_equal(places[Kind.HOLE], np.unique([*faces[0], *faces[100], *fin]))


@pytest.mark.parametrize(
    ("polydata", "message"),
    [
        (pv.PolyData(), "it has no faces"),
        (pv.PolyData(np.eye(3)), "it has no faces"),
        (surface_of(np.zeros((4, 3)), [0, 1, 2, 3]), "all faces are flat"),
        (surface_of([[0, 0, 0], [1, 0, 0], [np.nan, 1, 0]], [0, 1, 2]), r"NaN .*\(vertex 2\)"),
        (surface_of([[0, 0, 0], [1, 0, 0], [0, np.inf, 0], [0, 1, 0]], [0, 1, 2, 3]), "NaN or inf"),
    ],
)
def test_what_cannot_be_deformed_is_refused_at_once(polydata, message):
    with pytest.raises(MeshError, match=message):
        sd.Surface(polydata)


def test_a_handle_of_points_in_no_face_is_an_error():
    given = pv.Sphere(theta_resolution=8, phi_resolution=6)
    n = given.n_points
    stray = pv.PolyData(np.vstack([given.points, [[0, 0, 2.0]]]), given.faces)
    surface = sd.Surface(stray)
    with pytest.raises(ConstraintError, match="no point of the handle is in a face"):
        surface.targets_at([n], [[0.0, 0.0, 3.0]])
    vertices, targets = surface.targets_at([0, n], [[0.0, 0.0, 1.0], [0.0, 0.0, 3.0]])
    assert len(vertices) == 1
    assert_array_equal(targets, [[0.0, 0.0, 1.0]])


def parametric(kind, radius):
    """Return a torus, or for 0 a sphere, of quads whose seams and poles are computed."""
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 25), np.linspace(0.0, np.pi, 13))
    u, v = u.astype(kind), v.astype(kind) * kind(2.0 if radius else 1.0)
    across = kind(radius) + np.sin(v)
    x, y, z = across * np.cos(u), across * np.sin(u), np.cos(v)
    turn = rotation([1.0, 2.0, 0.5], 0.7)
    points = (np.stack([x, y, z], axis=-1).reshape(-1, 3) @ turn.T).astype(kind)
    k, n = np.arange(12)[:, None] * 25 + np.arange(24), 25
    quads = np.stack([k, k + n, k + n + 1, k + 1], axis=-1).reshape(-1, 4)
    return polydata_of(points, np.full(len(quads), 4), quads.ravel())


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("radius", [3.0, 0.0])
@pytest.mark.parametrize("suffix", [".vtp", ".ply", ".obj"])
def test_computed_seams_and_poles_are_closed_also_after_writing(tmp_path, kind, radius, suffix):
    surface = sd.Surface(parametric(kind, radius))
    mesh = surface.mesh
    assert mesh.is_closed
    assert mesh.n_vertices == (24 * 12 if radius else 24 * 11 + 2)
    assert_array_equal(surface.moved(mesh.vertices).points, surface.given.points)
    bent = mesh.vertices + 0.1 * np.sin(mesh.vertices[:, [1, 2, 0]])
    surface.write(tmp_path / f"a{suffix}", bent)
    again = sd.Surface.read(tmp_path / f"a{suffix}")
    assert again.mesh.is_closed
    assert again.mesh.n_vertices == mesh.n_vertices
    assert_array_equal(np.unique(again.mesh.vertices, axis=0), np.unique(bent, axis=0))


def test_a_surface_of_a_known_mesh_is_the_same_surface_and_others_do_not_fit(tmp_path):
    given = pv.Cube().triangulate()
    stray = pv.PolyData(np.vstack([given.points, [[9.0, 9.0, 9.0]]]), given.faces)
    surface = sd.Surface(stray)
    again = sd.Surface.of(stray, surface._soup)
    assert again.mesh is surface.mesh
    assert_array_equal(again.loose, [len(given.points)])
    assert_array_equal(again.vertex_of, surface.vertex_of)
    assert again.workarounds == surface.workarounds
    with pytest.raises(MeshError, match="the mesh of 9 points is not one of 8 points"):
        sd.Surface.of(given, surface._soup)
    pose = 2.0 * surface.mesh.vertices + [1.0, 0.0, 0.0]
    again.write(tmp_path / "a.ply", pose)
    assert_array_equal(sd.io.read_polydata(tmp_path / "a.ply").points, surface.moved(pose).points)
    for values, count in ((np.zeros(7), 8), (3.0, 8)):
        with pytest.raises(ArgumentError, match=f"one row for each vertex of the mesh, {count}"):
            surface.at_points(values)
    with pytest.raises(ArgumentError, match="one row for each given point, 9"):
        surface.at_vertices(np.zeros(8))


def test_each_label_has_the_bodies_that_have_its_volume():
    """Boxes of voxels: two that touch, one inside of another, and one in two parts."""
    labels = np.zeros((16, 12, 24), dtype=int)
    for label, box in (
        (9, np.s_[1:11, 1:11, 1:11]),
        (2, np.s_[4:7, 4:8, 5:7]),
        (5, np.s_[1:11, 1:11, 11:14]),
        (7, np.s_[1:4, 1:4, 17:22]),
        (7, np.s_[8:11, 1:6, 17:22]),
    ):
        labels[box] = label
    surface = sd.Surface(organs.surface_of(labels))
    found = surface.labels()
    assert found[2] == ("cavity 0",)
    assert {label: len(names) for label, names in found.items()} == {9: 1, 2: 1, 5: 1, 7: 2}
    mesh, regions = surface.mesh, sd.Regions.single(surface.mesh)
    volumes = sd.Deformer(mesh, regions, sd.fit_cages(mesh, regions, 40)).volumes()
    volumes["cavity 0"] = volumes["cavity"]
    for label, names in found.items():
        own = sum(volumes[name] for name in names)
        assert own == pytest.approx(np.count_nonzero(labels == label), rel=0.25)  # round corners
    assert sd.Surface(surface.given.copy()).labels("others") == {}
