"""Small components near a large one are attached to it; those of a part are joined."""

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


def found(mesh):
    return list(attached(mesh.vertices, mesh.vertex_areas, mesh.components))


def test_small_components_near_a_large_one_are_attached():
    assert found(with_small_ones()) == [False]
    assert found(with_small_ones([1.08, 0, 0], [2.0, 0, 0])) == [False, True, False]


def test_what_is_set_into_a_larger_component_is_attached_although_it_has_a_limbs_size():
    for place, radius, expected in (
        (0.98 * BALL[0], 0.155, True),
        (1.1 * BALL[0], 0.155, False),  # its far side is away
        ([0.6, 0, 0.5], 0.4, False),  # too large
    ):
        mesh = with_small_ones(place, radius=radius)
        share = mesh.vertex_areas[mesh.components == 1].sum() / mesh.vertex_areas.sum()
        assert share > 0.0125
        assert found(mesh) == [False, expected], place


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_what_is_attached_does_not_depend_on_the_frame(scale):
    mesh = with_small_ones([1.08, 0.01, 0], [0, -1.2, 0.02], [0, 0, 3.0])
    turn = rotation([1.0, 2.0, -0.5], 0.8)
    moved = mesh.with_vertices(scale * (mesh.vertices @ turn.T + [5.0, -7.0, 2.0]))
    assert found(mesh) == found(moved) == [False, True, True, False]


def test_the_components_of_a_part_are_joined_at_each_point():
    radii = [1.0, 0.8, 0.9, 0.05, 0.05, 0.7]
    at = np.array([[0, 0, 0], [2.0, 0, 0], [4.0, 0, 0], [1.2, 0, 0], [4.0, 1.0, 0], [0, 0, 9.0]])
    pieces = [r * BALL + place for r, place in zip(radii, at, strict=True)]
    starts = len(BALL) * np.arange(len(at))
    mesh = Mesh(np.concatenate(pieces), np.concatenate([FACES + start for start in starts]))
    component = mesh.components
    part = np.where(component == 5, 1, 0)
    one, other = joints(mesh.vertices, mesh.vertex_areas, component, part)
    assert_array_equal(np.sort(one), np.flatnonzero(np.isin(component, [1, 2, 3, 4])))
    larger = {1: [0, 2], 2: [0], 3: [0, 1, 2], 4: [0, 1, 2]}
    length = np.linalg.norm(mesh.vertices[one] - mesh.vertices[other], axis=1)
    for k, those in larger.items():
        there = mesh.vertices[np.isin(component, those)]
        mine = component[one] == k
        assert np.isin(component[other[mine]], those).all()
        apart = np.linalg.norm(mesh.vertices[one[mine], None] - there, axis=2).min(axis=1)
        assert_array_equal(length[mine], apart)
