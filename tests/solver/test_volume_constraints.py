from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from open_meshes import bottle, open_box, sheet, together, tube, with_holes
from scenes import sausage
from solids import icosphere, rotation

from vtk_segdeform import models
from vtk_segdeform.geometry.lids import lids_of
from vtk_segdeform.geometry.volume import signed_volume, volume_along_path
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.solver.exact_volume import steps_to_volume
from vtk_segdeform.solver.volume_constraints import (
    VolumeConstraint,
    _labels_of_faces,
    region_volumes,
    total_volume,
)
from vtk_segdeform.solver.volumes import gradients, violations

SCENE = sausage(3)
MESH = SCENE.mesh


def wobble(seed=0, size=0.05):
    return size * np.random.default_rng(seed).normal(size=MESH.vertices.shape)


def test_region_volumes_add_up_to_the_mesh_however_it_is_bent():
    constraints = region_volumes(MESH, SCENE.regions.labels)
    assert len(constraints) == 3
    for x in (MESH.vertices, MESH.vertices + wobble()):
        volumes = [c.violation(x) + c.target for c in constraints]
        assert_allclose(sum(volumes), signed_volume(x, MESH.faces), rtol=1e-12)
        assert min(volumes) > 0.0


def test_region_volumes_do_not_change_when_the_mesh_is_moved():
    moved = MESH.vertices @ rotation([1, 2, 3], 2.0).T + [50.0, -20.0, 3.0]
    for constraint in region_volumes(MESH, SCENE.regions.labels):
        assert abs(constraint.violation(moved)) < 1e-12 * constraint.target


def test_region_volumes_keep_their_digits_far_from_the_origin():
    # Coordinates of 30 binary digits: the translation is exact.
    mesh = MESH.with_vertices(np.round(MESH.vertices * 2.0**28) / 2.0**28)
    bent = np.round((mesh.vertices + wobble()) * 2.0**28) / 2.0**28
    far = np.array([2.0**22, -(2.0**21), 2.0**22])
    near = region_volumes(mesh, SCENE.regions.labels)
    moved = region_volumes(mesh.with_vertices(mesh.vertices + far), SCENE.regions.labels)
    expected = [each.relative(bent) for each in near]
    assert_allclose([each.relative(bent + far) for each in moved], expected, atol=1e-14)


def test_a_slab_has_the_volume_of_a_slab():
    # The middle region of a bar-like solid: cut by planes, its volume is known from the thirds.
    constraints = region_volumes(MESH, SCENE.regions.labels)
    left, middle, right = (c.target for c in constraints)
    assert_allclose(left, right, rtol=0.15)
    assert middle > left


def test_gradients_are_correct_to_second_order():
    direction = wobble(1, 1.0)
    for constraint in (total_volume(MESH), *region_volumes(MESH, SCENE.regions.labels)):
        slope = np.vdot(constraint.gradient(MESH.vertices), direction)
        errors = []
        for t in (1e-3, 5e-4):
            rise = constraint.violation(MESH.vertices + t * direction)
            errors.append(abs(rise - t * slope))
        assert_allclose(errors[0] / errors[1], 4.0, rtol=0.1)


def test_the_hessian_is_the_derivative_of_the_gradient():
    x, dx = MESH.vertices + wobble(3), wobble(4, 1.0)
    for constraint in (total_volume(MESH), *region_volumes(MESH, SCENE.regions.labels)):
        halves = constraint.hessian_halves(x).toarray().reshape(3, len(x), -1)
        bends = [half @ dx - half.T @ dx for half in halves]  # M_c dx
        product = np.stack(
            [bends[2][:, 1] - bends[1][:, 2], bends[0][:, 2] - bends[2][:, 0]]
            + [bends[1][:, 0] - bends[0][:, 1]],
            axis=1,
        )
        # The gradient is quadratic: its central difference is no approximation.
        exact = 0.5 * (constraint.gradient(x + dx) - constraint.gradient(x - dx))
        assert_allclose(product, exact, atol=1e-12)


