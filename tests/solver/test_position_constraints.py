"""Position constraints: sets of many vertices, and places that neighbours share."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import icosphere

from vtk_segdeform import sizes
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.solver.position_constraints import (
    Anchors,
    PositionTerm,
    connected_sets,
    position_term,
)
from vtk_segdeform.subspace import cage_subspace

SCENE = sausage(3)


def test_shared_places_are_as_accurate_as_separate_ones(monkeypatch):
    targets = SCENE.turned(40)
    each = SCENE.held().solve(targets)
    monkeypatch.setattr(sizes, "SHARED_PLACES", 20)
    monkeypatch.setattr(sizes, "PLACES", 30)
    deformer = SCENE.held()
    assert len(deformer._path.solver.positions.rows) == 60
    shared = deformer.solve(targets)
    assert shared.handle_error < 1.5 * each.handle_error + 1e-4
    assert shared.fixed_error < 1.5 * each.fixed_error + 1e-4
    away = np.linalg.norm(shared.vertices - each.vertices, axis=1).max()
    assert away < 4e-3 * SCENE.mesh.diagonal  # a quarter as many places


def test_many_vertices_of_a_set_are_equivalent_to_few_rows():
    rng = np.random.default_rng(6)
    rows = rng.normal(size=(500, 40)) * (np.arange(40) < 12)  # moved by 12 of the cage vertices
    rows = np.vstack([rows, rng.normal(size=(7, 40))])
    set_of = np.repeat([0, 1], [500, 7])
    term = PositionTerm(rows, set_of, np.where(set_of == 0, 1.5, 2.0))
    p, u = rng.normal(size=(40, 3)), rng.normal(size=(507, 3))
    few = term.toward(u)
    assert len(few.rows) == 12 + 7
    away = rows @ p - u
    value, slope = few.value_and_slope(p)
    assert value == pytest.approx((term.weights * np.square(away).sum(axis=1)).sum(), rel=1e-13)
    assert_allclose(slope, rows.T @ (term.weights[:, None] * away), rtol=1e-11, atol=1e-10)


def test_sets_are_vertices_joined_by_edges_among_themselves():
    ball, faces = icosphere(1)
    top = np.flatnonzero(ball[:, 2] > 0.5)
    low = np.flatnonzero(ball[:, 2] < -0.5)
    ids = np.random.default_rng(0).permutation(np.concatenate([top, low]))
    found = connected_sets(Mesh(ball, faces), ids)
    assert sorted(len(own) for own in found) == sorted([len(top), len(low)])
    assert {tuple(sorted(ids[own])) for own in found} == {tuple(top), tuple(low)}
    assert connected_sets(Mesh(ball, faces), ids[:0]) == []


@pytest.mark.parametrize("shared", [1000, 3])
def test_every_set_has_the_same_weight_in_all_whatever_its_size(monkeypatch, shared):
    """Places that neighbours share are their means, and weigh as much together."""
    monkeypatch.setattr(sizes, "SHARED_PLACES", shared)
    monkeypatch.setattr(sizes, "PLACES", 4)
    subspace = cage_subspace(SCENE.regions, SCENE.cages)
    sets = [SCENE.fixed, SCENE.handle[:1], SCENE.handle[5:8]]
    term = position_term(subspace, SCENE.mesh, sets, 6.0)
    assert_allclose(np.bincount(term.set_of, term.weights), 6.0)
    ids = np.concatenate(sets)
    of_ids = subspace.at(ids)
    if shared == 1000:
        assert term.mean is None
        assert_allclose(term.rows, of_ids)
    else:
        assert np.bincount(term.set_of).tolist() == [4, 1, 3]
        assert_allclose(term.mean.sum(axis=1), 1.0)
        assert_allclose(term.rows, term.mean @ of_ids, atol=1e-12)
        near = (term.mean.toarray() > 0.0)[:4, : len(SCENE.fixed)]
        assert (near.sum(axis=0) == 1).all()
    without = position_term(subspace, SCENE.mesh, [], 6.0)
    assert without.rows.shape == (0, subspace.n_columns)
    assert (
        without.toward(np.empty((0, 3))).value_and_slope(np.ones((subspace.n_columns, 3)))[0] == 0
    )


def test_anchors_are_a_square_about_their_pose_beside_a_constant_load():
    rng = np.random.default_rng(2)
    root, p, load, q, way = rng.normal(size=(6, 5)), *rng.normal(size=(4, 5, 3))
    anchors = Anchors(root.T @ root, p, load)
    value, slope = anchors.value_and_slope(q)
    expected = np.sum((root @ (q - p)) ** 2) - 2.0 * np.sum(load * (q - p))
    assert value == pytest.approx(expected)
    assert anchors.value_and_slope(p)[0] == 0.0
    ahead, behind = (anchors.value_and_slope(q + t * way)[0] for t in (0.5, -0.5))
    assert ahead - behind == pytest.approx(2.0 * np.vdot(slope, way))  # quadratic: exact
