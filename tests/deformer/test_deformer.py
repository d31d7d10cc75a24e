"""`Deformer` as a caller sees it: motion, scale, many handles, far targets, bad input."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from scipy.spatial.transform import Rotation
from solids import exact_volume_change, icosphere, rotation

from vtk_segdeform import sizes
from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.deformer.deform import deform
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.errors import (
    ArgumentError,
    CageError,
    Cancelled,
    ConstraintError,
    MeshError,
    RegionError,
)
from vtk_segdeform.geometry.rotations import rigid_fit
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.regions.segmentation import segment
from vtk_segdeform.solver.solution import Status

SCENE = sausage(2, is_coarse=True)
VERTICES = SCENE.mesh.vertices
REST = SCENE.mesh.vertices[SCENE.handle]


def test_at_rest_no_step_is_taken():
    solution = SCENE.deformer().solve(REST)
    assert_allclose(solution.vertices, VERTICES, atol=1e-9)
    assert solution.steps == 0


def test_without_fixed_vertices_a_rigid_motion_of_the_handle_moves_the_mesh_rigidly():
    scene = replace(SCENE, fixed=np.array([], dtype=int))
    turn = rotation([1, 2, 0], 0.4)
    solution = scene.deformer(tolerance=1e-9, max_steps=2000).solve(REST @ turn.T + [0.5, 0, 0])
    assert_allclose(solution.vertices, VERTICES @ turn.T + [0.5, 0, 0], atol=1e-4)


@pytest.mark.parametrize("scale", every(2, [1e-3, 1.0, 1e3]))
def test_rotating_and_scaling_the_scene_rotates_and_scales_the_pose(scale):
    turn = rotation([1, 2, 3], 1.2)
    targets = SCENE.turned(50)
    plain = SCENE.held().solve(targets)
    moved = SCENE.transformed(turn, scale).deformer().solve(scale * targets @ turn.T)
    error = moved.vertices / scale - plain.vertices @ turn.T
    assert np.abs(error).max() < 1e-6 * SCENE.mesh.diagonal
    assert moved.steps == plain.steps


@pytest.mark.parametrize("diagonals", every(3, [0.0, 10.0, 1e3, 1e5, 1e7]))
def test_the_volume_change_is_that_of_the_returned_vertices_at_any_distance(diagonals):
    shift = diagonals * SCENE.mesh.diagonal * np.array([0.6, -0.64, 0.48])
    scene = SCENE.transformed(shift=shift)
    solution = scene.deformer().solve(SCENE.turned(50) + shift)
    x, faces = solution.vertices, scene.mesh.faces
    true = exact_volume_change(scene.mesh.vertices, x, faces)
    print(f"{diagonals:g} diagonals away: {solution.volume_change:.2e}, truly {true:.2e}")
    assert abs(solution.volume_change - true) < 1e-14
    # Rounding moves a vertex by half an ulp along each axis at most: not more than a shell of that.
    shell = 2.0**-52 * np.abs(x).max() * scene.mesh.with_vertices(x).face_areas.sum()
    assert abs(true) <= shell / signed_volume(scene.mesh.vertices, faces) + 1e-14


@pytest.mark.parametrize(
    "degrees", [*(pytest.param(d, marks=pytest.mark.campaign) for d in (30, 70, 120)), 180]
)
def test_far_motions_end_with_exact_volume_and_without_folds(degrees):
    scene = sausage(3)
    solution = scene.deformer().solve(scene.turned(degrees, about=(0.0, 0.0, 1.2)))
    assert abs(solution.volume_change) < 1e-12
    assert solution.handle_error < 1e-3
    assert solution.fixed_error < 1e-3
    x, faces = solution.vertices, scene.mesh.faces
    a, b, c = x[faces.T]
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # One or two of the 2048 faces may be much smaller where a fold would be; none vanishes.
    ratio = area / scene.mesh.face_areas
    assert ratio.min() > 0.01
    assert np.quantile(ratio, 0.01) > 0.2


def test_a_jump_and_a_drag_end_in_the_same_place():
    jump = SCENE.deformer(tolerance=1e-8, max_steps=2000).solve(SCENE.turned(45))
    drag = SCENE.deformer(tolerance=1e-8, max_steps=2000)
    for degrees in range(15, 50, 15):
        solution = drag.solve(SCENE.turned(degrees))
        assert abs(solution.volume_change) < 1e-13
    assert_allclose(solution.vertices, jump.vertices, atol=1e-4 * SCENE.mesh.diagonal)


def test_a_handle_turns_the_way_it_is_led_and_half_a_turn_stays_as_it_was_made():
    x = VERTICES[SCENE.handle].mean(axis=0) - VERTICES.mean(axis=0)
    middle = np.flatnonzero(np.abs(VERTICES @ x) < 0.2 * np.abs(VERTICES @ x).max())
    for sense in (1.0, -1.0):
        deformer = SCENE.held()
        for degrees in (90, 180, 180):
            solution = deformer.solve(SCENE.turned(sense * degrees, axis=x))
        turn = rigid_fit(VERTICES[middle], solution.vertices[middle])[0]
        turned = Rotation.from_matrix(turn).as_rotvec() @ x / np.linalg.norm(x)
        assert 0.5 < sense * turned < 2.0  # not halfway at every point: one end twists more
        assert abs(solution.volume_change) < 1e-12


def test_solving_for_the_rest_targets_and_reset_both_return_to_rest():
    deformer = SCENE.deformer(tolerance=1e-8, max_steps=2000)
    deformer.solve(SCENE.turned(45))
    back = deformer.solve(REST)
    assert np.abs(back.vertices - VERTICES).max() < 1e-4 * SCENE.mesh.diagonal
    deformer.solve(SCENE.turned(45))
    deformer.reset()
    assert_allclose(deformer.solve(REST).vertices, VERTICES, atol=1e-9)


def test_a_single_handle_vertex_translates_the_mesh():
    scene = replace(SCENE, fixed=np.array([], dtype=int), handle=np.array([7]))
    solution = scene.deformer().solve(VERTICES[[7]] + [0.4, 0.1, 0.0])
    assert_allclose(solution.vertices, VERTICES + [0.4, 0.1, 0.0], atol=1e-5)


@pytest.mark.parametrize(
    ("targets", "says"),
    [
        (REST[:-1], "one point for each of the"),
        (np.where(REST > 2.5, np.nan, REST), "NaN or infinite"),
        (REST[:, :2], r"shape \(n, 3\)"),
    ],
)
def test_wrong_targets_are_named_and_keep_the_pose(targets, says):
    deformer = SCENE.held()
    with pytest.raises(ConstraintError, match=says):
        deformer.solve(targets)
    assert_allclose(deformer.solve(REST).vertices, VERTICES, atol=1e-9)


def test_cages_that_do_not_fit_are_refused():
    with pytest.raises(CageError, match="2 regions need as many cages; got 1"):
        Deformer(SCENE.mesh, SCENE.regions, SCENE.cages[:1])
    small = Cage(*icosphere(1))
    with pytest.raises(CageError, match=r"region 0 .*outside the cage"):
        Deformer(SCENE.mesh, SCENE.regions, [small, small])


def test_regions_of_another_mesh_are_refused():
    with pytest.raises(RegionError, match="mesh of 258 vertices, but this mesh has 66"):
        Deformer(Mesh(*icosphere(2)), SCENE.regions, SCENE.cages)


def test_without_constraints_rounding_does_not_move_the_mesh_even_with_slivers():
    vertices, faces = icosphere(3)
    middle = 0.5 * (vertices[faces[0, 0]] + vertices[faces[0, 1]])
    a, b, c = faces[0]
    d = next(v for f in faces[1:] if a in f and b in f for v in f if v not in (a, b))
    new = len(vertices)
    kept = [f for f in faces if not {a, b} <= set(f)]
    fan = [[a, new, c], [new, b, c], [new, a, d], [b, new, d]]
    almost = middle + 1e-7 * (vertices[c] - middle)
    mesh = Mesh(np.array([*vertices, almost]), np.array([*kept, *fan]))
    cage = Cage(1.6 * icosphere(1)[0], icosphere(1)[1])
    solution = Deformer(mesh, Regions.single(mesh), [cage]).solve(np.empty((0, 3)))
    assert_allclose(solution.vertices, mesh.vertices, atol=1e-6)


@pytest.mark.parametrize(
    ("option", "says"),
    [
        ({"stretch": -1.0}, "stretch must be a number, 0 or more; got -1"),
        ({"stretch": np.nan}, "stretch must be a number"),
        ({"stretch": "much"}, "stretch must be a number, 0 or more; got 'much'"),
        ({"rotation_groups": 0}, "rotation_groups must be a whole number, 1 or more; got 0"),
        ({"tolerance": np.nan}, "tolerance must be a positive number"),
        ({"max_steps": 0}, "max_steps must be a whole number, 1 or more"),
    ],
)
def test_invalid_options_are_refused_by_name(option, says):
    with pytest.raises(ValueError, match=says):
        SCENE.deformer(**option)


def test_a_target_in_another_unit_is_refused():
    with pytest.raises(ConstraintError, match="in the same unit"):
        SCENE.held().solve(1e6 * REST)
    with pytest.raises(ConstraintError, match="in the same unit"):
        SCENE.held().solve(REST + 1e200)


@pytest.mark.parametrize("way", every(2, [((1.0, 0.9, -0.8),), ((0.0, 1.0, 0.0),)]))
def test_the_volume_is_exact_for_targets_as_far_apart_as_allowed(way):
    coarse = sausage(2, is_coarse=True)
    both = np.concatenate([coarse.fixed, coarse.handle])
    scene = replace(coarse, fixed=both[:0], handle=both)
    deformer = scene.deformer()
    rest = scene.mesh.vertices[deformer.handle]
    side = np.where(np.isin(deformer.handle, coarse.handle), 1.0, -1.0)[:, None]
    far = scene.mesh.diagonal * side * way
    for distance in np.linspace(1.0, 9.4, 4):
        solution = deformer.solve(rest + distance * far, max_steps=8)
        while not deformer.has_arrived:
            solution = deformer.solve(rest + distance * far, max_steps=8)
        assert abs(solution.volume_change) <= 5e-12  # rounding, at the largest distance
    assert np.ptp(solution.vertices, axis=0).max() > 18.0 * scene.mesh.diagonal
    with pytest.raises(ConstraintError, match="at most 20 are allowed"):
        deformer.solve(rest + 10.5 * far)


def test_a_cage_so_large_that_it_moves_nothing_is_refused():
    huge = Cage(1e6 * icosphere(1)[0], icosphere(1)[1])
    scene = replace(SCENE, regions=Regions.single(SCENE.mesh), cages=(huge,))
    with pytest.raises(CageError, match=r"region 0 is more than 1000 times as large"):
        scene.deformer()


def test_a_pose_can_be_resumed():
    deformer = SCENE.deformer()
    first = deformer.solve(SCENE.turned(30))
    deformer.solve(SCENE.turned(-40))
    deformer.resume(first.cage_vertices, SCENE.turned(30))
    again = deformer.solve(SCENE.turned(30))
    assert_allclose(again.vertices, first.vertices, atol=1e-4 * SCENE.mesh.diagonal)
    assert again.steps < first.steps
    with pytest.raises(
        CageError, match=r"must contain \[18, 18\] points, cage by cage; got \[18\]"
    ):
        deformer.resume(first.cage_vertices[:1], SCENE.turned(30))


def test_set_up_reports_every_stage_and_can_be_cancelled_at_each():
    mesh = Mesh(icosphere(2)[0] * [3.0, 1.0, 1.0], icosphere(2)[1])
    regions = segment(mesh, 2)
    cages = fit_cages(mesh, regions, 25)
    for work, least in (
        (lambda told: segment(mesh, 2, progress=told), 4),
        (lambda told: fit_cages(mesh, regions, 25, progress=told), 4),
        (lambda told: Deformer(mesh, regions, cages, handle=[0], progress=told), 6),
    ):
        seen = []
        work(lambda _, message, seen=seen: seen.append(message))
        assert len(set(seen)) >= least
        for last in dict.fromkeys(seen):

            def stop(_, message, last=last):
                if message == last:
                    raise Cancelled(last)

            with pytest.raises(Cancelled, match=last):
                work(stop)


def test_cages_with_too_many_vertices_are_refused():
    ball, faces = icosphere(4)
    big = tuple(Cage(ball * [9.0, 3.0, 3.0], faces) for _ in SCENE.cages)
    with pytest.raises(CageError, match="2052 vertices; the limit of the solver is 1600"):
        Deformer(SCENE.mesh, SCENE.regions, big)


@pytest.mark.parametrize("number", [[60], "60", np.full(3, 60), 3, 60.5, np.nan])
def test_the_number_of_cage_vertices_is_named_if_it_is_none(number):
    mesh = SCENE.mesh
    with pytest.raises(ArgumentError, match="n_cage_vertices must be a whole number, 4 or more"):
        deform(mesh, [0], [9], mesh.vertices[[9]], n_cage_vertices=number)


def test_the_mesh_moves_with_its_cages_by_affine_maps():
    deformer, turn = SCENE.held(), rotation([1.0, 2.0, 3.0], 1.2)
    rest = [cage.vertices for cage in SCENE.cages]
    assert_allclose(deformer.surface(rest), VERTICES, atol=1e-15)
    affine, shift = turn @ np.diag([1.1, 0.9, 1.3]), np.array([3.0, -1.0, 2.0])
    moved = deformer.surface([p @ affine.T + shift for p in rest])
    assert_allclose(moved, VERTICES @ affine.T + shift, atol=1e-9)
    turned = deformer.rotations([p @ turn.T + shift for p in rest])
    assert_allclose(turned, np.broadcast_to(turn, (len(VERTICES), 3, 3)), atol=1e-7)
    with pytest.raises(CageError, match="cage by cage"):
        deformer.rotations(rest[:1])


@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_other_points_are_carried_along(shift):
    scene = SCENE.transformed(shift=np.full(3, shift))
    deformer = scene.held()
    x, points = scene.mesh.vertices, 0.5 * SCENE.mesh.vertices[::7] + shift
    assert_allclose(deformer.carry(points), points, atol=1e-9 * (1.0 + shift))
    solution = deformer.solve(scene.turned(30, about=np.full(3, shift)))
    assert_allclose(deformer.carry(x[::9]), solution.vertices[::9], atol=0.02)
    bound = deformer.passengers(points)
    assert_array_equal(bound.moved(solution.cage_vertices), deformer.carry(points))


def test_fixed_vertices_are_kept_where_they_are_wanted():
    deformer = SCENE.held()
    places = VERTICES[SCENE.fixed] + [-0.2, 0.1, 0.0]
    other = deformer.hold(fixed=SCENE.fixed, handle=SCENE.handle, fixed_at=places)
    solution = other.solve(REST)
    assert solution.fixed_error < 1e-3
    assert_allclose(solution.vertices[SCENE.fixed], places, atol=1e-3 * SCENE.mesh.diagonal)
    assert other.finish(solution).fixed_error < 1e-12
    says = f"fixed_at must give one point for each of the {len(places)} fixed vertices"
    with pytest.raises(ConstraintError, match=says):
        deformer.hold(fixed=SCENE.fixed, fixed_at=places[:-1])
    with pytest.raises(ConstraintError, match="mesh sizes away"):
        deformer.hold(fixed=SCENE.fixed, fixed_at=1e5 * places)


def test_options_of_a_deformer_are_kept_unless_they_are_changed():
    first = SCENE.deformer(preserve_volume=False, avoid_contact=True)
    assert first.preserved_volumes == ()
    same = first.hold(handle=[0])
    assert same.preserved_volumes == ()
    assert same._constraints.contact is not None
    other = first.hold(handle=[0], preserve_volume=True, avoid_contact=False)
    assert len(other.preserved_volumes) == 1
    assert other._constraints.contact is None
    regions = first.hold(handle=[0], preserve_region_volumes=True)
    assert len(regions.preserved_volumes) == SCENE.regions.n_regions
    assert len(regions.hold(handle=[1], preserve_volume=True).preserved_volumes) == 2
    sheet = Mesh(VERTICES, SCENE.mesh.faces[1:])
    open_mesh = Deformer(sheet, Regions(sheet, SCENE.regions.membership), SCENE.cages, lids=False)
    assert not open_mesh.has_volume
    assert not open_mesh.hold(handle=[0]).has_volume
    assert open_mesh.hold(handle=[0], lids=True).has_volume
    assert open_mesh.hold(handle=[0], lids=True).hold(handle=[1]).has_volume
    for option in ("preserve_volume", "preserve_region_volumes", "avoid_contact", "lids"):
        with pytest.raises(ArgumentError, match=option):
            first.hold(**{option: "yes"})
        with pytest.raises(ArgumentError, match=option):
            SCENE.deformer(**{option: "yes"})


def test_a_pickled_deformer_continues_like_the_deformer():
    deformer = SCENE.held().copy()
    deformer.finish(deformer.solve(SCENE.turned(20), max_steps=3))
    text = pickle.dumps(deformer)
    for left in (*deformer.subspace.blocks, deformer._problem.energy.rotation_operator):
        assert left.tobytes() not in text  # computed again, and stored without zeros
    again = pickle.loads(text)
    assert "cell_energy" in vars(deformer._problem)
    assert "cell_energy" not in vars(again._problem)
    assert not again.fixed.flags.writeable
    assert not again.handle.flags.writeable
    targets = SCENE.turned(30)
    assert_array_equal(again.solve(targets).vertices, deformer.solve(targets).vertices)


def test_a_block_that_fails_leaves_the_deformer_as_it_was():
    deformer, other = SCENE.held(), SCENE.held()

    def fail():
        with deformer.restoring():
            deformer.solve(SCENE.turned(50))
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    again = deformer.solve(SCENE.turned(20))
    assert_array_equal(again.vertices, other.solve(SCENE.turned(20)).vertices)
    with deformer.restoring():
        deformer.solve(SCENE.turned(30))
    assert_allclose(
        deformer.carry(VERTICES[:1]), other.solve(SCENE.turned(30)).vertices[:1], atol=0.02
    )


def test_a_cache_that_is_no_path_is_refused_by_name():
    with pytest.raises(ArgumentError, match=r"^cache must be"):
        SCENE.deformer(cache=3.5)


@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_pull_is_the_same_in_every_unit(scale, beside):
    """Also beside a fixed vertex, where the surface around the point is pulled."""
    d, vertex = SCENE.mesh.diagonal, int(VERTICES[:, 2].argmax())
    near = np.setdiff1d(SCENE.mesh.adjacency[[vertex]].indices, [vertex])
    fixed = np.append(SCENE.fixed, near[:1] if beside else [])
    scenes, poses = (SCENE, SCENE.transformed(scale=scale)), []
    for scene, unit in zip(scenes, (1.0, scale), strict=True):
        deformer = scene.held().hold(fixed=fixed.astype(int), handle=[vertex])
        local = deformer.local(vertex, 0.25 * d * unit, 0.1 * d * unit, follows=1.0)
        is_soft = local._constraints.solver.energy is deformer._problem.energy
        assert is_soft == beside
        solution = local.solve(scene.mesh.vertices[[vertex]] + [0.0, 0.0, 0.05 * d * unit])
        poses.append([each.vertices / unit for each in (solution, local.finish(solution))])
    for here, there in zip(*poses, strict=True):
        assert_allclose(there, here, atol=1e-6 * d)


@pytest.mark.parametrize("scale", [1e-3, 1.0])
def test_weights_of_the_finish_are_a_quarter_of_a_cage_vertex_over_its_region(scale):
    scene = SCENE.transformed(scale=scale)
    deformer, areas = scene.held(), scene.mesh.vertex_areas
    found = deformer._problem.cage_weights
    assert found.sum() == pytest.approx(36 / 4)
    alone = scene.regions.weights == 1.0
    for own, weights in zip(alone, scene.regions.weights, strict=True):
        density = 18 / (weights * areas).sum()
        assert_allclose(found[own], 0.25 * density * areas[own])


def test_a_pose_is_plausible_within_two_sizes_and_one_and_a_half_motions():
    deformer = SCENE.held()
    size, rest = deformer._problem.frame.size, deformer._problem.rest.vertices[SCENE.handle]
    at_rest = deformer._problem.rest_cages
    for moved in (0.0, 1.0):
        goal, limit = rest + [moved, 0.0, 0.0], 2.0 + 1.5 * moved
        for share, ok in ((0.99, True), (1.01, False)):
            x = VERTICES.copy()
            x[7, 1] += share * limit * size
            assert deformer._is_plausible(x, goal, at_rest) == ok
            far = at_rest + [0.0, 5.0, 0.0]
            assert deformer._is_plausible(x, goal, far)
    assert deformer._is_plausible(deformer._problem.map(far), rest, far)  # the same pose again


def test_a_pose_far_from_every_reasonable_one_is_replaced_by_the_last_one(monkeypatch):
    deformer, targets = SCENE.held(), SCENE.turned(20)
    before = deformer.solve(targets)
    with monkeypatch.context() as wrong:
        wrong.setattr(Deformer, "_is_plausible", lambda *_: False)
        missed = deformer.solve(SCENE.turned(40))
    assert missed.status is Status.MISSED
    assert missed.remaining == np.inf
    assert_allclose(missed.vertices, before.vertices, atol=1e-12)
    for own, expected in zip(missed.cage_vertices, before.cage_vertices, strict=True):
        assert_allclose(own, expected, atol=1e-12)
    off = np.linalg.norm(missed.vertices[SCENE.handle] - SCENE.turned(40), axis=1).max()
    assert missed.handle_error == pytest.approx(off / SCENE.mesh.diagonal)
    assert missed.volume_change == pytest.approx(before.volume_change, abs=1e-14)
    finished = deformer.finish(missed)
    assert finished.status is Status.MISSED
    assert finished.handle_error > 0.9 * missed.handle_error
    again = deformer.solve(targets)
    assert_allclose(again.vertices, before.vertices, atol=1e-5)
    assert deformer.finish(again).status is Status.CONVERGED


def test_what_is_no_mesh_region_or_callback_is_refused_by_name():
    with pytest.raises(MeshError, match=r"^mesh must be"):
        Deformer(None, SCENE.regions, SCENE.cages)
    with pytest.raises(RegionError, match=r"^regions must be"):
        Deformer(SCENE.mesh, None, SCENE.cages)
    with pytest.raises(ArgumentError, match=r"^cages"):
        Deformer(SCENE.mesh, SCENE.regions, [SCENE.mesh] * 2)
    with pytest.raises(ArgumentError, match=r"^progress must be"):
        SCENE.held().solve(REST, progress=3)
    with pytest.raises(ArgumentError, match=r"^solution must be"):
        SCENE.held().finish(VERTICES)


def test_samples_of_a_body_are_held_where_half_of_their_vertices_are(monkeypatch):
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 100)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 60)
    deformer = SCENE.deformer(avoid_contact=True)
    cells, is_held = deformer._problem.samples.cells, deformer._constraints.contact.held
    ids = np.concatenate([SCENE.fixed, SCENE.handle])
    shares = [np.isin(np.flatnonzero(cells == k), ids).mean() for k in range(len(is_held))]
    assert_array_equal(is_held, np.array(shares) >= 0.5)
    assert any(0.0 < share < 0.5 for share in shares)
