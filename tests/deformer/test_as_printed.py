"""The paper as printed: identities of its steps, and a dense witness on a small mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import OCTAHEDRON, icosphere, rotation, somewhere

from vtk_segdeform import Deformer
from vtk_segdeform.cages import mean_value_coordinates
from vtk_segdeform.deformer import PaperDeformer
from vtk_segdeform.errors import ArgumentError, CageError, ConstraintError, MeshError, RegionError
from vtk_segdeform.geometry import signed_volume, volume_gradient
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions

COARSE = sausage(2, is_coarse=True)


def printed(scene=COARSE) -> PaperDeformer:
    return Deformer.as_printed(
        scene.mesh, scene.regions, scene.cages, fixed=scene.fixed, handle=scene.handle
    )


@pytest.fixture(scope="module")
def bent():
    """Return a deformer one step on its way, its places u and x = W~ p."""
    deformer = printed()
    x = deformer.solve(COARSE.turned(40), max_steps=1).vertices
    return deformer, np.concatenate([COARSE.mesh.vertices[COARSE.fixed], COARSE.turned(40)]), x


def test_rest_is_a_fixed_point():
    solution = printed().solve(COARSE.mesh.vertices[COARSE.handle])
    assert solution.steps == 1
    assert solution.step_lengths[0] < 1e-9
    assert_allclose(solution.vertices, COARSE.mesh.vertices, atol=1e-9)
    assert abs(solution.volume_change) < 1e-12


def test_a_rigid_motion_is_a_fixed_point_too():
    scene = replace(COARSE, fixed=np.zeros(0, dtype=int))
    deformer, turn, shift = printed(scene), rotation([1.0, 2.0, 0.5], 2.0), np.array([3.0, -1, 2])
    deformer.p = deformer.p @ turn.T + shift
    x = deformer.W @ deformer.p
    assert_allclose(deformer.rotations(x), np.broadcast_to(turn, (len(x), 3, 3)), atol=1e-7)
    assert np.abs(deformer.step(x, x[scene.handle])).max() < 1e-8


def test_a_turned_scene_has_the_turned_pose():
    turn, shift = rotation([0.3, 1.0, 2.0], 1.1), np.array([1.0, 2.0, -3.0])
    pose = printed().solve(COARSE.turned(40), max_steps=5)
    there = printed(COARSE.transformed(turn, shift=shift))
    moved = there.solve(COARSE.turned(40) @ turn.T + shift, max_steps=5)
    assert_allclose(moved.vertices, pose.vertices @ turn.T + shift, atol=1e-7)


def test_a_step_meets_the_linearised_volume(bent):
    deformer, u, x = bent
    h = deformer.step(x, u)
    g = deformer.g(x)
    assert abs(g) > 1e-3
    assert np.vdot(volume_gradient(x, deformer.mesh.faces), deformer.W @ h) == pytest.approx(-g)


def test_the_gradient_of_the_volume_is_its_slope(bent):
    deformer, _, x = bent
    away, errors = somewhere(len(x)), []
    slope = np.vdot(volume_gradient(x, deformer.mesh.faces), away)
    for t in (1e-3, 1e-4):
        errors.append(abs(deformer.g(x + t * away) - deformer.g(x) - t * slope))
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.1)


def test_a_solve_ends_with_its_first_small_step_and_the_next_continues():
    targets = COARSE.turned(20)
    whole = printed().solve(targets, tolerance=1e-3)
    assert whole.step_lengths[-1] <= 1e-3 < whole.step_lengths[:-1].min()
    assert len(whole.step_lengths) == whole.steps
    deformer = printed()
    first = deformer.solve(targets, tolerance=1e-3, max_steps=2)
    rest = deformer.solve(targets, tolerance=1e-3)
    assert first.steps + rest.steps == whole.steps
    assert_allclose(rest.vertices, whole.vertices, atol=1e-12)
    assert [len(p) for p in rest.cage_vertices] == [cage.n_vertices for cage in COARSE.cages]
    deformer.reset()
    assert_allclose(deformer.solve(targets, max_steps=2).vertices, first.vertices)


def test_a_step_is_that_of_dense_constrained_least_squares():
    """Eqs. (3) to (7) and (11) on 66 vertices, each from its formula, vertex by vertex."""
    sphere, faces = icosphere(2)
    mesh = Mesh(sphere * [1.5, 1.0, 1.0], faces)
    v, n = mesh.vertices, mesh.n_vertices
    membership = np.stack([v[:, 0] < 0.5, v[:, 0] > -0.4])
    corners, cage_faces = OCTAHEDRON
    cages = [Mesh(3.0 * corners * [1.3, 1.0, 1.1] + [x, 0, 0], cage_faces) for x in (-0.8, 0.9)]
    regions = Regions(mesh, membership)
    fixed, handle = np.flatnonzero(v[:, 0] < -1.1), np.flatnonzero(v[:, 0] > 1.2)
    deformer = Deformer.as_printed(mesh, regions, cages, fixed=fixed, handle=handle)

    distance = [_distances_to_octahedron(v, cage) for cage in cages]
    w = np.zeros((n, 12))
    for i in range(n):
        here = np.array([d[i] for d in distance]) * membership[:, i]
        for r, cage in enumerate(cages):
            if membership[r, i]:
                own = mean_value_coordinates(v[[i]], cage.vertices, cage.faces)[0]
                w[i, 6 * r : 6 * r + 6] = here[r] / here.sum() * own
    p = np.concatenate([cage.vertices for cage in cages]) * [1.0, 1.1, 0.9]
    p[:, 2] += 0.1 * p[:, 0] ** 2
    x = w @ p
    u = np.concatenate([v[fixed], v[handle] + [0.2, 0.0, 0.4]])

    cotangents, areas = np.zeros((n, n)), np.zeros(n)
    for face in faces:
        for a, b, c in (face, np.roll(face, 1), np.roll(face, 2)):
            left, right = v[b] - v[a], v[c] - v[a]
            cot = left @ right / np.linalg.norm(np.cross(left, right))
            cotangents[b, c] += cot
            cotangents[c, b] += cot
            for corner in (b, c):  # acute triangles only: the Voronoi part of each corner
                assert cot > 0.0
                areas[corner] += cot * ((v[b] - v[c]) @ (v[b] - v[c])) / 8.0
    rows, right = [], []
    for i in range(n):
        around = np.flatnonzero(cotangents[i])
        row = np.zeros(n)
        for j in around:
            row[i] += cotangents[i, j] / (4.0 * areas[i])
            row[j] -= cotangents[i, j] / (4.0 * areas[i])
        moved = sum(cotangents[i, j] * np.outer(x[i] - x[j], v[i] - v[j]) for j in around)
        left, _, across = np.linalg.svd(moved)
        turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ across)]) @ across
        rows.append(row)
        right.append(turn @ (row @ v))
    a = np.concatenate([rows, np.eye(n)[np.concatenate([fixed, handle])]])
    b = np.concatenate([right, u])

    # The least squares over all h with G h = -g: one such h, and the directions beside it.
    reduced = np.kron(a @ w, np.eye(3))
    constraint = (w.T @ volume_gradient(x, faces)).ravel()
    g = signed_volume(x, faces) - signed_volume(v, faces)
    start = -g * constraint / (constraint @ constraint)
    beside = np.linalg.svd(constraint[None])[2][1:].T
    gap = (b - a @ x).ravel() - reduced @ start
    witness = start + beside @ np.linalg.lstsq(reduced @ beside, gap, rcond=None)[0]
    assert_allclose(deformer.W.toarray(), w, atol=1e-12)
    assert_allclose(deformer.step(x, u).ravel(), witness, atol=1e-9)


def _distances_to_octahedron(points, cage) -> np.ndarray:
    """Return how far *points* inside a convex cage are from the nearest plane of its faces."""
    a, b, c = cage.vertices[cage.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return np.einsum("fk,nfk->nf", normals, a - points[:, None]).min(axis=1)


def test_arguments_that_cannot_be_solved_are_refused():
    scene = COARSE
    with pytest.raises(ConstraintError, match="at least one"):
        Deformer.as_printed(scene.mesh, scene.regions, scene.cages, fixed=(), handle=())
    with pytest.raises(RegionError, match="one cage for each"):
        Deformer.as_printed(scene.mesh, scene.regions, scene.cages[:1], fixed=[0], handle=())
    with pytest.raises(ArgumentError, match=r"cages\[1\]"):
        Deformer.as_printed(scene.mesh, scene.regions, [scene.cages[0], None], fixed=[0], handle=())
    with pytest.raises(ArgumentError, match=r"^cages must be"):
        Deformer.as_printed(scene.mesh, scene.regions, 3, fixed=[0], handle=())
    sheet = Mesh(scene.mesh.vertices, scene.mesh.faces[1:])
    with pytest.raises(MeshError, match="closed"):
        Deformer.as_printed(sheet, Regions.single(sheet), scene.cages[:1], fixed=[0], handle=())
    ball = Mesh(*OCTAHEDRON)
    cage = Mesh(*icosphere(2, 3.0))  # 66 cage vertices move 6
    with pytest.raises(CageError, match="influence"):
        Deformer.as_printed(ball, Regions.single(ball), [cage], fixed=[0], handle=())
    for option in ({"max_steps": 0}, {"tolerance": 0.0}, {"epsilon": -1.0}):
        with pytest.raises(ArgumentError, match=f"^{next(iter(option))} must be"):
            printed().solve(scene.turned(10), **option)
    with pytest.raises(ConstraintError, match="targets"):
        printed().solve(scene.turned(10)[:1])


def test_without_options_whole_steps_are_taken_to_a_ten_thousandth():
    targets = COARSE.turned(10)
    plain, same = printed().solve(targets), printed().solve(targets, tolerance=1e-4, epsilon=1.0)
    assert_allclose(plain.vertices, same.vertices, rtol=0, atol=1e-12)
    assert plain.step_lengths[-1] <= 1e-4 < plain.step_lengths[:-1].min()


def test_its_energy_is_least_at_the_end_among_poses_of_the_same_volume():
    """Where no step moves, |A x - b|^2 with b fixed rises along every other direction."""
    deformer = printed()
    targets = COARSE.turned(20)
    deformer.solve(targets, tolerance=1e-10)
    x = deformer.W @ deformer.p
    u = np.concatenate([COARSE.mesh.vertices[COARSE.fixed], targets])
    gap = deformer.A @ x - deformer.b(x, u)
    slope = deformer.W.T @ (deformer.A.T @ gap)
    row = deformer.W.T @ volume_gradient(x, deformer.mesh.faces)
    share = np.vdot(slope, row) / np.vdot(row, row)
    assert np.linalg.norm(slope - share * row) < 1e-6 * np.linalg.norm(slope)
    assert abs(deformer.g(x)) < 1e-9 * deformer.volume
