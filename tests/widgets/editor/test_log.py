"""The log: one entry for each drag and each job."""

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
from vtk_segdeform.widgets import DeformEditor, Mode
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


def test_a_drag_is_one_entry_with_all_its_steps_and_its_outcome(written):
    session, log = written
    steps = [session.move_handle("tip", up(z), max_steps=2).steps for z in (0.1, 0.2, 0.3)]
    assert log.entries == ()
    session.commit()
    (entry,) = log.entries
    assert (entry.title, entry.steps) == ("drag tip", sum(steps))
    assert entry.outcome == str(Status.STEP_LIMIT)
    assert entry.handle_error == session.solution.handle_error
    assert entry.volume_change == session.volume_change
    assert 0.0 < entry.seconds <= session.effort.seconds


@pytest.mark.parametrize("at_once", [1, 5])
def test_refinement_updates_the_entry_until_the_next_change(written, at_once):
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


def test_a_cancelled_drag_leaves_no_entry_and_undo_during_a_drag_leaves_one(written):
    session, log = written
    session.move_handle("tip", up(0.1), max_steps=1)
    session.revert()
    session.remove_handle("tip")
    session.undo()
    assert log.entries == ()
    session.move_handle("tip", up(0.1), max_steps=1)
    error = session.solution.handle_error
    session.undo()
    assert [(each.title, each.handle_error) for each in log.entries] == [("drag tip", error)]


def test_editing_a_cage_is_logged_without_solver_steps(written):
    session, log = written
    session.move_cage(1, session.cage_vertices[1] + [0.0, 0.0, 0.02])
    session.commit()
    (entry,) = log.entries
    assert (entry.title, entry.steps) == ("drag the cage of region 2", None)
    assert entry.text.endswith("  drag the cage of region 2\nCage edited\nvolume 0 %")


def test_the_oldest_entries_are_dropped_and_other_sessions_are_not_logged(written):
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
    log.unfollow()
    assert not other._listeners._listeners


def test_a_job_is_logged_with_its_outcome():
    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.AddRenderer(renderer)
    editor = DeformEditor((renderer, vtkGenericRenderWindowInteractor()), ready())
    editor.view.on_failure(lambda _: None)
    editor.mode = Mode.REGIONS
    editor.On()

    def fail(*_):
        raise CageError("no room for it")

    def cancel(*_):
        raise Cancelled("stopped")

    jobs = [
        ("Counting", lambda _: 7, lambda seven: f"{seven} found"),
        ("Being silent", lambda _: 7, lambda _: None),  # not the outcome of the job before
        ("Failing", fail, None),
        ("Failing late", lambda _: 7, fail),
        ("Stopping", cancel, None),
    ]
    for doing, work, done in jobs:
        editor.controller.start(doing, work, done)
        with editor.view.guarded():
            editor.wait()
    assert [(entry.title, entry.outcome) for entry in editor.controller.log.entries] == [
        ("Counting", "7 found"),
        ("Being silent", "Done"),
        ("Failing", "no room for it"),
        ("Failing late", "Failed"),
        ("Stopping", "Cancelled"),
    ]
    editor.remove()


@pytest.mark.parametrize(
    ("entry", "lines"),
    [
        (Entry(1, 0.0, "Fitting cages", 2.04, "Done"), ["2.0 s: Done"]),
        (
            Entry(1, 0.0, "drag tip", 0.0314, "converged", 1, 1.234e-4, -2e-16),
            ["1 step, 31 ms: converged", "volume 0 %, handle error 0.012 % of model size"],
        ),
    ],
)
def test_an_entry_is_two_or_three_lines_of_text(entry, lines):
    first, *rest = entry.text.splitlines()
    assert first.endswith(f":00  {entry.title}")
    assert rest == lines
