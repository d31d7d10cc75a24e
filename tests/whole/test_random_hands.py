"""Random events in every mode of the editor: no exception, no stuck drag, no change of volume."""

from __future__ import annotations

import gc

import pytest
from monkey import Monkey
from soaking import resident

from vtk_segdeform.kernels import compiled_kernels


@pytest.mark.parametrize(
    ("seed", "count"),
    [
        (5, 30),
        pytest.param(5, 60, marks=pytest.mark.campaign),
        pytest.param(2, 150, marks=pytest.mark.campaign),
        pytest.param(8, 300, marks=pytest.mark.campaign),
        pytest.param(3, 10_000, marks=pytest.mark.campaign),
    ],
)
def test_random_events_preserve_the_volume(seed, count, tmp_path):
    compiled_kernels()  # numba takes 100 MB, which are no leak
    monkey = Monkey(seed, tmp_path)
    half = 0
    for k in range(count):
        monkey.act()
        if k == count // 2:
            gc.collect()
            half = resident()
    monkey.release_all()
    gc.collect()
    grown = resident() - half
    print(
        f"seed {seed}: {count} events, {monkey.frames} frames, {monkey.posed} of them deformed, "
        f"{monkey.pulled} with pulls, {monkey.pinned} pins, {monkey.turned} events of turns, "
        f"{monkey.refused} actions refused, {monkey.free} frames of free volume, "
        f"|dV|/V at most {monkey.worst:.1e}, {grown / 1e6:.0f} MB more in the second half"
    )
    assert monkey.frames > count / 10
    assert monkey.posed > count / 50
    assert monkey.pulled > count / 50
    assert monkey.worst <= 1e-12
    assert grown < 100e6
    monkey.editor.remove()
