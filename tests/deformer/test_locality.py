"""Locality: anchors, samples of the surface, and pulls that make no spike."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose
from real_meshes import path_of
from scenes import sausage
from scipy import linalg, sparse
from scipy.sparse import csgraph
from solids import icosphere, revolved

from vtk_segdeform import models, sizes
from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.cages import fit_cages
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.deformer.limbs import _lengths
from vtk_segdeform.deformer.locality import Ring, SurfaceSamples
from vtk_segdeform.deformer.path import Path
from vtk_segdeform.deformer.pull import pull
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.geometry import distortion
from vtk_segdeform.io.surface import Surface
from vtk_segdeform.mesh import Mesh, SurfacePoint
from vtk_segdeform.models.implicit import Limb, implicit_surface
from vtk_segdeform.regions import Regions
from vtk_segdeform.session import Session
from vtk_segdeform.solver.position_constraints import Anchors, PositionTerm
from vtk_segdeform.solver.solution import Status

SCENE = sausage(2, is_coarse=True)
X = SCENE.mesh.vertices
D = SCENE.mesh.diagonal
HIGH = int(np.argmax(X[:, 2]))
UP = np.array([0.0, 0.0, 0.1 * D])


@functools.cache
def held() -> Deformer:
    return SCENE.deformer().hold(handle=[HIGH])


def chain(count: int = 12, forks: dict[int, int] | None = None) -> SurfaceSamples:
    """Return samples along a line, one apart, whose weights are the diagonal of `quadratic`.

    With *forks*, some of them are joined to others than the ones before.
    """
    i = np.arange(count - 1)
    before = np.array([(forks or {}).get(k + 1, k) for k in range(count - 1)])
    edges = sparse.coo_array((np.ones(count - 1), (before, i + 1)), (count, count)).tocsr()
    points = np.stack([np.arange(count), *np.zeros((2, count))], axis=1)
    share = np.full(count, 1.0 / count)
    faces = np.empty((0, 3), dtype=np.int64)
    return SurfaceSamples(np.arange(count), np.eye(count), points, share, faces, edges + edges.T)


def test_the_slope_of_the_objective_is_its_derivative_and_the_hessian_has_the_anchors():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(9, 8))
    anchors = Anchors(root.T @ root, rng.normal(size=(8, 3)), rng.normal(size=(8, 3)))
    rows, weights = rng.normal(size=(3, 8)), np.array([2.0, 2.0, 15.0])
    term = PositionTerm(rows, np.array([0, 0, 1]), weights, anchors=anchors)
    p, way, u = rng.normal(size=(8, 3)), rng.normal(size=(8, 3)), rng.normal(size=(3, 3))
    value, slope = term.value_and_slope(p, u)
    errors = []
    for step in (1e-2, 1e-3):
        ahead, _ = term.value_and_slope(p + step * way, u)
        first_order = value + 2.0 * step * np.vdot(slope, way)
        second = step**2 * np.vdot(way, term.quadratic() @ way)
        assert_allclose(ahead, first_order + second, rtol=1e-12)
        errors.append(abs(ahead - first_order))
    assert np.log10(errors[0] / errors[1]) == pytest.approx(2.0, abs=1e-6)
    free = PositionTerm(rows, term.set_of, weights)
    assert_allclose(term.quadratic() - free.quadratic(), anchors.quadratic, atol=1e-12)


def test_at_the_press_the_objective_of_a_local_deformer_is_at_rest():
    posed = held().copy()
    posed.solve(X[[HIGH]] + UP)
    local = posed.local(int(X[:, 0].argmax()), 0.2 * D, 0.1 * D)
    solver, p = local._constraints.solver, local._path.p
    places = local._constraints.places(local._path.targets)
    assert np.abs(solver.unbalanced(p, places)).max() < 1e-12 * np.abs(solver._hessian).max()
    assert local.solve(X[[HIGH]] + UP).steps == 0
    assert local._constraints.pulled.points == (SurfacePoint.at_vertex(HIGH),)


@pytest.mark.parametrize(
    ("follows", "free"), [(0.0, range(6, 11)), (0.1, range(6, 11)), (0.5, range(6, 12))]
)
def test_the_reach_is_free_and_parts_beyond_it_follow_if_they_are_small(follows, free):
    weights = np.diag(chain().quadratic([SurfacePoint.at_vertex(8)], 2.0, follows)) * 12
    assert set(np.flatnonzero(weights == 0.0)) == set(free)
    assert weights[:6] == pytest.approx((np.arange(8, 2, -1) ** 2 / 4.0 - 1.0) ** 2)


def test_what_shares_a_region_with_the_pulled_part_comes_along_and_other_bodies_stay():
    """A button on the pulled end, one on the other end, and a body of its own."""
    low, high = X[X[:, 0].argmin()], X[X[:, 0].argmax()]
    ball, faces = icosphere(1)
    others = [0.05 * D * ball + 1.1 * low, 0.05 * D * ball + 1.1 * high, ball + [0.0, 4.0, 0.0]]
    starts = len(X) + len(ball) * np.arange(3)
    corners = [SCENE.mesh.faces, *(faces + start for start in starts)]
    mesh = Mesh(np.concatenate([X, *others]), np.concatenate(corners))
    regions = Regions.from_labels(mesh, mesh.components // 3)
    tip = int(X[:, 0].argmax())
    held = Deformer(mesh, regions, fit_cages(mesh, regions, 60), fixed=SCENE.fixed, handle=[tip])
    local = held.local(tip, 0.2 * D, 0.1 * D)
    solution = local.solve(X[[tip]] + 0.1 * UP)
    away = np.linalg.norm(solution.vertices - mesh.vertices, axis=1)
    of_tip, (far, near, other) = away[tip], np.split(away, starts)[1:]
    assert near.min() > 0.5 * of_tip
    assert far.max() < 0.01 * of_tip
    assert other.max() < 1e-9 * D
    free = held.local(tip, np.inf, 0.1 * D)._constraints  # only what nothing else holds is anchored
    loose = free.problem.anchors_of_loose_parts(np.append(SCENE.fixed, tip))
    assert loose.any()
    assert_allclose(free.solver.positions.anchors.quadratic, loose, atol=1e-12)


def test_steadying_anchors_make_the_pose_a_minimum_and_are_absent_where_it_is_one():
    solver, p = held()._constraints.solver, held()._path.p
    assert solver.steadying(p, 0.0) == 0.0
    assert solver.steadying(p, 10.0 * solver.energy.scale) > 0.0
    squeezed = p * [1.0, 1.0, 0.6]
    least = 0.02 * solver.energy.scale
    weight = solver.steadying(squeezed, least)
    assert weight > 0.0
    places = held()._constraints.places(held()._path.targets)

    def slope(k, q):
        anchors = Anchors(k * solver.energy.mass, squeezed, np.zeros_like(p))
        position = solver.positions.local(solver.positions.rows, anchors)
        return replace(solver, positions=position)._at(q, places).slope

    def least_curvature(k):
        steps = 1e-6 * np.eye(p.size).reshape(-1, *p.shape)
        columns = [slope(k, squeezed + step) - slope(k, squeezed - step) for step in steps]
        hessian = np.reshape(columns, (p.size, p.size)) / 2e-6
        mass = np.kron(solver.energy.mass, np.eye(3))
        return linalg.eigvalsh(0.5 * (hessian + hessian.T) - least * mass)[0]

    rounding = 1e-6 * solver.energy.scale
    assert least_curvature(weight) > -rounding
    assert least_curvature(0.49 * weight) < -rounding


def test_the_search_for_steadying_anchors_ends_where_none_are_enough():
    solver, p = held()._constraints.solver, held()._path.p
    without = replace(solver, energy=replace(solver.energy, mass=0.0 * solver.energy.mass))
    assert without.steadying(p * [1.0, 1.0, 0.2], solver.energy.scale) == 0.0


@functools.cache
def strongly_bent():
    deformer = SCENE.held()
    for degrees in (30, 60, 90, 120):
        deformer.solve(SCENE.turned(degrees))
    return deformer.solve(SCENE.turned(150))


@pytest.mark.parametrize("pins", [SCENE.fixed, SCENE.fixed[:0]], ids=["pinned", "free"])
def test_a_press_on_a_strongly_bent_body_lets_nothing_jump(pins):
    """What bent it is released, and is a load now: without steadying, two of 24 presses jump.

    By 55 times the motion of the hand, or more.
    """
    bent = strongly_bent()
    hand = 3e-3 * D * np.array([0.6, 0.0, 0.8])
    for vertex in np.setdiff1d(np.arange(0, len(X), 9), pins):
        held = SCENE.held().hold(fixed=pins, handle=[vertex])
        held.resume(bent.cage_vertices, bent.vertices[[vertex]])
        local = held.local(int(vertex), 0.2 * D, 0.1 * D, follows=0.2)
        pose = local.solve(bent.vertices[[vertex]] + hand, max_steps=20)
        moved = np.linalg.norm(pose.vertices - bent.vertices, axis=1).max()
        assert moved < 10.0 * np.linalg.norm(hand), vertex


def test_a_pose_out_of_all_proportion_is_not_shown_and_the_status_says_so(monkeypatch):
    deformer = held().local(HIGH, 0.2 * D, 0.1 * D)
    before = deformer.solve(X[[HIGH]] + 0.1 * UP)
    own = Path._with_exact_volume

    def explode(self, result):
        x, scaled_by = own(self, result)
        self.p = 50.0 * self.p
        return 50.0 * x, scaled_by

    with monkeypatch.context() as wrong:
        wrong.setattr(Path, "_with_exact_volume", explode)
        missed = deformer.solve(X[[HIGH]] + 0.2 * UP)
        assert missed.status is Status.MISSED
        assert_allclose(missed.vertices, before.vertices, atol=1e-12)
        assert abs(missed.volume_change) < 1e-12
    after = deformer.solve(X[[HIGH]] + 0.2 * UP)
    assert after.status is Status.CONVERGED
    assert np.linalg.norm(after.vertices[HIGH] - X[HIGH] - 0.2 * UP) < 6e-4 * D


def ring_around(mesh, vertex):
    """Return the directed edges opposite to *vertex* in its triangles, (k, 2)."""
    faces = mesh.faces[(mesh.faces == vertex).any(axis=1)]
    turned = np.argmax(faces == vertex, axis=1)[:, None] + [1, 2]
    return np.take_along_axis(faces, turned % 3, axis=1)


def outward(x, vertex, ring):
    normal = np.cross(x[ring[:, 0]] - x[vertex], x[ring[:, 1]] - x[vertex]).sum(axis=0)
    return normal / np.linalg.norm(normal)


def offset(x, vertex, ring):
    """Return the signed offset of a vertex from the plane of its neighbours."""
    middle = x[np.unique(ring)].mean(axis=0)
    normal = np.cross(x[ring[:, 0]] - middle, x[ring[:, 1]] - middle).sum(axis=0)
    return (x[vertex] - middle) @ normal / np.linalg.norm(normal)


def spike(mesh, x, vertex):
    """Return the change of a vertex's offset from the plane of its neighbours, in edge lengths."""
    ring = ring_around(mesh, vertex)
    edge = np.linalg.norm(mesh.vertices[np.unique(ring)] - mesh.vertices[vertex], axis=1).mean()
    return abs(offset(x, vertex, ring) - offset(mesh.vertices, vertex, ring)) / edge


