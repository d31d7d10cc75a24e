"""The components of a part are joined."""

import numpy as np
from numpy.testing import assert_array_equal
from solids import icosphere

from vtk_segdeform.geometry import joints
from vtk_segdeform.mesh import Mesh

BALL, FACES = icosphere(2)


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
