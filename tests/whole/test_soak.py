"""What goes on for long: nothing drifts, nothing grows, nothing sticks.

make campaign               100,000 steps there and back; random hands for two minutes
make soak                   random hands for an hour
make soak SECONDS=900       or for as long as you like
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


def sways_and_comes_back(drag: LongDrag, targets, rest_at=None, every=200) -> None:
    """Follow *targets* with a step for each, resting at *rest_at* now and then; then go back."""
    scene, memory, farthest = drag.scene, [], 0.0
    for event, target in enumerate(targets):
        if rest_at is not None and event % every == every // 2:
            assert drag.arrive(rest_at).handle_error < 5e-4
        drag.follow(target, max_steps=1)
        farthest = max(farthest, drag.away)
        if event % 100 == 0:
            memory.append(resident())
    settled = drag.arrive(scene.mesh.vertices[scene.handle])
    early = len(memory) // 10 + 1  # what is allocated once is there by then
    grown = (memory[-1] - max(memory[:early])) / 1e6
    print(
        f"\n{scene.mesh.n_vertices} vertices, {drag.events} events, {drag.steps} steps, as far as "
        f"{farthest:.2f} diagonals: |dV|/V at most {drag.worst:.1e}, back within {drag.away:.1e} "
        f"of rest, {settled.status}, {grown:.1f} MB more"
    )
    assert drag.steps >= event
    assert farthest > 0.1
    assert settled.status is Status.CONVERGED
    assert drag.away <= 1e-6
    assert grown < 10.0


@pytest.mark.parametrize("count", [300, pytest.param(100_000, marks=pytest.mark.campaign)])
def test_a_drag_there_and_back_however_long_ends_at_rest(count):
    drag = LongDrag(slender())
    sways_and_comes_back(drag, sways(drag.scene, count, degrees=60.0))
    drag.session.commit()
    assert drag.session.undo() == "drag tip"
    assert drag.away == 0.0


@pytest.mark.parametrize("count", [100, pytest.param(20_000, marks=pytest.mark.campaign)])
def test_so_does_one_with_more_weight_on_what_misses_its_place(count):
    drag = LongDrag(sausage())
    scene = drag.scene
    far = scene.turned(20.0) + np.array([0.2, 0.4, 0.0])
    assert scene.deformer(hold_tolerance=1.0).solve(far).handle_error > 5e-4  # it is due
    sways_and_comes_back(drag, sways(scene, count, degrees=30.0), far, every=min(200, count // 2))


# Random hands, watched by the minute.

SECONDS = float(os.environ.get("SEGDEFORM_SOAK", "120"))


def counted(monkey) -> dict[str, int]:
    """Return how many there are of what must not pile up, with nothing in hand."""
    monkey.rests()
    return {
        "threads": threading.active_count(),
        "files": len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0,
        "props": monkey.view.renderer.GetViewProps().GetNumberOfItems(),
        "handles": len(monkey.editor.session.handles),
        "MB": round(resident() / 1e6),
    }


def require_sound(session) -> None:
    """Assert that no vertex is held twice, and that every handle has targets."""
    held = np.concatenate([session.fixed, *session.handles.values()])
    assert len(np.unique(held)) == len(held)
    assert {name: len(ids) for name, ids in session.handles.items()} == {
        name: len(targets) for name, targets in session.targets.items()
    }


@pytest.mark.campaign
def test_random_hands_for_long_leave_nothing_behind(tmp_path):
    from test_random_hands import Monkey  # here, as that is skipped where nothing can be drawn

    monkey = Monkey(4, tmp_path)
    end, looks = time.monotonic() + SECONDS, [counted(monkey)]
    events, posed = 0, []
    print()
    while time.monotonic() < end:
        until = time.monotonic() + min(60.0, SECONDS / 12.0)
        while time.monotonic() < min(until, end):
            monkey.acts()
            events += 1
            require_sound(monkey.editor.session)
        looks.append(counted(monkey))
        print(f"{events} events, {monkey.frames} frames, {monkey.posed} deformed: {looks[-1]}")
        posed.append(monkey.posed)
    first, last = looks[len(looks) // 4], looks[-1]
    steps = 0
    while monkey.editor.session.undo() is not None:
        steps += 1
        require_sound(monkey.editor.session)
    print(
        f"{SECONDS:.0f} s: {events} events, {monkey.refused} refused, |dV|/V at most "
        f"{monkey.worst:.1e}, {last['MB'] - first['MB']} MB more since a quarter of the time, "
        f"at most {max(look['handles'] for look in looks)} handles, {steps} steps undone"
    )
    assert posed[-1] > posed[len(posed) // 2]  # it got not stuck where nothing can be done
    assert monkey.worst <= 1e-12
    assert steps <= 100
    assert last["MB"] - first["MB"] < 50
    assert last["threads"] <= first["threads"]
    assert last["files"] <= first["files"] + 3  # a recording may be going on
    monkey.editor.remove()
    assert monkey.view.renderer.GetViewProps().GetNumberOfItems() == 0
    assert monkey.view.window.GetRenderers().GetNumberOfItems() == 1
