"""Every frame of a drag has the exact volume, however the volume of a mesh of its size is kept."""

from __future__ import annotations

import numpy as np
import pytest
from hands import plain_view
from scenes import sausage
from solids import exact_volume_change
from test_editor import Bench, pull_handle
from test_finishing_poses import grabbed

from vtk_segdeform import sizes
from vtk_segdeform.widgets.scene.view import View

pytestmark = pytest.mark.usefixtures("unprepared")
SCENE = sausage(2, is_coarse=True)


@pytest.mark.parametrize("kept_by", ["every step", "the last projection", "scaling"])
@pytest.mark.parametrize("mode", ["deform", "pull"])
def test_every_frame_of_a_drag_has_the_exact_volume(monkeypatch, kept_by, mode):
    """A large mesh has its own volume by the last operation only: the steps have a coarse one."""
    if kept_by != "every step":
        monkeypatch.setattr(sizes, "COARSE_VOLUME", 250)
        monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 175)
    if kept_by == "scaling":
        monkeypatch.setattr(sizes, "SCALED_VOLUME", 250)
    session = SCENE.session()
    session.bind()
    bench, shown, changes = Bench(plain_view((400, 320)), session), [], []
    bench.editor.controller.finishing.is_wanted = False
    bench.type("4" if mode == "deform" else "0")

    def frame(*_):
        x = np.array(bench.editor.widgets.surface.points)
        if not shown or not np.array_equal(x, shown[-1]):
            shown.append(x)
            changes.append(exact_volume_change(SCENE.mesh.vertices, x, SCENE.mesh.faces))

    bench.view.render = lambda: View.render(bench.view)  # at every event
    bench.view.renderer.AddObserver("EndEvent", frame)
    bench.view.render()
    if mode == "deform":
        pull_handle(bench, (-15, 40), moves=6)
    else:
        grabbed(bench, 0.7)
    bench.hand.tick(10)
    assert bench.hand.failures == []
    assert len(shown) > 3
    assert np.abs(shown[-1] - shown[0]).max() > 0.1
    assert np.abs(changes).max() < 1e-12
    bench.editor.remove()
