"""What needles, creases of numbers and tight cages do to an answer: bounded, and by how much.

Energies are measured on an intrinsic triangulation (`intrinsic`), so that even the thinnest
triangle has no more weight than a well-shaped one.
Each scene is bent by 30 degrees.  Two numbers are measured: how far the answer moves when a scene
is made bad in a way that should not matter, and how far when targets move by a millionth.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import zoo
from zoo_operations import bent, require_right

import vtk_segdeform as sd

STEP = 1e-6
LONG = pytest.mark.campaign


def answer(soup, cage, shift=0.0):
    """Return the mesh, and the solution of the body's bend by 30 degrees, shifted along z."""
    mesh = sd.Mesh(*soup)
    regions, cages = sd.Regions.single(mesh), [sd.Cage(*cage)]
    deformer = sd.Deformer(mesh, regions, cages, fixed=zoo.LEFT, handle=zoo.RIGHT, tolerance=1e-9)
    targets = bent(sd.Mesh(*zoo.body()), zoo.RIGHT, 30.0)
    return mesh, deformer.solve(targets + [0.0, 0.0, shift])


@lru_cache(maxsize=1)
def good():
    return answer(zoo.body(), zoo.ball())


def difference(one, other):
    """Return the greatest distance between the body's own 258 vertices, in diagonals."""
    away = np.linalg.norm(one.vertices[:258] - other.vertices[:258], axis=1)
    return away.max() / good()[0].diagonal


@pytest.mark.parametrize(
    "share", [pytest.param(1e-1, marks=LONG), 1e-3, pytest.param(1e-9, marks=LONG), 0.0]
)
def test_needles_move_the_answer_by_less_than_a_hundredth_however_thin(share):
    mesh, solution = answer(zoo.split_near(share), zoo.ball())
    require_right(mesh, solution.vertices)
    assert solution.status is sd.Status.CONVERGED
    assert difference(solution, good()[1]) < 0.01


@pytest.mark.parametrize("gap", [pytest.param(1e-3, marks=LONG), 1e-9])
def test_a_cage_almost_on_the_skin_is_as_good_as_one_a_hundredth_away(gap):
    near = answer(zoo.body(), zoo.moved(zoo.body(), 1.01))
    nearer = answer(zoo.body(), zoo.moved(zoo.body(), 1.0 + gap))
    require_right(*[nearer[0], nearer[1].vertices])
    assert difference(near[1], nearer[1]) < 1e-3


@pytest.mark.parametrize(
    ("soup", "cage"),
    [
        (zoo.body, zoo.ball),
        (lambda: zoo.split_near(1e-9), zoo.ball),
        pytest.param(zoo.body, lambda: zoo.moved(zoo.body(), 1.0 + 1e-6), marks=LONG),
        (zoo.body, lambda: zoo.ball(10.0)),
        pytest.param(
            zoo.body, lambda: zoo.moved(zoo.split_near(1e-6), [1.25, 1.45, 1.45]), marks=LONG
        ),
    ],
    ids=["good", "needles", "cage on the skin", "cage far away", "needles in the cage"],
)
def test_a_small_change_of_targets_makes_no_larger_change_of_the_answer(soup, cage):
    _, before = answer(soup(), cage())
    _, after = answer(soup(), cage(), shift=STEP)
    assert np.abs(after.vertices - before.vertices).max() < 2.0 * STEP
