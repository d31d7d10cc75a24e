"""Pairs of faces that intersect: what touches at an edge only does not."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vtk_segdeform.mesh import Crossings, new_crossings, self_intersections


def test_coplanar_faces_beside_an_edge_do_not_intersect_however_they_are_oriented():
    points = [[0, 0, 0], [1, 0, 0], [0.3, 1, 0], [0.4, -1, 0], [0.5, 0.5, 0]]
    for other in ([1, 0, 3], [0, 1, 3]):  # on the other side of the edge 0 1
        assert not len(self_intersections(points, [[0, 1, 2], other]))
    for other in ([1, 0, 4], [0, 1, 4]):  # on the same side
        assert self_intersections(points, [[0, 1, 2], other]).tolist() == [[0, 1]]


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
