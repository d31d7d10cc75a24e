"""Sessions: undo, exact volume at every move, and notification of every listener."""

from __future__ import annotations

import copy
import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import exact_volume_change, icosphere, rotation

from vtk_segdeform import sizes
from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.errors import CageError, Cancelled, ConstraintError, RegionError, SessionError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session import preparing, solving
from vtk_segdeform.session.listeners import Change
from vtk_segdeform.session.session import Session
from vtk_segdeform.session.state import State
from vtk_segdeform.session.store import load_session, save_session
from vtk_segdeform.session.timeline import Timeline
from vtk_segdeform.solver.solution import Status
from vtk_segdeform.widgets.volume_overlay.region_volumes import RegionVolumes

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(2, is_coarse=True)
VERTICES = SCENE.mesh.vertices
X = VERTICES[:, 0]


def ready(**options) -> Session:
    """Return a session with regions, cages, fixed vertices and a handle called "tip"."""
    return SCENE.session("tip", **options)


def snapshot(session: Session) -> list[bytes]:
    """Return the visible state of a session, as bytes."""
    regions = session.regions
    seen = [b"none" if regions is None else regions.membership.tobytes()]
    seen += [cage.vertices.tobytes() + cage.faces.tobytes() for cage in session.cages]
    seen += [vertices.tobytes() for vertices in session.cage_vertices]
    seen += [session.fixed.tobytes(), session.vertices.tobytes(), repr(session.options).encode()]
    for name, ids in session.handles.items():
        seen += [name.encode(), ids.tobytes(), session.targets[name].tobytes()]
    return seen


def volume_error(session: Session) -> float:
    faces = SCENE.mesh.faces
    return abs(signed_volume(session.vertices, faces) / signed_volume(VERTICES, faces) - 1.0)


