"""Bodies with known parts: all of them are found, and nothing else."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from campaign import every
from solids import icosphere

from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.models.implicit import Limb, implicit_surface
from vtk_segdeform.regions import limbs as limbs_module
from vtk_segdeform.regions.coarse import coarsen
from vtk_segdeform.regions.limbs import find_limbs
from vtk_segdeform.regions.segmentation import segment


def two(name, points, radii):
    """Return limbs on the left and the right."""
    mirrored = [(-x, y, z) for x, y, z in points]
    return {f"left {name}": (points, radii), f"right {name}": (mirrored, radii)}


BODIES = {
    "man": {
        "trunk": ([(0, 0, 0.29), (0, 0, 0.36), (0, 0, 0.42)], [0.051, 0.048, 0.051]),
        "head": ([(0, 0, 0.45), (0, 0, 0.486), (0, 0, 0.528)], [0.02, 0.023, 0.038]),
        **two("arm", [(0.05, 0, 0.426), (0.13, 0, 0.37), (0.2, 0.01, 0.32)], [0.022, 0.017, 0.015]),
        **two("leg", [(0.03, 0, 0.27), (0.036, 0, 0.15), (0.039, 0, 0.02)], [0.033, 0.024, 0.017]),
    },
    "toy": {
        "trunk": ([(0, 0, 0.135), (0, 0, 0.225)], [0.135, 0.12]),
        "head": ([(0, 0, 0.417), (0, 0, 0.423)], [0.108, 0.108]),
        **two("arm", [(0.09, 0, 0.255), (0.21, 0, 0.24)], [0.048, 0.045]),
        **two("leg", [(0.066, -0.03, 0.09), (0.078, -0.03, -0.06)], [0.06, 0.057]),
    },
    "dog": {
        "trunk": ([(0, -0.165, 0.18), (0, 0.15, 0.186)], [0.072, 0.075]),
        "head": ([(0, 0.195, 0.255), (0, 0.225, 0.315), (0, 0.315, 0.3)], [0.051, 0.06, 0.036]),
        "tail": ([(0, -0.225, 0.21), (0, -0.285, 0.285), (0, -0.3, 0.345)], [0.018, 0.017, 0.015]),
        **two("ear", [(0.036, 0.198, 0.36), (0.06, 0.186, 0.414)], [0.021, 0.015]),
        **two("hind leg", [(0.042, -0.15, 0.15), (0.045, -0.15, 0.015)], [0.033, 0.027]),
        **two("fore leg", [(0.042, 0.135, 0.15), (0.045, 0.135, 0.015)], [0.033, 0.027]),
    },
}


@cache
def body(name, n=1000):
    """Return the mesh of a body, and the number of the part of each vertex."""
    parts = [Limb(points, radii) for points, radii in BODIES[name].values()]

    def distances(x):
        return np.stack([part(x) for part in parts])

    points = np.concatenate([part.points for part in parts])
    box = np.stack([points.min(axis=0) - 0.17, points.max(axis=0) + 0.17])

    def field(x):  # rounded by 0.01 where two parts meet
        first, second = np.partition(distances(x), 1, axis=0)[:2]
        return first - 0.005 * np.maximum(1.0 - (second - first) / 0.02, 0.0) ** 2

    mesh = implicit_surface(field, box, n)
    return mesh, distances(mesh.vertices).argmin(axis=0)


def overlaps(mesh, truth, **options):
    """Return the number of regions, and of each part how well a region agrees with it."""
    labels = segment(mesh, overlap=0, **options).labels
    table = np.zeros((truth.max() + 1, labels.max() + 1))
    np.add.at(table, (truth, labels), 1.0)
    union = table.sum(axis=1)[:, None] + table.sum(axis=0) - table
    return table.shape[1], (table / union).max(axis=1)


def noisy(mesh, seed=1):
    shift = np.random.default_rng(seed).normal(0.0, 0.15, mesh.vertices.shape)
    return mesh.with_vertices(mesh.vertices + np.median(mesh.adjacency.data) * shift)


@pytest.mark.parametrize("name", every(4, BODIES))
@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda mesh: mesh, id="smooth"),
        pytest.param(noisy, id="noisy", marks=pytest.mark.campaign),
    ],
)
def test_every_part_of_a_body_is_a_region_and_nothing_else(name, change):
    mesh, truth = body(name, 1500) if change is noisy else body(name)
    count, agreement = overlaps(change(mesh), truth)
    assert dict(zip(BODIES[name], agreement > 0.5, strict=True)) == dict.fromkeys(
        BODIES[name], True
    )
    assert count == len(BODIES[name])


@pytest.mark.parametrize("name", every(3, BODIES))
def test_a_mirror_image_has_the_same_regions(name):
    mesh, _ = body(name)
    mirrored = Mesh(mesh.vertices * [-1.0, 1.0, 1.0], mesh.faces[:, ::-1])
    np.testing.assert_array_equal(segment(mirrored).labels, segment(mesh).labels)


@pytest.mark.parametrize("size", [(3.0, 1.0, 0.7), (1.0, 1.0, 0.15), (12.0, 1.0, 1.0)])
def test_a_convex_body_is_one_region(size):
    vertices, faces = icosphere(4)
    assert segment(noisy(Mesh(vertices * size, faces))).n_regions == 1


def test_a_waist_divides_and_the_neck_of_a_head_is_where_it_is_shortest():
    vertices, faces = icosphere(5)
    z = vertices[:, 2]
    width = np.sqrt(np.maximum(1.0 - z**2, 0.0))
    girth = np.interp(z, [-1, -0.5, 0.1, 0.5, 1], [0.0, 1.0, 0.4, 0.7, 0.0])
    snowman = Mesh(
        np.column_stack(
            [vertices[:, :2] / np.maximum(width, 1e-9)[:, None] * girth[:, None], 2 * z]
        ),
        faces,
    )
    labels = segment(snowman, overlap=0).labels
    assert labels.max() == 1
    edges = snowman.edges[np.diff(labels[snowman.edges], axis=1)[:, 0] != 0]
    np.testing.assert_allclose(snowman.vertices[edges, 2], 0.2, atol=0.2)


def test_a_limb_has_the_area_and_the_neck_that_it_has():
    mesh, truth = body("dog")
    _, surface = coarsen(mesh, 1500, np.random.default_rng(0))
    limbs = find_limbs(surface, 0.01 * mesh.face_areas.sum())
    area = np.bincount(truth, np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3)))
    legs = [limb for limb in limbs if limb.inside[surface.vertices[:, 2].argmin()]]
    assert len(legs) == 1
    assert legs[0].area == pytest.approx(area[list(BODIES["dog"]).index("left hind leg")], rel=0.25)
    assert legs[0].length == pytest.approx(2.0 * np.pi * 0.035, rel=0.25)
    assert [limb.score for limb in limbs] == sorted(limb.score for limb in limbs)


def test_protrusion_and_score_have_the_values_of_the_definitions():
    length = 2.0 * np.pi * 0.3
    for area, expected in ((np.pi * 0.09, 1.0), (2.0 * np.pi * 0.09, 2.0), (4.0 * np.pi * 0.09, 4)):
        assert limbs_module._protrusion(area, length) == pytest.approx(expected)
    around = np.full(5, length)  # of a tube
    plane = length * (1.0 + limbs_module._PARALLELS)  # around the foot of a tube on a plane
    area = 4.0 * np.pi * 0.09
    assert limbs_module._score(around, around, length, area) == pytest.approx(2.0 / 4.0)
    assert limbs_module._score(around, plane, length, area) == pytest.approx(2.0 / 64.0 / 4.0)
    assert limbs_module._score(around, 0.5 * around, length, area) == pytest.approx(0.5)
    assert limbs_module._score(around, around, length, 9.0 * area) == pytest.approx(2.0 / 6.0)
    short = np.where(np.arange(5) < 4, around, 0.29 * length)  # beyond the tip
    assert limbs_module._score(short, plane, length, area) == pytest.approx(2.0 / 1.75**6 / 4.0)
    at_tip = np.where(np.arange(5) < 4, around, 0.31 * length)
    assert limbs_module._score(at_tip, plane, length, area) < 2.0 / 1.75**6 / 4.0


def test_a_neck_is_one_if_it_is_sharp_and_its_limb_protrudes():
    inside, length = np.ones(3, dtype=bool), 2.0

    def found(protrusion, score):
        area = protrusion * length**2 / (4.0 * np.pi)
        return limbs_module.Limb(inside, area, length, score).found

    assert found(2.51, 0.0999)
    assert not found(2.49, 0.0999)
    assert not found(2.51, 0.1001)
