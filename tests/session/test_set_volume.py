"""Volumes that are set in a session: undo, files, reset, drags and finished poses."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage

from vtk_segdeform.errors import ConstraintError, SessionError
from vtk_segdeform.mesh import SurfacePoint
from vtk_segdeform.session import Session, load_session, save_session
from vtk_segdeform.session.state import Options
from vtk_segdeform.session.state_store import FIRST_OPTIONS

EXACT = 1e-12
SCENE = sausage(2, is_coarse=True)
pytestmark = pytest.mark.usefixtures("bound_once")


def share(session: Session, name: str = "whole") -> float:
    return session.volumes()[name] / session.deformer.volumes()[name]


def turned(session: Session, degrees: float = 30.0) -> None:
    (name,) = session.handles
    session.drag({name: SCENE.turned(degrees)})
    session.commit()


def test_a_slider_is_one_undo_step_and_exact_in_every_move():
    session = SCENE.session()
    steps = len(session.history.labels)
    for percent in range(99, 79, -2):
        session.set_volume("whole", f"{percent}%", max_steps=3)
        assert_allclose(share(session), percent / 100.0, rtol=EXACT)
    session.commit()
    assert len(session.history.labels) == steps + 1
    assert "the volume of whole" in session.history.labels[-1]
    small, rest = session.vertices.copy(), session.mesh.vertices
    session.history.undo()
    assert_array_equal(session.vertices, rest)
    assert session.options.volumes == ()
    session.history.redo()
    assert_array_equal(session.vertices, small)
    assert session.options.volumes == (("whole", "81%"),)


@pytest.mark.parametrize("goal", ["85%", "at most 85%", "free"])
def test_a_volume_is_set_in_a_finished_pose(goal):
    session = SCENE.session()
    turned(session)
    session.refine()
    finished = session.vertices.copy()
    session.set_volume("whole", goal, max_steps=5)
    session.commit()
    if goal != "free":
        assert_allclose(share(session), 0.85, rtol=EXACT)
    session.history.undo()
    assert_array_equal(session.vertices, finished)
    session.history.redo()
    session.refine()
    if goal != "free":
        assert_allclose(share(session), 0.85, rtol=EXACT)


def test_after_pulls_nothing_moves_but_what_a_volume_moves_and_all_of_it_returns():
    session = SCENE.session()
    session.handles.remove(*session.handles)
    session.set_fixed([])
    size, x = session.mesh.diagonal, session.mesh.vertices
    for direction in ([1.0, 0.3, 0.0], [-1.0, 0.3, 0.0]):
        corners = session.mesh.faces[(x @ direction)[session.mesh.faces].min(axis=1).argmax()]
        middle = SurfacePoint.in_face(x, corners, x[corners].mean(axis=0))
        session.pull(middle, middle.at(session.vertices) + [0.0, 0.15 * size, 0.0])
        session.commit()
    pulled = session.vertices
    for name, goal, most in (("whole", "-20%", 0.025), ("region 1", "+10%", 0.015)):
        session.set_volume(name, goal)
        session.commit()
        away = np.linalg.norm(session.vertices - pulled, axis=1)
        assert away.max() < most * size
        if name == "region 1":
            assert away[session.regions.weights[0] == 1.0].max() < 1e-4 * size
        assert np.linalg.norm(middle.at(session.vertices) - middle.at(pulled)) < 1e-3 * size
        at_once = session.vertices
        session.undo()
        for share in (0.3, 0.7, 1.0):
            session.set_volume(name, f"{share * float(goal[:-1]):+g}%")
            session.commit()
        assert_allclose(session.vertices, at_once, atol=1e-3 * size)
        session.forget_volume(name)
        session.refine()
        assert_allclose(session.vertices, pulled, atol=1e-3 * size)


def test_resetting_the_pose_forgets_the_goals_and_undo_brings_them_back():
    session = SCENE.session()
    session.set_volume("whole", "-15%")
    session.commit()
    small = session.vertices.copy()
    session.reset_pose()
    assert_array_equal(session.vertices, session.mesh.vertices)
    assert session.options.volumes == ()
    session.history.undo()
    assert_array_equal(session.vertices, small)
    assert session.options.volumes == (("whole", "-15%"),)


def test_a_pull_whose_volumes_changed_is_saved_and_continues_alike(tmp_path):
    session = SCENE.session()
    tip = int(session.mesh.vertices[:, 1].argmax())
    session.pull(tip, [0.0, 1.5, 0.2])
    session.set_volume("region 1", "+10%")
    session.commit()
    path = tmp_path / "a.segdeform"
    save_session(path, session)
    with zipfile.ZipFile(path) as archive:
        name = next(each for each in archive.namelist() if each.endswith("header.json"))
        assert json.loads(archive.read(name))["version"] == 3  # earlier programs refuse it
    again = load_session(path)
    assert again.state.locality.reach == 0.0
    for each in (session, again):
        each.set_volume("region 1", "+15%")
        each.commit()
    assert_allclose(again.vertices, session.vertices, atol=1e-5)
    assert_allclose(again.volume("region 1")[1], 0.15, atol=EXACT)


def test_a_part_has_a_volume_under_a_lid_which_is_set_saved_and_removed(tmp_path):
    session = SCENE.session()
    x = session.mesh.vertices
    top = (x[:, 2] > 0.2) & (np.abs(x[:, 0]) < 1.2)
    session.set_part("bump", top)
    rest, change = session.volume("bump")
    assert (change, session.history.labels[-1]) == (0.0, "add the volume of bump")
    assert 0.0 < rest < session.volume("whole")[0]
    session.set_volume("bump", "+30%")
    session.commit()
    turned(session)
    assert_allclose(session.volume("bump"), [1.3 * rest, 0.3], rtol=EXACT)
    save_session(tmp_path / "a.segdeform", session)
    again = load_session(tmp_path / "a.segdeform")
    assert_array_equal(again.vertices, session.vertices)
    assert_array_equal(dict(again.state.parts)["bump"], np.flatnonzero(top))
    turned(again, 50.0)
    assert_allclose(again.volume("bump")[1], 0.3, rtol=EXACT)
    session.set_part("bump", None)
    assert session.options.volumes == session.state.parts == ()
    session.undo()
    assert session.options.volumes == (("bump", "+30%"),)


@pytest.mark.parametrize(
    ("name", "ids", "says"),
    [
        ("whole", range(50), "there is a volume 'whole' already"), ("a", [0], "encloses no volume"),
        ("a", [-1], "must index"), ("a", "all", "must contain vertex numbers"),
        ("", range(50), "printable text"),
    ],
)  # fmt: skip
def test_parts_that_are_wrong_are_refused(name, ids, says):
    session = SCENE.session()
    with pytest.raises((ConstraintError, SessionError, ValueError), match=says):
        session.set_part(name, ids)
    assert session.state.parts == ()


def test_a_file_of_an_earlier_version_has_no_goals(tmp_path):
    """Options at their defaults are not in a file, so that earlier programs read it."""
    session = SCENE.session()
    turned(session)
    path = tmp_path / "a.segdeform"
    save_session(path, session)
    with zipfile.ZipFile(path) as archive:
        name = next(each for each in archive.namelist() if each.endswith("header.json"))
        header = json.loads(archive.read(name))
    assert header["options"].keys() == FIRST_OPTIONS
    assert header["version"] == 1
    assert load_session(path).options.volumes == ()


@pytest.mark.parametrize(
    ("name", "goal", "says"),
    [
        ("belly", "keep", "there is no volume 'belly'"), ("whole", "much", "must be keep"),
        ("whole", -1.0, "must be positive"), ("whole", None, "must be keep"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_and_changes_nothing(name, goal, says):
    session = SCENE.session()
    turned(session)
    before, steps = session.vertices.copy(), session.history.labels
    with pytest.raises((SessionError, ConstraintError), match=says):
        session.set_volume(name, goal)
    assert_array_equal(session.vertices, before)
    assert session.history.labels == steps
    assert session.options.volumes == ()
    assert not session.is_dragging


@pytest.mark.parametrize("volumes", ["whole", {"whole": "much"}, {1: "keep"}, [("whole",)], 3])
def test_options_take_goals_only(volumes):
    with pytest.raises(SessionError, match="volumes must be goals by name"):
        Options(volumes=volumes)


def test_a_pull_after_goals_were_given_as_options_starts_from_these_volumes():
    session = SCENE.session()
    session.change_options(volumes={"whole": "+20%"})
    top = int(session.mesh.vertices[:, 1].argmax())
    solution = session.pull(top, session.mesh.vertices[top] + [0.0, 0.3, 0.0])
    session.commit()
    assert solution.handle_error < 1e-3
    assert_allclose(share(session), 1.2, rtol=EXACT)
