"""Lids over borders, and which open surfaces enclose a volume under them."""

from __future__ import annotations

import functools
import time

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from open_meshes import (
    bottle,
    cut,
    moebius_strip,
    open_box,
    pipe,
    revolved,
    sheet,
    together,
    tube,
    with_holes,
    with_walls,
)
from solids import CUBE, rotation

from vtk_segdeform import models
from vtk_segdeform.geometry.lids import _winding_of_few, lids_of, mean_winding, volume_summary
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh

BALL = models.sphere(1500)


def scaled(mesh: Mesh, *factors: float) -> Mesh:
    return mesh.with_vertices(mesh.vertices * np.array(factors))


def shaken(mesh: Mesh, size: float) -> Mesh:
    steps = np.random.default_rng(0).normal(size=mesh.vertices.shape)
    return mesh.with_vertices(mesh.vertices + size * steps)


BODIES = {
    "hemisphere": lambda: cut(BALL, 2, 0.5),
    "coarse hemisphere": lambda: cut(models.sphere(162), 2, 0.5),
    "noisy hemisphere": lambda: shaken(cut(BALL, 2, 0.5), 0.03),
    "three quarters of a ball": lambda: cut(BALL, 2, 0.75),
    "ball with a small hole": lambda: cut(BALL, 2, 0.97),
    "egg, cut lengthwise": lambda: cut(scaled(BALL, 1, 1, 2), 0, 0.5),
    "egg, cut across": lambda: cut(scaled(BALL, 1, 1, 2), 2, 0.5),
    "half of a dinosaur": lambda: cut(models.dinosaur(1200), 1, 0.5),
    "half of a ring": lambda: cut(models.torus(1500), 0, 0.5),
    "box without a face": lambda: open_box(),
    "box of five quadrilaterals": lambda: open_box(1),
    "bar without ends": lambda: pipe(lambda u, v: (np.cos(u), np.sin(u), 12 * v), 4, 12),
    "tube": lambda: tube(),
    "tube of 100 radii": lambda: tube(100.0, 20, 100),
    "short tube": lambda: tube(2.0),
    "bent tube": lambda: pipe(
        lambda u, v: ((6 + np.cos(u)) * np.cos(4 * v), (6 + np.cos(u)) * np.sin(4 * v), -np.sin(u))
    ),
    "tube turned inside out": lambda: pipe(lambda u, v: (np.cos(u), -np.sin(u), 6 * v)),
    "cup": lambda: revolved([0.02, 1.0, 1.0], [0.0, 0.0, 2.0]),
    "cone": lambda: revolved([1.0, 0.02], [0.0, 2.0]),
    "bottle": lambda: bottle(),
    "bust with an open neck": lambda: cut(models.cactus(1000), 2, 0.6),
    "body with 12 holes": lambda: with_holes(models.cactus(1000), 12, 0.03),
    "body with many holes": lambda: with_holes(models.cactus(1000), 40, 0.02),
    "hollow blade": lambda: cut(models.bar((4, 0.1, 4), divisions=(16, 2, 16)), 2, 0.97),
}
SHEETS = {
    "plane": lambda: sheet(lambda u, v: (u, v, 0 * u)),
    "two triangles": lambda: sheet(lambda u, v: (u, v, 0 * u), 2, 2),
    "wavy sheet": lambda: sheet(lambda u, v: (u, v, 0.1 * np.sin(9 * u) * np.cos(9 * v))),
    "wrinkled cloth": lambda: sheet(
        lambda u, v: (u, v, 0.3 * np.sin(15 * u) * np.cos(15 * v)), 90, 90
    ),
    "pleats": lambda: sheet(lambda u, v: (u, v, 0.5 * np.sin(20 * u)), 120, 20),
    "crumpled paper": lambda: sheet(
        lambda u, v: (
            u + 0.2 * np.sin(7 * v),
            v + 0.2 * np.sin(8 * u),
            0.3 * np.sin(9 * u * v) + 0.2 * np.cos(11 * u),
        ),
        90,
        90,
    ),
    "noisy sheet": lambda: shaken(sheet(lambda u, v: (u, v, 0 * u)), 0.02),
    "saddle": lambda: sheet(lambda u, v: (u, v, u * u - v * v)),
    "shallow cap": lambda: cut(BALL, 2, 0.07),
    "cap of 90 degrees": lambda: cut(BALL, 2, 0.146),
    "face scan": lambda: cut(scaled(BALL, 1, 1.3, 0.5), 2, 0.5),
    "quarter of a pipe": lambda: sheet(lambda u, v: (np.cos(0.785 * u), np.sin(0.785 * u), 5 * v)),
    "half of a pipe": lambda: sheet(lambda u, v: (np.cos(1.57 * u), np.sin(1.57 * u), 5 * v)),
    "rolled carpet": lambda: sheet(
        lambda u, v: ((1.2 + u) * np.cos(9 * u), (1.2 + u) * np.sin(9 * u), 5 * v), 120, 20
    ),
    "ring": lambda: tube(0.2),
    "wide ring": lambda: tube(1.0),
    "annulus": lambda: pipe(lambda u, v: ((1 + v) * np.cos(u), (1 + v) * np.sin(u), 0 * v)),
    "flag": lambda: sheet(lambda u, v: (u, 0.6 * v, 0.15 * np.sin(5 * u) + 0.05 * np.sin(9 * v))),
    "sheet with holes": lambda: with_holes(sheet(lambda u, v: (u, v, 0 * u)), 8, 0.04),
    "twisted scarf": lambda: sheet(
        lambda u, v: (6 * u, 0.4 * v * np.cos(6 * u), 0.4 * v * np.sin(6 * u)), 120, 10
    ),
}
BODIES, SHEETS = (
    {name: functools.cache(made) for name, made in kind.items()} for kind in (BODIES, SHEETS)
)


