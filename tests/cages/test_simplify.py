"""Simplification keeps topology, orientation and shape, with and without compiled kernels."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import CUBE, icosphere, rotation, torus, two_components

from vtk_segdeform.cages.cage import cage_faults
from vtk_segdeform.cages.simplify import roundness, simplify
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.geometry.volume import signed_volume

TURN = rotation([1.0, 2.0, -0.5], 1.234)


def fine_cube(times=3):
    """Return a cube whose faces are split in four several times."""
    vertices, faces = CUBE
    for _ in range(times):
        pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, which = np.unique(pairs, axis=0, return_inverse=True)
        (a, b, c), (ab, bc, ca) = faces.T, (len(vertices) + which.reshape(-1, 3)).T
        parts = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
        faces = np.concatenate([np.stack(part, axis=-1) for part in parts])
    return vertices, faces


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize(("solid", "genus"), [(icosphere(4), 0), (torus(), 1)])
def test_simplifying_preserves_the_topology_and_reaches_n_vertices(solid, genus):
    for n in (300, 77, 20):
        vertices, faces = simplify(*solid, n)
        assert len(vertices) == n
        assert len(vertices) - len(faces) // 2 == 2 - 2 * genus
        assert cage_faults(vertices, faces) == ()
        assert roundness(vertices, faces).min() > 0.1


@pytest.mark.usefixtures("either")
def test_simplifying_stops_where_every_component_is_a_tetrahedron():
    vertices, faces = simplify(*two_components(), 3)
    assert len(vertices) == 8
    assert cage_faults(vertices, faces) == ()


@pytest.mark.usefixtures("either")
def test_simplifying_a_rough_surface_inverts_no_face():
    ball, faces = icosphere(4)
    rough = ball * np.random.default_rng(0).uniform(0.5, 1.5, (len(ball), 1))
    vertices, faces = simplify(rough, faces, 300)
    a, b, c = vertices[faces.T]
    assert (np.einsum("fi,fi->f", np.cross(b - a, c - a), a + b + c) > 0).all()


@pytest.mark.usefixtures("either")
def test_a_simplified_cube_is_nearly_the_same_cube():
    fine, faces = fine_cube()
    vertices, found = simplify(fine @ TURN.T + 3.0, faces, 60)
    assert len(vertices) == 60
    assert signed_volume(vertices, found) == pytest.approx(1.0, abs=0.03)
    back = (vertices - 3.0) @ TURN
    depth = np.minimum(back, 1.0 - back).min(axis=1)
    assert np.abs(depth).max() < 0.05
    corners = np.linalg.norm(back[:, None] - CUBE[0], axis=2).min(axis=0)
    assert corners.max() < 0.05


@pytest.mark.usefixtures("either")
def test_a_simplified_surface_moves_with_the_surface():
    ball, faces = icosphere(3)
    bumpy = ball * np.random.default_rng(1).uniform(0.9, 1.1, (len(ball), 1))  # without symmetries
    vertices, found = simplify(bumpy, faces, 90)
    moved, same = simplify(10.0 * bumpy @ TURN.T, faces, 90)
    assert_array_equal(same, found)
    assert_allclose(moved, 10.0 * vertices @ TURN.T, atol=1e-9)


def test_roundness_is_one_for_equilateral_triangles_and_zero_for_needles():
    corners = np.array([[0.0, 0, 0], [2, 0, 0], [1, np.sqrt(3.0), 0], [1, 0, 0], [0, 2, 0]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    expected = [1.0, 0.0, 4.0 * np.sqrt(3.0) * 2.0 / 16.0]
    assert_allclose(roundness(corners @ TURN.T, faces), expected, atol=1e-14)


def test_progress_of_simplifying_increases_from_zero_and_can_cancel():
    seen = []
    simplify(*icosphere(3), 50, progress=lambda fraction, _: seen.append(fraction))
    assert seen[0] == 0.0
    assert seen == sorted(seen)
    assert 0.5 < seen[-1] < 1.0

    def stop(fraction, message):
        raise Cancelled(message)

    with pytest.raises(Cancelled):
        simplify(*icosphere(3), 50, progress=stop)
