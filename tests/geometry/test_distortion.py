from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import icosphere, rotation, torus

from vtk_segdeform.geometry.distortion import distortion, triangle_distortion
from vtk_segdeform.mesh.mesh import Mesh


def test_a_rigid_motion_has_no_distortion():
    mesh = Mesh(*torus())
    moved = mesh.vertices @ rotation([1, 2, 3], 1.0).T + [4, 5, 6]
    assert triangle_distortion(mesh, moved).max() < 1e-6


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
def test_scaling_changes_both_singular_values(scale):
    mesh = Mesh(*icosphere(2))
    assert_allclose(distortion(mesh, scale * mesh.vertices), np.sqrt(2) * abs(scale - 1), atol=1e-7)


def test_it_agrees_with_the_singular_values_of_each_face():
    mesh = Mesh(*icosphere(2))
    pose = mesh.vertices + 0.1 * np.random.default_rng(3).normal(size=mesh.vertices.shape)
    for face, found in zip(mesh.faces, triangle_distortion(mesh, pose), strict=True):
        rest, now = (x[face[1:]] - x[face[0]] for x in (mesh.vertices, pose))
        s = np.linalg.svd(now.T @ np.linalg.pinv(rest.T), compute_uv=False)[:2]
        assert_allclose(found, np.linalg.norm(s - 1), atol=1e-9)


def test_a_face_without_area_has_no_distortion():
    vertices, faces = icosphere(1)
    a, b = faces[0, :2]
    split = np.array([*vertices, 0.5 * (vertices[a] + vertices[b])])
    new = len(vertices)
    one = [[a, new, faces[0, 2]], [new, b, faces[0, 2]], [a, b, new]]
    mesh = Mesh(split, np.concatenate([faces[1:], one]))
    assert np.isfinite(distortion(mesh, 2.0 * split))
    assert_allclose(distortion(mesh, 2.0 * split), np.sqrt(2), atol=1e-9)
