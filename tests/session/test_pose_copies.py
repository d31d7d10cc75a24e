"""Poses given to another mesh: the same on an equal one, moved along with it, alike on another."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import Scene, sausage
from solids import rotation

from vtk_segdeform import Session, models
from vtk_segdeform.errors import ArgumentError, ConstraintError
from vtk_segdeform.geometry import rigid_fit

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(is_coarse=True)
X, D = SCENE.mesh.vertices, SCENE.mesh.diagonal


@pytest.fixture
def bent() -> Session:
    """Return a session whose handle was turned by 50 degrees and lifted."""
    session = SCENE.session()
    (name,) = session.handles
    session.drag({name: SCENE.turned(50.0) + [0.0, 0.2, 0.5]})
    session.commit()
    return session


def copied(bent: Session, scene: Scene) -> Session:
    """Return a session of *scene* with the pose of *bent*."""
    session = scene.session()
    (name,) = session.saved_poses.copy(bent)
    session.saved_poses.apply(name)
    return session


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_the_pose_is_the_same_on_the_same_mesh_and_moves_along_with_it(bent, scale):
    turn, shift = (np.eye(3), 0.0) if scale == 1.0 else (rotation([1.0, 2.0, 0.5], 2.0), 7.0)
    session = copied(bent, SCENE.transformed(turn, scale, [shift, 0.0, shift]))
    expected = scale * bent.vertices @ turn.T + [shift, 0.0, shift]
    assert_allclose(session.vertices, expected, atol=1e-5 * scale * D)
    assert abs(session.volume_change) < 1e-12
    (name,) = session.handles
    assert_allclose(session.targets[name], session.vertices[session.handles[name]], atol=1e-12)


def test_on_another_body_each_part_turns_as_there_and_what_stays_stays(bent):
    session, end = copied(bent, SCENE.transformed(np.diag([1.0, 1.3, 1.3]))), SCENE.handle
    thick = session.mesh.vertices
    there, _ = rigid_fit(X[end], bent.vertices[end])
    here, _ = rigid_fit(thick[end], session.vertices[end])
    assert np.degrees(np.arccos((np.trace(there.T @ here) - 1.0) / 2.0)) < 5.0
    stayed = np.linalg.norm(bent.vertices - X, axis=1) < 0.002 * D
    assert stayed.sum() > 20
    assert np.abs(session.vertices - thick)[stayed].max() < 0.02 * D
    assert abs(session.volume_change) < 1e-12


def test_saved_poses_are_copied_by_name_in_one_step(bent):
    bent.saved_poses.save("bent")
    bent.reset_pose()
    bent.saved_poses.save("rest")
    session = SCENE.session()
    assert session.saved_poses.copy(bent) == ("bent", "rest")
    assert session.history.undo_label == "copy 2 poses"
    assert session.saved_poses["rest"].pose is None
    session.undo()
    assert not session.saved_poses
    assert session.saved_poses.copy(bent, "bent") == ("bent",)
    assert session.history.undo_label == "copy bent"
    assert_array_equal(session.vertices, X)  # which is applied only on demand
    with pytest.raises(ConstraintError, match="there is no pose 'arm'"):
        session.saved_poses.copy(bent, "arm")


def test_a_mesh_with_other_faces_is_refused(bent):
    with pytest.raises(ArgumentError, match="other must be a Session"):
        SCENE.session().saved_poses.copy(SCENE.mesh)
    with pytest.raises(ConstraintError, match="the other mesh has other faces"):
        Session(models.sphere(300)).saved_poses.copy(bent)
