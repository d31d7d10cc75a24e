"""Copies share nothing that changes, and a cancelled call leaves nothing behind.

What a deformer does next is compared bit for bit, whatever happened to a copy of it, and wherever
a call was cancelled.
"""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest
from campaign import every
from scenes import sausage

from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.errors import Cancelled

SCENE = sausage(2, is_coarse=True)
X, D = SCENE.mesh.vertices, SCENE.mesh.diagonal
TIP = int(X[:, 0].argmax())
NEAR, FAR = 0.06 * D * np.array([-1.0, 0.2, 1.0]), 0.2 * D * np.array([-1.0, 0.1, 1.0])


def in_a_drag() -> Deformer:
    """Return a deformer during a drag, with raised weights."""
    deformer = SCENE.held()
    for degrees in (10, 40):
        deformer.solve(SCENE.turned(degrees), max_steps=3)
    return deformer


def in_a_live_drag() -> Deformer:
    """Return a deformer on the way to targets far away."""
    deformer = SCENE.held()
    for _ in range(2):
        deformer.solve(SCENE.turned(50), max_steps=3)
    return deformer


def avoiding() -> Deformer:
    """Return a deformer with further terms."""
    deformer = SCENE.held(avoid_contact=True)
    deformer.solve(SCENE.turned(70), max_steps=20)
    return deformer


def in_a_pull() -> Deformer:
    """Return a local deformer that has been pulled."""
    deformer = SCENE.held().hold(fixed=SCENE.fixed, handle=[TIP]).local(TIP, 0.3 * D, 0.1 * D)
    for share in (0.5, 1.0):
        deformer.solve(X[[TIP]] + share * NEAR, max_steps=30)
    return deformer


BEGINNINGS = [in_a_drag, in_a_live_drag, avoiding, in_a_pull]
begun = functools.cache(lambda beginning: beginning())


def targets(deformer: Deformer, degrees: float) -> np.ndarray:
    """Return targets on from the present ones."""
    if len(deformer.handle) > 1:
        return SCENE.turned(degrees)
    return X[[TIP]] + degrees / 60.0 * FAR


def what_comes_next(deformer: Deformer) -> list[bytes]:
    """Return what a *deformer* does from where it is, bit for bit."""
    last = deformer._problem.frame.outward(deformer._path.targets)
    solutions = [
        deformer.solve(last, max_steps=1),
        deformer.solve(targets(deformer, 55), max_steps=3),
        deformer.solve(targets(deformer, 58), max_steps=3),
        deformer.solve(targets(deformer, 58)),
    ]
    solutions.append(deformer.finish(solutions[-1]))
    deformer.reset()
    solutions.append(deformer.solve(targets(deformer, 12)))
    return [each.vertices.tobytes() for each in solutions]


def solve_far(deformer, progress=None):
    deformer.solve(targets(deformer, 75), progress=progress)


def solve_live(deformer, progress=None):
    deformer.solve(targets(deformer, 60), max_steps=6, progress=progress)


def solve_some_steps(deformer, progress=None):
    deformer.solve(targets(deformer, 60), max_steps=4, progress=progress)


def solve_and_finish(deformer, progress=None):
    solution = deformer.solve(deformer._problem.frame.outward(deformer._path.targets), max_steps=1)
    deformer.finish(deformer.finish(solution, progress=progress), progress=progress)


def begin_again(deformer):
    solution = deformer.solve(targets(deformer, 60))
    deformer.reset()
    deformer.resume(solution.cage_vertices, targets(deformer, 60))


def hold_others(deformer):
    for other in (
        deformer.hold(fixed=deformer.fixed, handle=deformer.handle, preserve_volume=False),
        deformer.hold(fixed=SCENE.fixed, handle=[TIP]),
        deformer.local(TIP, 0.2 * D, 0.05 * D),
    ):
        other.solve(X[other.handle] + NEAR, max_steps=5)


CANCELLABLE = [solve_far, solve_live, solve_some_steps]


ACTS = [*CANCELLABLE, solve_and_finish, begin_again, hold_others]
PAIRS = list(itertools.product(BEGINNINGS, ACTS))
ALL_CANCELLED = list(itertools.product(BEGINNINGS, CANCELLABLE))


@functools.cache
def expected(beginning) -> list[bytes]:
    return what_comes_next(begun(beginning).copy())


@pytest.mark.parametrize(("beginning", "act"), every(6, PAIRS))
def test_nothing_that_a_copy_does_reaches_the_others(beginning, act):
    first = begun(beginning).copy()
    second = first.copy()
    third = second.copy()
    act(second)
    assert what_comes_next(first) == expected(beginning)
    assert what_comes_next(third) == expected(beginning)


@pytest.mark.parametrize(("beginning", "act"), every(4, ALL_CANCELLED))
def test_a_cancelled_call_leaves_the_deformer_as_it_was(beginning, act):
    count = number_of_calls(beginning, act)
    for last in {count // 2, count - 1}:
        require_unchanged(beginning, act, last)


@pytest.mark.campaign
@pytest.mark.parametrize(("beginning", "act"), ALL_CANCELLED)
def test_so_does_one_that_is_cancelled_anywhere(beginning, act):
    for last in range(number_of_calls(beginning, act)):
        require_unchanged(beginning, act, last)


def number_of_calls(beginning, act) -> int:
    """Return how often *act* calls its progress callback."""
    calls = []
    act(begun(beginning).copy(), lambda *told: calls.append(told))
    return len(calls)


def require_unchanged(beginning, act, last, error=Cancelled) -> None:
    """Check what comes next after *act* was cancelled in the call number *last*."""
    deformer, numbers = begun(beginning).copy(), itertools.count()

    def stop(*_):
        if next(numbers) == last:
            raise error("enough")

    with pytest.raises(error):
        act(deformer, stop)
    assert what_comes_next(deformer) == expected(beginning)
