"""Places of handles and pulled points."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage

from vtk_segdeform.deformer.constraints import PulledPoints
from vtk_segdeform.mesh import SurfacePoint

SCENE = sausage(2, is_coarse=True)
X = SCENE.mesh.vertices


def test_places_are_those_of_the_targets_and_fixed_vertices_set_by_set():
    """Two handles and two fixed patches, given in mixed order."""
    low, high = np.flatnonzero(X[:, 2] < -0.7), np.flatnonzero(X[:, 2] > 0.7)
    handle = np.random.default_rng(0).permutation(np.concatenate([SCENE.handle, high]))
    fixed = np.random.default_rng(1).permutation(np.concatenate([low, SCENE.fixed]))
    deformer = SCENE.held().hold(fixed=fixed, handle=handle)
    constraints, frame = deformer._constraints, deformer._problem.frame
    targets = X[deformer.handle] + [0.0, 0.1, 0.2]
    places = frame.outward(constraints.places(frame.inward(targets)))
    assert len(constraints.handles) == 2
    sets = [*(deformer.handle[own] for own in constraints.handles)]
    assert {frozenset(own) for own in sets} == {frozenset(SCENE.handle), frozenset(high)}
    moved = X + np.where(np.isin(np.arange(len(X)), handle)[:, None], [0.0, 0.1, 0.2], 0.0)
    count = sum(map(len, sets))
    assert_allclose(places[:count], moved[np.concatenate(sets)], atol=1e-12)
    assert {tuple(x) for x in places[count:].round(9)} == {tuple(x) for x in X[fixed].round(9)}
    box = frame.outward(constraints.fixed_box)
    assert_allclose(box, [X[fixed].min(axis=0), X[fixed].max(axis=0)], atol=1e-12)
    assert SCENE.held().hold(handle=[0])._constraints.fixed_box.shape == (0, 3)


def test_pulled_points_move_their_own_places_and_no_others():
    places, levers = np.arange(15.0).reshape(5, 3), np.array([[1.0, 2, 3], [0, 0, 7]])
    points = SurfacePoint.at_vertex(3), SurfacePoint.of([1, 2], [0.25, 0.75])
    pulled = PulledPoints(np.array([4, 1]), np.array([0, 1]), points, levers)
    moved = pulled.moved(places)
    expected = places.copy()
    expected[4] += levers[0]
    expected[1] += levers[1]
    assert_array_equal(moved, expected)
    assert_array_equal(places, np.arange(15.0).reshape(5, 3))
    assert_allclose(pulled.at(X), [X[3], 0.25 * X[1] + 0.75 * X[2]])
    assert PulledPoints().moved(places) is places
    assert PulledPoints().at(X).shape == (0, 3)