def dense():
    return models.cactus(600)


def real(name):
    return Surface.read(path_of(name)).mesh


BODIES = {
    "cactus": (dense, 0.15, 5),
    # With equal weights beyond the reach the far surface would move by 0.6 % of the diagonal.
    "hand": (functools.partial(real, "hand.off"), 0.1, 57),
}


@pytest.mark.parametrize("name", every(2, BODIES))
def test_a_pull_reaches_its_target_without_a_spike_and_far_away_nothing_moves(name):
    body, radius, seed = BODIES[name]
    mesh, rng = body(), np.random.default_rng(seed)
    radius *= mesh.diagonal
    vertex = int(rng.integers(mesh.n_vertices))
    x, away = mesh.vertices, np.linalg.norm(mesh.vertices - mesh.vertices[vertex], axis=1)
    way = rng.normal(size=3)
    to = x[vertex] + 0.1 * mesh.diagonal * way / np.linalg.norm(way)
    solution = pull(mesh, vertex, to, radius, locality=1.0)
    assert solution.status is Status.CONVERGED
    assert abs(solution.volume_change) < 1e-12
    assert np.linalg.norm(solution.vertices[vertex] - to) < 6e-4 * mesh.diagonal
    assert spike(mesh, solution.vertices, vertex) < 0.1
    far = np.linalg.norm(solution.vertices - x, axis=1)[away > 4.0 * radius]
    assert far.max(initial=0.0) < 2e-3 * mesh.diagonal


