"""Parts that move affinely: best fits of what their cages do, blended with their surroundings."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import vtk_segdeform as sd
from vtk_segdeform import models, sizes
from vtk_segdeform.subspace import AffineParts, cage_subspace

BAR = models.bar((0.3, 0.2, 1.0), divisions=(6, 4, 24))
X, HEIGHT = BAR.vertices, BAR.vertices[:, 2] - BAR.vertices[:, 2].min()
COLLAR = 0.12
LOWER, UPPER = np.flatnonzero((HEIGHT > 0.2) & (HEIGHT < 0.4)), np.flatnonzero(HEIGHT > 0.6)
SIDE = np.flatnonzero((np.abs(X[:, 0] - X[:, 0].max()) < 1e-9) & (np.abs(HEIGHT - 0.5) < 0.2))
REGIONS = sd.segment(BAR, 2)
CAGES = sd.fit_cages(BAR, REGIONS, 60)
REST = np.concatenate([cage.vertices for cage in CAGES])


def bound(*, interpolated=False, parts=(LOWER, UPPER)):
    """Return W~ by the cages alone, the parts, and W~ with the parts."""
    plain = sizes.INTERPOLATED
    try:
        sizes.INTERPOLATED = 100 if interpolated else plain
        cages = cage_subspace(REGIONS, CAGES)
    finally:
        sizes.INTERPOLATED = plain
    found = AffineParts.of(BAR, cages, parts, collar=COLLAR, smoothness=1.0)
    return cages, found, found.blended(cages, X, found.shares)


def a_pose(seed=0):
    return REST + 0.05 * np.random.default_rng(seed).normal(size=REST.shape)


def test_a_part_moves_by_the_affine_map_that_fits_the_motion_of_its_cages_best():
    cages, parts, both = bound()
    p = a_pose()
    before, after = cages.map(p), both.map(p)
    for ids, share in zip((LOWER, UPPER), parts.shares, strict=True):
        root = np.sqrt(BAR.vertex_areas * share)[:, None]
        basis = np.c_[np.ones(len(X)), X]
        fit = np.linalg.lstsq(root * basis, root * before, rcond=None)[0]
        assert_allclose(after[ids], basis[ids] @ fit, atol=1e-12)
        assert np.abs(after[ids] - before[ids]).max() > 1e-3


def test_the_misfit_is_the_mean_square_distance_from_the_affine_maps():
    cages, parts, _ = bound()
    p, expected = a_pose(), 0.0
    for share in parts.shares:
        c = BAR.vertex_areas * share / (BAR.vertex_areas @ share)
        basis, before = np.sqrt(c)[:, None] * np.c_[np.ones(len(X)), X], cages.map(p)
        expected += np.linalg.lstsq(basis, np.sqrt(c)[:, None] * before, rcond=None)[1].sum()
    assert_allclose(np.vdot(p, parts.misfit @ p), expected, rtol=1e-9)


def test_affine_maps_of_the_cages_are_affine_maps_of_the_surface():
    _, _, both = bound()
    turn, shift = np.array([[1.0, 0.3, 0.0], [0.2, 0.8, 0.1], [0.0, -0.4, 1.1]]), [3.0, -1.0, 2.0]
    assert_allclose(both.map(REST @ turn + shift), X @ turn + shift, atol=1e-12)


def test_beyond_the_collars_nothing_changes():
    cages, parts, both = bound()
    p = a_pose()
    away = np.full(len(X), np.inf)
    for ids in (LOWER, UPPER):
        away = np.minimum(away, np.abs(HEIGHT[:, None] - HEIGHT[ids]).min(axis=1))
    far = away > COLLAR
    assert far.any()
    assert_array_equal(parts.shares[:, far], 0.0)
    assert_allclose(both.map(p)[far], cages.map(p)[far], atol=1e-15)


def test_shares_are_1_in_a_part_and_fall_linearly_to_0_and_no_part_is_in_another_collar():
    near = np.flatnonzero((HEIGHT > 0.42) & (HEIGHT < 0.55))
    _, parts, _ = bound(parts=(LOWER, near))
    assert_array_equal(parts.shares[0, LOWER], 1.0)
    assert_array_equal(parts.shares[1, near], 1.0)
    assert (parts.shares.sum(axis=0) <= 1.0 + 1e-15).all()
    away = HEIGHT[LOWER].min() - HEIGHT
    below = away > 0.0
    assert_allclose(parts.shares[0, below], np.maximum(1.0 - away[below] / COLLAR, 0.0), atol=1e-12)


@pytest.mark.parametrize("ids", [SIDE, SIDE[:1]], ids=["flat", "one vertex"])
def test_a_flat_part_takes_its_normal_from_the_collar(ids):
    cages, parts, both = bound(parts=(ids,))
    p = REST @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert_allclose(both.map(p), cages.map(p), atol=1e-12)
    assert (np.linalg.norm(parts.axes[0], axis=0) > 0.0).all()


def test_a_plane_has_no_gradient_across_it():
    rng, (cages, _, _) = np.random.default_rng(0), bound()
    for _ in range(6):  # rounding makes the least moment positive or negative
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        flat = BAR.with_vertices((X * [1.0, 0.0, 1.0]) @ turn)
        parts = AffineParts.of(flat, cages, (LOWER,), collar=COLLAR, smoothness=1.0)
        assert np.isfinite(parts.maps).all()
        assert (np.linalg.norm(parts.axes[0], axis=0) == 0.0).sum() == 1


def test_gradients_inside_a_part_are_those_of_its_map():
    _, parts, both = bound()
    p, own = a_pose(), UPPER[[3]]
    found = parts.blended_gradients(np.zeros((1, 3, len(REST))), parts.shares[:, own])[0] @ p
    steps = X[UPPER] - X[own]
    after = both.map(p)
    assert_allclose(after[UPPER] - after[own], steps @ found, atol=1e-12)


def test_interpolated_rows_are_blended_as_well():
    p = a_pose()
    exact, interpolated = (bound(interpolated=each)[2].map(p) for each in (False, True))
    # As far as rows of the grid are from the coordinates themselves.
    assert np.abs(exact - interpolated).max() < 3e-3
    assert_allclose(bound(interpolated=True)[2].map(REST), X, atol=1e-5)