@pytest.mark.parametrize(("held", "size"), [(1.0, 1.0), (1e-13, 1.0), (1.0, 1e-4)])
def test_steps_to_volume_meet_every_constraint(held, size):
    mesh = MESH.with_vertices(size * MESH.vertices)
    constraints = region_volumes(mesh, SCENE.regions.labels)
    x = mesh.vertices + size * wobble(2)
    directions = [c.gradient(mesh.vertices) for c in constraints]
    directions[-1] = directions[-1] * held  # as of a body that hardly moves
    t = steps_to_volume(constraints, np.hstack([x, *directions]))
    x = x + sum(step * d for step, d in zip(t, directions, strict=True))
    assert max(abs(c.violation(x)) for c in constraints) < 1e-12 * size**3
    (step,) = steps_to_volume([total_volume(mesh)], np.hstack([x, mesh.vertices]))
    assert abs(step) < 1e-12


def test_a_volume_that_vanishes_takes_no_step():
    corners, faces = icosphere(0)
    n, size = MESH.n_vertices, 1e-10
    points = np.vstack([MESH.vertices, size * corners])
    whole = VolumeConstraint(MESH.faces, total_volume(MESH).target)
    constraints = [whole, VolumeConstraint(n + faces, 0.0)]
    directions = [each.gradient(points) for each in constraints]
    x = points + np.vstack([wobble(2), np.zeros_like(corners)])
    t = steps_to_volume(constraints, np.hstack([x, *directions]))
    assert abs(t[1]) < 1e-3
    assert abs(whole.violation(x + t[0] * directions[0])) < 1e-12


OPEN = {
    "box without a face": lambda: open_box(),
    "bottle": lambda: bottle(24, 24),
    "tube": lambda: tube(6.0, 24, 16),
    "body with holes": lambda: with_holes(models.cactus(1000), 12, 0.04),
    "box beside a sheet": lambda: together(
        open_box(), sheet(lambda u, v: (4 + u, v, 0.1 * np.sin(9 * u)), 9, 9)
    ),
}
OPEN = {name: functools.cache(made) for name, made in OPEN.items()}


def thirds(mesh):
    """Return labels of three slabs, which cut borders along the body."""
    along = mesh.vertices @ [0.3, 1.0, 0.5]
    return np.searchsorted(np.quantile(along, [0.33, 0.67]), along)


def constraints_of(mesh):
    return (total_volume(mesh), *region_volumes(mesh, thirds(mesh)))


def shaken(mesh, seed=0, size=0.05):
    return size * np.random.default_rng(seed).normal(size=mesh.vertices.shape)


def test_an_open_box_has_the_volume_of_the_box():
    assert_allclose(total_volume(open_box()).target, 2.0, rtol=1e-14)
    assert_allclose(total_volume(OPEN["box beside a sheet"]()).target, 2.0, rtol=1e-14)
    wide = tube(6.0, 360, 4)  # a prism over a polygon of 360 sides
    area = 180 * np.sin(2 * np.pi / 360)
    assert_allclose(total_volume(wide).target, 6.0 * area, rtol=1e-13)


@pytest.mark.parametrize("name", OPEN)
def test_region_volumes_of_open_meshes_add_up_to_the_whole(name):
    mesh = OPEN[name]()
    whole, regions = total_volume(mesh), region_volumes(mesh, thirds(mesh))
    assert len(regions) == 3
    for x in (mesh.vertices, mesh.vertices + shaken(mesh)):
        volumes = [c.violation(x) + c.target for c in regions]
        assert_allclose(sum(volumes), whole.violation(x) + whole.target, rtol=1e-12)


@pytest.mark.parametrize("name", OPEN)
def test_volumes_of_open_meshes_do_not_change_under_a_motion(name):
    mesh = OPEN[name]()
    moved = mesh.vertices @ rotation([1, 2, 3], 2.0).T + [50.0, -20.0, 3.0]
    for constraint in constraints_of(mesh):
        assert abs(constraint.violation(moved)) < 1e-12 * total_volume(mesh).target


