from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import icosphere, rotation, somewhere

from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.geometry.kmeans import cluster_positions, cluster_within_parts


def test_there_are_about_as_many_clusters_as_asked_for_and_none_is_empty():
    positions = icosphere(3)[0]
    clusters = cluster_positions(positions, 40)
    assert clusters.min() == 0
    assert 30 <= clusters.max() + 1 <= 40
    assert (np.bincount(clusters) > 0).all()


def test_clusters_do_not_depend_on_the_frame_even_where_distances_tie():
    positions = icosphere(3)[0]  # full of ties
    turned = positions @ rotation([1, 2, 3], 1.1).T
    assert (cluster_positions(positions, 25) == cluster_positions(turned, 25)).all()


def test_no_cluster_spans_two_parts():
    positions = icosphere(3)[0]
    parts = (positions[:, 0] > 0).astype(int) + 2 * (positions[:, 1] > 0.5)
    clusters = cluster_within_parts(positions, parts, 30)
    for cluster in range(clusters.max() + 1):
        assert len(np.unique(parts[clusters == cluster])) == 1
    shares = np.array([7.0, 5.0, 7.0, 1.0, 0.0, 9.0])
    some = np.array([1, 3, 4, 5])  # not every number is a part
    clusters = cluster_within_parts(positions, some[parts], 30, shares=shares)
    numbers = [len(np.unique(clusters[parts == part])) for part in range(4)]
    assert numbers == [10, 2, 1, 18]


def test_centres_are_the_means_of_their_points_after_enough_rounds():
    points = somewhere(400, seed=5)
    clusters = cluster_positions(points, 12, rounds=60)
    centres = np.array([points[clusters == k].mean(axis=0) for k in range(clusters.max() + 1)])
    apart = np.linalg.norm(points[:, None] - centres, axis=2)
    assert_array_equal(apart.argmin(axis=1), clusters)
    few = cluster_positions(points, 12, rounds=1)
    spread = [
        sum(np.var(points[c == k], axis=0).sum() * (c == k).sum() for k in range(c.max() + 1))
        for c in (few, cluster_positions(points, 12), clusters)
    ]
    assert spread[0] > spread[1] >= spread[2]


def test_the_clusters_of_many_points_are_those_of_a_sample():
    points = somewhere(20_000, seed=6)
    for seeded in (True, False):
        clusters = cluster_positions(points, 20, seeded=seeded)
        assert clusters.max() == 19
        assert np.bincount(clusters).min() > 200
        assert np.bincount(clusters).max() < 3000


def test_the_number_of_clusters_within_parts_is_whole_and_positive():
    for wrong in (0, -1, 1.5):
        with pytest.raises(ArgumentError, match="must be a whole number, 1 or more"):
            cluster_within_parts(somewhere(), np.zeros(50, dtype=int), wrong)
    clusters = cluster_within_parts(somewhere(), np.zeros(50, dtype=int), 10)
    assert set(clusters) == set(range(10))
    every = cluster_within_parts(somewhere(), np.arange(50) % 3, 1000)
    assert len(set(every)) == 50
