"""The term of sliding vertices: its value in closed form, its gradient and its Hessian."""

from __future__ import annotations

import numpy as np
import pytest
from limbed import torso
from numpy.testing import assert_allclose
from solids import icosphere, rotation

from vtk_segdeform.deformer.slides import Slide, guides
from vtk_segdeform.mesh import Mesh, distance_to_surface
from vtk_segdeform.solver import Sliding

BODY = Mesh(*icosphere(2))
CAP = np.flatnonzero(BODY.vertices[:, 2] > 0.8)
AXIS = (0.3, -1.0, 0.5)
KINDS = [("plane", AXIS), ("line", AXIS), ("plane", None), ("surface", None)]


def sliding(along, direction, weight=2.5):
    """Return the term of a cap in terms of six cage vertices, and these, off the track."""
    rng = np.random.default_rng(3)
    track = guides([Slide(CAP, along, direction)], BODY)[0].track
    rows = rng.dirichlet(np.ones(6), len(CAP))
    p = 1.5 * rng.normal(size=(6, 3)) + [0.0, 0.0, 1.3]
    return Sliding.at(p, (np.arange(6), rows), track, weight), p


@pytest.mark.parametrize(("along", "direction"), KINDS)
def test_its_gradient_is_that_of_its_value(along, direction):
    term, p = sliding(along, direction)
    value, slope = term.value_and_slope(p)
    assert value > 0.0
    step = np.random.default_rng(4).normal(size=p.shape)
    central = [
        (term.value_and_slope(p + e * step)[0] - term.value_and_slope(p - e * step)[0]) / (4.0 * e)
        for e in (1e-3, 5e-4)
    ]
    expected = np.vdot(slope, step)
    errors = np.abs(np.array(central) - expected)
    assert errors[0] < 1e-3 * abs(expected)
    assert errors[1] < max(0.5 * errors[0], 1e-9 * abs(expected))


@pytest.mark.parametrize(("along", "direction"), KINDS)
def test_its_hessian_is_symmetric_and_positive_semidefinite(along, direction):
    term, p = sliding(along, direction)
    full = term.hessian(p)
    assert_allclose(full, full.T)
    assert np.linalg.eigvalsh(full)[0] > -1e-12 * np.abs(full).max()


@pytest.mark.parametrize(("along", "direction"), KINDS[:3])
def test_of_planes_and_lines_it_is_quadratic(along, direction):
    term, p = sliding(along, direction)
    step = np.random.default_rng(4).normal(size=p.shape)
    stacked = step.T.ravel()  # axis by axis
    there, here = term.value_and_slope(p + step)[1], term.value_and_slope(p)[1]
    assert_allclose(term.hessian(p) @ stacked, (there - here).T.ravel())


def test_the_planes_of_a_surface_are_renewed():
    track = guides([Slide(CAP, "surface")], BODY)[0].track
    faces = BODY.vertices[BODY.faces[:9]].mean(axis=1)  # inside faces, which are the planes here
    term = Sliding.at(faces, (np.arange(9), np.eye(9)), track, 2.0)
    assert term.renewed(faces) is term
    there = rotation([0.3, 1.0, -0.2], 0.7) @ faces.T
    outside = 1.02 * there.T
    away = outside - track(outside)[0]
    expected = 2.0 * (away**2).sum()
    assert term.value_and_slope(outside)[0] > 3.0 * expected  # far from its planes
    moved = term.renewed(outside)
    assert moved.value_and_slope(outside)[0] == pytest.approx(expected, rel=0.2)
    assert moved.renewed(outside) is moved


def test_it_is_the_distance_from_the_track():
    x = BODY.vertices[CAP]
    rows, shift = np.eye(len(CAP)), np.array([0.1, 0.2, 0.7])
    unit = np.array(AXIS) / np.linalg.norm(AXIS)
    across = (shift @ unit) ** 2
    for along, expected in (("plane", across), ("line", shift @ shift - across)):
        track = guides([Slide(CAP, along, 9.0 * np.array(AXIS))], BODY)[0].track
        term = Sliding.at(x, (np.arange(len(x)), rows), track, 2.0)
        value = term.value_and_slope(x + shift)[0]
        assert value == pytest.approx(2.0 * len(CAP) * expected)
    outward = 1.3 * x / np.linalg.norm(x, axis=1)[:, None]
    track = guides([Slide(CAP, "surface")], BODY)[0].track
    term = Sliding.at(outward, (np.arange(len(x)), rows), track, 1.0)
    # Above an edge or a corner the distance from the plane of one face is counted, which is less.
    assert term.value_and_slope(outward)[0] == pytest.approx(len(CAP) * 0.3**2, rel=0.1)
    assert term.renewed(x).value_and_slope(x)[0] < 1e-28


def test_the_nearest_point_is_in_the_nearest_triangle():
    """It need not be next to the nearest vertex."""
    mesh = torso()
    rng = np.random.default_rng(0)
    shares, faces = (
        rng.dirichlet(np.ones(3), 2000),
        mesh.faces[rng.integers(mesh.n_faces, size=2000)],
    )
    x = np.einsum("kc,kcj->kj", shares, mesh.vertices[faces])
    x = x + 0.02 * mesh.diagonal * rng.normal(size=x.shape)
    nearest, _ = guides([Slide([0], "surface")], mesh)[0].track(x)
    expected = distance_to_surface(x, mesh.vertices, mesh.faces)
    assert_allclose(np.linalg.norm(x - nearest, axis=1), expected, atol=1e-12)


def test_a_plane_or_a_line_is_by_default_the_nearest_to_the_vertices():
    rng = np.random.default_rng(0)
    frame = rotation(rng.normal(size=3), 1.0)
    x = rng.normal(size=(30, 3)) * [3.0, 1.0, 1e-3] @ frame.T
    faces = np.array([[i + i % 2, i + 1 - i % 2, i + 2] for i in range(28)])
    ids = np.arange(30)
    for along, axis in (("plane", 2), ("line", 0)):
        track = guides([Slide(ids, along)], Mesh(x, faces))[0].track
        normal = track(x)[1][0]
        outer = np.outer(frame[:, axis], frame[:, axis])
        expected = outer if along == "plane" else np.eye(3) - outer
        assert_allclose(normal, expected, atol=0.1 if along == "line" else 2e-3)