@functools.cache
def coarse():
    """Return a ball whose cage is about as dense as itself, without handles."""
    mesh = models.sphere(400)
    regions = Regions.single(mesh)
    return Deformer(mesh, regions, fit_cages(mesh, regions, 150))


def test_the_finish_of_a_pull_has_no_more_energy_than_its_start():
    d, x = coarse().mesh.diagonal, coarse().mesh.vertices
    local = coarse().hold(handle=[0]).local(0, 0.3 * d, 0.075 * d)
    solution = local.solve(x[[0]] + [0.0, 0.0, 0.1 * d])
    finished = local.finish(solution)
    before, after = (
        local._problem.cell_energy.value_and_slope(each.vertices)[0]
        for each in (solution, finished)
    )
    assert after < before
    assert finished.status is Status.CONVERGED
    assert abs(finished.volume_change) < 1e-12


def test_only_rings_that_would_bend_resist():
    deformer, d = coarse(), coarse().mesh.diagonal
    plain = deformer._problem.energy
    one = deformer.hold(handle=[0]).local(0, 0.3 * d, 0.075 * d)
    more = one._constraints.solver.energy.constant - plain.constant
    assert more > 0.0
    patch = deformer.hold(handle=[0, *ring_around(deformer.mesh, 0)[:, 0]])
    beside = deformer.hold(handle=[0], fixed=ring_around(deformer.mesh, 0)[:1, 0])
    for other in (patch, beside):
        assert other.local(0, 0.3 * d, 0.075 * d)._constraints.solver.energy is plain
    dense = models.sphere(2562)
    regions = Regions.single(dense)
    fine = Deformer(dense, regions, fit_cages(dense, regions, 20))
    local = fine.hold(handle=[0]).local(0, 0.8 * d, 0.075 * d)
    assert local._constraints.solver.energy is fine._problem.energy
    ring = Ring.around(deformer.mesh, deformer._problem.rest.vertices, SurfacePoint.at_vertex(0))
    rows = ring.combinations @ deformer.subspace.at(ring.vertices)
    solver = one._constraints.solver
    (own, both), _ = solver.compliance(np.stack([deformer.subspace.at(np.array([0]))[0], rows[0]]))
    pulled = 0.3 * d / deformer._problem.frame.size  # 0.15 edges of offset, or less by its edges
    assert abs(both) / own * pulled == pytest.approx(0.15 * ring.edge, rel=0.05)
    far = deformer.hold(handle=[0, 217]).local(0, 0.3 * d, 0.075 * d)
    assert far._constraints.solver.energy.constant > plain.constant + 1.5 * more


