"""`mesh_of`: any triangles become a mesh, and every given point follows a vertex of it."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from solids import CUBE, SOLIDS, icosphere, soup, together, torus, two_components

from vtk_segdeform.errors import ConstraintError, MeshError
from vtk_segdeform.mesh import Kind, find_faults, mesh_of

SPHERE = icosphere(2)
BODIES = [*SOLIDS.values(), SPHERE, torus(12, 8), two_components()]
BODIES = [body for body in BODIES if len(body[1]) < 400]


def checked(vertices, faces):
    """Return the mesh of triangles, after checks that hold for any."""
    vertices, faces = np.asarray(vertices, float), np.asarray(faces)
    before = vertices.copy(), faces.copy()
    found = mesh_of(vertices, faces)
    mesh = found.mesh
    assert_array_equal(found.moved(mesh.vertices), vertices)  # bit for bit
    in_face = np.setdiff1d(np.arange(len(vertices)), found.loose)
    there = mesh.vertices[found.vertex_of[in_face]]
    assert_allclose(there, vertices[in_face], rtol=0.0, atol=2e-15 * np.abs(there).max())
    given = {
        tuple(sorted(found.vertex_of[face].tolist()))
        for face in faces
        if not np.isin(face, found.loose).any()
    }
    given = {face for face in given if len(set(face)) == 3}
    assert given == {tuple(sorted(face)) for face in mesh.faces.tolist()}
    report = find_faults(mesh.vertices, mesh.faces)
    assert report.ok
    counts = {each.kind: each.count for each in found.workarounds}
    for kind in (Kind.HOLE, Kind.NON_MANIFOLD_EDGE, Kind.ONE_SIDED):
        assert counts.get(kind, 0) == report.count(kind)
    again = mesh_of(mesh.vertices, mesh.faces)
    assert_array_equal(again.mesh.faces, mesh.faces)
    assert_array_equal(again.mesh.vertices, mesh.vertices)
    assert_array_equal(vertices, before[0])
    assert_array_equal(faces, before[1])
    for each in found.workarounds:
        assert str(each) == each.text
        assert each.text.startswith((str(each.count), "welded", "flipped", "ignored"))
        assert 0 < len(each.points) == len(np.unique(each.points)) <= len(vertices)
    return found


def texts(found):
    return [str(each) for each in found.workarounds]


@pytest.mark.parametrize("body", BODIES, ids=len)
def test_a_mesh_remains_the_same_bit_for_bit(body):
    found = checked(*body)
    assert_array_equal(found.mesh.vertices, body[0])
    assert_array_equal(found.mesh.faces, body[1])
    assert_array_equal(found.vertex_of, np.arange(len(body[0])))
    assert found.workarounds == ()


@pytest.mark.parametrize("body", BODIES, ids=len)
def test_a_triangle_soup_is_welded_to_the_body(body):
    found = checked(*soup(*body))
    assert found.mesh.n_vertices == len(np.unique(body[0], axis=0)) == len(body[0])
    assert found.mesh.is_two_manifold
    assert_array_equal(found.mesh.vertices[found.mesh.faces], body[0][body[1]])
    _, first = np.unique(body[1], return_index=True)  # the vertices are numbered by first corners
    assert_array_equal(found.vertex_of[np.sort(first)], np.arange(len(first)))
    assert texts(found) == [f"welded {3 * len(body[1])} seam points"]


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("at", [0.0, 100.0])
def test_border_points_at_the_same_position_but_for_rounding_are_welded(kind, at):
    vertices, faces = soup(SPHERE[0] + at, SPHERE[1])
    moved = vertices.astype(kind)
    moved[7] = np.nextafter(moved[7], kind(9.0 + at))
    found = mesh_of(moved, faces)
    assert found.mesh.is_closed
    assert len(found.loose) == 0
    assert_array_equal(found.moved(found.mesh.vertices), moved)
    assert_array_equal(found.vertices_at([7]), [found.vertex_of[7]])
    zero = np.where(np.arange(len(vertices))[:, None] % 2, vertices, np.negative(vertices) * -1.0)
    assert checked(zero, faces).mesh.is_closed  # -0.0 is 0.0


@pytest.mark.parametrize("away", [1e-9, 1e-5])
def test_border_points_that_almost_coincide_are_not_welded_but_reported(away):
    vertices, faces = soup(*SPHERE)
    moved = vertices.copy()
    moved[7] += away
    found = checked(moved, faces)
    assert found.mesh.n_vertices == len(SPHERE[0]) + 1
    assert "2 border points almost coincide (not welded)" in texts(found)
    (told,) = (each for each in found.workarounds if "almost" in each.text)
    assert 7 in told.points
    moved[7] += 0.01
    assert not any("almost" in text for text in texts(checked(moved, faces)))


def test_a_gap_of_one_step_of_coarse_coordinates_remains():
    step = 2.0**-10  # of single precision at 1e4
    sheet = 3.0 * step * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    both = np.concatenate([sheet, sheet + [4.0 * step, 0.0, 0.0]]) + [8192.0, 0.0, 0.0]
    assert_array_equal(both.astype(np.float32), both)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    assert checked(both, faces).workarounds[-1].text == "2 holes"
    assert mesh_of(both, faces).mesh.n_vertices == 8


def test_a_sheet_given_twice_becomes_one_sheet():
    vertices, faces = SPHERE
    cap = faces[(vertices[faces][:, :, 2] > 0.3).all(axis=1)]
    used = np.unique(cap)
    sheet = vertices[used], np.searchsorted(used, cap)
    n, m = len(used), len(cap)
    shared = checked(sheet[0], np.concatenate([sheet[1], sheet[1][:, ::-1]]))
    assert texts(shared) == [f"ignored {m} duplicate faces", "1 hole"]
    doubled = (
        np.concatenate([sheet[0], sheet[0]]),
        np.concatenate([sheet[1], sheet[1][:, ::-1] + n]),
    )
    apart = checked(*doubled)
    assert texts(apart) == [
        f"welded {2 * n} seam points", f"ignored {m} duplicate faces", "1 hole",
    ]  # fmt: skip
    for found in (shared, apart, checked(*soup(*doubled))):
        assert found.mesh.n_vertices == n
        assert_array_equal(found.mesh.vertices[found.mesh.faces], sheet[0][sheet[1]])


def test_degenerate_faces_and_points_in_no_face_are_ignored():
    vertices, faces = SPHERE
    more = np.append(vertices, [[9.0, 9.0, 9.0], [np.nan, np.inf, 0.0], [0, 0, 1e90]], axis=0)
    found = checked(more, np.concatenate([[[0, 0, 1]], faces, faces[:3], [[67, 67, 68]]]))
    assert texts(found) == [
        "ignored 3 duplicate faces", "ignored 2 degenerate faces", "3 points are in no face",
    ]  # fmt: skip
    assert_array_equal(found.mesh.faces, faces)
    away = np.linalg.norm(vertices - 9.0, axis=1)
    assert away[found.vertex_of[66]] == pytest.approx(away.min())
    moved = found.moved(found.mesh.vertices + [1.0, 0.0, 0.0])
    assert_array_equal(moved[:66], vertices + [1.0, 0.0, 0.0])
    assert_array_equal(moved[66:], more[66:] + [1.0, 0.0, 0.0])


@pytest.mark.parametrize("size", [1e-14, 1e-30, 1e-100])
def test_a_component_as_small_as_a_rounding_error_is_ignored(size):
    vertices, faces = SPHERE
    points = np.concatenate([vertices + [2.0, 0.0, 0.0], size * vertices])
    found = mesh_of(points, np.concatenate([faces, faces + len(vertices)]))
    assert texts(found) == [f"ignored {len(faces)} faces without area"]
    assert_array_equal(found.mesh.faces, faces)
    assert_array_equal(found.moved(found.mesh.vertices), points)


def test_a_component_without_area_follows_the_nearest_vertices():
    vertices, faces = SPHERE
    line = np.array([[2.0, 0, 0], [2, 0, 1], [2, 0, 3], [2, 0, 7]])
    n = len(vertices)
    more = np.array([[n, n + 1, n + 2], [n + 1, n + 2, n + 3]])
    unused = [[5.0, 5.0, 5.0]]
    found = checked(np.concatenate([vertices, line, unused]), np.append(more, faces, axis=0))
    assert_array_equal(found.mesh.faces, faces)
    assert [str(each) for each in found.workarounds] == [
        "ignored 2 faces without area",
        "1 point is in no face",
    ]
    assert_array_equal(found.workarounds[0].points, n + np.arange(4))
    assert_array_equal(found.workarounds[1].points, n + 4)
    moved = found.moved(found.mesh.vertices + [0.0, 0.0, 1.0])
    assert_array_equal(moved[n : n + 4], line + [0.0, 0.0, 1.0])
    joined = np.array([[n, n + 1, 0]])  # touches the sphere in a vertex
    mesh = checked(
        np.concatenate([vertices, vertices[:1] + [[1, 0, 0], [2, 0, 0]]]),
        np.append(faces, joined, axis=0),
    ).mesh
    assert mesh.n_faces == len(faces) + 1


def test_a_moebius_strip_is_left_as_it_is():
    k = np.arange(12)
    a, t = 2 * np.pi * k / 12, np.pi * k / 12
    r = np.stack([1 - 0.3 * np.cos(t), 1 + 0.3 * np.cos(t)], axis=1)
    z = np.stack([-0.3 * np.sin(t), 0.3 * np.sin(t)], axis=1)
    vertices = np.stack([r * np.cos(a)[:, None], r * np.sin(a)[:, None], z], axis=-1).reshape(-1, 3)
    here, there = 2 * k, 2 * (k + 1)
    one, two = np.where(k < 11, there, 1), np.where(k < 11, there + 1, 0)
    faces = np.concatenate([np.stack([here, here + 1, one], 1), np.stack([here + 1, two, one], 1)])
    found = checked(vertices, faces)
    assert_array_equal(found.mesh.faces, faces)
    assert texts(found) == ["1 hole", "1 one-sided component"]


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([], [], "it has no faces"),
        (np.eye(3), [], "it has no faces"),
        (CUBE[0], CUBE[1] + 1, "faces? with a vertex index out of range"),
        (np.where(CUBE[0] == CUBE[0][3], np.nan, CUBE[0]), CUBE[1], "NaN or infinite coordinates"),
        (CUBE[0] * 1e80, CUBE[1], "too far from the origin"),
        (CUBE[0] * 1e-80, CUBE[1], "too small to compute volumes"),
        (np.append(CUBE[0][:-1], [[0, 0, 1e16]], axis=0), CUBE[1], "too far from all others"),
        (CUBE[0], [[0, 0, 1], [2, 3, 3]], "all faces are flat"),
        (CUBE[0] * [1.0, 0.0, 0.0], CUBE[1], "all faces are flat"),
    ],
)
def test_the_few_refusals_are_named_and_give_advice(vertices, faces, message):
    with pytest.raises(MeshError, match=f"this surface cannot be deformed: .*{message}.*; "):
        mesh_of(vertices, faces)


def hostile(rng):
    """Return random triangles, with every damage that occurs in files."""
    if rng.random() < 0.25:
        n = rng.integers(3, 12)
        vertices = rng.integers(0, 3, (n, 3)) if rng.random() < 0.5 else rng.normal(size=(n, 3))
        return vertices.astype(float), rng.integers(0, n, (rng.integers(1, 30), 3))
    parts = []
    for _ in range(rng.integers(1, 4)):
        vertices, faces = BODIES[rng.integers(len(BODIES))]
        vertices = vertices * rng.choice([1.0, 0.5, 2.0]) + rng.choice([0.0, 0.0, 1.0, 3.0], 3)
        parts.append((vertices, faces[:, :: rng.choice([1, -1])]))
    starts = np.cumsum([0] + [len(v) for v, _ in parts])
    vertices = np.concatenate([v for v, _ in parts])
    faces = np.concatenate([f + start for (_, f), start in zip(parts, starts, strict=False)])
    if rng.random() < 0.3:
        vertices = np.round(2.0 * vertices) / 2.0
    faces = faces[rng.random(len(faces)) >= rng.choice([0.0, 0.02, 0.2, 0.8])]
    turned = rng.random(len(faces)) < rng.choice([0.0, 0.01, 0.3, 0.9])
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    faces = np.append(faces, rng.integers(0, len(vertices), (rng.integers(0, 4), 3)), axis=0)
    again = faces[rng.random(len(faces)) < rng.choice([0.0, 0.1, 1.0])]
    faces = np.concatenate([faces, again[:, :: rng.choice([1, -1])]])
    merged = np.arange(len(vertices))
    merged[rng.integers(0, len(vertices), 2)] = rng.integers(0, len(vertices), 2)
    faces = merged[faces] if rng.random() < 0.3 else faces
    if rng.random() < 0.4:
        vertices, faces = soup(vertices, faces)
    elif rng.random() < 0.3:
        vertices, faces = together((vertices, faces))
    return vertices, rng.permutation(faces)


@pytest.mark.parametrize("seed", every(2, range(4)))
def test_any_triangles_with_a_face_that_is_not_flat_become_a_mesh(seed):
    rng = np.random.default_rng(seed)
    for _ in range(20):
        vertices, faces = hostile(rng)
        corners = vertices[faces]
        sides = corners[:, [1, 2, 0]] - corners
        areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        if (areas > 1e-9).any():
            checked(vertices, faces)


def test_points_of_a_seam_are_one_vertex_and_go_to_the_mean_of_their_targets():
    points, faces = soup(*CUBE)
    points = np.vstack([points, [[9.0, 0.0, 0.0], [0.1, 0.0, 0.0]]])  # two in no face
    found = mesh_of(points, faces)
    assert_array_equal(found.loose, [36, 37])
    some = np.array([37, 5, 0, 2, 9, 36])
    vertices = found.vertices_at(some)
    assert_array_equal(vertices, np.unique(found.vertex_of[[5, 0, 2, 9]]))
    mask = np.isin(np.arange(len(points)), some)
    assert_array_equal(found.vertices_at(mask), vertices)
    ends = np.random.default_rng(0).normal(size=(len(some), 3))
    ids, targets = found.targets_at(some, ends)
    assert_array_equal(ids, vertices)
    for vertex, target in zip(ids, targets, strict=True):
        own = [k for k, i in enumerate(some) if found.vertex_of[i] == vertex and i < 36]
        assert_allclose(target, ends[own].mean(axis=0), rtol=1e-14)
    every, targets = found.targets_at(np.arange(36), points[:36])
    assert_array_equal(every, np.arange(8))
    assert_allclose(targets, found.mesh.vertices)
    with pytest.raises(ConstraintError, match="no point of the handle is in a face"):
        found.targets_at([36, 37], ends[:2])
    with pytest.raises(
        ConstraintError, match=r"targets .* each of the 3 points of the handle; got"
    ):
        found.targets_at([0, 1, 2], ends[:2])
    assert len(found.targets_at([], np.empty((0, 3)))[0]) == 0


def test_values_at_vertices_are_those_of_the_first_of_their_points_in_a_face():
    points, faces = soup(*CUBE)
    points = np.vstack([[[9.0, 9.0, 9.0]], points])
    found = mesh_of(points, faces + 1)
    values = np.arange(37)
    first = [np.flatnonzero(found.vertex_of[1:] == vertex)[0] + 1 for vertex in range(8)]
    assert_array_equal(found.at_vertices(values), first)
    assert_array_equal(found.at_vertices(points), found.mesh.vertices)


def test_loose_points_follow_the_step_of_the_vertex_nearest_to_them():
    vertices, faces = CUBE
    points = np.vstack([vertices, [[2.0, 1.0, 1.0], [-1.0, 0.0, 0.1]]])
    found = mesh_of(points, faces)
    assert_array_equal(found.vertex_of[8:], [7, 0])
    posed = found.mesh.vertices * [1.0, 2.0, 3.0] + [5.0, 0.0, 0.0]
    moved = found.moved(posed)
    assert_array_equal(moved[:8], posed)
    assert_allclose(moved[8:], [[7.0, 2.0, 3.0], [4.0, 0.0, 0.1]], rtol=1e-15)
