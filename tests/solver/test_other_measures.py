"""Areas and centroids: known solids, derivatives, motions, lids."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from open_meshes import open_box
from solids import icosphere, rotation

from vtk_segdeform import models
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.solver import (
    CoarseVolume,
    VolumeConstraint,
    are_met,
    area_of,
    centroid_of,
    gradients,
    moved_along,
    steps_to_volume,
    total_volume,
    violations,
    with_same_points,
)
from vtk_segdeform.solver.volumes import values_along
from vtk_segdeform.subspace import Subspace

BODY = Mesh(icosphere(2)[0] * [2.0, 1.0, 1.3], icosphere(2)[1])
X = BODY.vertices


def centroid(axis: int, mesh: Mesh = BODY, **more) -> VolumeConstraint:
    return centroid_of(total_volume(mesh), mesh.vertices, axis, diagonal=mesh.diagonal, **more)


def test_known_solids():
    bar = models.bar(size=(1.0, 2.0, 3.0), divisions=(2, 2, 3))
    low = bar.vertices.min(axis=0)
    assert area_of(bar.vertices, bar.faces).target == pytest.approx(22.0)
    found = [centroid(axis, bar).target for axis in range(3)]
    assert_allclose(found, low + [0.5, 1.0, 1.5], atol=1e-12)
    box = open_box()  # under its lid
    moved = box.with_vertices(box.vertices + [4.0, 0.0, 0.0])
    assert centroid(0, moved).target - centroid(0, box).target == pytest.approx(4.0)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("mesh", [BODY, open_box()], ids=["closed", "under a lid"])
def test_gradients_are_derivatives_to_second_order(mesh, rng):
    x = mesh.vertices + 0.1 * rng.normal(size=mesh.vertices.shape)
    d = rng.normal(size=mesh.vertices.shape)
    some = [centroid(1, mesh), total_volume(mesh), area_of(mesh.vertices, mesh.faces)]
    every = with_same_points(some)
    slopes = [float(np.vdot(row, d)) for row in gradients(every, x)]
    off = [
        np.abs(violations(every, x + t * d) - violations(every, x) - t * np.array(slopes))
        for t in (1e-3, 1e-4)
    ]
    assert_allclose(np.log10(off[0] / off[1]), 2.0, atol=0.1)
    values, along = values_along(every, np.hstack([x, d, -2.0 * d]))
    assert_allclose(values, violations(every, x), atol=1e-13)
    assert_allclose(along, np.outer(slopes, [1.0, -2.0]), atol=1e-12)
    alone = [each.gradient(x) for each in some]
    assert_allclose(gradients(every, x), alone, atol=1e-13)


def test_a_motion_changes_centroids_alone_and_by_as_much(rng):
    some = [area_of(X, BODY.faces), centroid(0), centroid(1)]
    x = X + 0.1 * rng.normal(size=X.shape)
    here = violations(some, x)
    assert_allclose(violations(some, x + [3.0, 0.0, 0.0]), here + [0.0, 3.0, 0.0], atol=1e-12)
    turned = violations(some, x @ rotation([0.0, 0.0, 1.0], 0.5 * np.pi).T)
    targets = np.array([each.target for each in some])
    old, new = here + targets, turned + targets
    assert_allclose(new, [old[0], -old[2], old[1]], atol=1e-12)


def test_volume_area_and_centroid_are_met_together(rng):
    x = X + 0.02 * rng.normal(size=X.shape)
    every = (total_volume(BODY), area_of(X, BODY.faces), centroid(0), centroid(2, origin=5.0))
    assert every[3].target == pytest.approx(5.0)
    paths = np.hstack([x, *(each / np.abs(each).max() for each in gradients(every, x))])
    met = moved_along(paths, steps_to_volume(every, paths))
    assert are_met(every, met)
    assert not are_met(every, x)
    assert_allclose([each.relative(met) for each in every], 0.0, atol=1e-14)


def test_flat_triangles_have_no_slope():
    faces = np.array([[0, 1, 2], [0, 1, 1]])
    x = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    area = area_of(x, faces)
    assert area.target == 0.5
    assert np.isfinite(area.gradient(x)).all()


@pytest.mark.parametrize("mesh", [BODY, open_box()], ids=["closed", "under a lid"])
def test_the_hessian_is_the_derivative_of_the_gradient(mesh, rng, monkeypatch):
    monkeypatch.setattr("vtk_segdeform.sizes.VOLUME_HESSIAN_POINTS", mesh.n_vertices)
    n, m = mesh.n_vertices, 6
    block = rng.dirichlet(np.ones(m), n)
    surface = Subspace(n, (np.arange(n),), (block,))
    some = with_same_points([total_volume(mesh), centroid(0, mesh), centroid(2, mesh)])
    p, d = rng.normal(size=(2, m, 3))
    rest = block @ p
    volumes = CoarseVolume(surface).volumes(some, rest)
    multipliers = np.array([0.7, -1.3, 0.4])
    g, more = volumes.hessian(p, multipliers)
    dense = np.array(more)
    for a, b, c, sign in [(0, 1, 2, 1), (1, 2, 0, 1), (2, 0, 1, 1)]:
        i, j = slice(a * m, (a + 1) * m), slice(b * m, (b + 1) * m)
        dense[i, j] += sign * g[c]
        dense[j, i] += sign * g[c].T

    def slope(q):
        rows = gradients(volumes.constraints, surface.map(q))
        return block.T @ sum(k * row for k, row in zip(multipliers, rows, strict=True))

    assert_allclose(dense, dense.T, atol=1e-6)
    t = 1e-5
    expected = (slope(p + t * d) - slope(p - t * d)) / (2.0 * t)
    found = (dense @ d.T.ravel()).reshape(3, m).T
    assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())  # single precision