def test_a_ring_has_its_vertex_as_an_affine_mean_of_the_neighbours():
    mesh = coarse().mesh
    ring = Ring.around(mesh, mesh.vertices, SurfacePoint.at_vertex(5))
    around = np.setdiff1d(mesh.adjacency[[5]].indices, [5])
    assert ring.vertices.tolist() == [5, *around]
    assert_allclose(ring.combinations.sum(axis=1), 0.0, atol=1e-12)
    assert_allclose(ring.offsets[1:], mesh.vertices[5] - mesh.vertices[around], atol=1e-12)
    normal = outward(mesh.vertices, 5, ring_around(mesh, 5))
    assert np.linalg.norm(np.cross(ring.offsets[0], normal)) < 0.02 * ring.edge
    assert ring.weights[0] > ring.weights[1:].sum()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"vertex": -1}, "vertex must be"),
        ({"reach": -1.0}, "reach must be 0 or a positive number"),
        ({"reach": np.nan}, "reach must be 0 or a positive number"),
        ({"spread": np.inf}, "spread must be a positive number"),
        ({"spread": 0.0}, "spread must be a positive number"),
        ({"spread": "wide"}, "spread must be a positive number"),
        ({"follows": 1.5}, "follows must be a number from 0 to 1"),
        ({"follows": None}, "follows must be a number from 0 to 1"),
    ],
)
def test_arguments_of_a_local_deformer_are_checked(changes, says):
    with pytest.raises(ConstraintError, match=says):
        held().local(**{"vertex": HIGH, "reach": 1.0, "spread": 0.5, **changes})


