"""A solution computes its errors from its vertices once, and says them in words."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere

from vtk_segdeform.mesh import Mesh
from vtk_segdeform.solver import Solution, Status

X = np.arange(12.0).reshape(4, 3)


class Counted:
    """A function that remembers its calls."""

    def __init__(self, result):
        self.result, self.calls = result, []

    def __call__(self, *given):
        self.calls.append(given)
        return self.result


def solution(**changes) -> Solution:
    functions = {
        "errors": Counted((0.25, 0.5)), "volume": Counted(0.125),
        "region_volumes": Counted(np.array([0.1, 0.2])), "crossed": Counted(np.array([3, 4])),
        "folded": Counted(np.array([5])),
    }  # fmt: skip
    given = {
        "cage_vertices": (X[:2],),
        "steps": 7,
        "status": Status.CONVERGED,
        "merits": (2.0, 1.0),
    }
    return Solution(**{"vertices": X, **given, **functions, **changes})


def test_errors_are_those_of_its_vertices_each_computed_once():
    one = solution()
    for _ in range(2):
        assert (one.handle_error, one.fixed_error, one.volume_change) == (0.25, 0.5, 0.125)
        assert_array_equal(one.region_volume_change, [0.1, 0.2])
        assert_array_equal(one.crossings(), [3, 4])
        assert_array_equal(one.folds(), [5])
    for name in ("errors", "region_volumes", "crossed", "folded"):
        ((given,),) = getattr(one, name).calls
        assert_array_equal(given, X)
    assert one.volume.calls == [()]


def test_it_is_finished_if_it_has_the_mesh_before_its_finish():
    assert not solution().is_finished
    assert solution(unfinished=X).is_finished
    assert solution().remaining == 0.0


def test_a_pickle_has_the_numbers_instead_of_their_functions():
    one = solution(crossed=len, folded=len, unfinished=X)
    again = pickle.loads(pickle.dumps(one))
    assert (again.handle_error, again.fixed_error, again.volume_change) == (0.25, 0.5, 0.125)
    assert_array_equal(again.region_volume_change, [0.1, 0.2])
    assert_array_equal(again.vertices, X)
    assert again.status is Status.CONVERGED
    assert again.steps == 7
    assert not again.vertices.flags.writeable
    assert not again.unfinished.flags.writeable


@pytest.mark.parametrize(
    ("unmoved", "says"),
    [
        ((), ""),
        ((1,), "part 2 (6 vertices) has no handle and no fixed vertices: it stays where it is"),
        ((0, 2), "parts 1, 3 (12 vertices) have no handle and no fixed vertices: they stay where"),
        ((0, 1, 2), "parts 1, 2, 3 (18 vertices) have"),
        ((0, 1, 2, 3), "parts 1, 2, 3 and 1 more (24 vertices) have"),
    ],
)
def test_parts_that_do_not_move_are_counted_and_the_first_three_named(unmoved, says):
    ball, faces = icosphere(0)
    points = np.concatenate([ball + [3.0 * k, 0.0, 0.0] for k in range(4)])
    mesh = Mesh(points, np.concatenate([faces + 6 * k for k in range(4)]))
    one = replace(solution(), unmoved=np.array(unmoved, dtype=np.int64))
    text = one.unmoved_summary(mesh)
    assert text.startswith(says)
    assert bool(text) == bool(says)


def test_every_status_is_advice():
    assert str(Status.CONVERGED) == "converged"
    assert all(str(each) == each.value for each in Status)
    assert "max_steps" in str(Status.STEP_LIMIT)
