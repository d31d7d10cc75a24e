"""The guess of the up axis: models, and files of `shared/data` where it is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vtk_segdeform import models, read_mesh
from vtk_segdeform.geometry import guess_up_axis

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.mark.parametrize("name", ["cactus", "dinosaur"])
def test_a_cactus_and_a_dinosaur_stand_on_their_feet(name):
    vertices = getattr(models, name)(1000).vertices
    for scale, shift in (1.0, 0.0), (1e-7, 0.0), (1e6, 1e12):
        x = vertices * scale + shift
        assert guess_up_axis(x).axis == 2
        assert guess_up_axis(x[:, [1, 2, 0]]).axis == 1


def pyramid(base, top, height, n=12):
    """Return the points of a frustum that stands along z on the larger of two squares."""
    s = np.linspace(0.0, 1.0, n)
    size = base + (top - base) * s[:, None, None]
    corners = np.array([[-1.0, -1], [-1, 1], [1, -1], [1, 1]])
    xy = size * corners
    return np.concatenate([xy, np.broadcast_to(height * s[:, None, None], (n, 4, 1))], axis=2)


@pytest.mark.parametrize("turn", [False, True])
def test_a_body_stands_on_its_larger_end_or_else_along_its_longer_side(turn):
    def guess(points):
        points = points.reshape(-1, 3)
        return guess_up_axis(points[:, [1, 2, 0]] if turn else points).axis

    up, other = (1, 2) if turn else (2, 1)
    assert guess(pyramid(1.0, 0.5, 2.0)) == up
    assert guess(pyramid(1.0, 0.9, 2.0)) == up
    uneven = pyramid(1.0, 0.5, 2.0)
    uneven[..., 1] += 0.4 * uneven[..., 2] ** 2  # no mirror image in y
    upside_down = [1.0, 1.0, 0.0] - uneven
    assert guess(uneven) == up
    assert guess(upside_down) == other
    grounded = upside_down - upside_down.min(axis=(0, 1)) * [0.0, 0.0, 1.0]
    for gap in (0.0, 0.008, -0.008):  # of a height of 2; the end of a remeshed surface
        assert guess(grounded + [0.0, 0.0, gap]) == up
    assert guess(pyramid(1.0, 0.5, 2.0) * [1.0, 1.0, -1.0]) == up  # left and right are alike
    bar = pyramid(1.0, 1.0, 5.0)
    assert guess(bar) == up
    assert guess(bar[..., [0, 2, 1]]) == other
    for scale in (1e-3, 50.0):
        assert guess(scale * pyramid(1.0, 0.9, 2.0)) == up


def test_it_is_sure_of_the_ground_and_of_mirror_images_only():
    uneven = pyramid(1.0, 0.5, 2.0).reshape(-1, 3) - [0.0, 0.0, 1.0]
    assert guess_up_axis(uneven) == (2, True)  # left and right are alike
    uneven[:, 1] += 0.4 * uneven[:, 2] ** 2
    assert guess_up_axis(uneven) == (2, False)
    assert guess_up_axis(uneven + [0.0, 0.0, 1.0]) == (2, True)
    assert guess_up_axis(pyramid(1.0, 1.0, 5.0).reshape(-1, 3) - [0.0, 0.0, 2.5]) == (2, False)


def test_few_points_and_flat_ones_have_an_axis():
    line = np.linspace([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 5)
    for points in (line, line[:1], np.eye(3)):
        assert guess_up_axis(points).axis in (1, 2)
    assert guess_up_axis(line) == (1, False)
    assert guess_up_axis(line[:, [0, 2, 1]]) == (2, False)


@pytest.mark.parametrize(
    ("name", "axis"),
    [("armadilloman.obj", 1), ("suzanne.obj", 1), ("dino.off", 2), ("hand.off", 2),
     ("botsch-sorkine/cactus.off", 2)],
)  # fmt: skip
def test_real_meshes_stand_upright(name, axis):
    if not (DATA / name).is_file():
        pytest.skip("needs shared/data")
    assert guess_up_axis(read_mesh(DATA / name).vertices).axis == axis