@pytest.mark.campaign  # its energy is tested every day
def test_the_finish_of_a_pull_makes_no_bump_around_the_pulled_point():
    mesh = models.cactus(1800)
    x = mesh.vertices
    tip = int(np.argmin(np.linalg.norm(x - [-0.32, -0.05, 0.62], axis=1)))
    session = Session(mesh)
    session.accept(session.preparation())
    session.pull(tip, x[tip] + [-0.2, 0.0, 0.1])
    session.commit()
    poses = [session.vertices.copy()]
    session.finish()
    poses.append(session.vertices)
    near = (np.linalg.norm(x[mesh.faces] - x[tip], axis=2) < 0.2 * mesh.diagonal).all(axis=1)
    rest, *bent = (bends(each, mesh.faces[near]) for each in (x, *poses))
    before, after = (np.sqrt(((each - rest) ** 2).mean()) for each in bent)
    assert distortion(mesh, poses[1]) < 0.97 * distortion(mesh, poses[0])
    assert after < 1.3 * before  # 1.21 if more than the limb follows


def bends(x, faces):
    """Return the signed angles between the normals of neighbouring triangles."""
    sides = np.concatenate([faces, np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)])
    owner = {(a, b): k for k, (a, b, _) in enumerate(sides.tolist())}
    pairs = np.array([(k, owner[b, a]) for (a, b), k in owner.items() if a < b and (b, a) in owner])
    normal = np.cross(x[sides[:, 1]] - x[sides[:, 0]], x[sides[:, 2]] - x[sides[:, 0]])
    one, two = normal[pairs[:, 0]], normal[pairs[:, 1]]
    along = x[sides[pairs[:, 0], 1]] - x[sides[pairs[:, 0], 0]]
    across = np.cross(one, two)
    sine = np.einsum("ij,ij->i", across, along) / np.linalg.norm(along, axis=1)
    return np.arctan2(sine, np.einsum("ij,ij->i", one, two))


def samples_of(mesh: Mesh) -> SurfaceSamples:
    i, j = mesh.adjacency.nonzero()
    lengths = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
    edges = sparse.csr_array((lengths, (i, j)), mesh.adjacency.shape)
    n = mesh.n_vertices
    return SurfaceSamples(
        np.arange(n), mesh.vertices, mesh.vertices, mesh.vertex_areas, mesh.faces, edges
    )


def arc(radius: float, height: float, low: float, high: float) -> FloatArray:
    """Return points of a circle around the axis, from one angle to another; 0 is the top."""
    angles = np.arange(high, low, -0.09)
    return np.stack([radius * np.sin(angles), height + radius * np.cos(angles)], axis=1)


def figure(neck: float) -> Mesh:
    """Return a ball of radius 1 and a head of .35, at the top, on a neck of this length."""
    body, head = arc(1.0, 0.0, 0.2, np.pi), arc(0.35, 1.28 + neck, 0.0, 2.5)
    between = np.linspace(body[-1], head[0], max(2, round(neck / 0.1)))[1:-1]
    profile = np.concatenate([body, between, head])
    profile[[0, -1], 0] = 0.0
    return Mesh(*revolved(profile))


def on_head(mesh: Mesh, angle: float) -> SurfacePoint:
    """Return the vertex of a `figure` on its head at this angle from the top."""
    centre = mesh.vertices[:, 2].max() - 0.35
    place = [0.35 * np.sin(angle), 0.0, centre + 0.35 * np.cos(angle)]
    return SurfacePoint.at_vertex(int(np.linalg.norm(mesh.vertices - place, axis=1).argmin()))


@pytest.mark.parametrize("angle", [0.0, 0.8, 1.6])
@pytest.mark.parametrize("neck", [0.5, 0.8])
def test_a_limb_ends_where_the_surface_widens_wherever_it_is_grabbed(neck, angle):
    mesh = figure(neck)
    z = mesh.vertices[:, 2]
    (limb,) = samples_of(mesh).limbs(on_head(mesh, angle))
    assert limb.length == pytest.approx(2.5 * 0.35 + neck, rel=0.15)
    assert limb.length - 0.35 * angle - 0.15 < limb.depth <= limb.length
    assert (limb.share[z > 1.2] == 1.0).all()
    assert (limb.share[z < 0.4] == 0.0).all()
    weights = samples_of(mesh).weights([on_head(mesh, angle)], limb.length, 0.8, limb.depth)
    assert ((weights == 0.0) == (limb.share > 0.0)).all()  # so both sides of the body are held
    joint, axis = limb.axis(mesh, mesh.vertices + 3.0)
    assert np.linalg.norm(joint - [3.0, 3.0, 3.9]) < 0.3
    assert axis == pytest.approx([0.0, 0.0, 1.0], abs=0.15)


