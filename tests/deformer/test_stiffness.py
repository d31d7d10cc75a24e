"""Stiffness: bars of two materials bend as beams do, and rigid parts stay congruent."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from campaign import every
from limbed import crab, torso
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere, rotation

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.deformer import Stiffness, problem
from vtk_segdeform.deformer.binding import Binding
from vtk_segdeform.deformer.binding_cache import cached_binding
from vtk_segdeform.deformer.stiffness import rigid_places
from vtk_segdeform.energy import grown_gradients, shape_energy
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.finish import CellEnergy
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.mesh import Mesh, mesh_of
from vtk_segdeform.solver import Status

BAR = models.bar((0.3, 0.16, 2.4), divisions=(5, 4, 48))
X = BAR.vertices
HEIGHT = X[:, 2] - X[:, 2].min()  # s, the arc length of beam theory
LENGTH = float(np.ptp(X[:, 2]))
LEVELS = np.unique(HEIGHT.round(9))
LOWER, UPPER = np.flatnonzero(HEIGHT < 0.03 * LENGTH), np.flatnonzero(HEIGHT > 0.97 * LENGTH)
pytestmark = pytest.mark.usefixtures("bound_once")


@functools.cache
def bar_deformer() -> sd.Deformer:
    regions = sd.segment(BAR, 1)
    return sd.Deformer(BAR, regions, sd.fit_cages(BAR, regions, 200))


def of_two_materials(ratio: float) -> sd.Deformer:
    """Return a deformer of the bar, whose upper half is stiffer by *ratio*."""
    return bar_deformer().stiffened(np.where(HEIGHT < LENGTH / 2, 1.0, ratio))


def bent(ratio: float, fixed, handle, targets) -> np.ndarray:
    """Return the vertices of the bar, whose upper half is stiffer by *ratio*, in a pose."""
    stiffness = np.where(HEIGHT < LENGTH / 2, 1.0, ratio)
    return sd.deform(
        BAR, fixed, handle, targets, stiffness=stiffness, n_regions=1, n_cage_vertices=200
    ).vertices


def section_angles(x: np.ndarray) -> np.ndarray:
    """Return by how much each cross-section of the bar has turned about y."""
    found = []
    for level in LEVELS:
        ids = np.flatnonzero(np.abs(HEIGHT - level) < 1e-6)
        turn, _ = rigid_fit(X[ids], x[ids])
        found.append(np.arctan2(turn[0, 2], turn[2, 2]))
    return np.array(found)


def residuals(mesh: Mesh, stiffness: np.ndarray, x: np.ndarray) -> list[float]:
    """Return how far each rigid part of a pose is from congruent, in diagonals."""
    found = []
    for ids in Stiffness.of(mesh, stiffness).rigid:
        turn, shift = rigid_fit(mesh.vertices[ids], x[ids])
        off = mesh.vertices[ids] @ turn.T + shift - x[ids]
        found.append(float(np.abs(off).max()) / mesh.diagonal)
    return found


@pytest.mark.parametrize(("ratio", "degrees"), every(3, [(4.0, 12.0), (8.0, 60.0), (2.0, 35.0)]))
def test_curvatures_under_one_moment_are_as_the_inverse_of_the_stiffness(ratio, degrees):
    """The end is where it is if both halves are arcs, of curvatures k and k / ratio.

    What is held at the ends is straight.
    """
    begin, end = HEIGHT[LOWER].max(), HEIGHT[UPPER].min()
    soft = np.radians(degrees) / (LENGTH / 2 - begin + (end - LENGTH / 2) / ratio)
    s = np.linspace(0.0, LENGTH, 4001)
    curvature = np.where(s < LENGTH / 2, soft, soft / ratio) * ((begin <= s) & (s <= end))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]))]) * s[1]
    along = np.stack([np.sin(angle), np.cos(angle)])
    sums = np.cumsum(0.5 * (along[:, 1:] + along[:, :-1]), axis=1) * s[1]
    centre = np.concatenate([[[0.0], [0.0]], sums], axis=1)
    at = [np.interp(HEIGHT[UPPER], s, each) for each in (*centre, angle)]
    targets = np.stack(
        [
            at[0] + X[UPPER, 0] * np.cos(at[2]),
            X[UPPER, 1],
            X[:, 2].min() + at[1] - X[UPPER, 0] * np.sin(at[2]),
        ],
        axis=1,
    )
    angles, half = section_angles(bent(ratio, LOWER, UPPER, targets)), []
    for low, high in ((0.1, 0.4), (0.6, 0.9)):
        own = (low * LENGTH <= LEVELS) & (high * LENGTH >= LEVELS)
        half.append(np.polyfit(LEVELS[own], angles[own], 1)[0])
    assert half[0] / half[1] == pytest.approx(ratio, rel=0.05)


def test_the_same_stiffness_everywhere_changes_nothing():
    targets = X[UPPER] + [0.4, 0.1, -0.2]
    plain = bar_deformer().hold(fixed=LOWER, handle=UPPER)
    before = plain.finish(plain.solve(targets)).vertices
    for same in (0.0, 7.5):
        alike = bar_deformer().stiffened(np.full(len(X), same)).hold(fixed=LOWER, handle=UPPER)
        assert_array_equal(alike.finish(alike.solve(targets)).vertices, before)
    other = of_two_materials(1.5).hold(fixed=LOWER, handle=UPPER)
    assert np.abs(other.solve(targets).vertices - before).max() > 1e-3


def test_only_ratios_of_stiffness_matter():
    targets, given = X[UPPER] + [0.4, 0.1, -0.2], np.where(HEIGHT < LENGTH / 2, 1.0, 3.0)
    one, other = (
        bar_deformer().stiffened(scale * given).hold(fixed=LOWER, handle=UPPER).solve(targets)
        for scale in (1.0, 1e6)
    )
    assert_array_equal(one.vertices, other.vertices)


def test_a_stiffened_deformer_is_that_which_is_bound_so():
    given = np.where(HEIGHT < LENGTH / 2, 1.0, 3.0)
    start = bar_deformer()
    bound = sd.Deformer(BAR, start.regions, start.cages, fixed=LOWER, handle=UPPER, stiffness=given)
    targets = X[UPPER] + [0.4, 0.1, -0.2]
    stiffened = start.stiffened(given).hold(fixed=LOWER, handle=UPPER)
    assert_array_equal(stiffened.solve(targets).vertices, bound.solve(targets).vertices)


def test_the_gradient_of_the_energy_is_that_of_its_value():
    rng = np.random.default_rng(0)
    problem = of_two_materials(4.0)._problem
    energy, rest = problem.energy, problem.rest_cages
    p = rest + 0.1 * rng.normal(size=rest.shape)
    step = rng.normal(size=rest.shape)
    value, slope = energy.value_and_slope(p)
    off = [
        energy.value_and_slope(p + e * step)[0] - value - 2.0 * e * np.vdot(slope, step)
        for e in (2e-3, 1e-3)
    ]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)


def test_the_energies_of_surface_and_finish_grow_with_the_stiffness():
    """The same factor everywhere is a factor of the energy."""
    mesh = Mesh(*icosphere(2))
    regions = sd.Regions.single(mesh)
    deformer = sd.Deformer(mesh, regions, sd.fit_cages(mesh, regions, 40))
    subspace, clusters = deformer.subspace, np.arange(mesh.n_vertices)
    rest = np.concatenate([cage.vertices for cage in deformer.cages])
    p = rest + 0.1 * np.random.default_rng(1).normal(size=rest.shape)
    energies = [
        shape_energy(mesh, subspace, 1.0, clusters, stiffness=each)
        for each in (None, np.full(mesh.n_vertices, 3.0))
    ]
    one, three = (each.value_and_slope(p)[0] for each in energies)
    assert three == pytest.approx(3.0 * one)
    x = mesh.vertices + 0.1 * np.random.default_rng(2).normal(size=mesh.vertices.shape)
    cells = [CellEnergy.of(mesh, 0.0, each) for each in (None, np.full(mesh.n_vertices, 3.0))]
    one, three = (each.value_and_slope(x)[0] for each in cells)
    assert three == pytest.approx(3.0 * one)


def bodies():
    """Return meshes, fixed vertices, handles and rigid vertices, by name."""
    ring = models.torus(500)
    x = ring.vertices
    yield "ring", ring, x[:, 0] < -1.1, x[:, 0] > 1.1, np.abs(x[:, 0]) < 0.3  # two parts
    body = torso()
    x = body.vertices
    yield "in the rigid part", body, x[:, 2] < -1.3, x[:, 0] > 1.6, x[:, 0] > 1.2
    body = crab()
    x = body.vertices
    yield "beside it", body, x[:, 1] < -1.2, x[:, 1] > 1.0, np.abs(x[:, 1]) < 0.3


@pytest.mark.parametrize(("name", "mesh", "fixed", "handle", "rigid"), every(2, bodies()))
def test_rigid_parts_are_congruent_after_the_finish(name, mesh, fixed, handle, rigid):
    stiffness = np.where(rigid, np.inf, 1.0)
    handles = np.flatnonzero(handle)
    at = mesh.vertices[handles]
    targets = (at - at.mean(axis=0)) @ rotation([1, 2, 0], 0.6).T + at.mean(axis=0)
    targets = targets + [0.1, 0.2, 0.3]
    regions = sd.segment(mesh, 1)
    cages = sd.fit_cages(mesh, regions, 80)
    deformer = sd.Deformer(mesh, regions, cages, fixed=fixed, handle=handle, stiffness=stiffness)
    pose = deformer.finish(deformer.solve(targets))
    off = residuals(mesh, stiffness, pose.vertices)
    assert len(off) == (2 if name == "ring" else 1)
    assert max(off) <= 1e-9
    assert abs(pose.volume_change) < 1e-12
    assert pose.handle_error < 1e-12
    assert pose.fixed_error < 1e-12
    soft = deformer.stiffened(None).hold(fixed=fixed, handle=handle)
    assert max(residuals(mesh, stiffness, soft.finish(soft.solve(targets)).vertices)) > 1e-3


def test_a_rigid_part_that_its_handle_and_fixed_vertices_tear_is_told():
    rigid = np.where(np.abs(X[:, 0]) < 0.1, np.inf, 1.0)  # from the fixed end to the handle
    deformer = bar_deformer().stiffened(rigid).hold(fixed=LOWER, handle=UPPER)
    pose = deformer.solve(X[UPPER] @ rotation([1, 0, 0], 0.5).T)
    finished = deformer.finish(pose)
    assert finished.handle_error == finished.fixed_error == 0.0
    assert finished.status is Status.RIGID_MISSED
    for each in (pose, finished):
        assert each.rigid_error == pytest.approx(max(residuals(BAR, rigid, each.vertices)), rel=0.5)
    half = bar_deformer().stiffened(np.where(HEIGHT > LENGTH / 2, np.inf, 1.0))
    half = half.hold(fixed=LOWER, handle=UPPER)
    whole = half.finish(half.solve(X[UPPER] + [0.2, 0.0, 0.0]))
    assert whole.status is Status.CONVERGED
    assert whole.rigid_error < 1e-12


def test_a_rigid_part_is_placed_by_what_holds_it_then_by_tracks_then_by_the_pose():
    rng = np.random.default_rng(5)
    rest, turn = rng.normal(size=(40, 3)), rotation([0.4, 0.5, -0.8], 0.9)
    pose = rest @ turn.T + [1.0, 2.0, 3.0] + 0.01 * rng.normal(size=rest.shape)
    slides = np.arange(40) >= 38

    def on_plane(x, height=3.2):
        normals = np.zeros((40, 3, 3))
        normals[slides, 2, 2] = 1.0
        return np.where(slides[:, None], x * [1.0, 1.0, 0.0] + [0.0, 0.0, height], x), normals

    def free(x):
        return x, np.zeros((40, 3, 3))

    held = np.zeros(40, dtype=bool)
    r, t = rigid_fit(rest, pose)
    assert_allclose(
        rigid_places(rest, pose, held, pose, on_tracks=free), rest @ r.T + t, atol=1e-12
    )
    for count, tracks in ((0, on_plane), (1, on_plane), (2, free), (3, free)):
        held[:] = np.arange(40) < count
        x = rigid_places(rest, pose, held, rest @ turn.T + [1.5, 2.0, 3.0], on_tracks=tracks)
        r, t = rigid_fit(rest, x)
        assert_allclose(rest @ r.T + t, x, atol=1e-12)
        assert_allclose(x[held], (rest @ turn.T + [1.5, 2.0, 3.0])[held], atol=1e-12)
        if tracks is on_plane:
            assert_allclose(x[slides, 2], 3.2, atol=1e-12)
        if count == 2:  # it may still turn about their line
            for angle in (-1e-3, 1e-3):
                other = (x - x[0]) @ rotation(x[1] - x[0], angle).T + x[0]
                assert np.linalg.norm(other - pose) > np.linalg.norm(x - pose)
    held[:] = np.arange(40) < 1  # a plane that is out of reach leaves it where it is
    x = rigid_places(rest, pose, held, rest, on_tracks=lambda x: on_plane(x, 9.0))
    assert_allclose(x[0], rest[0], atol=1e-12)


def drag(n_frames, **options) -> tuple[sd.Deformer, np.ndarray, list[sd.Solution]]:
    """Return a deformer whose arm has a bone, the bone, and frames of a drag of the hand."""
    body = torso(3)
    x = body.vertices
    bone = (x[:, 0] > 0.8) & (x[:, 0] < 1.4)
    feet, hand = x[:, 2] < -1.3, np.flatnonzero(x[:, 0] > 1.6)
    regions = sd.segment(body)
    deformer = sd.Deformer(
        body, regions, sd.fit_cages(body, regions), fixed=feet, handle=hand,
        stiffness=np.where(bone, np.inf, 1.0), **options,
    )  # fmt: skip
    way = np.array([-0.3, 0.0, 0.6])
    shares = np.linspace(1.0, 0.2, n_frames)[::-1]
    frames = [deformer.solve(x[hand] + share * way) for share in shares]
    return deformer, np.where(bone, np.inf, 1.0), frames


dragged = functools.cache(drag)


def test_rigid_parts_are_nearly_congruent_in_every_frame_of_a_drag():
    deformer, stiffness, frames = dragged(5)
    for frame in frames:
        assert max(residuals(deformer.mesh, stiffness, frame.vertices)) < 1e-3
        assert frame.handle_error < 1e-4
        assert abs(frame.volume_change) < 1e-12


def test_the_inside_of_a_rigid_part_has_the_gradient_of_its_surface():
    middle = np.where(np.abs(HEIGHT - LENGTH / 2) < 0.3 * LENGTH, np.inf, 1.0)
    problem = bar_deformer().stiffened(middle)._problem
    binding = problem.binding
    gradients = grown_gradients(binding.energy, binding.interior, problem.rest_cages)
    of_bone = binding.rigid.axes[0] @ binding.rigid.maps[0, 1:]
    off = np.abs(gradients - of_bone).max(axis=(1, 2))
    assert (off < 1e-9 * np.abs(of_bone).max()).any()


def test_points_in_a_rigid_part_move_with_it():
    deformer, stiffness, frames = dragged(5)
    bone, rest = np.isinf(stiffness), deformer.mesh.vertices
    marrow = 0.4 * rest[bone] + 0.6 * rest[bone].mean(axis=0)
    turn, shift = rigid_fit(rest[bone], frames[-1].vertices[bone])
    off = deformer.carry(marrow) - (marrow @ turn.T + shift)
    assert np.abs(off).max() < 2e-3 * deformer.mesh.diagonal
    assert_allclose(deformer.carry(rest), frames[-1].vertices, atol=1e-12)


def test_a_rigid_ring_around_a_bar_follows_it():
    bar, ring = models.bar((0.2, 0.12, 1.0), (4, 3, 24)), models.torus(400, major=0.2, minor=0.03)
    middle = bar.vertices[:, 2].mean()
    mesh = mesh_of(
        np.concatenate([bar.vertices, ring.vertices + [0.0, 0.0, middle]]),
        np.concatenate([bar.faces, ring.faces + bar.n_vertices]),
    ).mesh
    x, own = mesh.vertices, np.arange(bar.n_vertices, mesh.n_vertices)
    on_bar = np.arange(mesh.n_vertices) < bar.n_vertices
    fixed = np.flatnonzero(on_bar & (x[:, 2] < middle - 0.45))
    handle = np.flatnonzero(on_bar & (x[:, 2] > middle + 0.45))
    regions = sd.segment(mesh)
    deformer = sd.Deformer(
        mesh, regions, sd.fit_cages(mesh, regions), fixed=fixed, handle=handle,
        stiffness=np.where(on_bar, 1.0, np.inf),
    )  # fmt: skip
    pose = deformer.solve(x[handle] + [0.5, 0.0, -0.25]).vertices
    inside = np.flatnonzero(on_bar & (np.abs(x[:, 2] - middle) < 0.06))
    (turn, _), (of_bar, _) = (rigid_fit(x[ids], pose[ids]) for ids in (own, inside))
    angle = np.degrees(np.arccos((np.trace(turn.T @ of_bar) - 1.0) / 2.0))
    assert angle < 8.0
    between = (pose - x)[own].mean(axis=0) - (pose - x)[inside].mean(axis=0)
    assert np.linalg.norm(between) < 0.02


def test_a_binding_with_rigid_parts_is_read_again(tmp_path, monkeypatch):
    monkeypatch.setattr(problem, "cached_binding", cached_binding)  # not from memory
    computed, _, frames = drag(1, cache=tmp_path)
    monkeypatch.setattr(Binding, "compute", None)
    read, _, again = drag(1, cache=tmp_path)
    monkeypatch.undo()
    assert_array_equal(frames[-1].vertices, again[-1].vertices)
    soft = read.stiffened(None)
    plain = sd.Deformer(read.mesh, read.regions, read.cages)
    hand = {"fixed": computed.fixed, "handle": computed.handle}
    targets = read.mesh.vertices[computed.handle] + [0.0, 0.0, 0.3]
    assert_array_equal(
        soft.hold(**hand).solve(targets).vertices, plain.hold(**hand).solve(targets).vertices
    )


def test_a_rigid_part_with_one_handle_vertex_turns_about_it():
    mesh = torso()
    x = mesh.vertices
    stiffness = np.where(x[:, 0] > 1.0, np.inf, 1.0)
    tip = int(x[:, 0].argmax())
    pose = sd.pull(
        mesh, tip, x[tip] + [-0.3, 0.2, 0.7], pins=x[:, 2] < -1.3, stiffness=stiffness,
        n_regions=1, n_cage_vertices=80,
    )  # fmt: skip
    assert max(residuals(mesh, stiffness, pose.vertices)) <= 1e-9
    assert pose.handle_error < 1e-12
    assert abs(pose.volume_change) < 1e-12
    ids = Stiffness.of(mesh, stiffness).rigid[0]
    turn, _ = rigid_fit(x[ids], pose.vertices[ids])
    assert np.degrees(np.arccos((np.trace(turn) - 1.0) / 2.0)) > 5.0


@pytest.mark.parametrize(
    "given",
    [-1.0, np.nan, [1.0, 2.0], "soft", np.ones((len(X), 1)), np.ones(len(X), dtype=complex), None],
)
def test_what_is_no_stiffness_is_named(given):
    deformer = bar_deformer()
    if given is None:
        given = np.ones(len(X))
        given[3] = -np.inf
    elif isinstance(given, float):
        given = np.where(np.arange(len(X)) == 3, given, 1.0)
    with pytest.raises(ConstraintError, match=f"stiffness must be {len(X)} numbers, 0 or more"):
        deformer.stiffened(given)
