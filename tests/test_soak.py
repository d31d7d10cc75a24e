"""What goes on for long: nothing drifts, nothing grows, nothing sticks.

make campaign               100,000 steps there and back; random hands for two minutes
make soak                   random hands for an hour
make soak SECONDS=900       or for as long as you like
"""

from __future__ import annotations

import numpy as np
import pytest
from scenes import sausage
from soaking import LongDrag, resident, slender, sways

from vtk_segdeform.solution import Status


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
