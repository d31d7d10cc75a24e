"""Copies of a session share nothing that changes, and a cancelled call leaves nothing behind."""

from __future__ import annotations

import copy
import functools
import gc
import itertools
import weakref

import numpy as np
import pytest
from campaign import every
from scenes import sausage
from solids import rotation

from vtk_segdeform.errors import Cancelled
from vtk_segdeform.session.session import Session

pytestmark = pytest.mark.usefixtures("bound_once")

SCENE = sausage(2, is_coarse=True)
X, D = SCENE.mesh.vertices, SCENE.mesh.diagonal
TIP = int(X[:, 0].argmax())
UP = 0.08 * D * np.array([-1.0, 0.2, 1.0])


def turned(angle: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation([0.0, 1.0, 0.0], angle)
    return matrix


def new() -> Session:
    session = Session(SCENE.mesh)
    session.set_regions(SCENE.regions)
    session.set_cages(SCENE.cages)
    session.set_fixed(SCENE.fixed)
    session.handles.add(SCENE.handle, "tip")
    return session


def in_a_drag(session: Session) -> None:
    session.move_handle("tip", turned(0.2), max_steps=3)
    session.move_handle("tip", turned(0.4), max_steps=3)


def after_a_pull(session: Session) -> None:
    session.pull(TIP, X[TIP] + UP)
    session.commit()
    session.pull(TIP, X[TIP] + 1.3 * UP, max_steps=4)


def on_from_a_finished_pose(session: Session) -> None:
    session.move_handle("tip", turned(0.5))
    session.commit()
    session.finish()
    session.move_handle("tip", turned(0.1), max_steps=3)


BEGINNINGS = [in_a_drag, after_a_pull, on_from_a_finished_pose]


def begun(beginning) -> Session:
    """Return a session after *beginning*: always the same, bit for bit."""
    session = new()
    beginning(session)
    return session


def what_comes_next(session: Session) -> list[bytes]:
    """Return what a *session* does from where it is, bit for bit."""
    seen = [session.vertices]
    for act in (
        lambda: session.refine(max_steps=1),
        lambda: session.move_handle("tip", turned(0.1), max_steps=3),
        session.refine,
        session.commit,
        session.finish,
        lambda: session.pull(TIP, session.vertices[TIP] + 0.3 * UP),
        session.undo,
        session.undo,
    ):
        act()
        seen.append(session.vertices)
    return [each.tobytes() for each in seen]


@functools.cache
def expected(beginning) -> list[bytes]:
    return what_comes_next(begun(beginning))


def drag(session: Session) -> None:
    session.move_handle("tip", turned(-0.6))
    session.commit()
    session.finish()


def pull(session: Session) -> None:
    session.pull(TIP, X[TIP] - UP, max_steps=5)
    session.pull(TIP, X[TIP] - UP)
    session.finish()


def edit(session: Session) -> None:
    session.undo()
    session.set_fixed([])
    session.change_options(preserve_volume=False, avoid_contact=True)
    session.move_handle("tip", turned(0.3))
    session.reset_pose()


ACTS = [drag, pull, edit]


@pytest.mark.parametrize(("beginning", "act"), every(2, itertools.product(BEGINNINGS, ACTS)))
def test_nothing_that_a_copy_does_reaches_the_session(beginning, act):
    session = begun(beginning)
    act(copy.copy(session))
    assert what_comes_next(session) == expected(beginning)


def refine(session: Session, progress=None) -> None:
    session.refine(progress=progress)


def finish(session: Session, progress=None) -> None:
    session.finishing()(progress)


CANCELLABLE = [refine, finish]
PAIRS = list(itertools.product(BEGINNINGS, CANCELLABLE))


@pytest.mark.parametrize(("beginning", "act"), every(2, PAIRS))
def test_a_cancelled_call_leaves_the_session_as_it_was(beginning, act):
    require_unchanged(beginning, act, number_of_calls(beginning, act) - 1)


@pytest.mark.campaign
@pytest.mark.parametrize(("beginning", "act"), PAIRS)
def test_so_does_one_that_is_cancelled_anywhere(beginning, act):
    for last in range(number_of_calls(beginning, act)):
        require_unchanged(beginning, act, last)


def number_of_calls(beginning, act) -> int:
    """Return how often *act* calls its progress callback."""
    calls = []
    act(begun(beginning), lambda *told: calls.append(told))
    return len(calls)


def require_unchanged(beginning, act, last) -> None:
    """Check what comes next after *act* was cancelled in the call number *last*."""
    session, numbers = begun(beginning), itertools.count()

    def stop(*_):
        if next(numbers) == last:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        act(session, stop)
    assert what_comes_next(session) == expected(beginning)


@pytest.mark.parametrize("beginning", BEGINNINGS)
def test_a_session_is_freed_with_its_last_reference(beginning):
    session = begun(beginning)
    seen = weakref.ref(session.poses)
    gc.disable()
    try:
        del session
        assert seen() is None
    finally:
        gc.enable()
