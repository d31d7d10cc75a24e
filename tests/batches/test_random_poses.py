"""Random poses are valid, and the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest
from limbed import torso

import vtk_segdeform as sd
from vtk_segdeform.batches.random_poses import Skeleton
from vtk_segdeform.cages import suggested_size
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh import new_crossings
from vtk_segdeform.models import random_limbs


@pytest.fixture(scope="module")
def body():
    return torso(3)


def test_the_first_poses_are_the_same_for_any_number_of_them(body):
    two, one = (sd.random_poses(body, n, 1).poses for n in (2, 1))
    for a, b in zip(two, one, strict=False):
        assert a.vertices.tobytes() == b.vertices.tobytes()
    other = sd.random_poses(body, 1, 2).poses[0]
    assert np.abs(other.vertices - two[0].vertices).max() > 0.01 * body.diagonal


def test_random_poses_are_valid_and_differ(body):
    found = sd.random_poses(body, 3, 1)
    assert 0.0 <= found.refused < 0.9
    volume = signed_volume(body.vertices, body.faces)
    distinct = {pose.vertices.tobytes() for pose in found.poses}
    assert len(distinct) == 3
    for pose in found.poses:
        x = pose.vertices
        assert signed_volume(x, body.faces) == pytest.approx(volume, rel=1e-12)
        assert not len(new_crossings(x, body.vertices, body.faces))
        assert not len(pose.folds())
        assert np.abs(x - body.vertices).max() > 0.02 * body.diagonal


def test_refused_poses_are_counted(body, monkeypatch):
    crossings, calls = sd.Solution.crossings, []

    def every_other(self):
        calls.append(self)
        return np.arange(1) if len(calls) % 2 else crossings(self)

    monkeypatch.setattr(sd.Solution, "crossings", every_other)
    found = sd.random_poses(body, 2, 1, degrees=20.0)
    assert len(calls) == 4
    assert found.refused == 0.5
    regions = sd.segment(body)
    cages = sd.fit_cages(body, regions, suggested_size(regions))
    skeleton = Skeleton.of(body, regions.labels)
    targets = skeleton.targets(body.vertices, np.random.default_rng([1, 0, 1]), np.radians(20.0))
    ends = {"fixed": skeleton.fixed, "handle": skeleton.handle}
    from_rest = sd.Deformer(body, regions, cages, **ends).solve(targets)
    np.testing.assert_allclose(found.poses[0].vertices, from_rest.vertices, atol=1e-10)


def test_limbs_turn_about_their_necks_by_at_most_the_given_angle():
    body = random_limbs(500, 11)
    skeleton = Skeleton.of(body, sd.segment(body).labels)
    x, angle = body.vertices, np.radians(30.0)
    assert len(skeleton.joints) >= 3
    assert not np.intersect1d(skeleton.fixed, skeleton.handle).size
    targets = skeleton.targets(x, np.random.default_rng(5), angle)
    for number, (parent, centre, _) in enumerate(skeleton.joints):
        own = skeleton.joint == number
        if parent >= 0 or not own.any():
            continue
        a, b = x[skeleton.handle[own]] - centre, targets[own] - centre
        lengths = np.linalg.norm(a, axis=1)
        np.testing.assert_allclose(np.linalg.norm(b, axis=1), lengths, rtol=1e-12)
        turned = np.arccos(np.clip(np.sum(a * b, axis=1) / lengths**2, -1.0, 1.0))
        assert 0.0 < turned.max() <= angle + 1e-9


def test_a_body_without_limbs_bends_in_the_middle():
    bar = sd.models.bar(size=(0.2, 0.2, 1.0), divisions=(3, 3, 15))
    skeleton = Skeleton.of(bar, np.zeros(bar.n_vertices, dtype=int))
    assert len(skeleton.joints) == 1
    middle = skeleton.joints[0].centre - bar.vertices.mean(axis=0)
    assert np.linalg.norm(middle) < 0.1


def test_no_limbs_are_found_in_loose_pieces():
    ball = sd.models.sphere(100)
    faces = np.concatenate([ball.faces, ball.faces + 100])
    two = sd.Mesh(np.concatenate([ball.vertices, ball.vertices + 5.0]), faces)
    with pytest.raises(sd.errors.ConstraintError, match="limbs"):
        sd.random_poses(two, 1)


def test_an_impossible_angle_says_what_to_do(body, monkeypatch):
    monkeypatch.setattr(sd.Solution, "crossings", lambda self: np.arange(1))
    monkeypatch.setitem(sd.random_poses.__globals__, "_MOST_DRAWS", 1)
    with pytest.raises(sd.errors.ConstraintError, match="bend by less than 60 degrees"):
        sd.random_poses(body, 1)
