"""Poses finished on the mesh: the next drag continues from them, and every copy is the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_array_equal
from scenes import Scene, sausage
from sheets import plate
from solids import rotation

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.errors import CageError, Cancelled, ConstraintError, SessionError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session import finishing
from vtk_segdeform.session.poses import Aim
from vtk_segdeform.session.session import Session
from vtk_segdeform.session.state import checked_state
from vtk_segdeform.session.store import load_session, save_session

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(2, is_coarse=True)


def turned(angle: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation([0.0, 1.0, 0.0], angle)
    return matrix


def volume_of(mesh: Mesh, vertices: np.ndarray | None = None) -> float:
    """Return the volume of the first part, which is the one that moves."""
    faces = mesh.faces[mesh.faces.max(axis=1) < SCENE.mesh.n_vertices]
    return signed_volume(mesh.vertices if vertices is None else vertices, faces)


def ready(scene: Scene = SCENE) -> Session:
    """Return a session with fixed vertices and a handle called "tip"."""
    return scene.session("tip")


def dragged(session: Session, angle: float = -0.9) -> Session:
    session.move_handle("tip", turned(angle))
    session.commit()
    return session


def two_parts() -> Session:
    """Return a session of two bodies in one cage each, of which one is bent."""
    one = SCENE.mesh
    far = np.array([0.0, 3.0 * one.diagonal, 0.0])
    mesh = Mesh(
        np.concatenate([one.vertices, one.vertices + far]),
        np.concatenate([one.faces, one.faces + one.n_vertices]),
    )
    session = Session(mesh)
    membership = np.zeros((2, mesh.n_vertices), dtype=bool)
    membership[0, : one.n_vertices] = membership[1, one.n_vertices :] = True
    session.set_regions(Regions(mesh, membership))
    (cage,) = fit_cages(one, Regions.single(one), 60)
    session.set_cages([cage, Cage(cage.vertices + far, cage.faces)])
    session.set_fixed(SCENE.fixed)
    session.handles.add(SCENE.handle, "tip")
    return session


def open_sheet() -> Session:
    mesh = Mesh(*plate(14, 10))
    session = Session(mesh)
    session.set_regions(Regions.single(mesh))
    session.change_options(n_cage_vertices=40)
    session.fit_cages()
    x = mesh.vertices[:, 0]
    session.set_fixed(x <= np.quantile(x, 0.1))
    session.handles.add(x >= np.quantile(x, 0.9), "tip")
    return session


@pytest.mark.parametrize("make", every(2, [ready, two_parts, open_sheet]))
def test_a_drag_goes_on_from_a_finished_pose_without_a_jump(make):
    session = dragged(make(), -0.6)
    other = dragged(make(), -0.6)
    before, steps = session.vertices, len(session.history.labels)
    solution = session.finish()
    finished = session.vertices
    assert np.abs(finished - before).max() > 1e-4 * session.mesh.diagonal
    assert len(session.history.labels) == steps
    assert solution.handle_error < 1e-12
    assert solution.fixed_error < 1e-12
    session.drag(session.targets)
    assert_array_equal(session.vertices, finished)
    for angle in (1e-5, 0.2):
        session.move_handle("tip", turned(-angle))
        other.move_handle("tip", turned(-angle))
        assert np.abs(session.vertices - finished).max() < 3.0 * angle * session.mesh.diagonal
        if session.has_volume:
            change = volume_of(session.mesh, session.vertices) / volume_of(session.mesh) - 1.0
            assert abs(change) < 1e-12
        assert_array_equal(session.cage_vertices[0], other.cage_vertices[0])


def test_every_copy_and_step_has_the_same_finished_pose(tmp_path):
    session = ready()
    dragged(session).finish()
    first = session.vertices
    dragged(session, -0.2)
    second = session.vertices  # not finished itself
    session.undo()
    assert_array_equal(session.vertices, first)
    session.undo()
    assert session.state.pose is None
    session.history.jump(len(session.history.labels) - 1)
    assert_array_equal(session.vertices, second)
    assert_array_equal(
        session.poses.peek(session.history.state_at(session.history.position - 1)),
        first,
    )
    save_session(tmp_path / "posed", session)
    loaded = load_session(tmp_path / "posed")
    assert_array_equal(loaded.vertices, second)
    for each in (session, loaded):
        each.poses.memo.drop("path")
        each.drag(each.targets)
        each.commit()
        each.finish()
    assert_array_equal(loaded.vertices, session.vertices)


def test_what_is_fixed_or_grabbed_after_a_finish_stays_where_it_is():
    session = ready()
    dragged(session).finish()
    finished, unit = session.vertices, session.mesh.diagonal
    free = np.setdiff1d(np.arange(len(finished)), [*session.fixed, *session.state.handle])
    away = np.abs(finished - SCENE.mesh.vertices).sum(axis=1)
    middle = free[np.argsort(away[free])][len(free) // 2 :][:20]
    session.set_fixed(np.concatenate([session.fixed, middle[:10]]))
    session.handles.add(middle[10:], "belly")
    solution = session.drag(session.targets)
    assert np.abs(session.vertices - finished).max() < 1e-3 * unit
    assert max(solution.handle_error, solution.fixed_error) < 5e-4
    session.commit()
    session.finish()
    places = session.state.fixed_at
    assert places is not None
    assert np.abs(session.vertices[session.fixed] - places).max() < 1e-12
    finished = session.vertices
    session.drag(session.targets)
    assert np.abs(session.vertices - finished).max() < 1e-3 * unit
    session.commit()
    vertex = int(free[3])
    before = session.vertices
    session.pull(vertex, before[vertex])
    assert np.abs(session.vertices - before).max() < 1e-9 * unit


def test_a_finish_that_is_cancelled_or_late_changes_nothing():
    session = dragged(ready())
    before = session.state

    def cancel(*_: object) -> None:
        raise Cancelled("Cancelled")

    with pytest.raises(Cancelled):
        session.finish(progress=cancel)
    assert session.state is before
    late = finishing.finish(session.poses, session.state)()
    dragged(session, -0.1)
    now = session.state
    assert not session.accept_finish(late)
    assert session.state is now


def test_what_cannot_be_finished_is_told():
    session = ready()
    with pytest.raises(SessionError, match="no pose"):
        session.finish()
    session.handles.remove("tip")
    session.set_fixed([])
    session.move_cage(0, 1.01 * session.cage_vertices[0])
    with pytest.raises(SessionError, match="add a handle"):
        session.finish()
    assert not session.can_finish


def rotated(session: Session, turn: np.ndarray) -> np.ndarray:
    """Rotate all handles, and return how far each vertex is from the rotated pose."""
    before, unit = session.vertices, session.mesh.diagonal
    solution = session.drag({name: at @ turn.T for name, at in session.targets.items()})
    session.commit()
    assert solution.handle_error < 1e-4
    return np.abs(session.vertices - before @ turn.T).max() / unit


def test_a_finished_pose_rotates_with_its_handles():
    scene = sausage(2)  # the cages of a coarse one meet their places less accurately
    session = ready(scene)
    session.set_fixed([])
    session.handles.add(scene.fixed, "base")
    dragged(session).finish()
    plain = session.vertices
    assert rotated(session, rotation([1.0, 2.0, 3.0], 2.0)) < 1e-4
    assert session.can_finish
    session.undo()
    assert_array_equal(session.vertices, plain)
    assert not session.can_finish
    # A handle made in a finished pose is where the cages do not put it.
    away = np.abs(plain - scene.mesh.vertices).sum(axis=1)
    away[session.state.handle] = 0.0
    session.handles.add(np.argsort(away)[-6:], "more")
    assert rotated(session, rotation([0.0, 1.0, 0.0], 1.0)) < 1e-3
    session.finish()
    assert session.solution is not None
    assert session.solution.handle_error < 1e-12
    # The cages meet the places of a few single vertices less accurately.
    assert rotated(session, rotation([0.0, 0.0, 1.0], 1.0)) < 1e-3


def test_a_finish_fades_as_the_pose_is_bent_back_and_comes_again():
    """It belongs to one way of bending, and would bend the surface the other way."""
    session, plain = dragged(ready(), -0.9), dragged(ready(), -0.9)
    session.finish()

    def difference(angle: float) -> float:
        for each in (session, plain):
            each.drag({"tip": SCENE.mesh.vertices[SCENE.handle] @ turned(angle)[:3, :3].T})
        assert_array_equal(session.cage_vertices[0], plain.cage_vertices[0])
        assert abs(volume_of(session.mesh, session.vertices) / volume_of(session.mesh) - 1) < 1e-12
        return float(np.linalg.norm(session.vertices - plain.vertices))

    there, half, back, other, again = (difference(a) for a in (-0.9, -0.45, 0.0, 0.9, -0.9))
    assert 0.3 * there < half < 0.7 * there
    assert back < 0.05 * there
    assert other < 0.05 * there  # the places of fixed vertices, which the cages miss by a little
    assert abs(again - there) < 0.01 * there
    assert difference(-1.1) > 0.9 * there


@pytest.mark.parametrize(("growth", "left"), [(-0.3, 0.01), (-1.0, 0.01), (-1.5, 0.1)])
def test_offsets_that_turn_with_their_pose_come_to_rest(growth, left):
    wanted, shift = np.zeros((1, 3)), np.ones((1, 3))
    aim = Aim(wanted, shift)
    for _ in range(20):
        before, aim = aim, aim.turned(wanted, growth * aim.shift)
    assert aim is before
    assert np.abs(aim.shift).max() < left
    assert aim.turned(wanted + 1.0, shift).shift is shift


def test_a_finished_pose_that_does_not_fit_is_refused():
    session = dragged(ready())
    session.finish()
    state = session.state
    assert state.pose is not None
    assert state.pose.finished is not None
    for part in ("vertices", "held", "shifts", "cage_vertices", "offset"):
        short = replace(state.pose.finished, **{part: getattr(state.pose.finished, part)[1:]})
        with pytest.raises((CageError, ConstraintError)):
            checked_state(session.mesh, replace(state, pose=replace(state.pose, finished=short)))


@pytest.mark.parametrize("free", [0, 1])
def test_a_finished_pose_of_which_hardly_a_vertex_is_free_keeps_its_volume(free):
    session = dragged(ready())
    session.finish()
    held = np.concatenate([session.fixed, session.handles["tip"]])
    rest = np.setdiff1d(np.arange(session.mesh.n_vertices), held)
    name = session.handles.add(rest[free:])
    before = session.vertices
    session.move_handle(name, turned(0.2))
    assert session.state.pose.finished is not None
    assert abs(session.volume_change) < 1e-12
    moved = np.linalg.norm(session.vertices - before, axis=1).max()
    assert moved < 0.3 * SCENE.mesh.diagonal
