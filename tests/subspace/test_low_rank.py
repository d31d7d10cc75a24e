"""Low-rank factors of W~: they map like W~ itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage

from vtk_segdeform import sizes
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.kernels import dispatch
from vtk_segdeform.subspace import low_rank
from vtk_segdeform.subspace.low_rank import LowRankSubspace
from vtk_segdeform.subspace.subspace import Subspace

SCENE = sausage(3)
DEFORMER = SCENE.deformer()
SUBSPACE, REST = DEFORMER.subspace, DEFORMER._rest.vertices
CAGES = DEFORMER._rest_cages
MOVES = 0.1 * np.random.default_rng(5).normal(size=(len(CAGES), 9))


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Allow low-rank factors of a small mesh, in small patches."""
    monkeypatch.setattr(low_rank, "_PATCH", 100)
    monkeypatch.setattr(low_rank, "_WORTHWHILE", np.inf)


def made() -> LowRankSubspace:
    return LowRankSubspace.of(SUBSPACE, REST, CAGES)


def parts(of: LowRankSubspace):
    return list(of._parts(0, len(of.starts) - 1))


def test_every_vertex_is_in_one_patch_with_the_cages_that_move_it():
    of = made()
    assert_array_equal(np.sort(of.vertices), np.arange(len(REST)))
    for ids, own, _, _ in parts(of):
        assert 0 < len(ids) <= 100
        reached = np.flatnonzero(SUBSPACE.at(ids).any(axis=0))
        assert np.isin(reached, own).all()
        assert len(own) % 66 == 0  # whole cages, and no other


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 3e-7])
def test_errors_of_rows_are_within_the_tolerance_and_a_looser_one_needs_fewer_numbers(
    monkeypatch, tolerance
):
    monkeypatch.setattr(low_rank, "_TOLERANCE", tolerance)
    of = made()
    for ids, own, left, right in parts(of):
        wide = right.astype(float)
        assert_allclose(wide @ wide.T, np.eye(len(wide)), atol=1e-6)
        off = SUBSPACE.at(ids)[:, own] - left.T.astype(float) @ wide
        assert np.linalg.norm(off, axis=1).max() < tolerance + 1e-7  # and single precision
    monkeypatch.setattr(low_rank, "_TOLERANCE", 0.1 * tolerance)
    assert made().left.size > of.left.size


def test_affine_maps_of_all_cages_are_exact_at_any_tolerance(monkeypatch):
    monkeypatch.setattr(low_rank, "_TOLERANCE", 1e-2)
    of, affine = made(), np.random.default_rng(1).normal(size=(3, 3))
    x = of.map(CAGES @ affine + [0.5, -2.0, 1.0])
    assert_allclose(x, REST @ affine + [0.5, -2.0, 1.0], atol=1e-6)
    others = of.map(MOVES)
    assert np.abs(others - SUBSPACE.map(MOVES)).max() > 1e-4


@pytest.mark.parametrize("columns", [3, 6, 9])
@pytest.mark.parametrize("compiled", [True, False])
def test_it_maps_like_the_subspace_compiled_or_not(monkeypatch, columns, compiled):
    if compiled:
        pytest.importorskip("numba")
    else:
        monkeypatch.setattr(dispatch, "_kernels", lambda: None)
    of, p = made(), MOVES[:, :columns]
    for start in (None, REST):
        mapped = of.map(p, None if start is None else of.base(start))
        assert_allclose(mapped, SUBSPACE.map(p, start), atol=1e-6)
    exact = np.zeros((len(REST), columns))
    for ids, own, left, right in parts(of):
        exact[ids] = left.T.astype(float) @ (right.astype(float) @ p[own])
    assert_allclose(of.map(p), exact, atol=1e-14)


def test_a_subspace_that_does_not_shrink_is_not_factored(monkeypatch):
    monkeypatch.setattr(low_rank, "_WORTHWHILE", 0.7)
    rough = tuple(np.random.default_rng(3).random(block.shape) for block in SUBSPACE.blocks)
    assert LowRankSubspace.of(Subspace(len(REST), SUBSPACE.rows, rough), REST, CAGES) is None


@pytest.mark.parametrize("region_volumes", [False, True])
def test_a_large_mesh_is_mapped_by_its_factors_and_keeps_its_volume(
    tmp_path, monkeypatch, region_volumes
):
    monkeypatch.setattr(sizes, "SCALED_VOLUME", 1000)
    whole = SCENE.deformer(preserve_region_volumes=region_volumes).solve(SCENE.turned(40))
    monkeypatch.setattr(sizes, "LOW_RANK", 1000)
    poses = []
    for _ in range(2):  # computed, then read from the cache
        deformer = SCENE.deformer(preserve_region_volumes=region_volumes, cache=tmp_path)
        assert isinstance(deformer._binding.mapping, LowRankSubspace)
        pose = deformer.solve(SCENE.turned(40))
        assert abs(pose.volume_change) < 1e-14
        assert_allclose(deformer.surface(pose.cage_vertices), pose.vertices, atol=1e-13)
        assert_allclose(pose.vertices, whole.vertices, atol=1e-6 * SCENE.mesh.diagonal)
        assert (pose.vertices != whole.vertices).any()
        poses.append(pose.vertices)
    assert_array_equal(*poses)


def test_factoring_reports_its_progress_and_can_be_cancelled(monkeypatch):
    monkeypatch.setattr(sizes, "LOW_RANK", 1000)
    told = []

    def listen(share, message):
        told.append((share, message))

    SCENE.deformer(progress=listen)
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert {message for _, message in told} >= {"factoring the subspace"}

    def stop(share, message):
        if message == "factoring the subspace":
            raise Cancelled

    with pytest.raises(Cancelled):
        SCENE.deformer(progress=stop)