@pytest.mark.parametrize("name", OPEN)
def test_derivatives_under_lids_are_exact(name):
    mesh = OPEN[name]()
    x, d = mesh.vertices + shaken(mesh, 1), shaken(mesh, 2, 0.3)
    for each in constraints_of(mesh):
        size = total_volume(mesh).target
        slope = np.vdot(each.gradient(x), d)
        far, near = (
            abs(each.violation(x + t * d) - each.violation(x) - t * slope) for t in (2e-3, 1e-3)
        )
        assert_allclose(far / near, 4.0, rtol=0.1)
        # The volume is a cubic along d, and a step along it is exact.
        cubic = volume_along_path(each.extended(np.hstack([x, d])), each.parts)
        for t in (-1.5, 0.7, 2.0):
            value = each.violation(x + t * d) + each.target
            assert_allclose(np.polyval(cubic[::-1], t), value, atol=1e-12 * size)
        # The gradient is quadratic: its central difference is no approximation.
        halves = each.hessian_halves(x).toarray().reshape(3, len(x), -1)
        bends = [half @ d - half.T @ d for half in halves]
        product = np.stack(
            [bends[2][:, 1] - bends[1][:, 2], bends[0][:, 2] - bends[2][:, 0]]
            + [bends[1][:, 0] - bends[0][:, 1]],
            axis=1,
        )
        exact = 0.5 * (each.gradient(x + d) - each.gradient(x - d))
        assert_allclose(product, exact, atol=1e-12 * size)


def test_a_fin_on_a_ball_adds_no_volume():
    ball = models.sphere(642)
    a, b = ball.edges[50]
    tip = 2.0 * ball.vertices[a]
    finned = Mesh(np.vstack([ball.vertices, tip]), np.vstack([ball.faces, [a, b, 642]]))
    whole = total_volume(finned)
    assert whole.target == pytest.approx(signed_volume(ball.vertices, ball.faces), rel=1e-12)
    regions = region_volumes(finned, thirds(finned))
    assert_allclose(sum(each.target for each in regions), whole.target, rtol=1e-12)


def test_a_sheet_has_no_volume_and_no_change_of_it():
    mesh = sheet(lambda u, v: (u, v, 0.1 * np.sin(9 * u)), 9, 9)
    whole = total_volume(mesh)
    assert not whole.has_volume
    assert whole.relative(mesh.vertices * 2.0) == 0.0
    assert region_volumes(mesh, thirds(mesh)) == ()


def test_the_faces_of_a_lid_belong_to_the_regions_at_its_border():
    mesh = tube(6.0, 12, 6)
    thin = np.ptp(mesh.vertices, axis=0).argmin()  # an axis across the tube
    labels = (mesh.vertices[:, thin] > 1e-9).astype(int)
    one, other = (abs(each.target) for each in region_volumes(mesh, labels))
    lids = lids_of(mesh)
    faces, of_faces = lids.closed(mesh), _labels_of_faces(mesh, labels, lids.closed(mesh))
    for corners, label in zip(faces[mesh.n_faces :], of_faces[mesh.n_faces :], strict=True):
        beside = (np.isin(mesh.faces, corners[:2]).sum(axis=1) == 2).nonzero()[0]
        assert label == of_faces[beside[0]]
    assert one + other == pytest.approx(abs(signed_volume(lids.extension @ mesh.vertices, faces)))


def test_constraints_that_share_their_points_are_evaluated_together():
    constraints, x = region_volumes(MESH, SCENE.regions.labels), MESH.vertices + wobble()
    mixed = (*constraints, total_volume(MESH), *constraints)  # which has other points
    assert_allclose(violations(mixed, x), [each.violation(x) for each in mixed], rtol=1e-12)
    for one, each in zip(gradients(mixed, x), mixed, strict=True):
        assert_allclose(one, each.gradient(x), atol=1e-15)
    weights = np.arange(2.0, 2.0 + len(constraints))
    of_face = np.repeat(weights, [len(each.faces) for each in constraints])
    faces = np.concatenate([each.faces for each in constraints])
    whole = replace(constraints[0], faces=faces).hessian_halves(x, of_face)
    apart = sum(w * each.hessian_halves(x) for w, each in zip(weights, constraints, strict=True))
    assert_allclose(whole.toarray(), apart.toarray(), atol=1e-15)
