"""Products of the edges of triangles."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from vtk_segdeform.mesh.triangles import cross, cross_rows


def test_cross_products_are_those_of_numpy_bit_for_bit():
    u, v = np.random.default_rng(1).normal(size=(2, 50, 3))
    assert_array_equal(cross_rows(u, v), np.cross(u, v))
    assert_array_equal(cross_rows(u[::2], v[1::2]), np.cross(u[::2], v[1::2]))
    assert_array_equal(cross(u.T, v.T), np.cross(u, v).T)
