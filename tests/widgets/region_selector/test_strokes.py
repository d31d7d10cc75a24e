"""Strokes without a widget: which vertices a brush reaches, however fast it is moved."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from hands import look_from, plain_view

from vtk_segdeform import Session, models
from vtk_segdeform.widgets.picking.picking import Picker
from vtk_segdeform.widgets.region_selector.strokes import Brush
from vtk_segdeform.widgets.scene.gestures import Phase, Pointer
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay


@pytest.mark.parametrize("radius", every(2, [0.1, 0.2]))
def test_one_fast_move_of_the_brush_reaches_all_that_a_slow_one_does(radius):
    """The brush reaches at least 95 % of its radius on both sides of the line, everywhere."""
    view = plain_view()
    session = Session(models.sphere(10_000))
    surface = SurfaceDisplay(view, session)
    look_from(view, 0.0, -4.0, 0.0)
    picker = Picker(surface)
    (x0, y0, _), (x1, y1, _) = view.to_display(np.array([[-0.5, -0.86, 0.05], [0.5, -0.86, 0.05]]))
    brush = Brush(picker, Pointer(Phase.PRESS, x0, y0), radius=radius, through=False)
    brush.extend(Pointer(Phase.MOVE, x1, y1))
    steps = np.linspace(0.0, 1.0, 60)
    path = [picker.hit(Pointer(Phase.MOVE, x0 + t * (x1 - x0), y0 + t * (y1 - y0))) for t in steps]
    points = np.array([hit.point for hit in path])
    away = np.linalg.norm(session.mesh.vertices[:, None] - points, axis=2).min(axis=1)
    assert np.count_nonzero(away < 0.95 * radius) > 100
    assert brush.mask[away < 0.95 * radius].all()
    assert not brush.mask[away > 1.1 * radius].any()
