"""Pulls: nothing moves at the press, the volume is exact in every frame, each pull is one step."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import icosphere, rotation

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.errors import CageError, ConstraintError
from vtk_segdeform.geometry.lids import lids_of
from vtk_segdeform.mesh import Mesh, SurfacePoint
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session.pulls import can_grab, grabbed
from vtk_segdeform.session.session import Session
from vtk_segdeform.session.state import State
from vtk_segdeform.session.store import load_session, save_session
from vtk_segdeform.solver.solution import Status

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(2, is_coarse=True)
MESH, X = SCENE.mesh, SCENE.mesh.vertices
D = MESH.diagonal
HIGH, LOW, TIP = (int(np.argmax(X @ way)) for way in ([0, 0, 1.0], [0.3, 0, -1.0], [1.0, 0, 0]))
NEAR = int(np.argsort(np.linalg.norm(X - X[HIGH], axis=1))[1])  # the nearest
UP = np.array([0.0, 0.0, 0.1 * D])


def ready() -> Session:
    return Session(MESH, state=State(SCENE.regions, SCENE.cages))


@functools.cache
def _pulled(vertex: int, shift: tuple[float, ...], **options) -> Session:
    session = ready()
    session.pull(vertex, X[vertex] + shift, **options)
    session.commit()
    return session


def pulled(vertex: int = HIGH, shift: np.ndarray = UP, **options) -> Session:
    """Return a session after one pull: a copy of the first one."""
    return copy.copy(_pulled(vertex, tuple(shift.tolist()), **options))


def moved(session: Session, before: np.ndarray) -> float:
    """Return how far the surface is from *before*, as a share of the diagonal."""
    return float(np.abs(session.vertices - before).max()) / D


def with_pin(session: Session) -> None:
    session.handles.pin(LOW)


def without_volume(session: Session) -> None:
    session.change_options(preserve_volume=False)


def with_fixed(session: Session) -> None:
    session.set_fixed(X[:, 0] < -2.6)


BEFORE: dict[str, Callable[[Session], object]] = {
    "nothing": lambda session: None,
    "a pull elsewhere": lambda session: session.pull(TIP, X[TIP] + UP),
    "a pull stopped early": lambda session: session.pull(TIP, X[TIP] + 3.0 * UP, max_steps=1),
    "a pin": with_pin,
    "fixed vertices": with_fixed,
    "volume preservation off": without_volume,
    "a handle": lambda session: session.handles.add(SCENE.handle),
    "a cage moved": lambda session: session.move_cage(0, SCENE.cages[0].vertices * [1, 1, 1.05]),
}


# Every state before it, the localities in turn; every pair in the campaign.
PRESSES = [(before, (None, 1.0)[(k + j) % 2]) for j in range(2) for k, before in enumerate(BEFORE)]


@pytest.mark.parametrize(
    ("before", "locality"),
    PRESSES[: len(BEFORE)]
    + [pytest.param(*each, marks=pytest.mark.campaign) for each in PRESSES[len(BEFORE) :]],
)
def test_nothing_moves_at_the_press(before, locality):
    session = pulled()
    BEFORE[before](session)
    session.commit()
    x = session.vertices
    for vertex in (LOW if before != "a pin" else NEAR, NEAR):
        session.pull(vertex, session.vertices[vertex], locality=locality, max_steps=8)
        assert moved(session, x) < 1e-12
        session.commit()


def test_vertices_fixed_after_a_pull_stay_where_they_are(tmp_path):
    session = ready()
    first = np.flatnonzero(X[:, 0] < -2.9)
    session.set_fixed(first)
    session.pull(TIP, X[TIP] + UP, locality=0.0)
    session.commit()
    x = session.vertices
    near = np.flatnonzero((X[:, 0] > 1.0) & (X[:, 0] < 1.4))
    assert np.linalg.norm(x[near] - X[near], axis=1).min() > 0.01 * D
    session.set_fixed([*near, *first])
    save_session(tmp_path / "fixed.segdeform", session)
    for each in (session, load_session(tmp_path / "fixed.segdeform")):
        each.pull(TIP, x[TIP], locality=0.0)
        assert moved(each, x) < 1e-12
        each.pull(TIP, x[TIP] - 2.0 * UP, locality=0.0)
        away = np.linalg.norm(each.vertices - x, axis=1)
        assert away[TIP] > 0.1 * D
        assert away[near].max() < 1e-3 * D
        assert np.linalg.norm(each.vertices[first] - X[first], axis=1).max() < 1e-3 * D
        assert abs(each.volume_change) < 1e-13
    session.reset_pose()
    session.pull(TIP, X[TIP] + 0.1 * UP, locality=0.0)
    assert np.linalg.norm(session.vertices[near] - X[near], axis=1).max() < 1e-3 * D


@pytest.mark.parametrize("locality", [None, 0.0, 1.0])
def test_the_grabbed_vertex_follows_and_the_volume_is_exact_in_every_frame(locality):
    session = ready()
    for k in range(1, 6):
        solution = session.pull(HIGH, X[HIGH] + k / 5 * UP, locality=locality, max_steps=8)
        assert abs(solution.volume_change) < 1e-13
    session.pull(HIGH, X[HIGH] + UP, locality=locality)
    assert np.linalg.norm(session.vertices[HIGH] - X[HIGH] - UP) < 6e-4 * D
    assert session.commit() == "drag pull 1"
    assert session.undo() == "drag pull 1"
    assert not session.history.can_undo
    assert_array_equal(session.vertices, X)


def test_a_pulled_point_nearby_is_grabbed_again_and_farther_ones_are_carried_along():
    session = pulled()
    x = session.vertices
    session.pull(NEAR, x[NEAR] + UP)
    assert list(session.handles) == ["pull 1"]
    assert_allclose(session.targets["pull 1"], x[[HIGH]] + UP, atol=1e-12)
    session.commit()
    order = np.argsort(np.linalg.norm(X - X[HIGH], axis=1))
    away = np.linalg.norm(X[order] - X[HIGH], axis=1) / (0.15 * D)
    other = int(order[np.searchsorted(away, 0.6)])
    x = session.vertices
    before = x[[HIGH]]
    session.pull(other, x[other] + UP)
    share = (session.targets["pull 1"] - before) @ UP / (UP @ UP)
    near = np.linalg.norm(X[other] - X[HIGH]) / (0.15 * D)
    assert_allclose(share, (1.0 - near**2) ** 2, rtol=1e-6)


def test_pins_stay_can_be_removed_and_three_make_the_surface_between_free():
    session = ready()
    ways = ([0.3, 0, -1.0], [1.0, 0, 0], [-1.0, 0, 0])
    free = []
    for k, way in enumerate(ways):
        assert session.handles.pin(int(np.argmax(X @ way))) == f"pin {k + 1}"
        session.pull(HIGH, X[HIGH], max_steps=1)
        free.append(np.isinf(session.state.locality.reach))
        session.revert()
    assert free == [False, False, True]  # one or two are a hinge
    for way in (UP, -UP):
        session.pull(HIGH, X[HIGH] + way)
        assert np.linalg.norm(session.vertices[LOW] - X[LOW]) < 6e-4 * D
    session.commit()
    x = session.vertices
    for k in (1, 2, 3):
        session.handles.remove(f"pin {k}")
    assert_array_equal(session.vertices, x)
    session.pull(HIGH, x[HIGH] + UP)
    assert np.isfinite(session.state.locality.reach)


def test_a_matrix_turns_the_surface_around_the_point():
    turn = np.eye(4)
    turn[:3, :3] = rotation([0.0, 0.0, 1.0], 0.5)
    turn[:3, 3] = X[HIGH] + 0.3 * UP - turn[:3, :3] @ X[HIGH]
    session = ready()
    session.pull(HIGH, X[HIGH] + 0.3 * UP, locality=1.0, max_steps=8)
    now, so_far = session.vertices, session.turned()
    session.pull(HIGH, turn, locality=1.0)  # turned in the same pull
    patch = session.handles["pull 1"]
    assert len(patch) > 5
    shape = X[HIGH] + (now[patch] - now[HIGH]) @ so_far  # that it has, where it was at the press
    assert_allclose(shape, X[patch], atol=0.02 * D)
    expected = shape @ turn[:3, :3].T + turn[:3, 3]
    assert_allclose(session.vertices[patch], expected, atol=5e-3 * D)
    assert session.commit() == "drag pull 1"
    assert session.undo() == "drag pull 1"
    assert not session.history.can_undo


def test_the_rotation_so_far_turns_nothing():
    session = ready()
    assert_array_equal(session.turned(), np.eye(3))
    tip = int(X[:, 0].argmax())
    for share in (0.25, 0.5, 0.75, 1.0):
        session.pull(tip, X[tip] + share * 0.3 * D * np.array([-0.5, 0.0, 1.0]), max_steps=8)
    session.refine()
    before, so_far = session.vertices.copy(), session.turned()
    assert (np.trace(so_far) - 1.0) / 2.0 < np.cos(0.5)
    matrix = np.eye(4)
    matrix[:3, :3] = so_far
    matrix[:3, 3] = before[tip] - so_far @ X[tip]
    session.pull(tip, matrix)
    assert np.abs(session.vertices - before).max() < 0.002 * D
    session.commit()
    assert_array_equal(session.turned(), np.eye(3))


@pytest.mark.parametrize("share", every(2, [0.7, 0.35]))
def test_a_turn_beside_an_earlier_pull_does_not_tear_the_surface(share):
    scene = sausage(2, is_coarse=share > 0.5)
    rest, unit = scene.mesh.vertices, scene.mesh.diagonal
    radius, tip = 0.3 * unit, int(rest[:, 0].argmax())
    session = Session(scene.mesh, state=State(scene.regions, scene.cages))
    session.pull(tip, rest[tip] + [0.0, 0.0, 0.2 * unit])
    session.commit()
    x = session.vertices
    vertex = int(np.abs(np.linalg.norm(rest - rest[tip], axis=1) - share * radius).argmin())

    def most_stretched():
        edges = (np.diff(each[scene.mesh.faces], axis=1) for each in (x, session.vertices))
        before, after = (np.linalg.norm(each, axis=2) for each in edges)
        return (after / before).max()

    for angle in (1.0, 2.0, 3.0):
        turn = np.eye(4)
        turn[:3, :3] = rotation([0.0, 1.0, 0.0], angle)
        turn[:3, 3] = x[vertex] - turn[:3, :3] @ x[vertex]
        session.pull(vertex, turn, radius=radius, locality=0.0, max_steps=8)
        all_turned = x @ turn[:3, :3].T + turn[:3, 3]
        assert np.abs(session.vertices - x).max() < np.abs(all_turned - x).max()
        assert most_stretched() < 1.5
        assert abs(session.volume_change) < 1e-12
    patch = session.handles["pull 2"]
    targets = session.targets
    assert_allclose(targets["pull 2"], x[patch] @ turn[:3, :3].T + turn[:3, 3], atol=1e-12)
    there = x[[tip]] @ turn[:3, :3].T + turn[:3, 3]
    if share < 0.5:  # in the patch
        assert_allclose(targets["pull 1"], there, atol=1e-12)
    else:  # beside it, with room between
        apart = np.linalg.norm(rest[patch] - rest[tip], axis=1).min()
        assert apart > 0.4 * share * radius
        way, whole = (targets["pull 1"] - x[[tip]])[0], (there - x[[tip]])[0]
        carried = way @ whole / (whole @ whole)
        assert_allclose(way, carried * whole, atol=1e-9)
        assert 0.5 < carried < 0.9
    assert session.refine().status in (Status.CONVERGED, Status.MISSED)
    assert session.solution.handle_error < 2e-3
    assert most_stretched() < 1.5  # it was 7.8


@pytest.mark.parametrize(
    ("scale", "shift"), [(1e-7, 0.0), (1e6, 0.0), (1.0, 1e6)], ids=["small", "large", "far"]
)
def test_a_pull_is_invariant_under_rigid_motion_and_scale(scale, shift):
    turn = rotation([1, 2, 3], 1.2)
    there = SCENE.transformed(turn, scale, shift=np.array([1.0, -1.0, 0.5]) * shift)
    session = Session(there.mesh, state=State(there.regions, there.cages))
    x = there.mesh.vertices
    session.pull(HIGH, x[HIGH] + scale * turn @ UP)
    expected = pulled().vertices
    error = (session.vertices - x) / scale - (expected - X) @ turn.T
    assert np.abs(error).max() < 3e-4 * D  # samples of the surface depend on its orientation
    assert abs(session.volume_change) < (1e-10 if shift else 1e-12)  # of rounded coordinates


def bodies() -> Session:
    """Return two balls in a cage each, one with a hole."""
    sphere, faces = icosphere(3)
    ball, ball_faces = icosphere(1)
    holed = faces[sphere[faces].mean(axis=1)[:, 2] > -0.9]
    used, holed = np.unique(holed, return_inverse=True)
    points = np.concatenate([sphere, sphere[used] + [3.0, 0.0, 0.0]])
    mesh = Mesh(points, np.concatenate([faces, holed.reshape(-1, 3) + len(sphere)]))
    right = points[:, 0] > 1.5
    cages = tuple(Cage(1.6 * ball + [x, 0.0, 0.0], ball_faces) for x in (0.0, 3.0))
    return Session(mesh, state=State(Regions.from_masks(mesh, [~right, right]), cages))


def test_every_body_has_its_volume_in_every_frame_also_under_a_lid():
    session = bodies()
    mesh = session.mesh
    tops = [int(np.argmax(mesh.vertices @ way)) for way in ([-0.2, 0, 1.0], [0.2, 0, 1.0])]
    right = mesh.vertices[:, 0] > 1.5
    for vertex in tops:
        other = session.vertices[right if vertex == tops[0] else ~right]
        start = session.vertices[vertex]
        for k in range(1, 4):
            session.pull(vertex, start + [0.0, 0.0, 0.2 * k], max_steps=8)
            for body in _volumes(session):
                assert abs(body.relative(session.vertices)) < 1e-12
        session.commit()
        stayed = session.vertices[right if vertex == tops[0] else ~right]
        assert np.abs(stayed - other).max() < 1e-3
    assert lids_of(mesh).has_volume


def pipe(wall: float, around: int = 40, along: int = 24) -> Mesh:
    """Return a pipe of length 4 and radius 1 with a thin *wall*, closed at its rims."""
    z = np.linspace(-2.0, 2.0, along)
    outline = np.concatenate([np.stack([0 * z + 1.0, z], 1), np.stack([0 * z + 1 - wall, -z], 1)])
    turn = 2.0 * np.pi * np.arange(around) / around
    radius, height = np.broadcast_arrays(outline[:, :1], turn), outline[:, 1:] + 0.0 * turn
    points = np.stack([radius[0] * np.cos(turn), radius[0] * np.sin(turn), height], axis=-1)
    n = len(outline)
    i, j = (each.ravel() for each in np.meshgrid(np.arange(n), np.arange(around), indexing="ij"))
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = (i + 1) % n * around + (j + 1) % around, (i + 1) % n * around + j
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh(points.reshape(-1, 3), faces)


@pytest.mark.parametrize("locality", [0.2, 1.0])
def test_the_two_sides_of_a_thin_wall_go_together(locality):
    session = Session(pipe(0.04))
    session.segment()
    session.fit_cages()
    x = session.mesh.vertices
    grabbed = int(np.argmax(x[:, 0] - 0.1 * np.abs(x[:, 2])))
    inner = int(np.argmin(np.linalg.norm(x - x[grabbed] + [0.04, 0.0, 0.0], axis=1)))
    session.pull(grabbed, x[grabbed] + [0.5, 0.0, 0.0], locality=locality)
    moved = session.vertices - x
    assert moved[inner, 0] > 0.35  # 0.001 or 0.04 if each side is held where it is
    assert np.linalg.norm(moved, axis=1).max() < 0.75


def _volumes(session: Session):
    state = session.state
    bound = Deformer(session.mesh, state.regions, state.cages, handle=state.handle)
    assert len(bound.preserved_volumes) == 2
    return bound.preserved_volumes


def test_a_preparation_is_no_step_and_is_accepted_only_by_what_it_was_made_for():
    session = Session(MESH)
    session.set_fixed(SCENE.fixed)
    session.change_options(n_cage_vertices=60)
    told = {}
    prepared = session.preparation(lambda fraction, message: told.setdefault(message, fraction))
    assert told["cages ready"] < 0.35  # measured: 17 to 50 % of the time, the less the larger
    assert session.regions is None
    assert sum(cage.n_vertices for cage in prepared.cages) == 60
    heard = []
    session.on_change(heard.append)
    assert session.accept(prepared)
    assert session.is_bound
    assert len(heard) == 1
    assert session.history.undo_label == "set fixed vertices"
    session.pull(HIGH, X[HIGH] + UP, max_steps=2)
    while session.history.can_undo:
        session.undo()
        assert session.regions is prepared.regions  # also before the first step
    assert session.accept(session.preparation())
    other = Session(MESH)
    other.set_regions(SCENE.regions)
    assert not other.accept(prepared)
    assert other.cages == ()
    elsewhere = Session(MESH.with_vertices(X * 2.0))
    assert not elsewhere.accept(prepared)


WRONG = [
    (lambda s: s.pull(-1, UP), "vertex must be a whole number"),
    (lambda s: s.pull(len(X), UP), "vertex must be a whole number"),
    (lambda s: s.pull(2.5, UP), "vertex must be a whole number"),
    (lambda s: s.pull(True, UP), "vertex must be a whole number"),
    (lambda s: s.pull(HIGH, [0.0, 1.0]), "to "),
    (lambda s: s.pull(HIGH, X[:2]), "to must be a point"),
    (lambda s: s.pull(HIGH, [np.nan, 0.0, 0.0]), "to .*NaN|to must be finite"),
    (lambda s: s.pull(HIGH, X[HIGH] + 100.0 * D), "pulled positions .to. are .* away"),
    (lambda s: s.pull(HIGH, np.full((4, 4), np.nan)), "last row of to"),
    (lambda s: s.pull(HIGH, np.diag([1.0, 1.0, 1.0, 2.0])), "last row of to"),
    (lambda s: s.pull(HIGH, np.diag([1e9, 1.0, 1.0, 1.0])), "pulled positions .to. are .* away"),
    (lambda s: s.pull(HIGH, X[HIGH], radius=0.0), "radius must be a positive number"),
    (lambda s: s.pull(HIGH, X[HIGH], radius=np.inf), "radius must be a positive number"),
    (lambda s: s.pull(HIGH, X[HIGH], radius="wide"), "radius must be a positive number"),
    (lambda s: s.pull(HIGH, X[HIGH], locality=1.1), "locality must be a number from 0 to 1"),
    (lambda s: s.pull(HIGH, X[HIGH], locality=-0.1), "locality must be a number from 0 to 1"),
    (lambda s: s.pull(int(SCENE.fixed[0]), UP), "this point is fixed"),
    (lambda s: s.handles.pin(int(SCENE.fixed[0])), "both fixed and handle"),
    (lambda s: s.handles.pin(TIP), "already in 'pull 1'"),
    (lambda s: s.handles.pin(-3), "vertex must be a whole number"),
    (lambda s: Session(MESH).pull(HIGH, X[HIGH]), "there are no cages"),
]


@functools.cache
def partly_fixed() -> Session:
    """Return a session with fixed vertices and a pull that was stopped early, to be copied."""
    session = ready()
    session.set_fixed(SCENE.fixed)
    session.pull(TIP, X[TIP] + 0.3 * UP, max_steps=2)
    session.commit()
    return session


@pytest.mark.parametrize(("wrong", "says"), WRONG)
def test_what_cannot_be_pulled_says_why_and_changes_nothing(wrong, says):
    session = copy.copy(partly_fixed())
    state = session.state
    with pytest.raises((ConstraintError, CageError), match=says):
        wrong(session)
    assert session.state is state


def test_a_pin_becomes_a_handle_that_can_rotate_and_a_pin_again():
    session = pulled()
    session.handles.pin(LOW)
    before = session.vertices
    handle = session.handles.to_patch("pin 1", radius=0.15 * D)
    other = session.handles.to_patch("pull 1")
    assert (handle, other) == ("handle 1", "handle 2") == tuple(sorted(session.handles))
    assert session.state.pulls == ()
    for name, vertex in ((handle, LOW), (other, HIGH)):
        ids = session.handles[name]
        assert vertex in ids
        assert len(ids) > 3
        assert np.linalg.norm(X[ids] - X[vertex], axis=1).max() < 0.15 * D
        assert_array_equal(session.targets[name], session.vertices[ids])
    assert_array_equal(session.vertices, before)
    session.move_handle(handle, np.diag([1.0, 1.0, 1.1, 1.0]))
    session.commit()
    assert session.handles.to_pin(handle) == "pin 1"
    assert session.handles["pin 1"].shape == (1,)
    for label in ("convert handle 1 to pin 1", "drag handle 1", "convert pull 1 to handle 2"):
        assert session.undo() == label
    assert session.undo() == "convert pin 1 to handle 1"
    assert (set(session.handles), session.state.pulls) == ({"pull 1", "pin 1"}, ("pull 1",))
    assert_array_equal(session.vertices, before)


FACE = MESH.faces[int(np.argmax(X[MESH.faces].mean(axis=1)[:, 2]))]
INSIDE = SurfacePoint.of(FACE, [0.3, 0.4, 0.3])


def test_a_pull_moves_the_grabbed_point_of_a_face_and_its_handle_stays_where_it_was_left():
    session, place = ready(), INSIDE.at(X)
    session.handles.pin(LOW)
    for share in (0.5, 1.0, 3.0):
        session.pull(INSIDE, place + share * UP)
        off = np.linalg.norm(INSIDE.at(session.vertices) - place - share * UP)
        assert off < 1e-4 * D
        assert session.solution.handle_error < 1e-4
    session.commit()
    assert list(session.handles["pull 1"]) == [INSIDE.vertex]
    assert grabbed(session.mesh, session.state, INSIDE) == "pull 1"
    before = session.vertices
    session.refine()
    assert moved(session, before) < 1e-4
    session.move_handle("pin 1", np.eye(4))
    assert np.linalg.norm(session.vertices[INSIDE.vertex] - before[INSIDE.vertex]) < 1e-3 * D
    session.revert()
    other = SurfacePoint.of(FACE, [0.6, 0.1, 0.3])
    start = other.at(session.vertices)
    for radius, names in ((0.1 * D, ["pull 1", "pull 2"]), (0.5 * D, ["pull 1"])):
        session.pull(other, start + UP, radius=radius)  # beside it, or as the same one
        assert np.linalg.norm(other.at(session.vertices) - start - UP) < 1e-4 * D
        assert list(session.handles) == ["pin 1", *names]
        session.revert()


def test_the_finish_of_a_pulled_point_of_a_face_keeps_it_at_its_target():
    session, place = ready(), INSIDE.at(X)
    session.pull(INSIDE, place + 3.0 * UP)
    session.commit()
    before = session.vertices
    session.finish()
    assert moved(session, before) > 1e-4
    assert_allclose(INSIDE.at(session.vertices), place + 3.0 * UP, atol=1e-9)
    session.revert()
    to = place + 3.0 * UP + UP[::-1]  # sideways: the face turns
    session.pull(INSIDE, to)
    assert np.linalg.norm(INSIDE.at(session.vertices) - to) < 1e-3 * D
    assert session.solution.handle_error < 1e-3


@pytest.mark.parametrize("finishes_again", [False, True])
def test_the_error_of_a_point_pulled_on_a_finished_pose_is_that_of_the_mesh(finishes_again):
    session, place = ready(), INSIDE.at(X)
    session.pull(INSIDE, place + 3.0 * UP)
    session.commit()
    session.finish()
    to = INSIDE.at(session.vertices) + UP[::-1]
    solution = session.pull(INSIDE, to)
    if finishes_again:
        session.commit()
        solution = session.finish()
    off = np.linalg.norm(INSIDE.at(session.vertices) - to) / D
    assert solution.handle_error == pytest.approx(off, rel=0.01, abs=1e-12)
    assert off < (1e-12 if finishes_again else 1e-3)


def test_a_saved_pull_of_a_point_of_a_face_is_continued(tmp_path):
    session, place = ready(), INSIDE.at(X)
    session.pull(INSIDE, place + UP)
    session.commit()
    save_session(tmp_path / "pulled.segdeform", session)
    again = load_session(tmp_path / "pulled.segdeform")
    assert again.state.locality.point == INSIDE
    again.refine()
    assert moved(again, session.vertices) < 1e-4


def test_the_limb_of_a_pull_is_saved(tmp_path):
    state = pulled().state
    assert state.locality.depth == 0.0  # a sausage has no limbs
    for depth, hinge in ((0.0, 0.0), (0.25 * D, 0.0), (0.25 * D, 0.5)):
        local = replace(state.locality, depth=depth, hinge=hinge)
        path = tmp_path / f"{depth} {hinge}.segdeform"
        save_session(path, Session(MESH, state=replace(state, locality=local)))
        again = load_session(path).state.locality
        assert (again.depth, again.hinge) == (depth, hinge)


def test_a_face_without_a_vertex_within_the_radius_is_not_grabbed():
    session = ready()
    assert can_grab(session.mesh, INSIDE)
    assert not can_grab(session.mesh, INSIDE, radius=0.001 * D)
    assert can_grab(session.mesh, HIGH, radius=0.001 * D)
    with pytest.raises(ConstraintError, match="no vertex is near this point"):
        session.pull(INSIDE, INSIDE.at(X) + UP, radius=0.001 * D)
    assert session.state.pose is None


def test_a_pulled_point_is_moved_as_any_handle_before_the_pull_is_committed():
    session, motion = ready(), np.eye(4)
    motion[:3, 3] = UP
    session.pull(HIGH, X[HIGH] + UP)
    (name,) = session.handles
    session.move_handle(name, motion)
    assert_allclose(session.targets[name], [X[HIGH] + 2.0 * UP], atol=1e-9 * D)
    session.commit()
    assert session.undo() is not None
    assert_allclose(session.targets[name], [X[HIGH] + UP], atol=1e-9 * D)
