"""Contact: two prongs of a fork that meet, and pass through each other without it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from vtk_segdeform.mesh import self_intersections
from vtk_segdeform.models.implicit import Limb, standing_body
from vtk_segdeform.solver import Contact
from vtk_segdeform.solver.contact import ContactSurface, _Pairs

SIDE = [(-0.35, 0, 1.2), (-0.35, 0, 0.6), (-0.2, 0, 0.3)]
CURVE = [*SIDE, (0, 0, 0.2), *((-x, y, z) for x, y, z in reversed(SIDE))]
LIMBS = [Limb(CURVE, [0.13] * 7), Limb([(0, 0, -0.1), (0, 0, 0.2)], [0.25, 0.2])]


@pytest.fixture(scope="module")
def fork():
    """Return a deformer of the fork that avoids contact, and targets beside the other prong."""
    mesh = standing_body(LIMBS, 500, blend=0.05)
    x = mesh.vertices
    regions = sd.segment(mesh, 1)
    fixed, handle = np.flatnonzero(x[:, 2] < 0.12), np.flatnonzero((x[:, 0] > 0) & (x[:, 2] > 0.85))
    cages = sd.fit_cages(mesh, regions, 40)
    deformer = sd.Deformer(mesh, regions, cages, fixed=fixed, handle=handle, avoid_contact=True)
    return deformer, x[handle] - [0.42, 0.0, 0.0]


@pytest.fixture(scope="module")
def through(fork):
    """Return the pose without avoiding contact, and its cages in the units of the solver."""
    deformer, targets = fork
    free = deformer.hold(fixed=deformer.fixed, handle=deformer.handle, avoid_contact=False)
    return free.solve(targets), free._path.p


def test_what_crosses_without_it_does_not_with_it(fork, through):
    deformer, targets = fork
    solution = deformer.solve(targets)
    faces = deformer.mesh.faces
    for each in (through[0], solution):
        everything = np.unique(self_intersections(each.vertices, faces))
        assert np.array_equal(each.crossings(), everything)  # the fork itself has none
        assert abs(each.volume_change) < 1e-12
    assert len(through[0].crossings()) > 50
    assert len(solution.crossings()) <= 2
    assert solution.handle_error < 1.5 * through[0].handle_error
    assert solution.steps < 60  # with the normals fixed in the Hessian, far more


def test_a_pull_avoids_contact_as_well(fork):
    mesh, x = fork[0].mesh, fork[0].mesh.vertices
    tip = int(np.where(x[:, 0] > 0, x[:, 2], 0.0).argmax())
    options = {"pins": fork[0].fixed, "n_regions": 1, "n_cage_vertices": 40, "refine": False}
    free, avoiding = (
        sd.pull(mesh, tip, x[tip] - [0.5, 0.0, 0.0], avoid_contact=on, **options)
        for on in (False, True)
    )
    assert len(free.crossings()) > 30
    assert not len(avoiding.crossings())
    assert avoiding.handle_error < 1e-4
    assert abs(avoiding.volume_change) < 1e-12
    with pytest.raises(sd.errors.ArgumentError, match="avoid_contact"):
        sd.pull(mesh, tip, x[tip], avoid_contact="yes")


def test_crossings_at_rest_do_not_count(through, fork):
    mesh = fork[0].mesh
    crossed = mesh.with_vertices(through[0].vertices)
    regions = sd.segment(crossed, 1)
    deformer = sd.Deformer(crossed, regions, sd.fit_cages(crossed, regions, 30), avoid_contact=True)
    contact = deformer._constraints.contact
    assert contact.value_and_slope(deformer._problem.rest_cages)[0] == 0.0
    assert not len(deformer.hold(handle=[0]).solve(crossed.vertices[[0]]).crossings())


def test_its_gradient_is_that_of_its_value_and_it_moves_along(fork, through, monkeypatch):
    contact, p = fork[0]._constraints.contact, through[1]
    value, slope = contact.value_and_slope(p)
    assert value > 0.0
    step = np.random.default_rng(0).standard_normal(p.shape)
    off = [
        contact.value_and_slope(p + e * step)[0] - value - 2.0 * e * np.vdot(slope, step)
        for e in (2e-5, 1e-5)
    ]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.1)
    lower = contact.hessian(p)
    half = np.tril(lower) + np.tril(lower, -1).T
    slopes = contact._active(p).jacobian().toarray().reshape(-1, len(contact.surface.rows), 3)
    by_cages = np.einsum("ksa,sm->kam", slopes, contact.surface.rows).reshape(len(slopes), -1)
    assert_allclose(half, contact.stiffness * by_cages.T @ by_cages, rtol=1e-9, atol=1e-9)
    fewer = Contact(contact.surface, contact.held, contact.stiffness)
    monkeypatch.setattr("vtk_segdeform.solver.contact.compiled_kernels", lambda: None)
    assert fewer.value_and_slope(p)[0] == pytest.approx(value, rel=1e-12)
    turn = Rotation.from_rotvec([0.3, -1.0, 0.5])
    there, turned = contact.value_and_slope(turn.apply(p) + [3.0, -2.0, 1.0])
    assert there == pytest.approx(value, rel=1e-9)
    assert turned == pytest.approx(turn.apply(slope), abs=1e-9 * np.abs(slope).max())
    assert Contact(contact.surface, contact.held | True, 1.0).value_and_slope(p)[0] == 0.0


@pytest.mark.parametrize("compiled", [True, False])
def test_on_a_way_into_contact_no_pair_is_missed(fork, through, compiled, monkeypatch):
    """The list of pairs, searched anew now and then, has every pair that is active."""
    deformer, end = fork[0], through[1]
    contact, start = deformer._constraints.contact, deformer._problem.rest_cages
    monkeypatch.setattr(contact, "_listed", None)
    if not compiled:
        monkeypatch.setattr("vtk_segdeform.solver.contact.compiled_kernels", lambda: None)
    lists, searched = [], Contact._list
    monkeypatch.setattr(Contact, "_list", lambda *given: lists.append(0) or searched(*given))
    a, b = np.nonzero(np.triu(~contact.surface.excluded, 1))
    kept = ~(contact.held[a] & contact.held[b])
    everything = np.stack([a[kept], b[kept]], axis=1)
    values = []
    for share in np.linspace(0.0, 1.0, 40):
        p = start + share * (end - start)
        y = contact.surface.rows @ p
        pairs = _Pairs.of(contact.surface, y, everything)
        values.append(0.0 if pairs is None else contact.stiffness * pairs.value)
        assert contact.value_and_slope(p)[0] == pytest.approx(values[-1], rel=1e-9)
        assert contact.value_and_slope(p, y)[0] == pytest.approx(values[-1], rel=1e-9)
    assert 2 <= len(lists) <= 20
    assert values[0] == 0.0
    assert values[-1] > 0.0


def test_no_contact_is_what_is_near_along_the_surface_or_the_other_side_of_a_thin_part():
    """Of a thick part everything else may meet, as in the crease of a bend."""
    for height, thin in ((1.0, False), (0.05, True)):
        body = sd.models.sphere(1000)
        body = body.with_vertices(body.vertices * [1.0, 1.0, height])
        a, b, c = body.vertices[body.faces.T]
        face_areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        areas = np.bincount(body.faces.ravel(), np.repeat(face_areas, 3)) / (3.0 * face_areas.sum())
        i, j = body.edges.T
        lengths = np.linalg.norm(body.vertices[i] - body.vertices[j], axis=1)
        graph = sparse.coo_array((lengths, (i, j)), shape=(1000, 1000)).tocsr()
        surface = ContactSurface.of(
            np.eye(1000), body.vertices, body.faces, areas=areas, edges=graph + graph.T
        )
        sums = np.add.outer(surface.radii, surface.radii)
        is_near = csgraph.dijkstra(graph, directed=False) <= 2.5 * sums
        assert surface.excluded[is_near].all()
        normals = surface.normals(body.vertices)
        facing_away = normals @ normals.T < 0.5
        others = surface.excluded & ~is_near
        assert not others[~facing_away].any()
        opposite = normals[:, 2][:, None] * normals[:, 2] < -0.9
        assert others[opposite].any() == thin


def test_samples_whose_faces_face_all_ways_are_in_contact_with_nothing():
    """Both sides of a wall thinner than the samples: what is left of the normals is rounding."""
    corners = np.array([[1.0, 0.0, 0.0], [-0.5, 0.9, 0.0], [-0.5, -0.9, 0.0]])
    wall = np.vstack([[0.0, 0.0, 1e-17], corners])
    points = np.vstack([wall, wall + [0.0, 0.0, 0.4]])
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    faces = np.vstack([fan, fan[:, ::-1], fan[:, ::-1] + 4])  # a sheet above it, facing down
    edges = sparse.csr_array((8, 8))
    areas = np.full(8, 1.0 / 8.0)
    surface = ContactSurface.of(np.eye(8), points, faces, areas=areas, edges=edges)
    assert surface.excluded[:4].all()
    assert not surface.excluded[4:, 4:][~np.eye(4, dtype=bool)].any()


def test_no_two_samples_pass_through_each_other_in_a_step(fork):
    deformer, _ = fork
    contact, p = deformer._constraints.contact, deformer._path.p
    rng = np.random.default_rng(1)
    for size in (1e-3, 10.0):
        step = size * rng.standard_normal(p.shape)
        share = contact.share(p, step)
        assert (share == 1.0) == (size < 1.0)
        y, motion = contact.surface.rows @ p, contact.surface.rows @ (share * step)
        a, b = contact._facing(y, 0.1).T
        assert len(a) > 20
        closing = np.linalg.norm(motion[a] - motion[b], axis=1)
        reach = np.linalg.norm(y[a] - y[b], axis=1) + 1.5 * contact.surface.spacing
        assert (closing <= reach * (1.0 + 1e-12)).all()


def sheets(gap: float):
    """Return two square sheets of 36 samples a side, facing each other, as a surface at rest."""
    u = np.arange(6) / 5.0
    grid = np.stack(np.meshgrid(u, u, indexing="ij"), axis=-1).reshape(-1, 2)
    a = (6 * np.arange(5)[:, None] + np.arange(5)).ravel()
    faces = np.concatenate([np.stack([a, a + 6, a + 7], 1), np.stack([a, a + 7, a + 1], 1)])
    low = np.column_stack([grid, np.zeros(36)])
    points = np.concatenate([low, low + [0.0, 0.0, gap]])
    faces = np.concatenate([faces, faces[:, ::-1] + 36])  # the lower one faces up
    areas = np.bincount(faces.ravel(), minlength=72) / faces.size
    i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    length = np.linalg.norm(points[i] - points[j], axis=1)
    graph = sparse.coo_array((length, (i, j)), (72, 72)).tocsr()
    edges = graph.maximum(graph.T).tocsr()
    surface = ContactSurface.of(np.eye(72), points, faces, areas=areas, edges=edges)
    return surface, points, areas


@pytest.mark.parametrize("degrees", [0.0, 60.0, 75.0])
@pytest.mark.parametrize("gap", [0.03, -0.1, -0.3, -1.0])
def test_its_value_is_that_of_the_formula(gap, degrees):
    """Summed over all pairs of two sheets, one of them tilted, vertex by vertex."""
    surface, points, areas = sheets(3.0)
    h = np.sqrt(2.0 * areas / np.pi)
    h = np.minimum(h, 2.0 * np.median(h))
    assert surface.radii == pytest.approx(h)
    turn = Rotation.from_euler("x", degrees, degrees=True)
    upper = turn.apply(points[36:] - [0.0, 0.0, 3.0]) + [0.02, 0.01, gap]
    y = np.concatenate([points[:36], upper])
    up, down = np.array([0.0, 0.0, 1.0]), turn.apply([0.0, 0.0, -1.0])

    def step(t):
        return np.clip(t, 0, 1) ** 2 * (3 - 2 * np.clip(t, 0, 1))

    total = 0.0
    for a in range(36):
        for b in range(36, 72):
            e, r, depth = y[a] - y[b], 1.1 * (h[a] + h[b]), 1.5 * (h[a] + h[b])
            g = (down - up) @ e / 2.0
            facing = step((-(up @ down) - 0.1) / 0.5)
            opposite = max(0.0, 1.0 - (e @ e - g * g) / r**2) ** 2
            into = max(0.0, 0.2 * (h[a] + h[b]) - g)
            shallow = step((g + depth) / (0.5 * depth))
            total += min(areas[a], areas[b]) * facing * opposite * into**2 * shallow
    contact = Contact(surface, np.zeros(72, dtype=bool), 7.0)
    assert contact.value_and_slope(y)[0] == pytest.approx(7.0 * total, rel=1e-9, abs=1e-15)
    assert contact.is_active(y) == (total > 0.0)
    if degrees == 0.0 and gap > -1.0:
        assert total > 1e-6


def test_its_margin_is_that_of_the_true_surface_but_less_than_the_gap_at_rest():
    far, near = sheets(3.0)[0], sheets(0.12)[0]
    assert far.margins == pytest.approx(0.2 * far.radii)
    assert far.with_heights(np.full(72, 0.1)).margins == pytest.approx(0.2 * far.radii + 0.1)
    assert near.with_heights(np.full(72, 9.0)).margins == pytest.approx(0.45 * 0.12)
    surface, points, _ = sheets(0.12)
    contact = Contact(surface.with_heights(np.full(72, 9.0)), np.zeros(72, dtype=bool), 1.0)
    closer = points - np.outer(np.arange(72) >= 36, [0.0, 0.0, 0.2 * 0.12])
    assert contact.value_and_slope(points)[0] == 0.0
    assert contact.hessian(points) is None
    assert contact.value_and_slope(closer)[0] > 0.0


def test_the_clearance_is_the_least_distance_of_samples_that_face_each_other():
    surface, points, _ = sheets(0.5)
    contact = Contact(surface, np.zeros(72, dtype=bool), 1.0)
    assert contact.clearance(points, 2.0) == pytest.approx(0.5)
    assert contact.clearance(points, 0.3) == 0.3
    crossed = points - np.outer(np.arange(72) >= 36, [0.0, 0.0, 0.7])
    assert contact.clearance(crossed, 0.4) == 0.4  # they have passed each other
    held = Contact(surface, np.ones(72, dtype=bool), 1.0)
    assert held.clearance(points, 2.0) == 2.0


def test_a_step_toward_a_part_ends_before_it_has_passed_though_nothing_touches_yet():
    surface, points, _ = sheets(0.05)
    contact = Contact(surface, np.zeros(72, dtype=bool), 1.0)
    assert not contact.is_active(points)
    down = np.outer(np.arange(72) >= 36, [0.0, 0.0, -3.0])
    room = 1.5 * surface.spacing
    assert contact.share(points, down) == pytest.approx((0.05 + room) / 3.0)
    assert contact.share(points, -down) < 1.0  # no direction is told apart
    assert contact.share(points, np.ones((72, 3))) == 1.0  # both together
    assert contact.share(points, 0.3 * room * down / 3.0) == 1.0


def test_with_and_without_compiled_kernels_the_same_pairs_are_listed(fork, through, monkeypatch):
    contact, p = fork[0]._constraints.contact, 0.9 * through[1] + 0.1 * fork[0]._problem.rest_cages
    y, slack = contact.surface.rows @ p, 2.5 * contact.surface.spacing
    listed = []
    for _ in range(2):
        pairs, beyond = contact._list(y, slack)
        order = np.lexsort(np.sort(pairs, axis=1).T)
        listed.append((np.sort(pairs, axis=1)[order], beyond[order]))
        monkeypatch.setattr("vtk_segdeform.solver.contact.compiled_kernels", lambda: None)
    assert len(listed[0][0]) > 100
    assert np.array_equal(listed[0][0], listed[1][0])
    assert listed[0][1] == pytest.approx(listed[1][1], abs=1e-12)
