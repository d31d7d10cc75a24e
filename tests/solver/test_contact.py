"""Contact: two prongs of a fork that meet, and pass through each other without it."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import sausage
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
    assert contact.value_and_slope(deformer._rest_cages)[0] == 0.0
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
    assert np.linalg.eigvalsh(half)[0] > -1e-9 * np.abs(half).max()
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
    contact, start = deformer._constraints.contact, deformer._rest_cages
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


def test_far_from_contact_no_bit_changes():
    scene = sausage(2, is_coarse=True)
    free, avoiding = scene.deformer(), scene.deformer(avoid_contact=True)
    targets = scene.mesh.vertices[scene.handle] + [0.0, 0.0, 0.01]
    assert avoiding._constraints.contact.surface.spacing < 0.2
    expected, solution = free.solve(targets), avoiding.solve(targets)
    assert np.array_equal(solution.vertices, expected.vertices)


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


def test_no_two_samples_pass_through_each_other_in_a_step(fork):
    deformer, _ = fork
    contact = deformer._constraints.contact
    radii = contact.surface.radii
    rng = np.random.default_rng(1)
    for size in (1e-3, 10.0):
        step = size * rng.standard_normal(deformer._path.p.shape)
        far = np.linalg.norm(contact.surface.rows @ step, axis=1).max()
        share = contact.share(step)
        assert share * 2.0 * far <= 1.5 * 2.0 * np.median(radii) * (1.0 + 1e-12)
        assert (share == 1.0) == (size < 1.0)
