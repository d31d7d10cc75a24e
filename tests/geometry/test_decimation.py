"""Decimation: clusters of neighbours, whatever the mesh is like."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from open_meshes import sheet, together

from vtk_segdeform import models
from vtk_segdeform.geometry import decimated, signed_volume
from vtk_segdeform.mesh import connected

N = 1500


@functools.cache
def cactus():
    return models.cactus(N)


def two_close_sheets():
    flat = sheet(lambda u, v: (u, v, 0.0 * u))
    return together(flat, flat.with_vertices(flat.vertices + [0.0, 0.0, 1e-4]))


def noisy_cactus():
    noise = 0.1 * np.random.default_rng(0).normal(size=(N, 3))  # several edge lengths
    return cactus().with_vertices(cactus().vertices + noise)


@pytest.mark.parametrize("made", [cactus, two_close_sheets, noisy_cactus])
def test_clusters_are_connected_and_never_join_two_sheets(made):
    mesh = made()
    coarse, kept, cluster = decimated(mesh, mesh.n_vertices // 8)
    assert 0.3 < coarse.n_vertices / (mesh.n_vertices // 8) < 3.0
    i, j = mesh.edges.T
    same = cluster[i] == cluster[j]
    assert connected(mesh.n_vertices, i[same], j[same]).max() + 1 == coarse.n_vertices
    assert (cluster[kept] == np.arange(len(kept))).all()
    assert (mesh.components[kept][cluster] == mesh.components).all()
    assert coarse.is_closed == mesh.is_closed


def test_the_shape_is_the_same_in_any_place_and_size():
    coarse, kept, _ = decimated(cactus(), 600)
    volumes = [signed_volume(each.vertices, each.faces) for each in (coarse, cactus())]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.05)
    assert decimated(cactus(), 600)[0] is coarse  # known
    moved = cactus().with_vertices(1e-7 * cactus().vertices[:, [1, 2, 0]] + 3.0)
    assert np.mean(np.isin(decimated(moved, 600)[1], kept)) > 0.9
