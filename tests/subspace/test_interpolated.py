"""Interpolated rows of W~: nearly the coordinates themselves, and exact where it matters."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from scipy import sparse

from vtk_segdeform import sizes
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.subspace import InterpolatedBlock, interpolated

SCENE = sausage(3, is_coarse=True)
N_COLUMNS = sum(cage.n_vertices for cage in SCENE.cages)
MOVES = 0.1 * np.random.default_rng(5).normal(size=(N_COLUMNS, 6))


@pytest.fixture(scope="module")
def exact():
    """Return the coordinates themselves."""
    return SCENE.deformer().subspace


def interpolate(monkeypatch):
    """Interpolate the rows of a small mesh."""
    monkeypatch.setattr(sizes, "INTERPOLATED", 250)
    monkeypatch.setattr(interpolated, "_MOST_NODES", np.inf)
    monkeypatch.setattr(interpolated, "_SPACING", 0.16)
    monkeypatch.setattr(interpolated, "_TOLERANCE", 0.1)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    interpolate(monkeypatch)


@pytest.fixture(scope="module")
def subspace():
    with pytest.MonkeyPatch.context() as patch:
        interpolate(patch)
        found = SCENE.deformer().subspace
    assert all(isinstance(block, InterpolatedBlock) for block in found.blocks)
    return found


def test_rows_are_those_of_the_coordinates_but_for_an_error_of_third_order(
    monkeypatch, exact, subspace
):
    monkeypatch.setattr(interpolated, "_SPACING", 0.32)
    monkeypatch.setattr(interpolated, "_TOLERANCE", np.inf)
    errors = []
    for blocks in (SCENE.deformer().subspace.blocks, subspace.blocks):
        pairs = zip(blocks, exact.blocks, strict=True)
        errors.append(max(np.abs(block[:] - exact).max() for block, exact in pairs))
    assert errors[1] < min(1e-2, errors[0] / 4.0)
    x = subspace.map(np.concatenate([cage.vertices for cage in SCENE.cages]))
    assert_allclose(x, SCENE.mesh.vertices, atol=1e-6)  # offsets are in single precision


@pytest.mark.usefixtures("either")
def test_products_are_those_of_the_rows_compiled_or_not(subspace):
    n = subspace.n_vertices
    rows = subspace.at(np.arange(n))
    base = SCENE.mesh.vertices
    assert_allclose(subspace.map(MOVES), rows @ MOVES, atol=1e-13)
    assert_allclose(subspace.map(MOVES, base)[:, :3], base + rows @ MOVES[:, :3], atol=1e-13)
    assert_allclose(subspace.adjoint(base), rows.T @ base, atol=1e-10)
    cells = np.arange(n) % 7
    mean = sparse.csr_array((np.ones(n), cells, np.arange(n + 1)), (n, 7)).T.tocsr()
    assert_allclose(subspace.premultiplied(mean), mean @ rows, atol=1e-10)
    averaged = subspace.averaged(mean)
    assert_allclose(averaged.at(np.arange(7)), mean @ rows, atol=1e-10)


@pytest.mark.campaign
def test_a_cage_too_close_for_a_coarse_grid_gets_a_finer_one_or_none(monkeypatch, exact, subspace):
    pairs = zip(subspace.blocks, exact.blocks, strict=True)
    error = max(np.abs(block[:] - exact).sum(axis=1).max() for block, exact in pairs)
    monkeypatch.setattr(interpolated, "_TOLERANCE", 1.01 * error)
    monkeypatch.setattr(interpolated, "_SPACING", 0.32)
    for block, finer in zip(subspace.blocks, SCENE.deformer().subspace.blocks, strict=True):
        assert_array_equal(block.values, finer.values)
    monkeypatch.setattr(interpolated, "_TOLERANCE", 1e-9)
    assert not any(isinstance(b, InterpolatedBlock) for b in SCENE.deformer().subspace.blocks)


@pytest.mark.parametrize("region_volumes", every(2, [True, False]))
def test_poses_keep_their_volume_and_nearly_the_shape_of_exact_rows(
    tmp_path, monkeypatch, region_volumes
):
    monkeypatch.setattr(sizes, "SCALED_VOLUME", 250)
    monkeypatch.setattr(sizes, "DECIMATED", 250)
    monkeypatch.setattr(sizes, "DECIMATED_POINTS", 200)
    poses = []
    for _ in range(2):  # computed, then read from the cache
        deformer = SCENE.deformer(preserve_region_volumes=region_volumes, cache=tmp_path)
        pose = deformer.solve(SCENE.turned(40))
        assert abs(pose.volume_change) < 1e-14
        assert_allclose(deformer.surface(pose.cage_vertices), pose.vertices, atol=1e-13)
        poses.append(pose.vertices)
    assert_array_equal(*poses)
    monkeypatch.setattr(sizes, "INTERPOLATED", np.inf)
    exact = SCENE.deformer(preserve_region_volumes=region_volumes).solve(SCENE.turned(40))
    assert_allclose(poses[0], exact.vertices, atol=1e-3 * SCENE.mesh.diagonal)
    assert (poses[0] != exact.vertices).any()


def test_interpolation_can_be_cancelled():
    def stop(share, message):
        if message == "mean value coordinates":
            raise Cancelled

    with pytest.raises(Cancelled):
        SCENE.deformer(progress=stop)
