"""Regions of their own for fixed parts and rigid handles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.sparse import csgraph
from solids import icosphere, rotation

from vtk_segdeform.deformer.clamping import clamped
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.regions import Regions

BODY = Mesh(icosphere(3)[0] * [3.0, 1.0, 1.0], icosphere(3)[1])
X = BODY.vertices
FIXED, HANDLE = X[:, 0] < -1.0, np.flatnonzero(X[:, 0] > 1.5)
TARGETS = X[HANDLE] @ rotation([0.0, 1.0, 0.0], 0.5).T + 0.1
NONE = np.zeros(BODY.n_vertices, dtype=bool)
FAR = X[BODY.faces, 0].min(axis=1) > 1.0


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


def test_a_part_is_large_beside_the_surface_between_clamped_parts():
    """A face is less than 1/400 of the body's area, but more than that of the half that is free."""
    share = BODY.face_areas / BODY.face_areas.sum()
    face = BODY.faces[np.flatnonzero((share > 1 / 700) & (share < 1 / 450) & FAR)[0]]
    turned = X[face] @ rotation([0.0, 0.0, 1.0], 0.3).T
    half = X[:, 0] < 0.0
    regions, rigid = clamp(fixed=half, handle=face, targets=turned)
    assert regions.n_regions == 3
    assert rigid.sum() == half.sum() + 3
    regions, rigid = clamp(fixed=X[:, 0] < -2.9, handle=face, targets=turned)
    assert not rigid[face].any()


@pytest.mark.parametrize(("off", "is_rigid"), [(0.5e-4, True), (2e-4, False)])
def test_a_handle_may_deviate_from_an_affine_map_by_a_ten_thousandth(off, is_rigid):
    wave = np.where(np.arange(len(HANDLE)) % 2, 1.0, -1.0)
    sheared = X[HANDLE] @ np.array([[1.2, 0.3, 0.0], [0.0, 0.8, 0.1], [0.2, 0.0, 1.0]])
    targets = sheared + 3.0 + off * BODY.diagonal * np.outer(wave, [0.0, 0.0, 1.0])
    assert clamp(targets=targets)[1][HANDLE].all() == is_rigid


def test_a_margin_is_a_tenth_of_the_size_of_the_free_surface_around_fixed_parts():
    """And half of that around handles, along the surface, or two rings if these are more."""
    fine = Mesh(*icosphere(4))
    x = fine.vertices
    fixed, handle = x[:, 0] < -0.9, np.flatnonzero(x[:, 0] > 0.9)
    moved = x[handle] + [0.3, 0.0, 0.0]
    given = {"fixed": fixed, "handle": handle, "targets": moved, "n_cage_vertices": 90}
    regions, _ = clamped(Regions.single(fine), **given)
    is_free = ~fixed
    is_free[handle] = False
    size = np.sqrt(fine.face_areas[is_free[fine.faces].any(axis=1)].sum())
    for own, part, share in ((regions.membership[1], np.flatnonzero(fixed), 0.1),
                             (regions.membership[2], handle, 0.05)):  # fmt: skip
        graph = fine.adjacency
        away = csgraph.dijkstra(graph, directed=False, indices=part, min_only=True)
        rings = csgraph.dijkstra(graph, unweighted=True, indices=part, min_only=True)
        assert_array_equal(own, (away <= share * size) | (rings <= 2))
        assert ((rings > 2) & own).any() == (share == 0.1)
