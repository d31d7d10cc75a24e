from __future__ import annotations

import functools

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import Scene, sausage
from solids import icosphere, rotation

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.deformer import Deformer, binding
from vtk_segdeform.energy import rotation_clusters
from vtk_segdeform.energy.energy import Energy
from vtk_segdeform.geometry.kmeans import cluster_within_parts
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions

SCENE = sausage()


def of_surface(scene: Scene) -> Deformer:
    """Return a deformer with a rotation for each vertex, and none inside."""
    with pytest.MonkeyPatch.context() as hollow:
        hollow.setattr(binding, "_with_interior", lambda _, energy: energy)
        return scene.deformer(rotation_groups=scene.mesh.n_vertices)


@functools.cache
def fine(scene: Scene) -> tuple[Energy, np.ndarray, tuple[np.ndarray, ...]]:
    """Return the energy with a rotation for each vertex, the cages at rest, and the patches."""
    deformer = of_surface(scene)
    n = scene.mesh.n_vertices
    patches = deformer._problem.rest.vertices, scene.regions.labels, np.ones(n, dtype=np.int64)
    return deformer._problem.energy, deformer._problem.rest_cages, patches


@functools.cache
def joined(scene: Scene, n_groups: int = 100) -> tuple[Energy, np.ndarray]:
    return rotation_clusters.join_rotations(*fine(scene), n_groups)


def plain(scene: Scene, n_groups: int = 100) -> Energy:
    """Return the energy with clusters of position, without the correction."""
    energy, _, (positions, parts, _) = fine(scene)
    groups = cluster_within_parts(positions, parts, n_groups)
    rows = energy.rotation_operator.reshape(len(groups), 3, -1)
    return rotation_clusters._with_rotations(energy, rotation_clusters._sums(rows, groups))


@functools.cache
def bent() -> np.ndarray:
    """Return the cages of the sausage, bent by 50 degrees, with a rotation for each vertex."""
    deformer = of_surface(SCENE)
    deformer.solve(SCENE.turned(50))
    return deformer._path.p


def value(energy: Energy, p: np.ndarray) -> float:
    return energy.value_and_slope(p)[0]


@functools.cache
def blade() -> Scene:
    """Return a long body, flat and thin in the middle, in one cage of 162 vertices."""
    sphere, faces = icosphere(4)
    x = 3.0 * sphere[:, :1]
    narrow = 0.12 + 0.88 * np.abs(x / 3.0) ** 2
    mesh = Mesh(np.hstack([x, sphere[:, 1:2], sphere[:, 2:] * narrow]), faces)
    ball, ball_faces = icosphere(2)
    cage = Cage(ball * [4.5, 1.6, 1.6], ball_faces)
    fixed, handle = np.flatnonzero(x[:, 0] < -2.5), np.flatnonzero(x[:, 0] > 2.5)
    return Scene(mesh, Regions.single(mesh), (cage,), fixed, handle)


def test_the_energy_of_a_pose_is_near_that_with_a_rotation_for_each_vertex():
    true = value(fine(SCENE)[0], bent())
    excess = value(plain(SCENE), bent()) - true
    assert excess > 0.05 * true
    assert abs(value(joined(SCENE)[0], bent()) - true) < 0.3 * excess


def test_a_pose_is_near_that_with_a_rotation_for_each_vertex(monkeypatch):
    def distance(**options):
        x = scene.deformer(**options).solve(scene.turned(50)).vertices
        return np.sqrt(((x - true) ** 2).sum(axis=1).mean())

    scene = blade()
    every = scene.deformer(rotation_groups=scene.mesh.n_vertices)
    true = every.solve(scene.turned(50)).vertices
    near = distance(rotation_groups=60)
    monkeypatch.setattr(rotation_clusters, "_ROUNDS", 0)
    monkeypatch.setattr(rotation_clusters, "_SUBTRACTED", 0.0)
    assert near < 0.6 * distance(rotation_groups=60)


def test_the_excess_is_the_spread_of_rotations_within_the_clusters():
    energy, rest, (positions, parts, _) = fine(SCENE)
    move = np.random.default_rng(0).normal(size=rest.shape)
    rows = energy.rotation_operator.reshape(len(parts), 3, -1)
    groups = cluster_within_parts(positions, parts, 100)
    one, whole = (
        rotation_clusters._response(k, rest, move[:, None])
        for k in (rows, rotation_clusters._sums(rows, groups))
    )
    step = 1e-4
    measured = value(plain(SCENE), rest + step * move) - value(energy, rest + step * move)
    assert_allclose(measured / step**2, one.turned.sum() - whole.turned.sum(), rtol=2e-3)


def test_the_rest_shape_moved_rigidly_is_at_rest():
    _, rest, _ = fine(SCENE)
    energy, _ = joined(SCENE)
    scale = np.trace(energy.quadratic)
    for p in (rest, rest @ rotation([1, 2, 3], 1.2).T + [0.3, 0.2, -0.5]):
        cost, slope = energy.value_and_slope(p)
        assert abs(cost) < 1e-12 * scale
        assert np.abs(slope).max() < 1e-12 * scale


def test_rotating_a_pose_costs_nothing():
    energy, _ = joined(SCENE)
    turned = bent() @ rotation([3, -1, 2], 2.0).T
    assert_allclose(value(energy, turned), value(energy, bent()), rtol=1e-9)


@pytest.mark.parametrize("size", [0.01, 0.1, 1.0])
def test_no_pose_has_negative_energy(size):
    energy, rest = joined(SCENE)[0], fine(SCENE)[1]
    rng = np.random.default_rng(1)
    stretches = np.eye(3) + rng.normal(0.0, size, (5, 3, 3))
    poses = [rest @ a for a in stretches] + [rest + rng.normal(0.0, size, rest.shape)]
    assert min(value(energy, p) for p in poses) > 0.0


def test_no_cluster_spans_two_parts_and_none_is_empty():
    _, groups = joined(SCENE)
    parts = fine(SCENE)[2][1]
    assert_array_equal(np.unique(groups), np.arange(groups.max() + 1))
    assert 80 <= groups.max() + 1 <= 101
    assert all(len(np.unique(parts[groups == g])) == 1 for g in range(groups.max() + 1))


def test_clusters_do_not_depend_on_position_size_and_orientation():
    moved = SCENE.transformed(rotation([1, 2, 3], 1.1), 70.0, (5.0, -3.0, 2.0))
    energy, groups = joined(moved)
    assert_array_equal(groups, joined(SCENE)[1])
    assert_allclose(energy.quadratic, joined(SCENE)[0].quadratic, atol=1e-6 * energy.mass.max())


def test_clusters_lie_across_a_bending_limb():
    def width(groups):
        """Return how much wider than long groups are, where the blade is thin."""
        spans = np.array([np.ptp(x[groups == k], axis=0) for k in np.unique(groups[thin])])
        return spans[:, 1].mean() / spans[:, 0].mean()

    x, parts, _ = fine(blade())[2]
    thin = np.abs(x[:, 0]) < 0.2 * x[:, 0].max()
    assert width(joined(blade(), 60)[1]) > 1.5 * width(cluster_within_parts(x, parts, 60))


def test_a_body_without_stiffness_is_clustered_by_position():
    energy, rest, patches = fine(SCENE)
    loose = rotation_clusters.replace(energy, quadratic=0.0 * energy.quadratic)
    _, groups = rotation_clusters.join_rotations(loose, rest, patches, 100)
    assert 80 <= groups.max() + 1 <= 101
