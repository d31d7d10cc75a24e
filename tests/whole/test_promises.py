"""The promises of the README, on whole meshes; `make campaign` checks more of them.

The tests print their measurements and assert the promised bounds.
"""

from __future__ import annotations

import functools
import time

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose
from real_meshes import botsch_sorkine, path_of
from scipy.spatial import cKDTree
from solids import rotation, torus, two_components

import vtk_segdeform as sd
from vtk_segdeform.benchmarks.peers import iterate_to_convergence
from vtk_segdeform.cages.simplify import simplify
from vtk_segdeform.geometry.distortion import distortion
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.subspace.subspace import cage_subspace

QUICK = ["small cactus", "torus", "two components", "botsch-sorkine/cylinder.off"]
ALL = [
    "cactus",
    *QUICK[1:],
    "hand.off",
    "dinosaur",
    "dino.off",
    "botsch-sorkine/cactus.off",
    "koala.obj",
]


def mesh_of(name):
    if name == "cactus":
        return sd.models.cactus()
    if name == "small cactus":
        return sd.models.cactus(600)
    if name == "dinosaur":
        return sd.models.dinosaur()
    if name == "torus":
        return sd.Mesh(*torus())
    if name == "two components":
        return sd.Mesh(*two_components())
    return sd.read_mesh(path_of(name))


@functools.lru_cache(maxsize=1)
def caged(name, n_regions):
    """Return a mesh, its regions and cages of 155 vertices in total; the last result is cached."""
    mesh = mesh_of(name)
    regions = sd.segment(mesh, n_regions)
    return mesh, regions, sd.fit_cages(mesh, regions, 155)


def ends(mesh):
    """Return the vertices at the two ends of the mesh's longest side."""
    axis = int(np.ptp(mesh.vertices, axis=0).argmax())
    height = mesh.vertices[:, axis]
    share = (height - height.min()) / np.ptp(height)
    return np.flatnonzero(share < 0.12), np.flatnonzero(share > 0.88), axis


def bent(mesh, handle, degrees, axis):
    """Return targets: the handle turned about a line across the middle of the mesh."""
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    turn = rotation(np.roll([1, 0, 0], axis + 1), np.radians(degrees))
    return (mesh.vertices[handle] - middle) @ turn.T + middle


def check_volume_and_coordinates(name, n_regions, angles, moves):
    mesh, regions, cages = caged(name, n_regions)
    fixed, handle, axis = ends(mesh)
    assert abs(sum(cage.n_vertices for cage in cages) - 155) <= 3
    for cage, members in zip(cages, regions.membership, strict=True):
        assert cage.contains(mesh.vertices[members]).all()
    subspace = cage_subspace(regions, cages)
    rest = np.concatenate([cage.vertices for cage in cages])
    ones = subspace.map(np.ones((len(rest), 1)))
    assert np.abs(ones - 1.0).max() <= 1e-9
    assert np.abs(subspace.map(rest) - mesh.vertices).max() <= 1e-9 * mesh.diagonal

    deformer = sd.Deformer(mesh, regions, cages, fixed=fixed, handle=handle)
    worst = steps = 0
    for degrees in angles:
        deformer.reset()
        solution = deformer.solve(bent(mesh, handle, degrees, axis))
        worst, steps = max(worst, abs(solution.volume_change)), steps + solution.steps
    deformer.reset()
    for move in range(1, moves + 1):
        targets = bent(mesh, handle, 60.0 * move / moves, axis)
        solution = deformer.solve(targets, max_steps=5)
        worst, steps = max(worst, abs(solution.volume_change)), steps + solution.steps
    print(f"{name}, {n_regions} regions: |dV|/V {worst:.1e} over {steps} steps")
    assert worst <= 1e-12


def test_a_cage_moves_only_its_own_region():
    # The purpose of several cages: moving the cage of one arm does not move the other arm.
    _, regions, cages = caged("small cactus", 3)
    subspace = cage_subspace(regions, cages)
    rest = np.concatenate([cage.vertices for cage in cages])
    moved = rest.copy()
    moved[subspace.columns[1]] += [0.3, 0.0, 0.0]
    moves = np.linalg.norm(subspace.map(moved) - subspace.map(rest), axis=1)
    assert_allclose(moves[~regions.membership[1]], 0.0, atol=1e-12)
    assert moves[regions.membership[1]].max() > 0.29


@pytest.mark.parametrize("name", every(4, QUICK))
def test_volume_is_exact_and_coordinates_reproduce_the_mesh(name):
    check_volume_and_coordinates(name, 3, angles=[70], moves=5)


