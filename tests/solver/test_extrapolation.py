"""The start of a solve on the path of the last ones."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vtk_segdeform.solver.extrapolation import End, Way

PLACES = np.zeros((2, 3))
TERMS = np.random.default_rng(0).normal(size=(4, 5, 3))  # of the path of five cage vertices


def path(t: float, degree: int) -> np.ndarray:
    """Return the cages where the targets have gone a way *t*, a polynomial of *degree*."""
    return sum(term * t**k for k, term in enumerate(TERMS[: degree + 1]))


def end(t: float, degree: int, p: np.ndarray | None = None) -> End:
    """Return the end of a solve for targets moved by *t* along x."""
    return End(path(t, degree) if p is None else p, PLACES + [t, 0.0, 0.0], ())


def along(times, degree: int) -> Way:
    """Return the way of solves at *times*."""
    way = Way()
    for t in times:
        way = way.on_to(end(t, degree))
    return way


def ahead(way: Way, t: float) -> np.ndarray:
    """Return where the cages are expected for targets moved by *t*."""
    return way.ahead(PLACES + [t, 0.0, 0.0])[0]


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_polynomial_path_is_continued_exactly_at_uneven_steps(degree):
    times = np.array([0.0, 1.0, 2.5, 3.0, 4.2, 5.0]) * 1e-3
    assert_allclose(ahead(along(times, degree), 6.1e-3), path(6.1e-3, degree), atol=1e-12)


@pytest.mark.parametrize("size", [0.05, 1e-4])  # larger, and smaller, than the steps
def test_a_noisy_path_is_continued_straight_on(size):
    """A polynomial of higher degree would enlarge the noise."""
    way = Way()
    for k in range(5):
        noise = size * (-1.0) ** k
        way = way.on_to(end(0.01 * k, 1, path(0.01 * k, 1) + noise))
    before, last = (each.p for each in way.ends[-2:])
    assert_allclose(ahead(way, 0.05), 2.0 * last - before, atol=1e-12)


def test_after_a_turn_only_the_way_since_counts():
    way = along([0.0, 1e-3, 2e-3, 3e-3], 3)
    way = way.on_to(End(path(1.0, 1), PLACES + [3e-3, 1e-3, 0.0], ()))
    assert len(way.ends) == 2
    back = along([0.0, 1e-3, 2e-3], 3).on_to(end(1.5e-3, 3))
    assert len(back.ends) == 2
    assert back.ahead(PLACES + [1.2e-3, 0.0, 0.0]) is not None
    assert back.ahead(PLACES + [2e-3, 0.0, 0.0]) is None


def test_an_end_beside_the_last_one_replaces_it():
    """The path through both would be steep: the quotient of two small differences."""
    way = along([0.0, 1e-3, 2e-3, 2.01e-3], 1)
    assert [each.targets[0, 0] for each in way.ends] == [0.0, 1e-3, 2.01e-3]
    assert_allclose(ahead(way, 3e-3), path(3e-3, 1), atol=1e-12)
    same = way.on_to(end(2.01e-3, 1))
    assert len(same.ends) == 3


def test_no_start_is_farther_than_two_ways_ahead_or_a_long_motion():
    way = along([0.0, 1e-3, 2e-3], 1)
    assert_allclose(ahead(way, 9e-3), path(4e-3, 1), atol=1e-12)
    assert way.ahead(PLACES + [0.03, 0.0, 0.0]) is None
    assert along([0.0], 1).ahead(PLACES + [1e-3, 0.0, 0.0]) is None


def test_an_end_is_beside_the_last_one_by_the_last_way_alone():
    """A fifth of it: of an earlier, longer way a fifth would be longer."""
    for last, count in ((5.19e-3, 3), (5.21e-3, 4), (5.9e-3, 4)):
        way = along([0.0, 4e-3, 5e-3, last], 1)
        assert len(way.ends) == count
        assert way.ends[-1].targets[0, 0] == last
    way = along([0.0, 1e-3, 6e-3, 6.9e-3], 1)
    assert len(way.ends) == 3  # of an earlier, shorter one it would be less


@pytest.mark.parametrize(("degrees", "count"), [(0, 4), (59, 4), (61, 2), (180, 2)])
def test_a_turn_by_more_than_60_degrees_begins_a_new_way(degrees, count):
    way = along([0.0, 4e-3, 5e-3], 1)
    turn = 1e-3 * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    way = way.on_to(End(path(7e-3, 1), PLACES + [5e-3, 0.0, 0.0] + turn, ()))
    assert len(way.ends) == count
    assert way.ends[-2].targets[0, 0] == 5e-3


def test_targets_that_do_not_move_or_move_aside_have_no_start():
    way = along([0.0, 1e-3, 2e-3], 1)
    assert way.ahead(PLACES + [2e-3, 0.0, 0.0]) is None
    assert way.ahead(PLACES + [2e-3, 1e-3, 0.0]) is None
    assert way.ahead(PLACES + [2e-3, 0.0201, 0.0]) is None
    shift = [2e-3 + 0.0199, 0.0, 0.0]
    assert_allclose(ahead(way, shift[0]), path(4e-3, 1), atol=1e-12)
