from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import CUBE, icosphere, rotation, torus

from vtk_segdeform.local_volume import LocalVolume, local_volume_change
from vtk_segdeform.mesh import Mesh

MESHES = {"sphere": icosphere(3), "torus": torus(), "cube": CUBE}


@pytest.mark.parametrize("solid", MESHES.values(), ids=MESHES)
def test_it_is_zero_under_rigid_motion_and_the_determinant_under_affine_maps(solid):
    mesh = Mesh(*solid)
    local = LocalVolume(mesh)
    x = mesh.vertices
    assert_allclose(local.change(x @ rotation([1, 2, 3], 1.0).T + [5, 6, 7]), 0.0, atol=1e-12)
    matrix = np.array([[1.2, 0.3, 0.0], [0.0, 0.9, -0.1], [0.2, 0.0, 1.1]])
    assert_allclose(local.change(x @ matrix.T), np.linalg.det(matrix) - 1.0, atol=1e-12)


def test_it_is_negative_where_a_body_is_pinched_and_positive_where_it_swells():
    mesh = sausage().mesh
    x = mesh.vertices
    girth = (
        1.0
        - 0.4 * np.exp(-((x[:, :1] + 1.2) ** 2) / 0.3)
        + 0.3 * np.exp(-((x[:, :1] - 1.2) ** 2) / 0.3)
    )
    change = local_volume_change(mesh, x * np.hstack([np.ones_like(girth), girth, girth]))
    pinched, swollen = np.abs(x[:, 0] + 1.2) < 0.2, np.abs(x[:, 0] - 1.2) < 0.2
    assert change[pinched].max() < -0.35
    assert change[swollen].min() > 0.35
    assert np.abs(change[np.abs(x[:, 0]) > 2.7]).max() < 0.1


def test_a_sheared_bar_has_lost_nothing():
    mesh = sausage().mesh
    x = mesh.vertices.copy()
    x[:, 2] += 0.3 * x[:, 0]
    assert_allclose(local_volume_change(mesh, x), 0.0, atol=1e-12)