@pytest.mark.campaign
@pytest.mark.parametrize("n_regions", [1, 3, 6])
@pytest.mark.parametrize("name", ALL)
def test_volume_is_exact_on_every_mesh_at_every_angle_and_throughout_a_drag(name, n_regions):
    check_volume_and_coordinates(name, n_regions, angles=[30, 70, 120, 180], moves=100)


def coarser(vertices, faces, selection, n):
    """Return a mesh with *n* vertices, each with the role of the nearest vertex given."""
    points, faces = simplify(vertices, faces, n)
    return points, faces, selection[cKDTree(vertices).query(points)[1]]


@pytest.mark.parametrize(
    ("name", "n", "most", "finished_most", "left"),
    # With few vertices, finishing reduces the distortion less, and ARAP loses less volume.
    every(
        3,
        [
            ("cactus", 800, 0.11, 0.09, 0.96),
            ("cactus", None, 0.10, 0.09, 0.95),
            ("cylinder", None, 0.22, 0.175, 0.95),
        ],
    ),
)
def test_the_botsch_sorkine_poses_preserve_the_volume_that_arap_loses(
    name, n, most, finished_most, left
):
    igl = pytest.importorskip("igl")
    vertices, faces, selection, matrix = botsch_sorkine(name)
    if n is not None:
        vertices, faces, selection = coarser(vertices, faces, selection, n)
    mesh = sd.Mesh(vertices, faces)
    fixed, handle = np.flatnonzero(selection == 0), np.flatnonzero(selection == 2)
    targets = vertices[handle] @ matrix[:3, :3].T + matrix[:3, 3]

    begin = time.perf_counter()
    regions = sd.segment(mesh, 3)
    cages = sd.fit_cages(mesh, regions, 200 if n is None else 120)
    deformer = sd.Deformer(mesh, regions, cages, fixed=fixed, handle=handle)
    ours = deformer.solve(targets)
    seconds = time.perf_counter() - begin
    change, ours_distortion = ours.volume_change, distortion(mesh, ours.vertices)
    print(
        f"{name}: volume {change:+.1e}, {ours.steps} steps, {seconds:.2f} s with set-up, "
        f"handle {ours.handle_error:.1e}, fixed {ours.fixed_error:.1e}, "
        f"distortion {ours_distortion:.4f}"
    )

    finished = deformer.finish(ours)
    finished_distortion = distortion(mesh, finished.vertices)
    print(
        f"{name}: finished on the mesh volume {finished.volume_change:+.1e}, "
        f"handle {finished.handle_error:.1e}, distortion {finished_distortion:.4f}"
    )

    free = deformer.hold(fixed=fixed, handle=handle, preserve_volume=False).solve(targets)
    free_distortion = distortion(mesh, free.vertices)
    gain = 1.0 - free_distortion / ours_distortion
    print(
        f"{name}: with preserve_volume=False volume {free.volume_change:+.3f}, "
        f"distortion {free_distortion:.4f}, lower by {100.0 * gain:.1f} %"
    )

    begin = time.perf_counter()
    arap = igl.ARAPData()
    arap.max_iter = 1
    constrained = np.concatenate([fixed, handle]).astype(np.int32)
    igl.arap_precomputation(mesh.vertices, mesh.faces, 3, constrained, arap)
    places = np.concatenate([vertices[fixed], targets])
    near, start = 1e-4 * mesh.diagonal, np.array(mesh.vertices)
    pose, iterations = iterate_to_convergence(
        start, near, 5000, lambda x: igl.arap_solve(places, arap, x)
    )
    seconds = time.perf_counter() - begin
    lost = signed_volume(pose, mesh.faces) / signed_volume(mesh.vertices, mesh.faces)
    print(
        f"{name}: ARAP volume {100 * (lost - 1):+.1f} %, {iterations} iterations, {seconds:.2f} s, "
        f"distortion {distortion(mesh, pose):.4f}"
    )
    assert iterations < 5000
    assert abs(change) <= 1e-12
    assert lost < left
    assert max(ours.handle_error, ours.fixed_error) <= 1e-3
    assert ours_distortion <= most
    assert finished_distortion <= finished_most
    assert abs(finished.volume_change) <= 1e-12
    assert finished.handle_error <= 1e-12
    assert free.volume_change < -0.02
    # Volume explains a part of the difference from ARAP: 3 % of 0.0855, 16 % of 0.1211.
    assert 0.0 < gain < 0.2
