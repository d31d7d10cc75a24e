"""The sensitivity of a solution to needle triangles and tight cages is bounded.

Energies are integrated over an intrinsic triangulation (`intrinsic`), so that even the thinnest
triangle has no more weight than a well-shaped one.
Each scene is bent by 30 degrees.  Two distances are measured: between the solutions with and
without a defect that should not matter, and between those for targets 1e-6 apart.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import zoo
from zoo_operations import bent, require_right

import vtk_segdeform as sd

pytestmark = pytest.mark.usefixtures("bound_once_in_memory")
STEP = 1e-6
LONG = pytest.mark.campaign


def solved(soup, cage, shift=0.0):
    """Return the mesh, and the solution for the body bent by 30 degrees and shifted along z."""
    mesh = sd.Mesh(*soup)
    regions, cages = sd.Regions.single(mesh), [sd.Cage(*cage)]
    deformer = sd.Deformer(mesh, regions, cages, fixed=zoo.LEFT, handle=zoo.RIGHT, tolerance=1e-9)
    targets = bent(sd.Mesh(*zoo.body()), zoo.RIGHT, 30.0)
    return mesh, deformer.solve(targets + [0.0, 0.0, shift])


@lru_cache(maxsize=1)
def reference():
    return solved(zoo.body(), zoo.ball())


def difference(one, other):
    """Return the largest distance between the 258 vertices of the body, in diagonals."""
    away = np.linalg.norm(one.vertices[:258] - other.vertices[:258], axis=1)
    return away.max() / reference()[0].diagonal


@pytest.mark.parametrize(
    "share", [pytest.param(1e-1, marks=LONG), 1e-3, pytest.param(1e-9, marks=LONG), 0.0]
)
def test_needles_of_any_width_change_the_solution_by_less_than_a_hundredth(share):
    mesh, solution = solved(zoo.split_near(share), zoo.ball())
    require_right(mesh, solution.vertices)
    assert solution.status is sd.Status.CONVERGED
    assert difference(solution, reference()[1]) < 0.01


@pytest.mark.parametrize("gap", [pytest.param(1e-3, marks=LONG), 1e-9])
def test_a_cage_almost_on_the_surface_gives_the_solution_of_one_a_hundredth_away(gap):
    near = solved(zoo.body(), zoo.moved(zoo.body(), 1.01))
    nearer = solved(zoo.body(), zoo.moved(zoo.body(), 1.0 + gap))
    require_right(nearer[0], nearer[1].vertices)
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
    ids=["regular", "needles", "cage near the surface", "cage far away", "needles in the cage"],
)
def test_a_small_change_of_the_targets_changes_the_solution_as_little(soup, cage):
    _, before = solved(soup(), cage())
    _, after = solved(soup(), cage(), shift=STEP)
    assert np.abs(after.vertices - before.vertices).max() < 2.0 * STEP
