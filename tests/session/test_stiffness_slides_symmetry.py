"""Stiffness, slides and symmetry in sessions: undo, redo, files, drags and pulls."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
from limbed import torso
from numpy.testing import assert_allclose, assert_array_equal

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.deformer import Mirror, Stiffness
from vtk_segdeform.errors import ConstraintError, SessionError
from vtk_segdeform.geometry import rigid_fit

BODY = torso(3)
X, SIZE = BODY.vertices, BODY.diagonal
FOOT = np.flatnonzero((X[:, 2] < -1.3) & (X[:, 0] < 0.0))
STIFFNESS = np.where((X[:, 0] > 0.8) & (X[:, 0] < 1.4), np.inf, 1.0)
MIRROR = Mirror.of(BODY, "x")
pytestmark = pytest.mark.usefixtures("bound_once")


def session() -> sd.Session:
    """Return a session with a rigid forearm, a sliding foot and symmetry, not yet posed."""
    found = sd.Session(BODY)
    found.segment(1)
    found.change_options(n_cage_vertices=80)
    found.fit_cages()
    found.change_options(symmetry="x")
    found.set_stiffness(STIFFNESS)
    found.set_slides([sd.Slide(FOOT, "plane", (0.0, 0.0, 1.0))])
    found.handles.add(np.flatnonzero(X[:, 0] > 1.6), "hand")
    return found


def require_kept(posed: sd.Session) -> None:
    """Assert that a finished pose is mirrored, rigid where it should be, and on its plate."""
    u = posed.vertices - X
    assert np.abs(u - MIRROR.mirrored(u)).max() < 1e-9 * SIZE
    parts = Stiffness.of(BODY, STIFFNESS, MIRROR).rigid
    assert len(parts) == 2
    for ids in parts:
        turn, shift = rigid_fit(X[ids], posed.vertices[ids])
        assert np.abs(X[ids] @ turn.T + shift - posed.vertices[ids]).max() < 1e-9 * SIZE
    feet = np.concatenate([FOOT, MIRROR.mates[FOOT]])
    assert np.abs(u[feet, 2]).max() < 1e-9 * SIZE
    assert abs(posed.volume_change) < 1e-12


def dragged(posed: sd.Session, by=(-0.2, 0.1, 0.5)) -> None:
    motion = np.eye(4)
    for share in (0.5, 1.0):
        motion[:3, 3] = share * np.array(by)
        posed.move_handle("hand", motion, max_steps=8)
    posed.commit()
    posed.refine()
    posed.finish()


def test_drags_and_pulls_keep_all_of_them():
    posed = session()
    dragged(posed)
    require_kept(posed)
    head = int(X[:, 2].argmax())
    to = posed.vertices[head] + [0.2, 0.2, 0.1]
    posed.pull(head, to)
    posed.commit()
    posed.refine()
    posed.finish()
    require_kept(posed)
    assert_allclose(posed.vertices[head, 1:], to[1:], atol=1e-12)


def test_they_are_undone_redone_saved_and_loaded_to_the_bit(tmp_path):
    posed = session()
    dragged(posed)
    before, path = posed.vertices.copy(), tmp_path / "s.segdeform"
    sd.save_session(path, posed)
    labels = []
    while label := posed.undo():
        labels.append(label)
    assert {"set stiffness", "set slides", "change symmetry"} <= set(labels)
    assert posed.state.stiffness is None
    assert posed.state.slides == ()
    assert posed.options.symmetry is None
    while posed.redo():
        pass
    assert_array_equal(posed.vertices, before)
    loaded = sd.load_session(path)
    assert_array_equal(loaded.vertices, before)
    assert_array_equal(loaded.state.stiffness, STIFFNESS)
    (slide,) = loaded.state.slides
    assert_array_equal(slide.vertices, FOOT)
    assert (slide.along, tuple(slide.direction)) == ("plane", (0.0, 0.0, 1.0))
    assert loaded.options.symmetry == "x"
    for each in (posed, loaded):
        dragged(each, (-0.1, 0.2, 0.1))
        require_kept(each)
    # What the solver has learned on its way is not in the file.
    assert_allclose(loaded.vertices, posed.vertices, atol=1e-5 * SIZE)


def test_a_change_applies_to_the_pose_when_it_is_refined():
    posed = session()
    dragged(posed)
    before = posed.vertices.copy()
    posed.set_stiffness(None)
    assert_array_equal(posed.vertices, before)
    posed.refine()
    assert np.abs(posed.vertices - before).max() > 1e-3
    posed.undo()
    assert_array_equal(posed.vertices, before)


def test_a_pose_keeps_the_rigid_parts_of_its_solve(tmp_path):
    posed = session()
    posed.set_stiffness(None)
    posed.move_handle("hand", moved(), max_steps=8)
    posed.commit()
    before, points = posed.vertices.copy(), 0.9 * X
    carried = posed.poses.carry(posed.state, points)
    posed.set_stiffness(STIFFNESS)
    path = tmp_path / "posed.segdeform"
    sd.save_session(path, posed)
    loaded = sd.load_session(path)
    for each in (posed, loaded):
        assert_array_equal(each.vertices, before)
        assert_array_equal(each.poses.carry(each.state, points), carried)
    posed.refine()
    solved = posed.vertices.copy()
    assert np.abs(solved - before).max() > 1e-3 * SIZE
    posed.set_stiffness(None)
    sd.save_session(path, posed)
    loaded = sd.load_session(path)
    assert_array_equal(loaded.vertices, solved)
    with zipfile.ZipFile(path) as archive:
        name = next(each for each in archive.namelist() if each.startswith("header"))
        assert json.loads(archive.read(name))["version"] == 4  # earlier programs refuse it
    rest = loaded.volumes()
    assert_allclose(list(rest.values()), list(session().volumes().values()), rtol=1e-12)


@pytest.mark.parametrize("first", [False, True], ids=["then finished", "finished before"])
def test_a_finish_and_a_drag_are_of_the_rigid_parts_of_now(first):
    posed = session()
    posed.set_stiffness(None)
    posed.handles.add(np.flatnonzero(np.isinf(STIFFNESS))[:5], "bone")
    posed.move_handle("hand", moved())
    posed.commit()
    if first:
        posed.finish()
    posed.set_stiffness(STIFFNESS)
    if not first:
        assert posed.finish().is_finished
        require_kept(posed)
    motion = np.eye(4)
    motion[:3, 3] = 0.0, 0.02, 0.02
    targets = posed.vertices[posed.state.handles["bone"]] + motion[:3, 3]
    posed.move_handle("bone", motion)
    off = posed.vertices[posed.state.handles["bone"]] - targets
    assert np.abs(off).max() < 1e-4 * SIZE


def moved() -> np.ndarray:
    """Return a motion of the hand that bends the forearm."""
    motion = np.eye(4)
    motion[:3, 3] = -0.3, 0.2, 0.5
    return motion


def test_bad_input_changes_nothing():
    posed = session()
    state = posed.state
    for call in (
        lambda: posed.set_stiffness([1.0]),
        lambda: posed.set_stiffness(np.full(len(X), np.nan)),
        lambda: posed.set_slides([sd.Slide([len(X)])]),
        lambda: posed.set_slides([sd.Slide([0], "curve")]),
        lambda: posed.change_options(symmetry="w"),
        lambda: posed.change_options(symmetry=1),
    ):
        with pytest.raises((ConstraintError, SessionError)):
            call()
        assert posed.state is state
    other = sd.Session(models.random_limbs(600, seed=3))
    with pytest.raises(ConstraintError, match="not symmetric about this plane"):
        other.change_options(symmetry="y")
    assert other.options.symmetry is None
