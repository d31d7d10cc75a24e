"""Bound deformers of states: known or not, kept, and with volumes whatever the stiffness."""

from __future__ import annotations

import pytest
from scenes import sausage

from vtk_segdeform import Session

SCENE = sausage(is_coarse=True)
ARM = SCENE.regions.labels == 1


@pytest.fixture
def session() -> Session:
    one = Session(SCENE.mesh)
    one.set_regions(SCENE.regions)
    one.set_cages(SCENE.cages)
    return one


def test_volumes_have_names_once_cages_are_bound_and_whatever_the_stiffness(session):
    assert session.volume_names == ()
    assert session.bodies is None
    session.bind()
    names, bodies = session.volume_names, session.bodies
    assert names == session.deformer.volume_names
    session.set_part("arm", ARM)
    session.set_stiffness(1.0 + 9.0 * ARM)
    assert not session.is_bound
    assert session.volume_names == (*names, "arm")
    assert session.bodies.volumes.tolist() == bodies.volumes.tolist()
    before = session.volumes()
    assert not session.is_bound
    session.bind()
    assert session.deformer.volumes() == before


def test_binding_a_stiffness_is_told_and_the_last_ones_are_kept(session):
    told = []
    session.bind()
    for k in range(4):
        session.set_stiffness(2.0 + k + 9.0 * ARM)
        session.bind(lambda fraction, text: told.append(text))
        assert told.count("binding the stiffness") == k + 1
    for kept in (True, True, True, False):
        assert session.is_bound == kept
        session.undo()
    assert session.state.stiffness is None
    assert session.is_bound


def test_a_snapshot_knows_what_was_bound_and_changes_nothing(session):
    session.bind()
    bindings, state = session.poses.bindings, session.state
    own = bindings.snapshot()
    assert own.bind(state) is bindings.bind(state)
    session.set_stiffness(1.0 + 9.0 * ARM)
    own.bind(session.state)
    assert own.is_bound(session.state)
    assert not session.is_bound
    bindings.adopt(state, own.bound(state), own.stiffened(session.state))
    assert session.is_bound
    assert session.deformer is own.bind(session.state)
