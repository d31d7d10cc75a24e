"""Landmarks of a session: edited, undone, kept in files, and the mesh fitted to their targets."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from scipy.spatial.transform import Rotation

from vtk_segdeform import load_session, save_session
from vtk_segdeform.errors import Cancelled, ConstraintError, MeshError
from vtk_segdeform.mesh import SurfacePoint
from vtk_segdeform.session import Change, Session, landmark_edits

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(is_coarse=True)
X = SCENE.mesh.vertices
SOME = [0, 40, 90, 130, 170, 200, 230, 250]


def grown(points):
    """Return an affine motion of points, which the spline of any landmarks has exactly."""
    return points @ np.diag([1.2, 0.9, 1.1]) + [0.1, 0.0, 0.4]


def with_targets(vertices=SOME):
    session = SCENE.caged()
    for k in vertices:
        session.landmarks.add(k, grown(X[k]))
    return session


def test_landmarks_are_added_changed_renamed_removed_and_undone():
    session, heard = with_targets([5, 7]), []
    session.on_change(heard.append)
    marks = session.landmarks
    assert list(marks) == ["landmark 1", "landmark 2"]
    assert_array_equal(marks["landmark 2"], [X[7], grown(X[7])])
    assert_allclose(marks.residuals, np.linalg.norm(grown(X[[5, 7]]) - X[[5, 7]], axis=1))
    marks.rename("landmark 2", "nose")
    assert heard == [Change.LANDMARKS | Change.HISTORY]
    session.landmarks.add(9, X[9], "nose")
    session.landmarks.remove("landmark 1")
    assert list(session.landmarks) == ["nose"]
    assert_array_equal(session.landmarks["nose"], [X[9], X[9]])
    for k in range(1, 4):
        session.landmarks.move("nose", X[9] + [0.0, 0.0, 0.1 * k])
    assert session.commit() == "drag target of nose"
    assert_allclose(session.landmarks.residuals, [0.3])
    steps = [session.undo() for _ in range(4)]
    assert steps == ["drag target of nose", "remove landmark 1", "set nose", "rename landmark 2"]
    assert list(session.landmarks) == ["landmark 1", "landmark 2"]
    assert session.state.pose is None  # nothing has moved the mesh
    for wrong in (lambda: marks.rename("landmark 1", "a\n"), lambda: marks.remove("eye"),
                  lambda: marks.rename("landmark 1", "landmark 2"),
                  lambda: marks.add(3, [1e300, 0.0, 0.0])):  # fmt: skip
        with pytest.raises(ConstraintError):
            wrong()


def test_a_fit_is_one_step_that_later_drags_continue_from():
    session = with_targets()
    session.landmarks.add(SOME[2], grown(X[SOME[2]]) + [0.0, 0.0, 0.5], "landmark 3")
    fit = session.landmarks.fit()
    assert session.history.undo_label == "fit landmarks"
    assert_array_equal(session.vertices, fit.vertices)
    assert_allclose(session.landmarks.residuals, 0.0, atol=1e-9)
    volume = 1.0 + fit.volume_change
    assert volume > 1.1
    assert_allclose(1.0 + session.volume_change, volume, rtol=1e-9)
    # A pull continues from there, and the volume stays as it has grown.
    before, tip = session.vertices, int(X[:, 0].argmax())
    session.pull(tip, before[tip] + [0.0, 0.0, 0.3], locality=1.0)
    session.commit()
    assert_allclose(session.vertices[tip], before[tip] + [0.0, 0.0, 0.3], atol=2e-3)
    assert_allclose(session.vertices[X[:, 0] < -1.0], before[X[:, 0] < -1.0], atol=5e-3)
    assert_allclose(1.0 + session.volume_change, volume, rtol=1e-9)
    assert [session.undo() for _ in range(2)][-1] == "fit landmarks"
    assert_array_equal(session.vertices, X)
    assert not session.options.volumes


@pytest.mark.parametrize("avoid", [False, True])
def test_a_fit_avoids_contact_if_the_session_does(monkeypatch, avoid):
    given = []

    def fit(*arguments, **options):
        given.append(options["avoid_contact"])
        raise Cancelled

    monkeypatch.setattr(landmark_edits, "fit_landmarks", fit)
    session = with_targets()
    session.change_options(avoid_contact=avoid)
    with pytest.raises(Cancelled):
        session.landmarks.fit()
    assert given == [avoid]


def test_a_session_without_cages_gets_them_by_the_fit_and_a_cancelled_one_changes_nothing():
    session = Session(SCENE.mesh)
    for k in SOME:
        session.landmarks.add(k, grown(X[k]))

    def cancel(fraction, _):
        if fraction > 0.5:
            raise Cancelled("enough")

    before = session.state
    with pytest.raises(Cancelled):
        session.landmarks.fit(progress=cancel)
    assert session.state is before
    session.landmarks.fit()
    assert session.cages
    assert_allclose(session.vertices, grown(X), atol=1e-9)
    session.undo()
    assert list(session.landmarks) == [f"landmark {k}" for k in range(1, 9)]
    session.landmarks.remove(*list(session.landmarks)[2:])
    with pytest.raises(ConstraintError, match=r"needs 3 .* there are 2"):
        session.landmarks.fit()


def test_a_landmark_beside_the_surface_moves_as_its_nearest_face_does():
    session = SCENE.caged()
    point = SurfacePoint.of(SCENE.mesh.faces[9], (0.25, 0.75, 0.0)).at(X)
    session.landmarks.add(point, point)
    session.landmarks.add(7, X[7])
    own = session.state.landmarks
    R = Rotation.from_euler("xyz", [0.3, -0.5, 1.1]).as_matrix()
    away = np.array([own.source[0] + [0.0, 0.0, 0.07], X[7]])
    object.__setattr__(own, "source", away)
    pose = 1.7 * X @ R.T + [3.0, 0.0, 1.0]
    session.poses.vertices = lambda *_, **__: pose
    assert_allclose(session.landmarks.places, 1.7 * away @ R.T + [3.0, 0.0, 1.0], atol=1e-9)


def test_landmarks_are_read_paired_by_name_and_written(tmp_path):
    session = SCENE.session()
    own, other = tmp_path / "own.csv", tmp_path / "other.csv"
    own.write_text("name,x,y,z\nnose,1,0,0.5\near,0,0.2,0\n")
    other.write_text("name,x,y,z,uncertainty\near,0,0.4,0,0.01\nchin,3,3,3,\n")
    assert session.landmarks.read(own) == ("nose", "ear")
    assert session.landmarks.read(other, targets=True) == ("nose", "chin")
    assert session.history.labels[-2:] == ("load landmarks", "load targets")
    assert list(session.landmarks) == ["nose", "ear", "chin"]
    assert_array_equal(session.landmarks["ear"], [[0.0, 0.2, 0.0], [0.0, 0.4, 0.0]])
    assert_array_equal(np.isnan(session.landmarks.residuals), [True, False, True])
    assert_array_equal(session.state.landmarks.uncertainty, [np.nan, 0.01, np.nan])
    written = tmp_path / "targets.csv"
    session.landmarks.write(written, targets=True)
    assert (
        written.read_text() == "name,x,y,z,uncertainty\near,0.0,0.4,0.0,0.01\nchin,3.0,3.0,3.0,\n"
    )
    empty = SCENE.session()
    assert empty.landmarks.read(written, targets=True) == ("ear", "chin")
    with pytest.raises(ConstraintError, match="there are no landmarks to write"):
        empty.landmarks.write(written)
    before = session.state
    own.write_text("name,x,y,z\nnose,nan,0,0\n")
    with pytest.raises(MeshError, match="not finite"):
        session.landmarks.read(own)
    own.write_text("name,x,y,z\nnose,1e300,0,0\n")
    with pytest.raises(ConstraintError, match="away from the mesh"):
        session.landmarks.read(own)
    assert session.state is before


def test_files_and_copies_have_the_landmarks(tmp_path):
    session = with_targets([5, 7])
    session.landmarks.rename("landmark 1", "nose")
    (tmp_path / "t.csv").write_text("ear,1,2,3,0.5\n")
    session.landmarks.read(tmp_path / "t.csv", targets=True)
    save_session(tmp_path / "s.segdeform", session)
    for other in (load_session(tmp_path / "s.segdeform"), copy.deepcopy(session)):
        own, its = session.state.landmarks, other.state.landmarks
        assert its.names == own.names == ("nose", "landmark 2", "ear")
        for name in ("source", "target", "uncertainty"):
            assert_array_equal(getattr(its, name), getattr(own, name))
            assert not getattr(its, name).flags.writeable
