"""Position constraints: sets of many vertices, and places that neighbours share."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage

from vtk_segdeform import sizes
from vtk_segdeform.solver.position_constraints import PositionTerm

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