BAR = models.bar((1, 1, 3), divisions=(2, 2, 6))


@pytest.mark.parametrize("name", every(3, BODIES))
def test_a_body_encloses_a_volume(name):
    mesh = BODIES[name]()
    print(f"{name}: q = {mean_winding(mesh.vertices, mesh.faces):.3f}")
    assert not mesh.is_closed
    assert lids_of(mesh).encloses.all()


@pytest.mark.parametrize("name", every(2, SHEETS))
def test_a_sheet_encloses_nothing(name):
    mesh = SHEETS[name]()
    print(f"{name}: q = {mean_winding(mesh.vertices, mesh.faces):.3f}")
    assert not lids_of(mesh).encloses.any()


def test_the_mean_winding_of_known_surfaces():
    def q(mesh):
        return mean_winding(mesh.vertices, mesh.faces)

    assert q(BALL) == pytest.approx(1.0, abs=0.03)
    assert q(scaled(BALL, 1, 1, 8)) == pytest.approx(1.0, abs=0.03)
    assert q(SHEETS["plane"]()) == pytest.approx(0.0, abs=1e-12)
    # An arc of the angle a has a / 2 pi; this gutter is long.
    for a in (1.0, 2.0, 3.0):
        half = a / 2
        gutter = sheet(lambda u, v, h=half: (np.cos(h * u), np.sin(h * u), -40 * v), 20, 200)
        assert abs(q(gutter)) == pytest.approx(a / (2 * np.pi), abs=0.02)


@pytest.mark.parametrize("name", ["bottle", "hemisphere", "body with 12 holes"])
def test_the_answer_does_not_depend_on_place_size_or_direction(name):
    mesh = BODIES[name]()
    moved = 1e-3 * mesh.vertices @ rotation([1, 2, 3], 2.0).T + [7.0, -5.0, 3.0]
    here = mean_winding(mesh.vertices, mesh.faces)
    there = mesh.with_vertices(moved)
    assert mean_winding(moved - moved[0], mesh.faces) == pytest.approx(here, abs=1e-6)
    assert lids_of(there).encloses.all()
    far = mesh.with_vertices(mesh.vertices + 1e6)
    assert lids_of(far).encloses.all()


def test_a_lid_of_a_flat_border_restores_the_volume_of_the_box():
    mesh = open_box()
    lids = lids_of(mesh)
    x = lids.extension @ mesh.vertices
    assert signed_volume(x, lids.closed(mesh)) == pytest.approx(2.0, rel=1e-14)
    assert_allclose(x[mesh.n_vertices :], [[0.0, 0.0, mesh.vertices[:, 2].max()]], atol=1e-14)


@pytest.mark.parametrize("name", [*every(3, BODIES), "ring", "annulus", "sheet with holes"])
def test_faces_and_lids_have_no_boundary(name):
    mesh = {**BODIES, **SHEETS}[name]()
    lids = lids_of(mesh, lids=True)
    faces = np.concatenate([mesh.faces, lids.faces])
    ends = np.bincount(faces.ravel(), minlength=lids.extension.shape[0])
    assert ends.all()
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    forward = np.sort(tails * len(ends) + heads)
    assert_array_equal(forward, np.sort(heads * len(ends) + tails))


def test_the_border_of_a_wall_is_no_hole_and_its_lid_adds_no_volume():
    lids = lids_of(with_walls(open_box(), 1.0))
    assert_array_equal(lids.used, ~lids.of_wall)
    assert sorted(np.bincount(lids.loop)[lids.used]) == [24]
    mesh = with_walls(BAR, 1.0, 2.0)
    lids = lids_of(mesh)
    assert not lids.used.any()
    volume = signed_volume(lids.extension @ mesh.vertices, lids.closed(mesh))
    assert volume == pytest.approx(3.0)


