"""Small components near a large one are attached to it; those of a part are joined."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere, rotation

from vtk_segdeform.geometry import attached, joints
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


def test_the_components_of_a_part_are_joined_into_one_each_to_its_nearest():
    radii = [1.0, 0.8, 0.9, 0.05, 0.05, 0.7]
    at = np.array([[0, 0, 0], [2.0, 0, 0], [4.0, 0, 0], [1.2, 0, 0], [4.0, 1.0, 0], [0, 0, 9.0]])
    pieces = [r * BALL + place for r, place in zip(radii, at, strict=True)]
    starts = len(BALL) * np.arange(len(at))
    mesh = Mesh(np.concatenate(pieces), np.concatenate([FACES + start for start in starts]))
    part = np.where(mesh.components == 5, 1, 0)
    one, other = joints(mesh.vertices, mesh.vertex_areas, mesh.components, part)
    found = set(zip(mesh.components[one], mesh.components[other], strict=True))
    # 2 to 0, as 1 between them is smaller; the small ones to any large one.
    assert found == {(2, 0), (1, 0), (3, 1), (4, 2)}
    apart = {
        pair: np.linalg.norm(pieces[pair[0]][:, None] - pieces[pair[1]], axis=2).min()
        for pair in itertools.permutations(range(5), 2)
    }
    for i, j in zip(one, other, strict=True):
        pair = int(mesh.components[i]), int(mesh.components[j])
        assert np.linalg.norm(mesh.vertices[i] - mesh.vertices[j]) == pytest.approx(apart[pair])
