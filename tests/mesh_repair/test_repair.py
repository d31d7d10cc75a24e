"""`repair` fixes each fault with as few changes as possible and reports every step."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_array_equal
from solids import CUBE, SOLIDS, icosphere, soup, torus

from vtk_segdeform.errors import MeshError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.faults import find_faults
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.mesh.report import Kind
from vtk_segdeform.mesh_repair.lids import triangulate_loops
from vtk_segdeform.mesh_repair.repair import repair

SPHERE = icosphere(2)
N, M = len(SPHERE[0]), len(SPHERE[1])


def together(*solids):
    """Return solids as one mesh, with coincident vertices merged."""
    vertices = np.concatenate([v for v, _ in solids])
    starts = np.cumsum([0] + [len(v) for v, _ in solids])
    faces = np.concatenate([f + start for (_, f), start in zip(solids, starts, strict=False)])
    vertices, number = np.unique(vertices, axis=0, return_inverse=True)
    return vertices, number.reshape(-1)[faces]


def repaired(vertices, faces, **options):
    """Repair, check the properties of every successful repair, and return the result."""
    result = repair(vertices, faces, **options)
    assert result.report.is_closed, str(result.report)
    assert Mesh(result.vertices, result.faces).n_faces == len(result.face_map)
    old = result.vertex_map >= 0
    assert_array_equal(result.vertices[old], np.asarray(vertices)[result.vertex_map[old]])
    kept = result.face_map[result.face_map >= 0]
    assert (np.diff(kept) > 0).all()  # kept faces keep their order, new ones come after
    assert (result.face_map[len(kept) :] == -1).all()
    originals = np.unique(result.vertex_map[old], return_index=True)[1]
    assert (np.diff(originals) > 0).all()
    assert repair(result.vertices, result.faces).steps == ()
    return result


@pytest.mark.parametrize("name", [*SOLIDS, "torus"])
def test_a_mesh_without_faults_remains_unchanged(name):
    vertices, faces = torus() if name == "torus" else SOLIDS[name]
    result = repaired(vertices, faces)
    assert result.steps == ()
    assert_array_equal(result.vertices, vertices)
    assert_array_equal(result.faces, faces)
    assert_array_equal(result.vertex_map, np.arange(len(vertices)))
    assert_array_equal(result.face_map, np.arange(len(faces)))


@pytest.mark.parametrize("mesh", [SPHERE, torus(), CUBE], ids=["sphere", "torus", "cube"])
def test_a_triangle_soup_is_welded(mesh):
    vertices, faces = mesh
    result = repaired(*soup(vertices, faces))
    n = len(vertices)
    welded, edges = 3 * len(faces) - n, 3 * len(faces)
    assert result.steps == (f"weld {welded} duplicate vertices, which closes {edges} open edges",)
    assert len(result.vertices) == n
    assert_array_equal(result.vertices[result.faces], vertices[faces])


def test_a_triangle_soup_with_holes_becomes_the_closed_mesh():
    vertices, faces = icosphere(3)
    keep = np.random.default_rng(5).random(len(faces)) > 0.1
    result = repaired(*soup(vertices, faces[keep]))
    assert any(step.endswith("where holes touch") for step in result.steps)
    assert len(result.vertices) == len(vertices)
    assert len(result.faces) == len(faces)


def test_vertices_that_nearly_coincide_are_welded_when_a_distance_is_given():
    vertices, faces = soup(*SPHERE)
    shaken = vertices + np.random.default_rng(2).uniform(-1e-7, 1e-7, vertices.shape)
    assert not repair(shaken, faces, largest_hole=0).report.is_closed
    result = repaired(shaken, faces, weld_distance=1e-6)
    assert len(result.vertices) == N


def test_degenerate_and_duplicate_faces_and_unreferenced_vertices_are_removed():
    vertices, faces = SPHERE
    result = repaired(
        np.append(vertices, [[9.0, 9.0, 9.0]], axis=0),
        np.concatenate([[[0, 0, 1]], faces, faces[:3]]),
    )
    assert result.steps == (
        "remove 1 degenerate face", "remove 3 duplicate faces", "remove 1 unreferenced vertex",
    )  # fmt: skip
    assert_array_equal(result.faces, faces)
    assert_array_equal(result.face_map, np.arange(1, M + 1))


def test_a_vertex_with_nan_coordinates_is_removed_and_the_hole_filled():
    vertices, faces = SPHERE
    broken = vertices.copy()
    broken[5] = np.nan
    around = int(np.sum(faces == 5))
    result = repaired(broken, faces)
    assert result.steps == (
        f"remove 1 vertex with NaN or infinite coordinates and {around} faces there",
        f"fill 1 hole of {around} edges with {around - 2} triangles",
    )
    assert 5 not in result.vertex_map


def test_the_minority_of_inconsistently_oriented_faces_is_flipped():
    vertices, faces = SPHERE
    some = np.random.default_rng(1).random(M) < 0.3
    some[0] = True  # the orientation of the first face does not decide
    broken = np.where(some[:, None], faces[:, [0, 2, 1]], faces)
    result = repaired(vertices, broken)
    assert result.steps == (f"flip {some.sum()} faces to agree with the neighbours",)
    assert_array_equal(result.faces, faces)
    most = repaired(vertices, np.where(some[:, None], faces, faces[:, [0, 2, 1]]))
    assert_array_equal(most.faces, faces)
    assert most.steps[1] == f"flip 1 inside-out component ({M} faces)"


def test_a_cavity_in_a_body_with_a_hole_stays_a_cavity():
    vertices, faces = SPHERE
    given = together((vertices, faces[1:]), (0.5 * vertices, faces[:, ::-1]))
    left = repair(*given, largest_hole=2)
    assert left.steps == ()
    assert left.report.ok
    assert repair(
        given[0],
        np.where(np.arange(len(given[1]))[:, None] < M - 1, given[1], given[1][:, ::-1]),
        largest_hole=2,
    ).report.ok


@pytest.mark.parametrize(
    ("shift", "step"),
    [
        ([1.0, 1.0, 1.0], "split 1 vertex where surfaces touch, adding 1 copy"),
        ([1.0, 1.0, 0.0], "split 2 vertices and 1 edge where surfaces touch, adding 2 copies"),
        ([-1.0, 1.0, 0.0], "split 2 vertices and 1 edge where surfaces touch, adding 2 copies"),
        ([0.0, -1.0, 1.0], "split 2 vertices and 1 edge where surfaces touch, adding 2 copies"),
    ],
)
def test_touching_bodies_are_separated_without_moving_vertices(shift, step):
    vertices, faces = CUBE
    result = repaired(*together(CUBE, (vertices + shift, faces)))
    assert result.steps == (step,)
    assert (len(result.vertices), len(result.faces)) == (16, 24)
    for body in (result.faces[:12], result.faces[12:]):  # whole cubes, not halves of each
        assert find_faults(
            result.vertices[np.unique(body)], np.searchsorted(np.unique(body), body)
        ).is_closed
        assert signed_volume(result.vertices, body) == pytest.approx(1.0)


def test_a_hole_larger_than_largest_hole_remains_open():
    vertices, faces = icosphere(4)
    lower = faces[(vertices[faces][:, :, 2] <= 1e-12).all(axis=1)]
    used = np.unique(lower)
    bowl = vertices[used], np.searchsorted(used, lower)
    left = repair(*bowl, largest_hole=20)
    assert left.steps == ()
    assert left.report.count(Kind.HOLE) == 1
    border = left.report.count(Kind.OPEN_EDGE)
    result = repaired(*bowl)
    new = len(result.vertices) - len(used)
    triangles = border - 2 + 2 * new
    assert result.steps == (
        f"fill 1 hole of {border} edges with {triangles} triangles and {new} new vertices",
    )
    whole = signed_volume(vertices, faces)
    assert signed_volume(result.vertices, result.faces) == pytest.approx(whole / 2, rel=1e-12)


def test_a_hole_whose_diagonals_all_exist_gets_one_new_vertex():
    # The torus of seven vertices has all edges: without one vertex, no lid over the others exists.
    i = np.arange(7)[:, None]
    faces = np.concatenate([(i + [0, 1, 3]) % 7, (i + [0, 3, 2]) % 7])
    vertices = np.random.default_rng(4).normal(size=(7, 3))
    left = faces[(faces != 6).all(axis=1)]
    result = repaired(vertices[:6], left)
    assert result.steps[0] == "fill 1 hole of 6 edges with 6 triangles and 1 new vertex"
    assert (len(result.vertices), len(result.faces)) == (7, 14)
    assert result.vertex_map[-1] == -1


def test_the_lid_of_a_loop_has_the_least_area():
    corners = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0]])  # an arrowhead
    lid = triangulate_loops(corners[None], np.zeros((1, 5, 5), bool))[0][0]
    a, b, c = corners[lid].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(2.5)  # without overlap
    assert (normals[:, 2] > 0).all()  # all oriented like the loop


def test_no_other_lid_of_a_bent_loop_has_less_area():
    def least(points, i, j):
        if j - i < 2:
            return 0.0
        return min(
            least(points, i, k) + least(points, k, j) + area(points[i], points[k], points[j])
            for k in range(i + 1, j)
        )

    def area(a, b, c):
        return np.linalg.norm(np.cross(b - a, c - a)) / 2.0

    rng = np.random.default_rng(8)
    for n in (4, 5, 6, 7) * 5:
        corners = rng.normal(size=(n, 3))
        lid = corners[triangulate_loops(corners[None], np.zeros((1, n, n), bool))[0][0]]
        found = sum(area(*triangle) for triangle in lid)
        assert found == pytest.approx(least(corners, 0, n - 1), rel=0.02)


@pytest.mark.parametrize("n_on_side", [1, 2, 5])
def test_a_crack_is_closed_by_splitting_the_face_with_vertices_on_its_edge(n_on_side):
    # The face (a, b, c) of a tetrahedron is a fan from c over vertices on the side a-b.
    a, b, c, d = 0, 1, 2, 3
    vertices = np.array([[0.0, 0, 0], [6, 0, 0], [0, 1, 0], [0, 0, 1]])
    share = np.arange(1, n_on_side + 1)[:, None] / (n_on_side + 1)
    vertices = np.concatenate([vertices, share * vertices[b]])
    along = [b, *range(3 + n_on_side, 3, -1), a]
    fan = [[c, one, other] for one, other in pairwise(along)]
    faces = np.array([*fan, [a, b, d], [b, c, d], [c, a, d]])
    result = repaired(vertices, faces)
    assert len(result.vertices) == len(vertices)
    assert result.report.count(Kind.ZERO_AREA) == 0
    assert result.steps[1] == "split 1 face at vertices on an edge, to close cracks"
    assert signed_volume(result.vertices, result.faces) == pytest.approx(1.0, rel=1e-12)


def test_edges_that_need_guessing_remain_in_the_report():
    vertices, faces = SPHERE
    fin = np.append(faces, [[faces[0, 0], faces[0, 1], N]], axis=0)
    result = repair(np.append(vertices, [[3.0, 3.0, 3.0]], axis=0), fin)
    assert result.steps == ()
    assert result.report.count(Kind.NON_MANIFOLD_EDGE) == 1
    assert result.report.ok
    assert not result.report.is_closed
    assert len(Mesh(result.vertices, result.faces).borders) == 1


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([], [], "empty mesh; give"),
        (CUBE[0], CUBE[1] + 1, "with a vertex index out of range"),
        (CUBE[0], [[0, 0, 1]], "no faces are left after these repairs: remove 1 degenerate face"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "no faces are left"),
        (np.zeros((3, 3)), [[0, 1, 2]], "cannot be repaired: all faces are flat; give at least"),
    ],
)
def test_a_mesh_that_cannot_be_repaired_is_an_error(vertices, faces, message):
    with pytest.raises(MeshError, match=message):
        repair(vertices, faces)


@pytest.mark.parametrize("seed", every(5, range(30)))
def test_random_damage_never_raises_and_never_gets_worse(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = SPHERE if seed % 2 else torus(12, 8)
    vertices, faces = vertices.copy(), faces[rng.random(len(faces)) > rng.choice([0.0, 0.02, 0.2])]
    turned = rng.random(len(faces)) < rng.choice([0.0, 0.1, 0.5])
    faces = np.where(turned[:, None], faces[:, [0, 2, 1]], faces)
    faces = np.append(faces, rng.integers(0, len(vertices), (rng.integers(0, 3), 3)), axis=0)
    faces = np.append(faces, faces[: rng.integers(0, 4)], axis=0)
    vertices[rng.integers(0, len(vertices), rng.integers(0, 2))] = np.inf
    if rng.random() < 0.4:
        vertices, faces = soup(vertices, faces)
    finite = np.isfinite(vertices[faces]).all(axis=(1, 2))
    before = find_faults(vertices, faces[finite])
    result = repair(vertices, faces)
    for kind in (Kind.DEGENERATE, Kind.DUPLICATE_FACE, Kind.UNREFERENCED, Kind.NON_FINITE):
        assert result.report.count(kind) == 0
    for kind in (Kind.OPEN_EDGE, Kind.NON_MANIFOLD_EDGE):
        assert result.report.count(kind) <= before.count(kind)
