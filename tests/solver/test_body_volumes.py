"""Volume constraints of meshes with several bodies: each body keeps its own volume."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from open_meshes import combined, with_walls
from scenes import joined

from vtk_segdeform import models
from vtk_segdeform.geometry import lids_of, signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.solver import Bodies, total_volume

BAR = models.bar(size=(0.2, 0.2, 1.0), divisions=(2, 2, 10))
BALL = models.sphere(162)


def constraints_of(mesh: Mesh, moved=()):
    lids = lids_of(mesh)
    bodies = Bodies(mesh, total_volume(mesh, lids), lids)
    return bodies.constraints(bodies.numbers(np.array(moved, dtype=np.int64)))


@pytest.mark.parametrize("count", [2, 6, 9])
def test_the_volumes_of_all_bodies_add_up_to_the_whole(count):
    mesh = joined(*((BALL, 3.0 * k, 1.0 + 0.1 * k, 1) for k in range(count)))
    found = constraints_of(mesh)
    assert len(found) == min(count, 7)
    each = signed_volume(BALL.vertices, BALL.faces) * (1.0 + 0.1 * np.arange(count)) ** 3
    assert_allclose([c.target for c in found][:6], each[::-1][:6], rtol=1e-12)
    assert_allclose(sum(c.target for c in found), total_volume(mesh).target, rtol=1e-12)


def test_a_moved_body_has_its_own_constraint_however_small():
    mesh = joined(*((BALL, 3.0 * k, 1.0 - 0.05 * k, 1) for k in range(10)))
    last = mesh.n_vertices - 1
    target = signed_volume(BALL.vertices, BALL.faces) * 0.55**3
    assert_allclose(constraints_of(mesh, [last])[5].target, target, rtol=1e-12)


def test_a_cavity_belongs_to_the_body_around_it():
    mesh = joined((BALL, 0.0, 1.0, 1), (BALL, 0.0, 0.5, -1), (BALL, 4.0, 0.8, 1))
    ball = signed_volume(BALL.vertices, BALL.faces)
    targets = [each.target for each in constraints_of(mesh)]
    assert_allclose(targets, [ball * (1 - 0.5**3), ball * 0.8**3], rtol=1e-12)


def test_splinters_share_the_constraint_of_the_largest_body():
    mesh = joined((BALL, 0.0, 1.0, 1), (BALL, 4.0, 0.01, 1), (BALL, 8.0, 0.02, 1))
    (only,) = constraints_of(mesh)
    assert_allclose(only.target, total_volume(mesh).target, rtol=1e-14)


@pytest.mark.parametrize(("height", "around"), [(0.25, 1), (0.75, 2)])
def test_a_cavity_in_a_chamber_belongs_to_it(height, around):
    hole = BALL.with_vertices(0.05 * BALL.vertices + [0.0, 0.0, height])
    mesh = combined(with_walls(BAR, 0.5), hole, BALL.with_vertices(BALL.vertices + 5.0))
    lids = lids_of(mesh)
    bodies = Bodies(mesh, total_volume(mesh, lids), lids)
    ball = signed_volume(BALL.vertices, BALL.faces)
    assert_allclose(np.sort(bodies.volumes), [0.02 - 0.05**3 * ball, 0.02, ball], rtol=1e-12)
    assert bodies.of_component.tolist() == [-1, around, 0]
    assert_allclose(bodies.body(around).target, bodies.volumes[around], rtol=1e-12)
    every = [bodies.body(k).target for k in range(3)]
    assert_allclose(sum(every), bodies.whole.target, rtol=1e-12)
