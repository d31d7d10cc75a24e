"""The gradient by the stiffness of every vertex: central differences of the energy itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import sausage

from vtk_segdeform import sizes
from vtk_segdeform.deformer.stiffness import Stiffness
from vtk_segdeform.energy import Contraction, turning

SCENE = sausage(2, is_coarse=True)
CASES = {  # sizes, rotation clusters, and rigid vertices
    "whole": ({}, 5_000, False),
    "sampled": ({"CUBATURE_SAMPLE": 60, "CUBATURE_FACTOR": 0}, 20, False),
    "decimated": ({"DECIMATED": 100, "DECIMATED_POINTS": 80}, 40, False),
    "rigid": ({}, 5_000, True),
}


def bent(p):
    """Return *p*, of size 1, bent by about a radian from end to end."""
    angle = 1.2 * p[:, :1]
    return np.hstack([p[:, :1] * np.cos(angle), p[:, 1:2], p[:, 2:] + p[:, :1] * np.sin(angle)])


@pytest.mark.parametrize("name", CASES)
def test_it_is_the_limit_of_differences_of_the_half_gradient(name, monkeypatch, rng):
    changed, clusters, is_rigid = CASES[name]
    for size, value in changed.items():
        monkeypatch.setattr(sizes, size, value)
    x = SCENE.mesh.vertices[:, 0]
    factors = rng.uniform(0.5, 2.0, size=len(x))
    middle = np.flatnonzero(np.abs(x - np.median(x)) < 0.1 * np.ptp(x))
    stiffness = Stiffness(factors, (middle,) if is_rigid else ())
    deformer = SCENE.deformer(rotation_groups=clusters)
    problem = deformer._problem.stiffened(stiffness)
    p = bent(problem.rest_cages)
    v, z, w = rng.normal(size=(3, *p.shape))
    squares = rng.uniform(size=len(p))

    def value(of):
        energy = problem.stiffened(replace(stiffness, factors=of)).energy
        products = np.vdot(w, energy.quadratic @ z) + squares @ np.diag(energy.quadratic)
        return np.vdot(v, energy.value_and_slope(p)[1]) + products

    twists = turning(problem.energy, p, v)
    sides = np.hstack([p, z]), np.hstack([v, w])
    contraction = Contraction(*sides, squares, *twists, value(factors))
    gradient = problem.binding.by_factors(problem.inputs, contraction)
    assert gradient @ factors == pytest.approx(value(factors), rel=1e-9)  # it is homogeneous
    change = np.sign(gradient) * factors * rng.uniform(size=len(x))
    ahead, back = (value(factors + step * change) for step in (1e-4, -1e-4))
    assert gradient @ change == pytest.approx((ahead - back) / 2e-4, rel=1e-6)
