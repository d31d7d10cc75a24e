"""Files that a session carries along: moved with the mesh, undone, written and kept in files."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage

from vtk_segdeform import load_session, read_mesh, save_session, write_mesh
from vtk_segdeform.errors import ConstraintError, MeshError
from vtk_segdeform.io import read_points
from vtk_segdeform.landmarks import Landmarks, read_landmarks, write_landmarks
from vtk_segdeform.session import Change

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(is_coarse=True)
X = SCENE.mesh.vertices


@pytest.fixture
def files(tmp_path):
    """Write a surface, points, a curve, a grid and landmarks, nearly all at vertices."""
    write_mesh(tmp_path / "skin.ply", SCENE.mesh)
    pv.PolyData(X[::7]).save(tmp_path / "points.ply")
    pv.Spline(X[:9], 9).save(tmp_path / "curve.vtp")
    grid = pv.ImageData(dimensions=(3, 3, 3), spacing=(0.1, 0.1, 0.1)).cast_to_unstructured_grid()
    grid.point_data["value"] = np.arange(27.0)
    grid.save(tmp_path / "grid.vtu")
    names = tuple("abcd")
    write_landmarks(tmp_path / "own.csv", Landmarks(names, X[[3, 9, 27, 81]], np.full(4, np.nan)))
    return [
        tmp_path / name for name in ("skin.ply", "points.ply", "curve.vtp", "grid.vtu", "own.csv")
    ]


def dragged(session):
    session.drag({name: each + [0.0, 0.4, 0.2] for name, each in session.targets.items()})
    session.commit()


def test_what_is_on_the_mesh_stays_on_it_dragged_and_finished_and_each_file_is_one_step(files):
    session, heard = SCENE.session(), []
    session.on_change(heard.append)
    assert session.carried.add(*files) == tuple(path.name for path in files)
    assert heard == [Change.CARRIED | Change.HISTORY]
    assert session.history.undo_label == "carry 5 files"
    assert_array_equal(session.carried.points("skin.ply"), X)
    for move in (dragged, lambda each: each.finish()):
        move(session)
        at = session.vertices
        assert np.abs(at - X).max() > 0.1
        assert_allclose(session.carried.points("skin.ply"), at, atol=1e-12)
        assert_allclose(session.carried.points("own.csv"), at[[3, 9, 27, 81]], atol=1e-12)
        rest = session.carried["skin.ply"].follower.points
        often = session.poses.carry_often(session.state, rest, live=False)
        assert_allclose(often, at, atol=1e-12)
    session.carried.remove("own.csv", "grid.vtu")
    assert list(session.carried) == ["skin.ply", "points.ply", "curve.vtp"]
    assert session.undo() == "remove 2 carried files"
    assert len(session.carried) == 5


def test_they_are_written_as_they_were_given_but_never_over_another_file(files, tmp_path):
    session = SCENE.session()
    session.carried.add(*files)
    dragged(session)
    written, failed = session.carried.write_all(tmp_path)
    assert not failed
    assert written["skin.ply"] == tmp_path / "skin-2.ply"  # the first is that which was given
    assert_array_equal(read_mesh(files[0]).vertices, X)
    assert_allclose(read_mesh(written["skin.ply"]).vertices, session.vertices, atol=1e-12)
    grid = read_points(written["grid.vtu"])
    assert_array_equal(grid.point_data["value"], np.arange(27.0))
    assert_allclose(grid.points, session.carried.points("grid.vtu"))
    assert read_landmarks(written["own.csv"]).names == tuple("abcd")
    again, _ = session.carried.write_all(tmp_path, ours={*written.values()})
    assert again == written
    assert session.carried.write_all(tmp_path)[0]["skin.ply"] == tmp_path / "skin-3.ply"
    with pytest.raises(MeshError, match="there is no such folder"):
        session.carried.write_all(tmp_path / "nowhere")


def test_a_session_file_has_their_content_when_the_files_are_gone(files, tmp_path):
    session = SCENE.session()
    session.carried.add(*files)
    dragged(session)
    session.saved_poses.save("bent")
    save_session(tmp_path / "a.segdeform", session)
    for path in files:
        path.unlink()
    loaded = load_session(tmp_path / "a.segdeform")
    assert list(loaded.carried) == list(session.carried)
    for name in loaded.carried:
        assert loaded.carried[name].content == session.carried[name].content
        assert_array_equal(loaded.carried.points(name), session.carried.points(name))


def test_files_of_one_name_get_numbers_and_the_same_file_is_carried_once(files, tmp_path):
    session = SCENE.caged()
    (tmp_path / "left").mkdir()
    other = tmp_path / "left" / "skin.ply"
    write_mesh(other, SCENE.mesh.with_vertices(X + 0.1))
    assert session.carried.add(files[0], other) == ("skin.ply", "skin-2.ply")
    n_steps = len(session.history.labels)
    assert session.carried.add(other) == ("skin-2.ply",)
    assert len(session.history.labels) == n_steps


def test_a_file_that_cannot_follow_is_refused_and_none_of_those_with_it_is_added(files, tmp_path):
    session = SCENE.caged()
    (tmp_path / "empty.ply").write_bytes(b"")
    (tmp_path / "text.vtu").write_text("no grid")
    pv.PolyData(np.array([[0.0, np.nan, 0.0]])).save(tmp_path / "nan.ply")
    pv.PolyData(X[:4] + 1e9).save(tmp_path / "far.vtp")
    wrong = {"empty.ply": MeshError, "text.vtu": MeshError, "nan.ply": ValueError,
             "far.vtp": ValueError, "none.ply": MeshError}  # fmt: skip
    for name, error in wrong.items():
        with pytest.raises(error, match=name):
            session.carried.add(files[0], tmp_path / name)
    assert not session.carried
    assert session.history.undo_label == "set cages"
    with pytest.raises(ConstraintError, match="no carried file 'skin'"):
        session.carried.remove("skin")
