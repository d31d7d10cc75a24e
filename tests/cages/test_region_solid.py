"""The distance to the solid of a region, on a grid, and the patch it is made from."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree
from solids import icosphere, rotation

from vtk_segdeform.cages.region_solid import Patch, Surface, _samples, solid_field
from vtk_segdeform.mesh import Mesh

BALL = Mesh(*icosphere(4))
TURN = rotation([1.0, 2.0, 3.0], 0.7).T


def field_of(mesh, members=None, offset=0.3, step=0.1, **options):
    members = np.ones(mesh.n_vertices, dtype=bool) if members is None else members
    options = {"most_nodes": 3e5, **options}
    return solid_field(Patch.of(Surface.of(mesh), members), offset, step, **options)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_the_distance_to_a_ball_is_known_at_every_node(scale):
    mesh = Mesh(scale * (BALL.vertices @ TURN), BALL.faces)
    field = field_of(mesh, offset=0.3 * scale, step=0.1 * scale)
    assert field.grid.step == pytest.approx(0.1 * scale)
    assert field.offset == pytest.approx(3.0)
    assert field.n_shells == 1
    nodes = np.indices(field.distance.shape).reshape(3, -1).T
    points = field.grid.to_points(nodes)
    assert_allclose(field.grid.to_nodes(points), nodes, atol=1e-9)
    radius = np.linalg.norm(points, axis=1) / scale
    found = field.distance.ravel() * 0.1
    outside = radius > 1.1
    assert_allclose(found[outside], radius[outside] - 1.0, atol=0.08)
    assert (found[radius < 0.95] <= 0.0).all()
    assert_allclose(found[radius < 0.8], radius[radius < 0.8] - 1.0, atol=0.12)
    along = points @ field.grid.axes.T / scale
    for beyond in (-along.min(axis=0), along.max(axis=0)):  # the offset surface and 3.7 steps
        assert_allclose(beyond, 1.3 + 0.37, atol=0.11)
    assert_allclose(field.members, field.grid.to_nodes(mesh.vertices), atol=1e-9)


def test_the_step_follows_the_number_of_nodes_and_the_offset():
    fine = field_of(BALL, step=0.05, most_nodes=1e6)
    assert fine.grid.step == pytest.approx(0.05)
    small = field_of(BALL, step=0.05, most_nodes=2e4)
    assert np.prod(small.distance.shape) < 3e4
    assert 0.05 < small.grid.step <= 0.2
    close = field_of(BALL, offset=0.06, step=0.1, most_nodes=1e6)
    assert close.grid.step == pytest.approx(0.04)
    assert close.offset == pytest.approx(1.5)
    coarse = field_of(BALL, offset=0.01, step=0.1, most_nodes=2e4)
    assert coarse.offset == pytest.approx(1.5)
    assert coarse.grid.step * coarse.offset > 0.1


@pytest.mark.parametrize("scale", [0.3, 2.0, 9.0])
def test_no_point_of_a_triangle_is_far_from_its_samples(scale):
    corners = scale * np.random.default_rng(0).normal(size=(30, 3, 3))
    corners[:5, 2] = 0.5 * (corners[:5, 0] + corners[:5, 1])  # needles
    share = np.random.default_rng(1).dirichlet(np.ones(3), (30, 40))
    longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1)
    for triangle, some, length in zip(corners, share, longest, strict=True):
        samples = _samples(triangle[None])
        if length <= 0.7:
            assert not len(samples)
            continue
        away, _ = cKDTree(samples).query(some @ triangle)
        assert away.max() < 0.6
        back = np.linalg.lstsq(
            np.vstack([triangle.T, np.ones(3)]),
            np.vstack([samples.T, np.ones(len(samples))]),
            rcond=None,
        )[0]
        assert_allclose(triangle.T @ back, samples.T, atol=1e-9 * scale)