def test_a_closed_mesh_has_no_lids_and_its_own_faces():
    lids = lids_of(BALL)
    assert lids.encloses.all()
    assert not len(lids.faces)
    assert lids.closed(BALL) is BALL.faces


def test_the_option_decides_for_open_components():
    cap = SHEETS["shallow cap"]()
    mesh = together(open_box(), cap.with_vertices(cap.vertices + 5))
    closed = together(BALL, SHEETS["flag"]())
    assert lids_of(mesh).encloses.tolist() == [True, False]
    assert lids_of(mesh, True).encloses.tolist() == [True, True]
    assert lids_of(mesh, False).encloses.tolist() == [False, False]
    assert lids_of(closed, False).encloses.tolist() == [True, False]


def test_nothing_encloses_a_volume_of_zero():
    flat = Mesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 1, 2], [0, 2, 3]],
    )
    assert not lids_of(flat, True).has_volume
    # A closed shell that is folded flat: two sheets with a common border.
    pillow = BALL.with_vertices(BALL.vertices * [1, 1, 0])
    assert not lids_of(pillow).has_volume
    # Two bodies of opposite orientation.
    inside_out = pipe(lambda u, v: (np.cos(u) + 5, -np.sin(u), 6 * v))
    cancelling = together(tube(), inside_out)
    assert not lids_of(cancelling).has_volume


@pytest.mark.parametrize("option", [None, True])
def test_a_one_sided_surface_encloses_nothing(option):
    strip = moebius_strip()
    assert not lids_of(strip, option).has_volume


SPIKE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 4]])


def test_the_winding_of_few_faces_is_summed_over_pairs_of_them():
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    several = [
        Mesh(SPIKE, tetrahedron),
        Mesh(SPIKE, tetrahedron[1:]),
        Mesh(*CUBE),
        Mesh(CUBE[0], CUBE[1][:8]),
    ]
    several.append(Mesh(SPIKE, tetrahedron[1:, ::-1]))
    mesh = together(*several)
    sizes = np.array([each.n_faces for each in several])
    found = _winding_of_few(mesh, np.arange(mesh.n_faces), np.cumsum(sizes) - sizes, sizes)
    assert_allclose(found[[0, 2]], 1.0, atol=1e-12)  # the whole inside, from any point
    assert found[4] == -found[1]
    for one, each in zip(found, several, strict=True):
        assert abs(one - mean_winding(each.vertices, each.faces)) < 0.12


def test_thousands_of_leaves_and_cups_are_told_apart_soon(rng):
    leaf = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0.3], [0, 1, -0.2]], [[0, 1, 2], [0, 2, 3]])
    spike = Mesh(SPIKE, [[0, 1, 3], [0, 3, 2], [1, 2, 3]])
    cup = cut(models.sphere(42), 2, 0.8)
    kinds = [leaf] * 1500 + [spike] * 1500 + [cup] * 150
    mesh = together(*(kinds[k] for k in rng.permutation(len(kinds))))
    began = time.process_time()
    lids = lids_of(mesh)
    assert time.process_time() - began < 5.0
    n_faces = np.bincount(mesh.components[mesh.faces[:, 0]])
    assert_array_equal(lids.encloses, n_faces > 2)


@pytest.mark.parametrize(
    ("mesh", "option", "says"),
    [
        (BALL, None, "Closed surface: volume kept"),
        (open_box(), None, "1 hole: volume kept under a lid"),
        (tube(), None, "2 holes: volume kept under lids"),
        (tube(), False, "Open surface, lids off: no volume to preserve"),
        (SHEETS["plane"](), None, "Open sheet: no volume to preserve"),
        (SHEETS["plane"](), True, "No enclosed volume: nothing to preserve"),
        (
            together(BALL, SHEETS["plane"]()),
            True,
            "Closed surface: volume kept; 1 part has no volume",
        ),
        (
            together(SHEETS["plane"](), SHEETS["flag"]()),
            None,
            "2 open sheets: no volume to preserve",
        ),
        (
            together(tube(), SHEETS["flag"]()),
            None,
            "2 holes: volume kept under lids; 1 open sheet has no volume",
        ),
        (
            together(BALL, SHEETS["plane"](), SHEETS["flag"]()),
            None,
            "Closed surface: volume kept; 2 open sheets have no volume",
        ),
        (with_walls(BAR, 1.0), None, "2 chambers with common walls: volume of each kept"),
        (with_walls(BAR, 1.0, 2.0), None, "3 chambers with common walls: volume of each kept"),
        (
            with_walls(open_box(), 1.0),
            None,
            "2 chambers with common walls, 1 hole: volume of each kept under a lid",
        ),
    ],
)
def test_one_sentence_says_what_has_a_volume(mesh, option, says):
    assert volume_summary(mesh, option) == says