def test_limbs_are_nested_and_branches_belong_to_them():
    fingers = [Limb([(x, 0, 0.2), (1.5 * x, 0, 0.9)], [0.07, 0.06]) for x in (-0.2, 0.0, 0.2)]
    hand = [*fingers, Limb([(0, 0, -0.1), (0, 0, 0.2)], [0.2, 0.25])]
    arm = [
        Limb([(0, 0, -1.0), (0, 0, 0.0)], [0.12, 0.1]),
        Limb([(0, 0, -1.9), (0, 0, -1.5)], [0.7, 0.7]),
    ]

    def field(x):
        return np.min([limb(x) for limb in (*hand, *arm)], axis=0)

    mesh = implicit_surface(field, np.array([[-0.9, -0.9, -2.8], [0.9, 0.9, 1.1]]), 2500)
    x = mesh.vertices
    tip = SurfacePoint.at_vertex(int(x[:, 2].argmax()))
    finger, whole = samples_of(mesh).limbs(tip)
    assert x[finger.share == 1.0][:, 2].min() > 0.2
    assert (whole.share >= finger.share).all()
    assert (whole.share[x[:, 2] > -0.5] == 1.0).all()  # the other fingers belong to it
    assert (whole.share[x[:, 2] < -1.3] == 0.0).all()


@pytest.mark.parametrize("mesh", [models.sphere(1000), models.bar(), models.torus(1200)])
def test_what_does_not_widen_has_no_limbs(mesh):
    samples = samples_of(mesh)
    for vertex in range(0, mesh.n_vertices, 97):
        assert samples.limbs(SurfacePoint.at_vertex(vertex)) == ()


def test_the_locality_decides_the_reach_and_what_follows():
    point = SurfacePoint.at_vertex(HIGH)
    for locality, expected in [(0.25, (6.0, 0.75)), (1.0, (3.0, 0.0)), (0.0, (np.inf, 1.0))]:
        for limb in (None, 0, 7):  # there is none
            found = held().reach_of_pull(point, 3.0, locality, limb)
            assert found == pytest.approx((*expected, 0.0))


def test_the_limb_decides_the_reach():
    mesh = figure(0.5)
    session = Session(mesh)
    assert session.accept(session.preparation())
    session.bind()
    deformer, side = session.deformer, on_head(mesh, 1.6)
    limb, whole = deformer.limbs(side)
    assert whole.is_whole
    assert (whole.share == 1.0).all()
    assert np.ptp(limb.share) == 1.0
    assert deformer.limbs(int(mesh.vertices[:, 2].argmin())) == ()
    expected = limb.length, 0.8, limb.depth
    assert deformer.reach_of_pull(side, 0.9, 0.2) == pytest.approx(expected)
    assert deformer.reach_of_pull(side, 0.1, 0.2) == pytest.approx((0.1 / 0.2**0.5, 0.8, 0.0))
    assert deformer.reach_of_pull(side, 0.1, 0.2, 0) == pytest.approx(expected)
    assert deformer.reach_of_pull(side, 0.9, 0.0, 0) == pytest.approx(expected)
    assert deformer.reach_of_pull(side, 0.9, 0.2, 1) == (np.inf, 1.0, 0.0)
    with pytest.raises(ConstraintError, match="limb must be None or a whole number"):
        deformer.reach_of_pull(side, 0.9, 0.2, -1)


def test_a_head_nods_alone():
    mesh = figure(0.5)
    body = mesh.vertices[:, 2] < 0.6
    for angle in (0.0, 1.6):  # the crown and the chin
        point = on_head(mesh, angle)
        to = mesh.vertices[point.vertex] + [0.2, 0.0, -0.3]
        moves = pull(mesh, point, to, 0.9).vertices - mesh.vertices
        assert np.linalg.norm(moves[body], axis=1).max() < 0.005 * mesh.diagonal
        assert np.linalg.norm(moves, axis=1).max() > 0.07 * mesh.diagonal


def test_weights_grow_with_the_distance_to_the_largest_one():
    samples, away = chain(25), np.arange(25.0)
    for reach in (1.0, 2.5):
        weights = samples.weights([SurfacePoint.at_vertex(0)], reach, 0.0)
        expected = np.minimum(np.maximum((away / reach) ** 2 - 1.0, 0.0) ** 2, 1e4)
        assert_allclose(weights, expected)
    assert samples.weights([SurfacePoint.at_vertex(0)], np.inf, 0.0).tolist() == [0.0] * 25


