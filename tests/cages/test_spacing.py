"""The spacing of cage vertices follows the density, and the thickness is that of inner balls."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csgraph
from solids import icosphere, rotation, torus

from vtk_segdeform.cages.spacing import bending_density, cage_spacing, thickness
from vtk_segdeform.mesh import Mesh

BALL = Mesh(*icosphere(4))


@pytest.mark.parametrize("n", [20, 150])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 7.0])
def test_a_uniform_density_gives_each_cage_vertex_an_equal_area(n, unit):
    spacing = cage_spacing(BALL, np.full(BALL.n_vertices, unit), n)
    assert_allclose(spacing, np.sqrt(BALL.face_areas.sum() / n), rtol=0.02)


def test_there_are_as_many_cage_vertices_as_wanted_and_more_where_the_density_is_larger():
    z = BALL.vertices[:, 2]
    density = np.where(z > 0.0, 4.0, 1.0)
    for n in (300, 1200):
        spacing = cage_spacing(BALL, density, n)
        assert BALL.vertex_areas @ spacing**-2.0 == pytest.approx(n, rel=0.03)
    ratio = spacing[z < -0.5].mean() / spacing[z > 0.2].mean()
    assert ratio == pytest.approx(2.0, rel=0.05)


def test_the_spacing_grows_no_faster_than_the_distance_also_where_nothing_is_wanted():
    z = BALL.vertices[:, 2]
    spacing = cage_spacing(BALL, (z > 0.0).astype(float), 200)
    i, j = BALL.edges.T
    length = np.linalg.norm(BALL.vertices[i] - BALL.vertices[j], axis=1)
    assert (np.abs(spacing[i] - spacing[j]) <= length * (1.0 + 1e-9)).all()
    wanted = np.flatnonzero(z > 0.0)
    away = csgraph.dijkstra(BALL.adjacency, indices=wanted, min_only=True)
    assert_allclose(spacing - spacing[wanted].min(), away, atol=1e-9)


def test_a_component_where_nothing_is_wanted_has_the_spacing_of_the_diagonal():
    points, faces = icosphere(2)
    both = Mesh(np.vstack([points, points + 9.0]), np.vstack([faces, faces + len(points)]))
    spacing = cage_spacing(both, (both.components == 0).astype(float), 50)
    assert_allclose(spacing[both.components == 1], both.diagonal)
    assert (spacing[both.components == 0] < 1.0).all()


@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_the_thickness_is_the_diameter_of_a_ball_that_fits_inside(scale):
    turn = rotation([1.0, 2.0, 3.0], 0.7).T
    ball, faces = icosphere(4)
    plate = Mesh(scale * ball * [1.0, 1.0, 0.1] @ turn + 5.0 * scale, faces)
    middle = np.abs(ball[:, 2]) > 0.95
    assert_allclose(thickness(plate)[middle], 0.2 * scale, rtol=0.1)
    ring = Mesh(*torus(60, 24, 1.0, 0.2))
    assert_allclose(thickness(ring), 0.4, rtol=0.12)


def test_the_density_is_the_inverse_of_the_thickness_within_limits():
    ring = Mesh(*torus(60, 24, 1.0, 0.2))
    assert_allclose(bending_density(ring), 1.0 / thickness(ring))
    ball, faces = icosphere(3)
    spike = np.where((ball[:, 2] > 0.3)[:, None], [0.02, 0.02, 6.0], 1.0)
    thin = Mesh(ball * spike, faces)
    density = bending_density(thin)
    middle = np.median(1.0 / thickness(thin))
    assert density.max() == pytest.approx(8.0 * middle)
    assert (density >= middle / 8.0).all()
    inner = (density > middle / 8.0) & (density < 8.0 * middle)
    assert_allclose(density[inner], (1.0 / thickness(thin))[inner])
