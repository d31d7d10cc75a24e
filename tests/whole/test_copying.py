"""Copies and pickles are bit-identical to the original, and independent of it."""

from __future__ import annotations

import copy
import pickle
from dataclasses import fields

import numpy as np
import public_calls
import pytest
from numpy.testing import assert_array_equal
from scenes import sausage
from shared_arrays import CLASSES, writable_shared_arrays

import vtk_segdeform as sd
from vtk_segdeform import Session
from vtk_segdeform.freezing import stored_whole, without_zeros
from vtk_segdeform.session.state import Pose, State

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage()


def pickled(thing):
    """Return *thing* after pickling and unpickling."""
    return pickle.loads(pickle.dumps(thing))


WAYS = [copy.copy, copy.deepcopy, pickled]


def working_session() -> Session:
    """Return a session with an ongoing drag, a step to undo and one to redo."""
    session = SCENE.caged()
    session.painting.rename(0, "trunk")
    session.set_fixed(SCENE.fixed)
    session.handles.add(SCENE.handle)
    session.drag(SCENE.turned(10), max_steps=2)
    session.commit()
    session.change_options(stretch=5.0)
    session.undo()
    session.drag(SCENE.turned(20), max_steps=2)
    return session


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_the_arrays_of_a_copy_are_read_only_as_well(cls, way):
    assert writable_shared_arrays(way(public_calls.instance(cls))) == []


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_pickled_matrix_has_the_same_bits_in_the_same_order_without_its_zeros(order):
    matrix = np.zeros((90, 50), order=order)
    matrix[3, 4:], matrix[5:9, 2] = np.random.default_rng(0).normal(size=46), [-0.0, np.nan, 1, 2]
    stored = without_zeros(matrix)
    again = stored_whole(stored)
    assert len(pickle.dumps(stored)) < 0.1 * matrix.nbytes
    assert again.strides == matrix.strides
    assert_array_equal(again.view(np.uint64), matrix.view(np.uint64))
    bools = np.asarray(matrix > 0.5, order=order)
    again = stored_whole(without_zeros(bools))
    assert (again.dtype, again.strides) == (bools.dtype, bools.strides)
    assert_array_equal(again, bools)
    points = np.zeros((9, 3))
    assert stored_whole(without_zeros(points)) is points


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_copies_of_a_mesh_regions_and_cages_are_equal_and_have_no_caches(way):
    mesh = sd.models.sphere(500)
    regions = sd.Regions.single(mesh)
    cage = public_calls.cages()[0]
    for thing, name in ((mesh, "vertices"), (mesh, "faces"), (regions, "membership"),
                        (cage, "vertices"), (cage, "faces")):  # fmt: skip
        assert_array_equal(getattr(way(thing), name), getattr(thing, name))
    before = [len(pickle.dumps(thing)) for thing in (mesh, regions)]
    cached = mesh.edges, mesh.adjacency, mesh.components, mesh.face_areas, mesh.diagonal
    assert len(cached) == 5
    assert_array_equal(way(regions).weights, regions.weights)
    assert [len(pickle.dumps(thing)) for thing in (mesh, regions)] == before
    assert set(vars(way(mesh))) == {each.name for each in fields(mesh)}


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_copied_session_has_the_drag_the_names_and_the_history(way):
    session = working_session()
    other = way(session)
    assert other.is_dragging
    assert other.painting.names == ("trunk", "region 2")
    assert_array_equal(other.vertices, session.vertices)
    for one in (session, other):
        one.poses.memo.drop("path")
    again = [one.refine().vertices for one in (session, other)]
    assert_array_equal(*again)
    labels = [[one.undo() for _ in range(7)] for one in (session, other)]
    assert labels[0] == labels[1]
    assert [one.redo() for one in (session, other)] == ["set regions"] * 2
    while session.redo():
        other.redo()
        assert_array_equal(other.vertices, session.vertices)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_copied_session_is_independent_and_has_no_listeners(way):
    session = working_session()
    heard: list[sd.Change] = []
    session.on_change(heard.append)
    other = way(session)
    before, label = session.state, session.history.undo_label
    other.undo()
    other.set_fixed([])
    other.handles.remove("handle 1")
    assert heard == []
    assert session.state is before
    assert (session.history.undo_label, session.history.redo_label) == (label, None)
    session.revert()
    assert heard
    assert other.history.undo_label == "remove handle 1"


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_copied_solution_has_the_same_values_and_no_deformer(way):
    solution = SCENE.held().solve(SCENE.turned(15))
    other = way(solution)
    assert_array_equal(other.vertices, solution.vertices)
    for name in ("handle_error", "fixed_error", "volume_change", "steps", "status", "merits"):
        assert getattr(other, name) == getattr(solution, name)
    assert_array_equal(other.region_volume_change, solution.region_volume_change)
    # Its vertices, those at rest, and the faces, for `crossings`; no rows of W~.
    assert len(pickle.dumps(solution)) < 5 * solution.vertices.nbytes


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_state_is_copied_with_its_pose_and_fits_another_session(way):
    session = working_session()
    state = way(session.state)
    assert isinstance(state, State)
    assert isinstance(state.pose, Pose)
    assert_array_equal(Session(SCENE.mesh, state=state).vertices, session.vertices)
    with pytest.raises(TypeError):
        state.handles["x"] = state.fixed
    assert way(session.options) == session.options
