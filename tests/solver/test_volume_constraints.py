from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
from scenes import sausage
from solids import rotation

from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.solver.exact_volume import steps_to_volume
from vtk_segdeform.solver.volume_constraints import region_volumes, total_volume

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


def test_one_region_has_the_volume_of_the_mesh():
    (constraint,) = region_volumes(MESH, np.zeros(MESH.n_vertices, dtype=int))
    assert_allclose(constraint.target, total_volume(MESH).target, rtol=1e-14)


def test_steps_to_volume_meet_every_constraint():
    constraints = region_volumes(MESH, SCENE.regions.labels)
    x = MESH.vertices + wobble(2)
    directions = [c.gradient(MESH.vertices) for c in constraints]
    t = steps_to_volume(constraints, np.hstack([x, *directions]))
    x = x + sum(step * d for step, d in zip(t, directions, strict=True))
    assert max(abs(c.violation(x)) for c in constraints) < 1e-12
    (step,) = steps_to_volume([total_volume(MESH)], np.hstack([x, MESH.vertices]))
    assert abs(step) < 1e-12
