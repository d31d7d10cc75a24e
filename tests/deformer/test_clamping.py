"""Regions of their own for fixed parts and rigid handles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere, rotation

from vtk_segdeform.deformer.clamping import clamped
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.regions import Regions

BODY = Mesh(icosphere(3)[0] * [3.0, 1.0, 1.0], icosphere(3)[1])
X = BODY.vertices
FIXED, HANDLE = X[:, 0] < -1.0, np.flatnonzero(X[:, 0] > 1.5)
TARGETS = X[HANDLE] @ rotation([0.0, 1.0, 0.0], 0.5).T + 0.1
NONE = np.zeros(BODY.n_vertices, dtype=bool)


def clamp(regions=None, fixed=FIXED, handle=HANDLE, targets=TARGETS, n_cage_vertices=60):
    regions = Regions.single(BODY) if regions is None else regions
    return clamped(
        regions, fixed=fixed, handle=handle, targets=targets, n_cage_vertices=n_cage_vertices
    )


def test_fixed_parts_and_rigid_handles_have_all_the_weight_there():
    regions, rigid = clamp()
    is_handle = NONE.copy()
    is_handle[HANDLE] = True
    assert_array_equal(rigid, FIXED | is_handle)
    assert regions.n_regions == 3
    assert_array_equal(regions.membership[0], ~rigid)
    for own, part in zip(regions.membership[1:], (FIXED, is_handle), strict=True):
        rings = part
        for _ in range(2):
            rings = BODY.adjacency @ rings > 0.0
        assert own[rings].all()
        assert own.sum() < 2 * part.sum()
    assert (regions.membership.sum(axis=0) > 0).all()


def test_a_handle_that_bends_is_part_of_a_free_region():
    bent = TARGETS + 0.01 * X[HANDLE] ** 2
    regions, rigid = clamp(targets=bent)
    assert_array_equal(rigid, FIXED)
    assert_array_equal(regions.membership[0], ~FIXED)
    assert regions.n_regions == 2


@pytest.mark.parametrize(
    "changes",
    [
        {"n_cage_vertices": 35},  # 12 for each of 3 regions
        {"fixed": NONE, "handle": HANDLE[:1], "targets": TARGETS[:1]},  # smaller than a margin
        {"fixed": NONE, "handle": np.empty(0, dtype=int), "targets": np.empty((0, 3))},
        {"fixed": ~NONE, "handle": np.empty(0, dtype=int), "targets": np.empty((0, 3))},
    ],
)
def test_regions_without_a_large_clamped_part_or_enough_cage_vertices_stay(changes):
    own = Regions.single(BODY)
    assert clamp(own, **changes)[0] is own


def test_a_region_that_is_fixed_or_covered_by_others_is_dropped():
    overlapping = Regions(BODY, np.array([X[:, 0] < -1.2, X[:, 0] < 1.0, X[:, 0] > 0.5]))
    regions, rigid = clamp(overlapping)
    assert regions.n_regions == 4
    assert_array_equal(regions.membership[0], (X[:, 0] < 1.0) & ~rigid)
    assert_array_equal(regions.membership[1], (X[:, 0] > 0.5) & ~rigid)