def test_the_room_beyond_a_joint_is_a_fifth_as_long_up_other_limbs():
    """Limbs 0 to 10 and 12 to 22 meet at 11, at the end of a longer one, 11 and 23 to 40."""
    fork, tip = chain(41, forks={23: 11}), SurfacePoint.at_vertex(0)
    weights = fork.weights([tip], 8.0, 0.0, 6.0)
    beyond = np.arange(1.0, 7.0)  # 6 to 11
    away = [np.zeros(6), beyond, 6.0 + 5.0 * np.arange(1.0, 12.0), 6.0 + np.arange(1.0, 19.0)]
    expected = np.maximum((0.75 + np.concatenate(away) / 8.0) ** 2 - 1.0, 0.0) ** 2
    assert_allclose(weights, expected)
    both = fork.weights([tip, SurfacePoint.at_vertex(22)], 8.0, 0.0, 6.0)
    assert_allclose(both[:12], expected[:12])
    assert_allclose(both[12:23], expected[:11][::-1])


def test_a_point_of_an_edge_is_as_far_as_its_nearer_corner():
    one = held()._problem.samples
    a, b = SCENE.mesh.edges[5]
    point = SurfacePoint.of([a, b], [0.3, 0.7])
    graph = one.edges
    length = np.linalg.norm(one.points[a] - one.points[b])
    from_corners = csgraph.dijkstra(graph, directed=False, indices=[a, b])
    expected = np.minimum(from_corners[0] + 0.7 * length, from_corners[1] + 0.3 * length)
    assert_allclose(one.distances(point), expected, atol=1e-12)


def two_sheets(gap: float, *, apart: float) -> SurfaceSamples:
    """Return two square sheets back to back, the other one moved by other cages by *apart*."""
    u = np.arange(5) / 4.0
    grid = np.stack(np.meshgrid(u, u, indexing="ij"), axis=-1).reshape(-1, 2)
    a = (5 * np.arange(4)[:, None] + np.arange(4)).ravel()
    faces = np.concatenate([np.stack([a, a + 5, a + 6], 1), np.stack([a, a + 6, a + 1], 1)])
    faces = np.concatenate([faces, faces[:, ::-1] + 25])
    low = np.column_stack([grid, np.zeros(25)])
    points = np.concatenate([low, low - [0.0, 0.0, gap]])
    rows = np.column_stack([points[:, :2], 1.0 - points[:, :2].sum(axis=1), np.zeros(50)])
    rows[25:, 2] -= apart
    rows[25:, 3] += apart
    i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    lengths = np.linalg.norm(points[i] - points[j], axis=1)
    graph = sparse.coo_array((lengths, (i, j)), (50, 50)).tocsr()
    areas = np.full(50, 1.0 / 50.0)
    return SurfaceSamples(np.arange(50), rows, points, areas, faces, graph.maximum(graph.T).tocsr())


def test_the_sides_of_a_thin_wall_are_joined_if_the_cages_cannot_move_them_apart():
    """Nearer, and moved more alike, than the ends of an edge: 1/4, and 1/2 in rows."""
    point = SurfacePoint.at_vertex(12)
    for gap, apart, joined in (
        (0.1, 0.0, True),
        (0.1, 0.2, True),
        (0.1, 0.6, False),
        (0.5, 0.0, False),
    ):
        away = two_sheets(gap, apart=apart).distances(point)
        assert away[12] == 0.0
        assert np.isfinite(away[:25]).all()
        if joined:
            assert away[37] == pytest.approx(gap)
            assert (np.abs(away[25:] - away[:25]) <= gap + 1e-12).all()
        else:
            assert np.isinf(away[25:]).all()


def test_sheets_that_face_the_same_way_are_joined_only_if_they_are_two_components():
    samples = two_sheets(0.1, apart=0.0)
    same = replace(
        samples, faces=np.where(samples.faces < 25, samples.faces, samples.faces[:, ::-1])
    )
    assert np.isfinite(same.distances(SurfacePoint.at_vertex(0))).all()
    edges = samples.edges.tolil()
    edges[24, 49] = edges[49, 24] = 0.1  # joined at a far corner
    one = replace(same, edges=edges.tocsr())
    path = csgraph.dijkstra(one.edges, directed=False, indices=0)
    assert_allclose(one.distances(SurfacePoint.at_vertex(0)), path)
    assert path[25] > 2.0
    layered = replace(samples, edges=edges.tocsr())
    assert layered.distances(SurfacePoint.at_vertex(0))[25] == pytest.approx(0.1)


