"""A hinge: a pulled limb bends at its joint, the more so the larger it is; the volume is exact."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from solids import revolved, rotation

from vtk_segdeform import Mesh, Session, pull
from vtk_segdeform.deformer.limbs import with_hinge
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.geometry import rigid_fit


def body() -> Mesh:
    """Return a ball of radius 1 with two arms of radius .2 to z = -3 and 3."""
    angles = np.linspace(np.pi - 0.3, 0.3, 10)
    ball = np.stack([np.sin(angles), np.cos(angles)], axis=1)
    arm = np.stack([np.full(9, 0.2), np.linspace(1.1, 2.8, 9)], axis=1)
    up = np.concatenate([arm, [[0.14, 2.95], [0.0, 3.0]]])
    return Mesh(*revolved(np.concatenate([up[::-1] * [1.0, -1.0], ball, up]), 12))


BODY = body()
REST = BODY.vertices
TIP = int(REST[:, 2].argmax())
TO = [0.0, 2.0 * np.sin(0.7), 1.0 + 2.0 * np.cos(0.7)]  # by 40 degrees about the joint


@functools.cache
def club() -> Session:
    """Return a session of the body, which can be pulled."""
    session = Session(BODY)
    assert session.accept(session.preparation())
    return session


def another(session: Session) -> Session:
    """Return a session in the same state, with the same bound cages."""
    other = Session(session.mesh, state=session.state)
    other.poses.bindings.adopt(session.state, club().deformer)
    return other


@functools.cache
def bent(hinge: float) -> Session:
    """Return the session after the tip of the arm was pulled by 40 degrees about its joint."""
    session = another(club())
    session.pull(TIP, TO, limb=0, hinge=hinge)
    session.commit()
    return session


def change_of_shape(x: np.ndarray, y: np.ndarray, side: float = 1.0) -> float:
    """Return by how much an arm in the pose *y* differs from that in *x*, turned and moved."""
    arm = side * REST[:, 2] > 1.5
    turn, shift = rigid_fit(x[arm], y[arm])
    return float(np.linalg.norm(x[arm] @ turn.T + shift - y[arm], axis=1).max())


def test_the_limb_keeps_its_shape_the_more_the_larger_the_hinge():
    changes = [change_of_shape(REST, bent(hinge).vertices) for hinge in (0.0, 0.5, 1.0)]
    assert changes[0] > 0.05
    assert changes[1] < 0.3 * changes[0]
    assert changes[2] < 0.5 * changes[1]


def test_the_volume_is_exact_and_the_body_stays():
    session = bent(1.0)
    assert abs(session.volume_change) < 1e-12
    body = session.mesh.vertices[:, 2] < 0.0
    assert np.abs(session.vertices - session.mesh.vertices)[body].max() < 0.02


def test_nothing_moves_at_the_next_press_and_the_limb_keeps_the_bend_that_it_has():
    session = another(bent(0.0))
    x = session.vertices
    session.pull(TIP, x[TIP], limb=0, hinge=1.0)
    assert np.abs(session.vertices - x).max() < 1e-9
    for k in (1.0, 2.0, 3.0):
        session.pull(TIP, x[TIP] + k * np.array([0.4, 0.0, -0.05]), limb=0, hinge=1.0)
    assert change_of_shape(REST, x) > 0.05
    assert change_of_shape(x, session.vertices) < 0.01


def test_turning_the_limb_as_a_whole_costs_nothing():
    deformer = club().deformer
    energy, p = deformer._problem.energy, deformer._problem.rest_cages
    rows = deformer.subspace.at(np.arange(40))
    costs = []
    value = lambda energy, p: energy.value_and_slope(p)[0]  # noqa: E731
    for hinge in (0.5, 1.0):
        other = with_hinge(energy, rows, np.arange(1.0, 41.0), p=p, hinge=hinge)
        moved = p @ rotation([1.0, 2.0, 3.0], 1.0).T + 0.3
        for each in (p, moved):
            assert value(other, each) == pytest.approx(value(energy, each), abs=1e-9)
        stretched = p * [1.0, 1.0, 1.1]
        costs.append(value(other, stretched) - value(energy, stretched))
    assert costs[1] == pytest.approx(8.0 * costs[0])
    assert costs[0] > 0.0


def test_the_mirrored_limb_has_a_hinge_too():
    changes = []
    for hinge in (0.0, 1.0):
        session = another(club())
        session.change_options(symmetry="z")
        session.pull(TIP, TO, limb=0, hinge=hinge)
        arms = [change_of_shape(REST, session.vertices, side) for side in (1.0, -1.0)]
        assert arms[1] == pytest.approx(arms[0], rel=0.1, abs=2e-3)
        changes.append(arms[0])
    assert changes[1] < 0.2 * changes[0]


@pytest.mark.parametrize("hinge", [-0.1, 1.1, None])
def test_a_hinge_is_from_0_to_1(hinge):
    with pytest.raises(ConstraintError, match="hinge must be a number from 0 to 1"):
        pull(club().mesh, 0, [0.0, 0.0, 4.0], hinge=hinge)


def test_one_call_pulls_the_limb_of_a_number_at_its_hinge():
    mesh, given = club().mesh, {"n_regions": 3, "n_cage_vertices": 90}
    solution = pull(mesh, TIP, TO, locality=0.0, limb=0, hinge=1.0, **given)
    assert change_of_shape(REST, solution.vertices) < 0.02
    body = REST[:, 2] < 0.0
    assert np.abs(solution.vertices - REST)[body].max() < 0.02  # without a limb, all is free
