"""Long runs: no drift, no growing memory, no stuck widget.

make campaign               100,000 steps back and forth; random events for two minutes
make soak                   random events for an hour
make soak SECONDS=900       random events for 15 minutes
"""

from __future__ import annotations

import os
import threading
import time

import numpy as np
import pytest
from scenes import sausage
from soaking import LongDrag, resident, slender, sways

from vtk_segdeform.solver.solution import Status


def drag_and_return(drag: LongDrag, targets, rest_at=None, every=200) -> None:
    """Follow *targets*, one step each, with a rest at *rest_at* every so often; then return."""
    scene, memory, farthest = drag.scene, [], 0.0
    for event, target in enumerate(targets):
        if rest_at is not None and event % every == every // 2:
            assert drag.arrive(rest_at).handle_error < 5e-4
        drag.follow(target, max_steps=1)
        farthest = max(farthest, drag.distance_from_rest)
        if event % 100 == 0:
            memory.append(resident())
    settled = drag.arrive(scene.mesh.vertices[scene.handle])
    early = len(memory) // 10 + 1  # by then everything allocated once is allocated
    grown = (memory[-1] - max(memory[:early])) / 1e6
    print(
        f"\n{scene.mesh.n_vertices} vertices, {drag.events} events, {drag.steps} steps, as far as "
        f"{farthest:.2f} diagonals: |dV|/V at most {drag.worst:.1e}, "
        f"{drag.distance_from_rest:.1e} of rest at the end, {settled.status}, {grown:.1f} MB more"
    )
    assert drag.steps >= event
    assert farthest > 0.1
    assert settled.status is Status.CONVERGED
    assert drag.distance_from_rest <= 1e-6
    assert grown < 10.0


@pytest.mark.parametrize("count", [60, pytest.param(100_000, marks=pytest.mark.campaign)])
def test_a_long_drag_back_and_forth_ends_at_rest(count):
    drag = LongDrag(slender())
    drag_and_return(drag, sways(drag.scene, count, degrees=60.0))
    drag.session.commit()
    assert drag.session.undo() == "drag tip"
    assert drag.distance_from_rest == 0.0


@pytest.mark.parametrize("count", [20, pytest.param(20_000, marks=pytest.mark.campaign)])
def test_a_long_drag_far_from_rest_ends_there(count):
    drag = LongDrag(sausage())
    scene = drag.scene
    far = scene.turned(20.0) + np.array([0.2, 0.4, 0.0])
    drag_and_return(drag, sways(scene, count, degrees=30.0), far, every=min(200, count // 2))


# Random events, measured every minute.

SECONDS = float(os.environ.get("SEGDEFORM_SOAK", "120"))


def counts(monkey) -> dict[str, int]:
    """Return the numbers that must not grow, with all buttons released."""
    monkey.release_all()
    return {
        "threads": threading.active_count(),
        "files": len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0,
        "props": monkey.view.renderer.GetViewProps().GetNumberOfItems(),
        "handles": len(monkey.editor.session.handles),
        "MB": round(resident() / 1e6),
    }


def check_session(session) -> None:
    """Check that no vertex is constrained twice, and that every handle has its targets."""
    constrained = np.concatenate([session.fixed, *session.handles.values()])
    assert len(np.unique(constrained)) == len(constrained)
    assert {name: len(ids) for name, ids in session.handles.items()} == {
        name: len(targets) for name, targets in session.targets.items()
    }


@pytest.mark.campaign
def test_random_hands_leave_nothing_behind(tmp_path):
    from monkey import Monkey  # here, since it skips the module where VTK cannot render

    monkey = Monkey(4, tmp_path)
    end, measured = time.monotonic() + SECONDS, [counts(monkey)]
    events, posed = 0, []
    print()
    while time.monotonic() < end:
        until = time.monotonic() + min(60.0, SECONDS / 12.0)
        while time.monotonic() < min(until, end):
            monkey.act()
            events += 1
            check_session(monkey.editor.session)
        measured.append(counts(monkey))
        print(f"{events} events, {monkey.frames} frames, {monkey.posed} deformed: {measured[-1]}")
        posed.append(monkey.posed)
    first, last = measured[len(measured) // 4], measured[-1]
    steps = 0
    while monkey.editor.session.undo() is not None:
        steps += 1
        check_session(monkey.editor.session)
    print(
        f"{SECONDS:.0f} s: {events} events, {monkey.refused} refused, |dV|/V at most "
        f"{monkey.worst:.1e}, {last['MB'] - first['MB']} MB more since a quarter of the time, "
        f"at most {max(each['handles'] for each in measured)} handles, {steps} steps undone"
    )
    assert posed[-1] > posed[len(posed) // 2]  # it did not end in a state without poses
    assert monkey.worst <= 1e-12
    assert steps <= 100
    assert last["MB"] - first["MB"] < 50
    assert last["threads"] <= first["threads"]
    assert last["files"] <= first["files"] + 3
    monkey.editor.remove()
    assert monkey.view.renderer.GetViewProps().GetNumberOfItems() == 0
    assert monkey.view.window.GetRenderers().GetNumberOfItems() == 1
