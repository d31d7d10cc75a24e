"""Cages of open, thin and non-manifold surfaces: valid, around their regions, and close to them."""

from __future__ import annotations

import itertools
import logging

import numpy as np
import pytest
from campaign import every
from sheets import SHEETS, bent, cup, mesh_of, plate
from solids import icosphere, rotation

from vtk_segdeform.cages.cage import cage_faults
from vtk_segdeform.cages.fit import fit_cage, fit_cages
from vtk_segdeform.deformer import Deformer
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.regions.segmentation import segment


@pytest.mark.parametrize("name", every(4, SHEETS))
def test_the_cages_of_any_surface_are_valid_and_enclose_their_regions(name, caplog):
    mesh = mesh_of(name)
    regions = segment(mesh, 2)
    with caplog.at_level(logging.WARNING):
        cages = fit_cages(mesh, regions, 60)
    assert not caplog.records  # no ellipsoid
    assert sum(cage.n_vertices for cage in cages) == 60
    for r, cage in enumerate(cages):
        assert cage_faults(cage.vertices, cage.faces) == ()
        assert cage.contains(mesh.vertices[regions.members(r)]).all()


def single_cage(mesh, n=155):
    return fit_cages(mesh, Regions.single(mesh), n)[0]


def test_the_cage_of_a_plate_is_offset_to_both_sides_and_even():
    mesh = Mesh(plate(30, 30)[0] @ rotation([1, 2, 3], 0.7).T, plate(30, 30)[1])
    cage = single_cage(mesh)
    local = cage.vertices @ rotation([1, 2, 3], 0.7)
    assert local[:, 2].max() > 0.02
    assert local[:, 2].min() < -0.02
    assert np.ptp(local[:, 2]) < 0.15
    for axis in (0, 1):  # on each side, and in every quarter along both axes
        for side in (local[:, 2] > 0.0, local[:, 2] < 0.0):
            counts, _ = np.histogram(local[side, axis], bins=4, range=(-0.05, 1.05))
            assert counts.min() >= 12


def test_a_long_ribbon_has_cage_vertices_all_along_it():
    cage = single_cage(Mesh(*plate(200, 4, 50.0, 1.0)))
    counts, _ = np.histogram(cage.vertices[:, 0], bins=20, range=(-1.0, 51.0))
    assert counts.min() >= 4
    assert np.ptp(cage.vertices[:, 1]) < 3.0


def test_the_cage_of_a_sheet_follows_it_and_leaves_its_hollow_side_empty():
    flat, faces = plate(40, 40)
    radius = 1.0 / 3.0
    mesh = Mesh(bent(flat, radius), faces)  # nearly half a cylinder about the y axis
    cage = single_cage(mesh)
    assert not cage.contains([[0.0, 0.5, 0.0], [0.08, 0.5, 0.08]]).any()
    assert cage.volume < 0.2  # about 2 offsets over area 1


def test_the_cage_of_a_sheet_does_not_depend_on_its_orientation():
    flat, faces = plate(24, 24)
    vertices = bent(flat, 1.0 / 3.0)
    one, other = (single_cage(Mesh(vertices, f), 60) for f in (faces, faces[:, ::-1]))
    np.testing.assert_allclose(one.vertices, other.vertices, atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_the_cage_of_a_pan_is_filled_as_under_a_lid(seed):
    vertices, faces = cup(40, 10, 1.0, 0.6)
    order = np.random.default_rng(seed).permutation(len(vertices))  # decides the signs of axes
    cage = single_cage(Mesh(vertices[order], np.argsort(order)[faces]))
    assert cage.contains([[0.0, 0.0, 0.3], [0.5, 0.0, 0.4], [0.0, 0.0, 0.55]]).all()


LINE, POINT = [[2.0, 0, -1], [2, 0, 0], [2, 0, 2]], [[2.0, 0, 0]] * 3


@pytest.mark.parametrize(
    ("ends", "n_regions"), every(2, itertools.product((LINE, POINT), (1, 2, 3)))
)
def test_a_component_of_flat_faces_only_gets_a_cage_as_any_other(ends, n_regions):
    vertices, faces = icosphere(2)
    n = len(vertices)
    mesh = Mesh(np.concatenate([vertices, ends]), np.append(faces, [[n, n + 1, n + 2]], axis=0))
    regions = segment(mesh, n_regions)
    cages = fit_cages(mesh, regions, 40 * n_regions)
    for members, cage in zip(regions.membership, cages, strict=True):
        assert cage.contains(mesh.vertices[members]).all()
    top = np.flatnonzero(vertices[:, 2] > 0.8)
    deformer = Deformer(mesh, regions, cages, handle=top, fixed=np.flatnonzero(vertices[:, 2] < 0))
    pose = deformer.solve(mesh.vertices[top] + [0.2, 0.0, 0.1], max_steps=4)
    assert abs(pose.volume_change) < 1e-12


def test_a_flat_region_of_a_body_gets_a_cage():
    vertices, faces = icosphere(2)
    fan = faces[(faces == 0).any(axis=1)]
    for flat in (vertices[:1], vertices[:1] + np.linspace(0.0, 0.3, len(fan) + 1)[:, None]):
        moved = vertices.copy()
        moved[np.unique(fan)] = flat
        cage = fit_cage(Mesh(moved, faces), [0], 30)
        assert cage.contains(moved[:1]).all()
