"""Small components near a large one are attached to it, where they are nearest."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere, rotation

from vtk_segdeform.geometry import attached
from vtk_segdeform.mesh import Mesh

BALL, FACES = icosphere(2)
SMALL = icosphere(0)


def with_small_ones(*places, radius=0.05):
    """Return a unit sphere with small ones at *places*."""
    vertices = [BALL, *(np.asarray(at) + radius * SMALL[0] for at in places)]
    starts = len(BALL) + len(SMALL[0]) * np.arange(len(places))
    faces = [FACES, *(SMALL[1] + start for start in starts)]
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def pairs(mesh):
    return attached(mesh.vertices, mesh.vertex_areas, mesh.components)


def test_a_small_component_is_attached_where_it_is_nearest():
    mesh = with_small_ones([1.08, 0, 0], [0, -1.08, 0])
    one, other = pairs(mesh)
    assert_array_equal(mesh.components[one], [1, 2])
    assert_array_equal(mesh.components[other], [0, 0])
    for here, there, k in zip(one, other, (1, 2), strict=True):
        small = mesh.vertices[mesh.components == k]
        every = np.linalg.norm(small[:, None] - BALL, axis=2)
        apart = np.linalg.norm(mesh.vertices[here] - mesh.vertices[there])
        assert apart == every.min()


def test_what_is_large_or_far_is_not_attached():
    for mesh in (
        with_small_ones(),
        with_small_ones([2.0, 0, 0]),
        with_small_ones([1.35, 0, 0], radius=0.3),
    ):
        one, other = pairs(mesh)
        assert len(one) == len(other) == 0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_what_is_attached_does_not_depend_on_the_frame(scale):
    mesh = with_small_ones([1.08, 0.01, 0], [0, -1.2, 0.02], [0, 0, 3.0])
    turn = rotation([1.0, 2.0, -0.5], 0.8)
    moved = mesh.with_vertices(scale * (mesh.vertices @ turn.T + [5.0, -7.0, 2.0]))
    for expected, found in zip(pairs(mesh), pairs(moved), strict=True):
        assert_array_equal(expected, found)