def up(z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


def one_action(session: Session, rng: np.random.Generator) -> None:
    """Perform a random action; an invalid one must change nothing."""
    some = rng.choice(len(X), 40, replace=False)
    region, subtract = int(rng.integers(3)), bool(rng.integers(2))
    free = np.setdiff1d(some, np.concatenate([session.fixed, session.state.handle]))
    handle = rng.choice([*session.handles, "nobody"])
    actions = [
        lambda: session.painting.paint(region, some, subtract=subtract),
        lambda: session.set_regions(SCENE.regions),
        lambda: session.painting.merge([0, region]),
        lambda: session.painting.split(region),
        lambda: session.set_cages(SCENE.cages),
        lambda: session.set_fixed(free),
        lambda: session.handles.add(free[:6]),
        lambda: session.handles.remove(handle),
        lambda: session.handles.rename(handle, f"called {rng.integers(1000)}"),
        lambda: session.change_options(stretch=float(rng.integers(1, 3))),
        session.reset_pose,
        *[lambda: session.move_handle(handle, up(0.4 * rng.normal()), max_steps=4)] * 5,
    ]
    before = snapshot(session)
    try:
        actions[rng.integers(len(actions))]()
    except (RegionError, CageError, ConstraintError):
        assert snapshot(session) == before
    session.commit()


@pytest.mark.parametrize("seed", every(3, [2, 0, 1]))
def test_any_sequence_of_actions_is_undone_and_redone_bit_for_bit(seed):
    rng = np.random.default_rng(seed)
    session = ready()
    for _ in range(50):
        if rng.random() < 0.3 and len(session.cages) == 0:
            session.set_regions(SCENE.regions)
            session.set_cages(SCENE.cages)
        one_action(session, rng)
    after = [snapshot(session)]
    labels = []
    while session.history.can_undo:
        labels.append(session.undo())
        after.append(snapshot(session))
    assert len(labels) > 20
    assert sum(label.startswith("drag") for label in labels) > 2
    assert session.regions is None
    for label, expected in zip(labels[::-1], after[-2::-1], strict=True):
        assert session.history.redo_label == label == session.redo()
        assert snapshot(session) == expected
    assert not session.history.can_redo
    assert session.redo() is None
    where = len(labels)
    for step in rng.integers(0, 2, 20) * 2 - 1:  # to and fro
        if 0 <= where + step <= len(labels):
            where += step
            _ = session.redo() if step > 0 else session.undo()
            assert snapshot(session) == after[::-1][where]
    assert session.history.labels == ("opened", *labels[::-1])
    for position in rng.integers(0, len(labels) + 1, 20):
        now, seen = snapshot(session), session.poses.peek(session.history.state_at(position))
        assert snapshot(session) == now
        session.history.jump(position)
        assert session.history.position == position
        assert snapshot(session) == after[::-1][position]
        assert seen is None or seen.tobytes() == session.vertices.tobytes()


def test_the_volume_is_exact_at_every_move_and_after_undo_and_redo():
    session = ready()
    for degrees in range(4, 61, 4):
        session.drag(SCENE.turned(degrees), max_steps=3)
        assert volume_error(session) < 1e-13
        assert abs(session.volume_change) < 1e-13
        session.commit()
    for _ in range(15):
        session.undo()
        assert volume_error(session) < 1e-13
    assert_array_equal(session.vertices, VERTICES)
    while session.redo():
        assert volume_error(session) < 1e-13


def test_a_drag_of_a_large_mesh_maps_it_once_a_frame_and_its_step_is_bit_for_bit(monkeypatch):
    monkeypatch.setattr(sizes, "SCALED_VOLUME", SCENE.mesh.n_vertices - 1)
    session, mapped = ready(), []
    session.bind()
    surface = Deformer.surface
    monkeypatch.setattr(Deformer, "surface", lambda *args: mapped.append(1) or surface(*args))
    for degrees in (10, 30, 60):
        solution = session.drag(SCENE.turned(degrees), max_steps=1)
        assert session.vertices is solution.vertices
        assert abs(session.volume_change) < 1e-14
    assert not mapped
    shown = session.vertices
    session.commit()
    assert_allclose(session.vertices, shown, atol=1e-13)
    assert_array_equal(Session(SCENE.mesh, state=session.state).vertices, session.vertices)
    assert session.refine(max_steps=2).steps == 2
    assert_array_equal(Session(SCENE.mesh, state=session.state).vertices, session.vertices)


def test_history_holds_no_vertices_of_the_mesh():
    session = ready()
    for k in range(5):
        session.move_handle("tip", up(0.1 * k), max_steps=2)
        session.commit()
    states = [session.state]
    while session.undo():
        states.append(session.state)
    arrays = [array for state in states if state.pose for array in state.pose.cage_vertices]
    assert arrays
    assert all(len(array) < 100 for array in arrays)
    assert len({id(state.regions) for state in states[:6]}) == 1
    assert all(state.regions is None or state.regions.mesh is SCENE.mesh for state in states)


def test_weights_of_regions_not_shown_are_let_go():
    session = ready()
    old = session.regions
    assert old.weights.shape == (2, len(X))
    session.painting.paint(0, X < 0.6)
    assert not {"weights", "border_distance"} & vars(old).keys()
    session.undo()
    assert_allclose(session.regions.weights.sum(axis=0), 1.0)


def test_history_is_bounded_and_the_oldest_steps_go_first():
    session = Session(SCENE.mesh, history=3)
    for k in range(6):
        session.set_fixed([k])
    labels = [session.undo() for _ in range(4)]
    assert labels == ["set fixed vertices"] * 3 + [None]
    assert session.fixed.tolist() == [2]
    assert session.history.labels == ("set fixed vertices",) * 4  # the oldest state has a name too
    for wrong in (-1, 4, 1.5, "1"):
        with pytest.raises(SessionError, match="position must be from 0 to 3"):
            session.history.jump(wrong)
    with pytest.raises(SessionError, match="number of steps"):
        Timeline(State(), 0)


def test_there_is_nothing_to_redo_during_a_drag_which_goes_on():
    session = ready()
    session.move_handle("tip", up(0.1), max_steps=2)
    session.commit()
    session.undo()
    assert session.history.redo_label == "drag tip"
    session.move_handle("tip", up(0.2), max_steps=2)
    dragged, labels = session.vertices, session.history.labels
    assert not session.history.can_redo
    assert session.redo() is None
    assert session.is_dragging
    assert session.vertices is dragged
    assert session.history.labels == labels
    session.commit()
    assert session.redo() is None
    assert session.vertices is dragged
    session.undo()
    assert session.vertices is session.mesh.vertices
    session.redo()
    assert session.vertices.tobytes() == dragged.tobytes()


def test_a_jump_during_a_drag_ends_it_as_one_step():
    session, heard = ready(), []
    count = len(session.history.labels)
    session.move_handle("tip", up(0.2), max_steps=2)
    dragged = session.vertices
    assert session.history.labels[count:] == ("drag tip",)
    assert session.history.position == count
    assert session.poses.peek(session.history.state_at(count)) is dragged
    assert session.poses.peek(session.history.state_at(count - 1)) is session.mesh.vertices
    session.on_change(heard.append)
    session.history.jump(count)
    assert (session.is_dragging, heard) == (False, [Change.HISTORY])
    session.move_handle("tip", up(0.3), max_steps=2)
    session.history.jump(0)
    assert session.history.labels[count:] == ("drag tip", "drag tip")
    session.history.jump(count)
    assert session.vertices.tobytes() == dragged.tobytes()


def test_a_drag_is_one_step_and_its_label_names_what_was_dragged():
    session = ready()
    session.handles.add(np.abs(X) < 0.1)
    for z in (0.1, 0.2, 0.3):
        session.move_handle("tip", up(z), max_steps=2)
        session.move_handle("handle 1", up(-z), max_steps=2)
    assert session.is_dragging
    assert session.history.undo_label == "drag tip, handle 1"
    assert session.commit() == "drag tip, handle 1"
    assert not session.is_dragging
    assert session.commit() is None
    session.move_handle("tip", up(0.2), max_steps=2)
    assert session.commit("nudge") == "nudge"
    assert [session.undo(), session.undo()] == ["nudge", "drag tip, handle 1"]
    assert_array_equal(session.vertices, VERTICES)


def test_revert_takes_a_drag_back_and_leaves_no_step():
    session = ready()
    session.move_handle("tip", up(0.3))
    session.commit()
    before, label = snapshot(session), session.history.undo_label
    session.move_handle("tip", up(0.3))
    session.refine()
    session.revert()
    session.revert()
    assert snapshot(session) == before
    assert session.history.undo_label == label
    assert not session.history.can_redo
    session.handles.add(np.abs(X) < 0.1, "middle")
    session.move_handle("middle", up(0.1), max_steps=1)
    assert session.commit() == "drag middle"


@pytest.mark.parametrize("action", ["undo", "set fixed"])
def test_another_action_commits_the_drag_in_hand_first(action):
    session = ready()
    session.move_handle("tip", up(0.3))
    dragged = snapshot(session)
    if action == "undo":
        assert session.undo() == "drag tip"
        assert_array_equal(session.vertices, VERTICES)
        assert session.redo() == "drag tip"
    else:
        session.set_fixed(X < -2.5)
        assert [session.history.undo_label, session.undo()] == ["set fixed vertices"] * 2
    assert snapshot(session) == dragged


def test_a_drag_stopped_early_is_refined_to_the_end():
    session = ready()
    for degrees in (10, 20, 25):
        session.drag(SCENE.turned(degrees), max_steps=1)
    assert session.solution.status is Status.STEP_LIMIT
    assert "refine" in session.what_next
    while session.refine(max_steps=3).status is Status.STEP_LIMIT:
        assert volume_error(session) < 1e-13
    session.commit()
    whole = ready()
    whole.drag(SCENE.turned(25))
    assert_allclose(session.vertices, whole.vertices, atol=1e-5)
    label = session.history.undo_label
    assert session.refine().status is not Status.STEP_LIMIT
    assert session.history.undo_label == label
    refined = snapshot(session)
    session.undo()
    session.redo()
    assert snapshot(session) == refined
    at_rest = ready()
    assert at_rest.refine().steps == 0
    assert at_rest.state.pose is None


def test_fixed_vertices_and_handles_change_without_moving_anything():
    session = ready()
    session.drag(SCENE.turned(30))
    session.commit()
    posed = session.vertices
    session.set_fixed(X < -2.2)
    session.handles.add(np.abs(X) < 0.1, "middle")
    session.handles.rename("tip", "end")
    assert_array_equal(session.vertices, posed)
    assert_array_equal(session.targets["middle"], posed[np.abs(X) < 0.1])
    assert_allclose(session.targets["end"], SCENE.turned(30))
    solution = session.move_handle("middle", up(1e-3))
    assert np.abs(session.vertices - posed).max() < 0.1
    assert solution.handle_error < 2e-3
    session.handles.add(np.abs(X) < 0.6, "middle")
    assert_array_equal(session.targets["middle"], session.vertices[np.abs(X) < 0.6])
    session.handles.remove("end")
    assert list(session.handles) == list(session.targets) == ["middle"]
    session.handles.remove("middle")
    assert not session.state.is_ready
    assert volume_error(session) < 1e-13


def test_binding_takes_hold_of_what_is_fixed_and_dragged_so_that_the_first_move_need_not(
    monkeypatch,
):
    holds = []
    hold = Deformer.hold

    def counted(*args, **kwargs):
        holds.append(kwargs)
        return hold(*args, **kwargs)

    monkeypatch.setattr(Deformer, "hold", counted)
    session, other = ready(), ready()
    shares: list[float] = []
    session.bind(lambda share, _: shares.append(share))
    assert len(holds) == 1
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    session.drag(SCENE.turned(20))
    assert len(holds) == 1
    other.drag(SCENE.turned(20))
    assert len(holds) == 2
    assert_array_equal(session.vertices, other.vertices)


@pytest.mark.parametrize("by_pull", [False, True])
def test_other_cages_are_carried_to_the_pose(by_pull):
    """A pull that was carried is refined about its own pose, not towards that of the whole body."""
    session = ready()
    if by_pull:
        session.set_fixed([])
        session.handles.remove(next(iter(session.handles)))
        tip = int(session.mesh.vertices[:, 0].argmax())
        session.pull(tip, session.mesh.vertices[tip] + [0.0, 0.0, 0.6])
        session.commit("pull")
    else:
        session.drag(SCENE.turned(40))
        session.commit()
    before, diagonal = session.vertices, session.mesh.diagonal
    sized = preparing.sized(session.state, 90)
    cages = preparing.fitted(session.mesh, sized)
    refitted = replace(sized, cages=cages).at_rest()
    posed = solving.carried(session.poses, refitted, session.vertices)
    session.set_cages(cages, posed=posed, n_cage_vertices=90)
    for _ in range(2):
        assert np.linalg.norm(session.vertices - before, axis=1).max() < 0.02 * diagonal
        assert abs(session.volume_change) < 1e-12
        session.refine()
    session.undo()
    assert_array_equal(session.vertices, before)


def test_options_of_fitting_need_no_new_binding_and_others_do():
    session = ready()
    session.bind()
    session.change_options(n_cage_vertices=60, offset=0.2)
    assert session.is_bound
    session.change_options(stretch=3.0)
    assert not session.is_bound
    session.change_options(stretch=1.0)
    assert session.is_bound


def test_a_region_at_rest_takes_its_handles_along_and_holds_no_vertex_later():
    session = ready()
    session.reset_region(1)
    assert session.history.undo_label == "set tip"  # at rest already
    front = int(np.abs(VERTICES - [-1.0, -0.8, 0.0]).max(axis=1).argmin())  # of the other region
    session.pull(front, VERTICES[front] + [0.0, 0.0, 0.4])
    session.commit()
    session.move_handle("tip", up(0.5), max_steps=2)
    session.reset_region(1)
    own = SCENE.regions.labels == 1
    assert session.history.labels[-2:] == ("drag tip", "reset region 2")
    assert_allclose(session.vertices[own], VERTICES[own], atol=0.02)
    assert np.abs(session.vertices[~own] - VERTICES[~own]).max() > 0.1
    for name, points in session.targets.items():
        at_rest = np.array_equal(points, VERTICES[session.handles[name]])
        assert at_rest is bool(own[session.handles[name]].all())
    assert volume_error(session) < 1e-12
    session.move_handle("tip", up(0.5))
    assert np.abs(session.vertices[own] - VERTICES[own]).max() > 0.3
    for wrong in (2, -1, 2.5, None):
        with pytest.raises(RegionError, match="must be the number of one of 2"):
            session.reset_region(wrong)


def test_settings_are_no_steps_and_stay_through_undo_and_redo():
    session = ready()
    session.move_handle("tip", up(0.2))
    session.commit()
    posed = session.vertices
    session.undo()
    heard = []
    session.on_change(heard.append)
    others = {"stretch": 3.0, "n_cage_vertices": 60, "avoid_contact": True, "lids": True}
    session.change_options(**others)
    session.change_options(**others)  # nothing new, nothing said
    session.set_stiffness(np.full(SCENE.mesh.n_vertices, 2.0))
    session.set_stiffness(np.full(SCENE.mesh.n_vertices, 2.0))
    assert heard == [Change.OPTIONS, Change.CONSTRAINTS | Change.HISTORY]
    session = ready()
    session.move_handle("tip", up(0.2))
    session.commit()
    session.undo()
    session.change_options(**others)
    assert session.redo() == "drag tip"
    assert_array_equal(session.vertices, posed)
    assert {name: getattr(session.options, name) for name in others} == others
    session.move_handle("tip", up(0.3), max_steps=1)
    session.change_options(stretch=4.0, volumes={"whole": "+1%"})
    assert session.history.labels[-2:] == ("drag tip", "change volumes")
    assert session.undo() == "change volumes"
    assert (session.options.stretch, session.options.volumes) == (4.0, ())


def test_regions_that_stay_in_their_cages_keep_them_and_others_drop_them():
    session = ready()
    heard = []
    session.on_change(heard.append)
    session.move_handle("tip", up(0.2))
    session.commit()
    session.painting.paint(0, X < 0.6)
    assert session.cages == SCENE.cages
    assert_array_equal(session.vertices, VERTICES)  # at rest
    session.painting.paint(0, X < 3.0)
    assert session.cages == ()
    assert heard[2:] == [
        Change.REGIONS | Change.POSE | Change.HISTORY,
        Change.REGIONS | Change.CAGES | Change.HISTORY,
    ]
    session.undo()
    assert session.cages == SCENE.cages
    session.painting.split(0)
    assert session.cages == ()


@pytest.mark.parametrize("work", ["segment", "fit_cages", "bind"])
def test_cancelling_leaves_everything_as_it_was(work):
    session = ready()
    session.move_handle("tip", up(0.1))
    session.commit()
    session.change_options(stretch=5.0)  # so that there is something to bind
    before, label, heard = snapshot(session), session.history.undo_label, []
    session.on_change(heard.append)
    session.handles.rename("tip", "top")
    session.undo()
    heard.clear()

    def stop(fraction, _):
        if fraction > 0.1:
            raise Cancelled("enough")

    if work == "bind":
        session = Session(SCENE.mesh, state=session.state)
    with pytest.raises(Cancelled, match="enough"):
        getattr(session, work)(progress=stop)
    assert snapshot(session) == before
    assert heard == []
    if work != "bind":
        assert session.history.undo_label == label


def test_a_cage_vertex_that_goes_out_and_back_in_one_drag_leaves_everything_where_it_was():
    session = ready()
    session.move_handle("tip", up(0.5))
    session.commit()
    before, start = session.cage_vertices, session.cage_vertices[0]
    for way in [*np.linspace(0.0, 1.0, 20), *np.linspace(1.0, 0.0, 20)]:
        moved = start.copy()
        moved[7] += way * np.array([0.3, -0.2, 0.5])
        session.move_cage(0, moved)
        assert volume_error(session) < 1e-13
        assert (np.abs(session.cage_vertices[1] - before[1]).max() > 1e-6) == (way > 0.0)
    for after, cage in zip(session.cage_vertices, before, strict=True):
        assert_allclose(after, cage, atol=1e-12)


def test_a_cage_vertex_can_be_moved_freely_and_the_volume_stays():
    session = ready()
    places = SCENE.cages[0].vertices.copy()
    places[np.argmin(places[:, 2])] -= [0.0, 0.0, 0.5]
    session.move_cage(0, places)
    assert volume_error(session) < 1e-13
    moved = np.abs(session.vertices - VERTICES).max(axis=1)
    assert moved.max() > 0.01
    assert session.commit() == "drag the cage of region 1"
    assert_array_equal(session.targets["tip"], session.vertices[SCENE.handle])
    session.undo()
    assert_array_equal(session.vertices, VERTICES)
    session.change_options(preserve_volume=False)
    session.move_cage(0, places)
    assert volume_error(session) > 1e-4
    assert_array_equal(session.cage_vertices[0], places)
    with pytest.raises(CageError, match="vertices must be 18 points; got 1"):
        session.move_cage(0, places[:1])


def test_a_cage_put_anywhere_keeps_the_volume_or_is_refused_and_nothing_flies_off():
    session, rng, refused = ready(), np.random.default_rng(0), []
    rest, diagonal = session.cage_vertices, session.mesh.diagonal
    for _ in range(60):
        region = int(rng.integers(2))
        places = rest[region].copy()
        some = rng.permutation(len(places))[: rng.integers(1, len(places))]
        places[some] += rng.normal(size=3) * diagonal * 10.0 ** rng.uniform(-1.0, 0.6)
        try:
            session.move_cage(region, places)
        except ConstraintError as error:
            refused.append(str(error))
        else:
            assert volume_error(session) < 1e-12
            assert np.ptp(session.vertices, axis=0).max() < 20.0 * diagonal
            session.commit()
            session.undo()
        assert not session.is_dragging
        assert_array_equal(session.vertices, VERTICES)
    assert 0 < len(refused) < 10
    assert all("more than 10 mesh diagonals away" in error for error in refused)


def test_what_to_do_next_is_said_at_every_stage():
    session = Session(SCENE.mesh)
    said = [session.what_next]
    for step in (
        lambda: session.set_regions(SCENE.regions),
        lambda: session.set_cages(SCENE.cages),
        lambda: session.handles.add(SCENE.handle),
        lambda: session.set_fixed(SCENE.fixed),
    ):
        assert session.state.is_ready == (len(said) > 3)
        step()
        said.append(session.what_next)
    assert [words.split()[0] for words in said] == ["create", "fit", "add", "drag", "drag"]
    assert "fixed" in said[3]


def test_listeners_hear_after_the_change_in_their_order_until_they_stop():
    session = ready()
    heard = []
    session.on_change(lambda change: heard.append(("first", change, session.fixed.tolist())))
    stop = session.on_change(lambda _: heard.append("second"))
    session.set_fixed([1])
    assert heard == [("first", Change.CONSTRAINTS | Change.HISTORY, [1]), "second"]
    stop()
    stop()
    session.set_fixed([1])  # nothing new, nothing said
    session.change_options(stretch=2.0)
    session.move_handle("tip", up(0.1), max_steps=1)
    session.commit()
    session.undo()
    assert [item[1] for item in heard[2:]] == [
        Change.OPTIONS,
        Change.POSE,
        Change.HISTORY,
        Change.POSE | Change.HISTORY,
    ]


NEAR = VERTICES[SCENE.handle]
WRONG = [
    (lambda s: s.drag({"nose": NEAR}), ConstraintError, "no handle 'nose'; the handles are 'tip'"),
    (lambda s: s.drag(NEAR[:-1]), ConstraintError, "targets of all handles must be"),
    (lambda s: s.drag(NEAR * np.nan), ConstraintError, "NaN or infinite"),
    (lambda s: s.drag(NEAR + 1e9), ConstraintError, "mesh diagonals away"),
    (lambda s: s.move_handle("tip", np.ones((4, 4))), ConstraintError, "last row"),
    (lambda s: s.move_handle("tip", up(np.inf)), ConstraintError, "NaN or infinite"),
    (lambda s: s.set_fixed(SCENE.handle), ConstraintError, "both fixed and handle"),
    (lambda s: s.handles.add(SCENE.handle[:3]), ConstraintError, "already in 'tip'"),
    (lambda s: s.handles.add([]), ConstraintError, "at least one vertex"),
    (lambda s: s.handles.add(np.abs(X) < 0.1, " "), ConstraintError, "printable"),
    (lambda s: s.handles.rename("tip", "x" * 81), ConstraintError, "80 characters"),
    (lambda s: s.handles.remove("nose"), ConstraintError, "no handle 'nose'"),
    (lambda s: s.painting.paint(0, X < -2.0, subtract=True), RegionError, "add them to another"),
    (lambda s: s.painting.paint(3, X < -2.0), RegionError, r"one of 0\.\.1"),
    (lambda s: s.painting.merge([1]), RegionError, "two or more regions"),
    (
        lambda s: s.painting.rename(2, "arm"),
        RegionError,
        "no region 2; there are 2, numbered from 0",
    ),
    (
        lambda s: s.painting.rename(0, "\u202egnp.exe"),
        RegionError,
        "printable",
    ),  # turns what follows
    (
        lambda s: s.painting.rename(0, "region 2"),
        RegionError,
        "reserved for a region of this number",
    ),
    (lambda s: s.painting.split(0, X < 9.0), RegionError, "cannot be split: all"),
    (lambda s: s.set_regions(Regions.single(Mesh(*icosphere(2)))), RegionError, "another mesh"),
    (lambda s: s.set_cages(SCENE.cages[:1]), CageError, "2 regions need as many cages; got 1"),
    (lambda s: s.set_cages([Cage(*icosphere(1))] * 2), CageError, "outside the cage"),
    (
        lambda s: s.change_options(stretch=-1.0),
        SessionError,
        "stretch must be a number of at least",
    ),
    (lambda s: s.change_options(rotation_groups=2.5), SessionError, "a whole number of at least 1"),
    (lambda s: s.change_options(preserve_volume="no"), SessionError, "True or False"),
    (lambda s: s.change_options(colour=1), SessionError, "no option colour; there are n_cage"),
    (
        lambda s: s.change_options(n_cage_vertices=9) or s.fit_cages(),
        CageError,
        "^n_cage_vertices must .* at least 8",
    ),
    (lambda s: s.drag(NEAR, max_steps=0), ValueError, "max_steps"),
]


@functools.cache
def posed() -> Session:
    """Return a session with a pose, to be copied."""
    session = ready()
    session.move_handle("tip", up(0.1), max_steps=2)
    session.commit()
    return session


@pytest.mark.parametrize(("wrong", "error", "says"), WRONG)
def test_what_cannot_be_done_says_why_and_changes_nothing(wrong, error, says):
    session = copy.copy(posed())
    before, options = snapshot(session), session.options
    with pytest.raises(error, match=says):
        wrong(session)
    if session.options == options:
        assert snapshot(session) == before
    session.move_handle("tip", up(0.1), max_steps=2)
    assert volume_error(session) < 1e-13


def test_without_cages_or_handles_or_regions_it_says_what_is_missing():
    session = Session(SCENE.mesh)
    with pytest.raises(RegionError, match="segment or paint"):
        session.fit_cages()
    with pytest.raises(CageError, match="create regions first"):
        session.set_cages(SCENE.cages)
    with pytest.raises(CageError, match="fit or set cages"):
        session.bind()
    with pytest.raises(ConstraintError, match="add a handle first"):
        session.drag(NEAR)
    session.handles.add(SCENE.handle)
    with pytest.raises(CageError, match="fit or set cages"):
        session.drag(NEAR)


def test_a_state_of_another_mesh_or_against_itself_is_refused():
    session = ready()
    session.drag(SCENE.turned(10), max_steps=1)
    with pytest.raises(RegionError, match="another mesh"):
        Session(Mesh(*icosphere(3)), state=session.state)
    state = session.state
    for bad, error in (
        (replace(state, cages=()), CageError),
        (replace(state, handles={}), ConstraintError),
        (replace(state, region_names=("arm", "arm")), RegionError),
        (replace(state, region_names=("", "", "arm")), RegionError),
        (replace(state, fixed=SCENE.handle), ConstraintError),
        (replace(state, pose=replace(state.pose, targets={"tip": NEAR[1:]})), ConstraintError),
    ):
        with pytest.raises(error):
            Session(SCENE.mesh, state=bad)


@pytest.mark.parametrize("diagonals", [0.0, 1e5])
def test_the_volume_change_is_that_of_the_vertices_after_a_drag_and_after_loading(diagonals):
    shift = diagonals * SCENE.mesh.diagonal * np.array([0.6, -0.64, 0.48])
    scene = SCENE.transformed(shift=shift)
    session = scene.session()
    solution = session.drag(scene.turned(40, about=shift))
    session.commit()
    loaded = Session(scene.mesh, state=session.state)
    assert loaded.solution is None
    for told, x in (
        (solution.volume_change, solution.vertices),
        (session.volume_change, session.vertices),
        (loaded.volume_change, loaded.vertices),
    ):
        true = exact_volume_change(scene.mesh.vertices, x, scene.mesh.faces)
        print(f"{diagonals:g} diagonals away: {told:.2e}, truly {true:.2e}")
        assert abs(told - true) < 1e-14
    shares = RegionVolumes(session).changes()
    assert shares == list(enumerate(solution.region_volume_change))
    assert_allclose(dict(RegionVolumes(loaded).changes())[0], shares[0][1], rtol=1e-12)


ODD = [
    "左腕",
    "\N{WOMAN}\N{ZERO WIDTH JOINER}\N{MICROSCOPE}",
    "ذراع",
    "a\N{COMBINING DIAERESIS}",
    "$x$ | %s <b>",
]


def test_regions_are_called_by_their_place_until_they_have_a_name():
    session = Session(SCENE.mesh)
    assert session.painting.names == ()
    session.set_regions(SCENE.regions)
    assert session.painting.names == ("region 1", "region 2")
    assert session.painting.name(2) == "region 3"  # that of one still to come
    news = []
    session.on_change(news.append)
    for name in ODD:
        session.painting.rename(1, f"  {name} ")
        assert session.painting.names == ("region 1", name)
        assert news[-1] == Change.NAMES | Change.HISTORY
    with pytest.raises(RegionError, match="already"):
        session.painting.rename(0, ODD[-1])
    session.painting.rename(1, ODD[-1])  # no other name: no step
    assert session.undo() == f"rename {ODD[-2]}"
    assert session.painting.names == ("region 1", ODD[-2])
    session.painting.rename(1, "")
    assert session.painting.names == ("region 1", "region 2")
    session.painting.rename(1, "arm")
    session.painting.rename(1, "region 2")  # what it would be called anyway is no name
    session.painting.merge([0, 1])
    assert session.painting.names == ("region 1",)


def test_a_name_goes_with_its_region_and_with_what_becomes_of_it():
    scene = sausage(4)
    session = scene.caged()
    session.painting.rename(1, "arm")
    session.painting.rename(3, "leg")
    assert len(session.cages) == 4  # a name changes nothing else
    masks = session.regions.membership
    whole = dict(zip(session.painting.names, masks, strict=True))

    def mask(name):
        return session.regions.membership[session.painting.names.index(name)]

    session.painting.split(1)
    assert session.painting.names == ("region 1", "arm", "region 3", "leg", "arm 2")
    assert_array_equal(mask("arm") | mask("arm 2"), whole["arm"])
    assert_array_equal(mask("leg"), whole["leg"])
    session.painting.split(4)
    assert session.painting.names[5] == "arm 3"
    session.painting.merge([0, 5, 4, 1])  # the first that has a name gives it
    assert session.painting.names == ("arm", "region 2", "leg")
    assert_array_equal(mask("arm"), whole["arm"] | whole["region 1"])
    session.painting.split(1)
    assert session.painting.names == ("arm", "region 2", "leg", "region 4")
    session.painting.paint(4, scene.mesh.vertices[:, 0] > 2.0)
    assert session.painting.names[2:] == ("leg", "region 4", "region 5")
    for _ in range(5):
        session.undo()
    assert session.painting.names == ("region 1", "arm", "region 3", "leg")
    session.segment(2)  # other regions
    assert session.painting.names == ("region 1", "region 2")


def test_halves_of_a_region_are_connected_overlap_and_cover_it():
    session = Session(SCENE.mesh)
    session.set_regions(Regions.single(SCENE.mesh))
    session.painting.split(0)
    session.painting.split(1, overlap=1)
    membership = session.regions.membership
    assert membership.any(axis=0).all()
    for a, b in itertools.pairwise(sorted(membership, key=lambda row: X[row].mean())):
        assert (a & b).any()
        assert X[a].mean() < X[b].mean()
    for row in membership:
        faces = SCENE.mesh.faces
        inside = faces[row[faces].all(axis=1)]
        reached = np.zeros(len(X), dtype=bool)
        reached[inside[0]] = True
        for _ in range(100):
            touched = inside[reached[inside].any(axis=1)]
            reached[touched] = True
        assert reached[row].mean() > 0.98
    session.painting.merge([2, 0, 1])
    assert session.regions.n_regions == 1
    assert session.regions.membership.all()


def test_a_pivot_moves_with_its_handle_is_undone_and_saved(tmp_path):
    session = Session(SCENE.mesh, state=State(SCENE.regions, SCENE.cages))
    name = session.handles.add(SCENE.handle)
    assert_allclose(session.handles.pivot(name), SCENE.mesh.vertices[SCENE.handle].mean(axis=0))
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = rotation([1.0, 2.0, 0.5], 0.2), [0.1, 0.2, 0.0]
    session.handles.set_pivot(name, [0.5, 0.1, 0.2])
    session.move_handle(name, turn, max_steps=2)
    there = turn[:3, :3] @ [0.5, 0.1, 0.2] + turn[:3, 3]
    assert_allclose(session.handles.pivot(name), there, atol=1e-12)
    session.handles.set_pivot(name, there + 0.1)
    assert_allclose(session.handles.pivot(name), there + 0.1, atol=1e-12)
    session.undo()
    session.handles.rename(name, "tip")
    assert_allclose(session.handles.pivot("tip"), there, atol=1e-12)
    save_session(tmp_path / "pivot.segdeform", session)
    assert_array_equal(
        load_session(tmp_path / "pivot.segdeform").handles.pivot("tip"),
        session.handles.pivot("tip"),
    )
    session.handles.set_pivot("tip", None)
    assert session.history.undo_label == "reset the pivot of tip"
    assert not session.state.pivots
    session.undo()
    session.handles.remove("tip")
    assert not session.state.pivots
    for point in ([1.0, 2.0], [np.nan, 0.0, 0.0], [1e9, 0.0, 0.0]):
        session.undo()
        with pytest.raises(ConstraintError, match="point"):
            session.handles.set_pivot(*session.handles, point)
        session.redo()
