from __future__ import annotations

import threading

import numpy as np
from solids import icosphere, rotation, somewhere

from vtk_segdeform.geometry.kmeans import cluster_positions, cluster_within_parts
from vtk_segdeform.kernels import threads


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


def test_with_as_many_clusters_as_points_each_point_has_its_own():
    positions = somewhere(20)
    assert len(np.unique(cluster_positions(positions, 20))) == 20


def test_small_sets_of_points_are_clustered_without_starting_threads(monkeypatch):
    started = []
    monkeypatch.setattr(threading.Thread, "start", started.append)
    monkeypatch.setattr(threads, "n_threads", lambda: 2)
    parts = np.repeat(np.arange(200), 40)
    clusters = cluster_within_parts(np.random.default_rng(0).random((8000, 3)), parts, 300)
    assert len(np.unique(clusters)) >= 200
    assert not started