def test_values_of_samples_are_smoothed_between_cells(monkeypatch):
    own = held()._problem.samples
    values = np.sin(3.0 * own.points[:, 0])
    assert_allclose(own.smooth_at_vertices(values), values)
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 100)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 60)
    coarse = SCENE.deformer()._problem.samples
    assert_allclose(coarse.smooth_at_vertices(np.ones(len(coarse.points))), 1.0)
    ids = np.arange(len(coarse.points)) % 2.0
    raw, smooth = ids[coarse.cells], coarse.smooth_at_vertices(ids)
    assert smooth.min() >= 0.0
    assert smooth.max() <= 1.0
    i, j = SCENE.mesh.edges.T
    assert np.abs(smooth[i] - smooth[j]).max() < 0.5 * np.abs(raw[i] - raw[j]).max()
    assert smooth.std() > 0.02


def test_a_ring_needs_three_neighbours_away_from_its_point():
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    tetrahedron = Mesh(x, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    ring = Ring.around(tetrahedron, x, SurfacePoint.at_vertex(0))
    assert ring.edge == pytest.approx(1.0)
    assert_allclose(ring.offsets[0], -np.full(3, 1.0 / 3.0), atol=1e-12)
    assert_allclose(ring.weights, [1.0, *[0.1 / 3.0] * 3])
    assert Ring.around(tetrahedron, 0.0 * x, SurfacePoint.at_vertex(0)) is None
    triangle = Mesh(x[:3], [[0, 1, 2]])
    assert Ring.around(triangle, x[:3], SurfacePoint.at_vertex(0)) is None
    assert Ring.around(tetrahedron, x, SurfacePoint.of([0, 1], [0.5, 0.5])) is None


def test_parts_beyond_the_reach_follow_by_their_area():
    """Along a line of twelve samples seven lie beyond on one side, and two on the other."""
    samples = chain(12)
    point = SurfacePoint.at_vertex(8)
    for follows, count in ((0.28, 0), (0.29, 2)):
        weights = samples.weights([point], 1.0, follows)
        assert np.count_nonzero(weights[:7]) == 7
        assert np.count_nonzero(weights[10:]) == 2 - count
    large = replace(samples, areas=np.where(np.arange(12) > 9, 10.0, 1.0) / 30.0)
    weights = large.weights([point], 1.0, 0.9)
    assert not weights[:7].any()
    assert weights[10:].all()


@pytest.mark.parametrize("corners", [1, 2, 3])
def test_a_point_is_pulled_alone_where_its_ring_may_not_resist(corners):
    """A neighbour is fixed."""
    face = SCENE.mesh.faces[(SCENE.mesh.faces == HIGH).any(axis=1)][0]
    face = [HIGH, *face[face != HIGH]]
    shares = np.array([[1.0, 0.0, 0.0], [0.6, 0.4, 0.0], [0.5, 0.3, 0.2]][corners - 1])
    point = SurfacePoint.of(face, shares)
    near = np.setdiff1d(SCENE.mesh.adjacency[[HIGH]].indices, face)[0]
    local = held().hold(fixed=[near], handle=[HIGH]).local(point, 0.3 * D, 0.2 * D)
    solver, pulled = local._constraints.solver, local._constraints.pulled
    assert solver.energy is local._problem.energy
    assert pulled.points == (point,)
    row = solver.positions.rows[pulled.places[0]]
    assert_allclose(
        row @ local._problem.rest_cages, point.at(local._problem.rest.vertices), atol=1e-6
    )


def test_no_front_is_shorter_than_nothing(rng):
    """Between parts of a surface that are not joined there are no faces, but rounding of areas."""
    for _ in range(8):
        low = np.concatenate([0.5 * rng.random(50), 2.0 + 0.5 * rng.random(50)])
        ends, rates = low + 0.1 + 0.4 * rng.random(100), rng.random(100)
        found = _lengths(np.linspace(1.2, 1.8, 7), low, ends, rates, 0.1)
        assert (found >= 0.0).all()
        assert (found < 1e-12).all()
