"""The log of steps: what drags and jobs took, each written down once."""

from __future__ import annotations

import hands  # noqa: F401 - skips where nothing can be drawn
import numpy as np
import pytest
from scenes import sausage
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

from vtk_segdeform.errors import CageError, Cancelled
from vtk_segdeform.session.session import Session
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.widgets import DeformEditor
from vtk_segdeform.widgets.editor.log import Entry, Log

SCENE = sausage()


def ready() -> Session:
    session = Session(SCENE.mesh)
    session.set_regions(SCENE.regions)
    session.set_cages(SCENE.cages)
    session.set_fixed(SCENE.fixed)
    session.add_handle(SCENE.handle, "tip")
    return session


def up(z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


@pytest.fixture
def written():
    """Return a session and the log that follows it."""
    session, log = ready(), Log(limit=3)
    log.follow(session)
    return session, log


def test_a_drag_is_one_entry_with_all_its_steps_and_its_end(written):
    session, log = written
    steps = [session.move_handle("tip", up(z), max_steps=2).steps for z in (0.1, 0.2, 0.3)]
    assert log.entries == ()
    session.commit()
    (entry,) = log.entries
    assert (entry.what, entry.steps) == ("drag tip", sum(steps))
    assert entry.outcome == str(Status.STEP_LIMIT)
    assert entry.handle_error == session.solution.handle_error
    assert entry.volume_change == session.volume_change
    assert 0.0 < entry.seconds <= session.effort.seconds


@pytest.mark.parametrize("at_once", [1, 5])
def test_refining_goes_on_with_the_entry_until_something_else_is_done(written, at_once):
    session, log = written
    steps = session.move_handle("tip", up(0.3), max_steps=2).steps
    session.commit()
    while session.solution.status is Status.STEP_LIMIT:
        steps += session.refine(max_steps=at_once).steps
    (entry,) = log.entries
    assert (entry.number, entry.steps) == (1, steps)
    assert entry.outcome == str(session.solution.status) != str(Status.STEP_LIMIT)
    assert entry.handle_error == session.solution.handle_error
    session.change_options(stretch=1.0)
    session.refine(max_steps=1)
    assert log.entries == (entry,)


def test_what_was_taken_back_leaves_no_entry_and_undo_during_a_drag_leaves_one(written):
    session, log = written
    session.move_handle("tip", up(0.1), max_steps=1)
    session.revert()
    session.remove_handle("tip")
    session.undo()
    assert log.entries == ()
    session.move_handle("tip", up(0.1), max_steps=1)
    error = session.solution.handle_error
    session.undo()
    assert [(each.what, each.handle_error) for each in log.entries] == [("drag tip", error)]


def test_a_cage_moved_by_hand_is_solved_for_by_nobody(written):
    session, log = written
    session.move_cage(1, session.cage_vertices[1] + [0.0, 0.0, 0.02])
    session.commit()
    (entry,) = log.entries
    assert (entry.what, entry.steps) == ("drag the cage of region 2", None)
    assert entry.text.endswith("moved freely\nvolume 0 %")


def test_the_oldest_is_forgotten_first_and_others_are_not_listened_to(written):
    session, log = written
    for k in range(5):
        session.move_handle("tip", up(0.01 * (k + 1)), max_steps=1)
        session.commit()
    assert [entry.number for entry in log.entries] == [3, 4, 5]
    other = ready()
    log.follow(other)
    session.move_handle("tip", up(0.0), max_steps=1)
    session.commit()
    assert len(log.entries) == 3
    log.clear()
    other.move_handle("tip", up(0.1), max_steps=1)
    other.commit()
    assert [entry.number for entry in log.entries] == [6]
    log.rest()
    assert not other._listeners._listeners


def test_a_job_is_written_down_with_what_was_said_of_it():
    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.AddRenderer(renderer)
    editor = DeformEditor((renderer, vtkGenericRenderWindowInteractor()), ready())
    editor.view.on_failure(lambda _: None)
    editor.On()

    def fail(*_):
        raise CageError("no room for it")

    def cancel(*_):
        raise Cancelled("stopped")

    jobs = [
        ("talking", lambda _: 7, lambda seven: editor.desk.say(f"{seven} found")),
        ("being silent", lambda _: 7, lambda _: None),  # what was said before is not of it
        ("failing", fail, None),
        ("failing late", lambda _: 7, fail),
        ("stopping", cancel, None),
    ]
    for doing, work, done in jobs:
        editor.desk.start(doing, work, done)
        with editor.view.guarded():
            editor.wait()
    assert [(entry.what, entry.outcome) for entry in editor.desk.log.entries] == [
        ("talking", "7 found"),
        ("being silent", "done"),
        ("failing", "no room for it"),
        ("failing late", "failed"),
        ("stopping", "cancelled"),
    ]
    editor.remove()


@pytest.mark.parametrize(
    ("entry", "lines"),
    [
        (Entry(1, 0.0, "fitting cages", 2.04, "done"), ["2.0 s: done"]),
        (
            Entry(1, 0.0, "drag tip", 0.0314, "converged", 1, 1.234e-4, -2e-16),
            ["1 step, 31 ms: converged", "volume 0 %, handle off by 1.2e-04 of the diagonal"],
        ),
    ],
)
def test_an_entry_is_read_in_two_or_three_lines(entry, lines):
    first, *rest = entry.text.splitlines()
    assert first.endswith(f":00  {entry.what}")
    assert rest == lines
