"""The guess of the up axis: models, and files of `shared/data` where it is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vtk_segdeform import models, read_mesh
from vtk_segdeform.geometry import guess_up_axis

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.mark.parametrize("enough", [500, 100_000])
@pytest.mark.parametrize("name", ["cactus", "dinosaur"])
def test_a_cactus_and_a_dinosaur_stand_on_their_feet(name, enough, monkeypatch):
    monkeypatch.setattr("vtk_segdeform.geometry.up_axis._ENOUGH", enough)
    vertices = getattr(models, name)(1000).vertices
    for scale, shift in (1.0, 0.0), (1e-7, 0.0), (1e6, 1e12):
        x = vertices * scale + shift
        assert guess_up_axis(x) == 2
        assert guess_up_axis(x[:, [1, 2, 0]]) == 1


def test_few_points_and_flat_ones_have_an_axis():
    line = np.linspace([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 5)
    for points in (line, line[:1], np.eye(3)):
        assert guess_up_axis(points) in (1, 2)


@pytest.mark.parametrize(
    ("name", "axis"),
    [("armadilloman.obj", 1), ("suzanne.obj", 1), ("dino.off", 2), ("hand.off", 2),
     ("botsch-sorkine/cactus.off", 2)],
)  # fmt: skip
def test_real_meshes_stand_upright(name, axis):
    if not (DATA / name).is_file():
        pytest.skip("needs shared/data")
    assert guess_up_axis(read_mesh(DATA / name).vertices) == axis
