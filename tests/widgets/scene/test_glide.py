"""Poses between two: they have the volume, and what stays does not move."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sheets import plate

from vtk_segdeform import Mesh, Session, models
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.widgets.scene.glide import _between

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)


@pytest.mark.parametrize("place", [0.0, 1e3])
def test_between_two_poses_of_a_volume_the_volume_is_exact(place):
    mesh = models.sphere(600)
    mesh = mesh.with_vertices(mesh.vertices + place)
    x, faces = mesh.vertices, mesh.faces
    upper = x[:, 2] > place
    after = np.where(upper[:, None], (x - place)[:, [1, 0, 2]] * [1.0, 0.5, -1.0] + place, x)
    after[upper] -= [0.4, 0.0, 0.0]
    between = _between(Session(mesh), x, after)
    volumes = [signed_volume(each, faces) for each in (x, after)]
    for share in SHARES:
        drawn = between(share)
        assert_allclose(
            signed_volume(drawn, faces), volumes[0] + share * (volumes[1] - volumes[0]), rtol=1e-11
        )
        assert_array_equal(drawn[~upper], x[~upper])
    assert_allclose(between(0.0), x, atol=1e-11)
    assert_allclose(between(1.0), after, atol=1e-11)


def test_between_two_poses_of_a_sheet_it_moves_straight():
    mesh = Mesh(*plate(5, 4))
    after = mesh.vertices + [0.0, 0.0, 1.0]
    between = _between(Session(mesh), mesh.vertices, after)
    for share in SHARES:
        assert_allclose(between(share), mesh.vertices + [0.0, 0.0, share], atol=1e-12)
