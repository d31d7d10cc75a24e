"""`Mesh` accepts oriented triangles, closed or with borders, and is immutable."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import CUBE, SOLIDS, icosphere, torus, two_components

import vtk_segdeform as sd
from vtk_segdeform.errors import MeshError
from vtk_segdeform.mesh.faults import find_faults
from vtk_segdeform.mesh.mesh import Mesh


@pytest.fixture(params=SOLIDS, ids=str)
def solid(request):
    return SOLIDS[request.param]


def test_a_mesh_has_the_given_arrays(solid):
    mesh = Mesh(*solid)
    assert_array_equal(mesh.vertices, solid[0])
    assert_array_equal(mesh.faces, solid[1])
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float64, np.int64)
    assert (mesh.n_vertices, mesh.n_faces) == (len(solid[0]), len(solid[1]))


def test_the_error_counts_every_fault():
    vertices, faces = icosphere(2)
    broken = np.concatenate([faces[1:], faces[5:7], [[0, 0, 1]]])
    with pytest.raises(MeshError) as caught:
        Mesh(np.append(vertices, [[9.0, 9.0, 9.0]], axis=0), broken)
    for words in ("1 unreferenced vertex (vertex 66)", "1 degenerate face (face 129)",
                  "2 duplicate faces (face 127, 128)"):  # fmt: skip
        assert words in str(caught.value)
    assert "open" not in str(caught.value)  # allowed
    assert "repair" in str(caught.value)


def test_a_mesh_is_immutable_and_independent_of_the_arrays_it_was_made_from():
    vertices, faces = CUBE[0].copy(), CUBE[1].copy()
    mesh = Mesh(vertices, faces)
    vertices[:], faces[:] = 7.0, 0
    assert_array_equal(mesh.vertices, CUBE[0])
    assert_array_equal(mesh.faces, CUBE[1])
    for array in (mesh.vertices, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(AttributeError):
        mesh.vertices = vertices


def test_edges_are_sorted_unique_and_satisfy_eulers_formula():
    for (vertices, faces), euler in ((icosphere(2), 2), (torus(), 0), (two_components(), 4)):
        edges = Mesh(vertices, faces).edges
        assert len(vertices) - len(edges) + len(faces) == euler
        pairs = {
            (min(i, j), max(i, j))
            for f in faces.tolist()
            for i, j in zip(f, f[1:] + f[:1], strict=True)
        }
        assert [tuple(e) for e in edges.tolist()] == sorted(pairs)


def test_components_area_and_size_of_known_solids():
    mesh = Mesh(*CUBE)
    assert mesh.face_areas.sum() == pytest.approx(6.0)
    assert mesh.diagonal == pytest.approx(np.sqrt(3.0))
    assert set(mesh.components) == {0}
    vertices, _ = two_components()
    assert_array_equal(Mesh(*two_components()).components, vertices[:, 0] > 1.5)


def test_a_pose_shares_the_triangles_and_their_cached_values():
    mesh = Mesh(*torus())
    edges = mesh.edges
    posed = mesh.with_vertices(2.0 * mesh.vertices)
    assert posed.faces is mesh.faces
    assert posed.edges is edges
    assert posed.diagonal == pytest.approx(2.0 * mesh.diagonal)
    assert posed.face_areas.sum() == pytest.approx(4.0 * mesh.face_areas.sum())
    assert not posed.vertices.flags.writeable


def test_a_pose_may_be_inside_out():
    mesh = Mesh(*CUBE)
    assert not find_faults(mesh.with_vertices(-mesh.vertices).vertices, mesh.faces).ok


def test_a_pose_must_be_finite_and_have_the_same_number_of_vertices():
    mesh = Mesh(*CUBE)
    with pytest.raises(ValueError, match="vertices must be finite; 1 of 8 points have NaN"):
        mesh.with_vertices(np.where(np.arange(8)[:, None] == 2, np.nan, mesh.vertices))
    with pytest.raises(ValueError, match=r"vertices must have shape \(8, 3\); got \(7, 3\)"):
        mesh.with_vertices(mesh.vertices[:7])


@pytest.mark.parametrize(
    "call",
    [
        lambda it: sd.Regions.single(it),
        lambda it: sd.fit_cages(it, None),
        lambda it: sd.Deformer(it, None, ()),
        lambda it: sd.Session(it),
    ],
)
def test_the_error_for_another_type_says_how_to_make_a_mesh(call):
    polydata = sd.io.to_polydata(sd.models.bar(divisions=(1, 1, 2)))
    says = r"mesh must be a Mesh; got {}\. Make one with {}\.mesh$"
    for given, name, line in (
        (np.zeros((4, 3)), "ndarray", r".* or Surface\(polydata\)"),
        (polydata, "PolyData", r"Surface\(mesh\)"),
    ):
        with pytest.raises(sd.errors.MeshError, match=says.format(name, line)):
            call(given)
    assert isinstance(sd.Surface(polydata).mesh, sd.Mesh)


def test_the_mesh_of_some_components_has_their_vertices_faces_and_borders():
    ball, open_ball = icosphere(1), icosphere(1)
    faces = np.concatenate([ball[1], open_ball[1][2:] + len(ball[0])])
    mesh = Mesh(np.concatenate([ball[0], open_ball[0] + 3.0]), faces)
    for which, single in ((0, Mesh(*ball)), (1, Mesh(open_ball[0] + 3.0, open_ball[1][2:]))):
        part, kept = mesh.of_components(np.arange(2) == which)
        assert_array_equal(part.vertices, mesh.vertices[kept])
        assert_array_equal(part.vertices, single.vertices)
        assert_array_equal(part.faces, single.faces)
        assert_array_equal(part.boundary, single.boundary)
        assert_array_equal(part.edges, single.edges)
        assert part.is_two_manifold == single.is_two_manifold == (which == 0)
        assert part.is_closed == single.is_closed
        assert_array_equal(part.components, np.zeros(part.n_vertices))
        assert part.n_faces == len(single.faces)
        assert part.diagonal == single.diagonal
    assert_array_equal(mesh.of_components([0, 1])[1], np.arange(mesh.n_vertices))
    with pytest.raises(MeshError, match="which is empty"):
        mesh.of_components([])


def test_areas_and_adjacency_are_those_of_the_faces():
    box = CUBE[0] * [2.0, 3.0, 4.0]
    mesh = Mesh(box, CUBE[1])
    assert_allclose(np.sort(mesh.face_areas), np.repeat([3.0, 4.0, 6.0], 4))
    a, b, c = box[CUBE[1]].transpose(1, 0, 2)
    assert_allclose(mesh.face_areas, 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
    assert mesh.vertex_areas.sum() == pytest.approx(52.0)
    first = (CUBE[1] == 0).any(axis=1)
    assert mesh.vertex_areas[0] == pytest.approx(mesh.face_areas[first].sum() / 3.0)
    lengths = np.zeros((8, 8))
    for face in CUBE[1]:
        for i, j in itertools.permutations(face, 2):
            lengths[i, j] = np.linalg.norm(box[i] - box[j])
    assert_allclose(mesh.adjacency.toarray(), lengths)
    assert mesh.adjacency.nnz == 2 * len(mesh.edges) == 36
