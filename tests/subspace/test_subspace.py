"""W~: its map, its adjoint and its rows, with and without compiled kernels."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage

from vtk_segdeform import sizes
from vtk_segdeform.subspace import subspace as subspace_module
from vtk_segdeform.subspace.subspace import Subspace, cage_subspace

SCENE = sausage(2)
SUBSPACE = cage_subspace(SCENE.regions, SCENE.cages)
P0 = np.concatenate([cage.vertices for cage in SCENE.cages])


def wobble(seed=0, size=0.05):
    return P0 + size * np.random.default_rng(seed).normal(size=P0.shape)


def test_cages_at_rest_reproduce_the_mesh():
    assert_allclose(SUBSPACE.map(P0), SCENE.mesh.vertices, atol=1e-11)


def test_an_affine_map_of_all_cages_is_an_affine_map_of_the_mesh():
    matrix, shift = np.random.default_rng(0).normal(size=(3, 3)), [1.0, 2.0, 3.0]
    moved = SUBSPACE.map(P0 @ matrix.T + shift)
    assert_allclose(moved, SCENE.mesh.vertices @ matrix.T + shift, atol=1e-10)


def test_the_adjoint_is_the_adjoint():
    rng = np.random.default_rng(1)
    p, y = rng.normal(size=P0.shape), rng.normal(size=SCENE.mesh.vertices.shape)
    assert_allclose(np.vdot(SUBSPACE.map(p), y), np.vdot(p, SUBSPACE.adjoint(y)), rtol=1e-12)


def test_single_rows_agree_with_the_map():
    ids = np.array([5, 900, 17])
    assert_allclose(SUBSPACE.at(ids) @ wobble(), SUBSPACE.map(wobble())[ids], atol=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("directions", [0, 1])
def test_a_map_adds_to_its_base_at_every_vertex(monkeypatch, compiled, directions):
    """Vertices in several blocks, in one, and in none; more of them than in a piece."""
    monkeypatch.setattr(subspace_module, "_CACHED_NUMBERS", 200)
    rng, n = np.random.default_rng(3), 5000
    rows = tuple(np.sort(rng.permutation(n - 10)[:k]) for k in (900, 2500))
    subspace = Subspace(n, rows, tuple(rng.normal(size=(len(own), 7)) for own in rows))
    subspace.__dict__["_is_compiled"] = compiled
    base, p = rng.normal(size=(n, 3)), rng.normal(size=(14, 3 + 3 * directions))
    expected = np.zeros((n, p.shape[1]))
    expected[:, :3] = base
    for own, block, columns in zip(rows, subspace.blocks, subspace.columns, strict=True):
        expected[own] += block @ p[columns]
    before = base.copy()
    assert_allclose(subspace.map(p, base), expected, atol=1e-13)
    assert_allclose(base, before, atol=0)


def test_arrays_of_any_layout_are_multiplied_alike():
    rng = np.random.default_rng(4)
    subspace = Subspace(5000, (np.arange(5000),), (rng.normal(size=(5000, 7)),))
    subspace.__dict__["_is_compiled"] = True  # by kernels, which are compiled for one layout
    p, y, base = (rng.normal(size=(k, 6))[:, :3] for k in (7, 5000, 5000))
    p.setflags(write=False)
    expected = subspace.map(p.copy(), base.copy()), subspace.adjoint(y.copy())
    base.setflags(write=False)
    assert_allclose(expected[0], subspace.blocks[0] @ p + base, atol=1e-13)
    assert_allclose(expected[1], subspace.blocks[0].T @ y, atol=1e-11)
    assert (subspace.map(p, base) == expected[0]).all()
    assert (subspace.adjoint(np.asfortranarray(y)) == expected[1]).all()


def test_in_single_precision_the_product_is_that_of_rounded_weights(monkeypatch):
    monkeypatch.setattr(sizes, "SINGLE_PRECISION", 0)
    deformer = SCENE.deformer()
    assert {block.dtype for block in deformer.subspace.blocks} == {np.dtype(np.float32)}
    solution = deformer.solve(SCENE.turned(40))
    assert abs(solution.volume_change) < 1e-13  # with rounded weights as well
    assert_allclose(deformer.surface(solution.cage_vertices), solution.vertices, atol=1e-13)
    rest = [cage.vertices for cage in SCENE.cages]
    assert_allclose(deformer.surface(rest), SCENE.mesh.vertices, rtol=0.0, atol=1e-15)
    monkeypatch.undo()
    double = SCENE.deformer().surface(solution.cage_vertices)
    away = np.linalg.norm(double - solution.vertices, axis=1).max()
    assert away < 1e-6 * SCENE.mesh.diagonal


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("again", [True, False])
def test_a_pickle_maps_the_same_bits_and_has_no_blocks_that_can_be_computed_again(compiled, again):
    subspace = replace(SUBSPACE) if again else replace(SUBSPACE, again=None)
    without_caches = len(pickle.dumps(subspace))
    assert (without_caches < 0.3 * sum(block.nbytes for block in subspace.blocks)) == again
    vars(subspace)["_is_compiled"] = compiled
    moved = subspace.map(wobble())
    text = pickle.dumps(subspace)
    assert len(text) < without_caches + 1000
    for other in (pickle.loads(text), copy.deepcopy(subspace)):
        assert other._is_compiled == compiled
        assert np.array_equal(other.map(wobble()), moved)
    assert copy.deepcopy(subspace).blocks is subspace.blocks  # not computed again
