"""The volume band: 0 inside, a force of bounded size outside, and what it does to a bend."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from open_meshes import sheet, together
from scenes import sausage
from scipy.integrate import quad
from solids import icosphere, rotation

from vtk_segdeform import sizes
from vtk_segdeform.finish import CellEnergy, Finisher
from vtk_segdeform.finish.volume_band import VolumeBand
from vtk_segdeform.geometry import local_volume_change
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.solver import total_volume

BALL = Mesh(*icosphere(3))
SHEET = sheet(lambda u, v: (u, v, 0.1 * np.sin(9 * u)), 9, 9)


@pytest.mark.parametrize("factor", [0.76, 1.0, 1.24])
def test_nothing_resists_within_a_quarter(factor):
    value, slope = VolumeBand.of(BALL).value_and_slope(BALL.vertices * [1.0, 1.0, factor])
    assert value == 0.0
    assert_array_equal(slope, 0.0)


@pytest.mark.parametrize("change", [-0.8, -0.29, 0.27, 0.9])
@pytest.mark.parametrize("cells", [10_000, 100])
def test_the_value_is_the_work_of_a_force_that_grows_until_five_per_cent_beyond(
    change, cells, monkeypatch
):
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_CELLS", cells)
    monkeypatch.setattr(sizes, "LOCAL_VOLUME_POINTS", 120)
    work, _ = quad(lambda e: 2.0 * min(e, 0.05), 0.0, abs(change) - 0.25, points=[0.05])
    for unit in (1.0, 1e-3):
        ball = BALL.with_vertices(unit * BALL.vertices)
        value, _ = VolumeBand.of(ball).value_and_slope(ball.vertices * [1.0, 1.0 + change, 1.0])
        assert value == pytest.approx(work * ball.face_areas.sum(), rel=1e-9)


@pytest.mark.parametrize("kind", ["vertices", "cells", "with a sheet"])
def test_the_slope_is_half_the_gradient(kind, monkeypatch):
    """The error of V(x + h d) - V(x - h d) falls with the square of h."""
    mesh = sausage(2, is_coarse=True).mesh
    if kind == "cells":
        monkeypatch.setattr(sizes, "LOCAL_VOLUME_CELLS", 100)
        monkeypatch.setattr(sizes, "LOCAL_VOLUME_POINTS", 150)
    elif kind == "with a sheet":
        mesh = together(mesh, SHEET)
    band, rng = VolumeBand.of(mesh), np.random.default_rng(0)
    wave = np.sin(0.4 * mesh.vertices[:, [1, 2, 0]] + 0.3)
    x, way = mesh.vertices * [1.1, 0.7, 0.8] + 0.1 * wave, rng.normal(size=wave.shape)
    exact = 2.0 * np.vdot(band.value_and_slope(x)[1], way)
    assert exact != 0.0

    def error(h):
        ahead, behind = (band.value_and_slope(x + each * way)[0] for each in (h, -h))
        return abs((ahead - behind) / (2.0 * h) - exact) / abs(exact)

    errors = [error(h) for h in (4e-4, 2e-4)]
    assert errors[0] < 1e-3
    assert 3.0 < errors[0] / errors[1] < 5.0


def test_a_sheet_has_no_band():
    value, slope = VolumeBand.of(SHEET).value_and_slope(2.0 * SHEET.vertices)
    assert value == 0.0
    assert_array_equal(slope, 0.0)


def test_the_inside_of_a_bend_keeps_its_volume(monkeypatch):
    monkeypatch.setattr("vtk_segdeform.finish.finisher._GAIN", 0.0)  # at the minimum
    mesh = sausage(2, is_coarse=True).mesh
    x = mesh.vertices
    share = np.clip(0.5 + 2.0 * x[:, :1] / np.ptp(x[:, 0]), 0.0, 1.0)
    start = (1.0 - share) * x + share * (x @ rotation([0, 0, 1], np.radians(80.0)).T)
    held = np.abs(x[:, 0]) > 0.35 * np.ptp(x[:, 0])
    finish = partial(Finisher, mesh, held=held, constraints=[total_volume(mesh)])
    energy = CellEnergy.of(mesh)
    kept = finish(energy).run(start, start[held]).vertices
    monkeypatch.setattr("vtk_segdeform.finish.volume_band._STRENGTH", 0.0)
    lost = finish(energy).run(start, start[held]).vertices
    with_band, without = (local_volume_change(mesh, each) for each in (kept, lost))
    assert without.min() < -0.44
    assert -0.38 < with_band.min() < with_band.max() < 0.38
    assert_allclose(total_volume(mesh).relative(kept), 0.0, atol=1e-13)
