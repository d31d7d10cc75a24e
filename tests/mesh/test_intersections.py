"""Pairs of faces that intersect: what touches at an edge only does not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere, joined
from vtkmodules.vtkCommonDataModel import vtkTriangle

from vtk_segdeform.mesh import Crossings, new_crossings, self_intersections
from vtk_segdeform.mesh.intersections import intersections_of
from vtk_segdeform.mesh.near_faces import _near_centres, near_faces
from vtk_segdeform.mesh.triangles import flat_faces


def triangles(n=150, spread=0.5, seed=6):
    """Return random triangles that share no corners."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (n, 1, 3)) + spread * rng.normal(size=(n, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


@pytest.mark.usefixtures("either")
def test_the_intersections_of_some_faces_are_those_of_all_that_involve_them():
    points, faces = triangles()
    every = self_intersections(points, faces)
    some = np.random.default_rng(1).permutation(len(faces))[:40]
    found = intersections_of(points, faces, some)
    both = np.concatenate([every, every[:, ::-1]])
    expected = both[np.isin(both[:, 0], some)]
    assert_array_equal(np.unique(found, axis=0), np.unique(expected, axis=0))
    assert len(found) == len(expected) > 50
    assert not len(intersections_of(points, faces, some[:0]))


@pytest.mark.usefixtures("either")
def test_near_faces_include_all_whose_boxes_touch_each_pair_once():
    points, faces = triangles(80, 0.2)
    size = np.repeat(2.0 ** np.random.default_rng(2).integers(-3, 3, 80), 3)[:, None]
    middle = np.repeat(points.reshape(-1, 3, 3).mean(axis=1), 3, axis=0)
    points = middle + size * (points - middle)
    asked = np.arange(80) % 3 == 0
    pairs = np.concatenate(list(near_faces(points, faces, asked)))
    assert asked[pairs[:, 0]].all()
    unordered = {tuple(sorted(pair)) for pair in pairs.tolist()}
    assert len(unordered) == len(pairs)
    meeting = {tuple(pair) for pair in self_intersections(points, faces).tolist()}
    assert {pair for pair in meeting if asked[list(pair)].any()} <= unordered
    low, high = points[faces].min(axis=1), points[faces].max(axis=1)
    for i, j in unordered:
        assert ((low[i] <= high[j]) & (low[j] <= high[i])).all()


def test_needles_have_no_plane():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1e-3, 0], [0.5, 1e-17, 0], [3, 3, 3]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [4, 4, 4], [0, 1, 4]])
    assert_array_equal(flat_faces(1e-3 * corners, faces), [1, 2])


@pytest.mark.parametrize("seed", range(3))
def test_new_crossings_are_in_pairs_that_intersect_now_but_not_at_rest(seed):
    rng = np.random.default_rng(seed)
    rest = (rng.uniform(-2, 2, (60, 1, 3)) + 0.5 * rng.normal(size=(60, 3, 3))).reshape(-1, 3)
    faces = np.arange(180).reshape(-1, 3)
    posed = rest.copy()
    posed[rng.permutation(180)[:60]] += 0.5 * rng.normal(size=(60, 3))
    before, after = ({tuple(pair) for pair in self_intersections(x, faces)} for x in (rest, posed))
    expected = sorted({face for pair in after - before for face in pair})
    assert len(expected) > 10
    assert after & before
    assert_array_equal(new_crossings(posed, rest, faces), expected)


@pytest.mark.parametrize("seed", range(3))
def test_crossings_of_one_pose_after_another_are_those_of_each(seed):
    rng = np.random.default_rng(seed)
    rest = (rng.uniform(-2, 2, (60, 1, 3)) + 0.5 * rng.normal(size=(60, 3, 3))).reshape(-1, 3)
    faces = np.arange(180).reshape(-1, 3)
    crossings, poses = Crossings(rest, faces), [rest]
    for _ in range(12):
        posed = poses[rng.integers(len(poses))].copy()
        posed[rng.permutation(180)[:20]] += 0.5 * rng.normal(size=(20, 3))
        poses.append(posed)
    for pose in (*poses[1:], poses[3], poses[3], rest):
        assert_array_equal(crossings.at(pose), new_crossings(pose, rest, faces))
    assert not len(crossings.at(rest))
    assert max(len(crossings.at(pose)) for pose in poses) > 10


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("spread", [0.15, 0.5])
def test_intersections_of_random_triangles_agree_with_vtk(spread):
    n = 150
    points, faces = triangles(n, spread)
    corners = points.reshape(-1, 3, 3)
    found = self_intersections(points, faces)
    expected = [
        (i, j)
        for i in range(n)
        for j in range(i + 1, n)
        if vtkTriangle.TrianglesIntersect(*corners[i], *corners[j])
    ]
    assert 10 < len(expected) < n * (n - 1) / 4
    assert_array_equal(found, expected)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_intersections_do_not_depend_on_axes_or_on_batches(axis, monkeypatch):
    ball, faces = icosphere(1)
    vertices, faces = joined((ball, faces), (ball + [0.7, 0.1, 0.2], faces))
    expected = self_intersections(vertices, faces)
    assert len(expected) > 20
    rolled = np.roll(vertices, axis, axis=1) * [1, 10, 1]
    monkeypatch.setattr("vtk_segdeform.mesh.intersections._BATCH", 97)
    assert_array_equal(self_intersections(rolled, faces), expected)


def test_the_number_of_tested_pairs_is_proportional_to_the_number_of_faces():
    def pairs_per_face(solid):
        found = _near_centres(*solid, np.ones(len(solid[1]), dtype=bool))
        return sum(len(pairs) for pairs in found) / len(solid[1])

    assert pairs_per_face(icosphere(4)) < 1.5 * pairs_per_face(icosphere(2))
