"""Models have the requested number of vertices, are closed and well shaped, and deterministic."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vtk_segdeform import models
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.models.implicit import Limb, implicit_surface

BODIES = [
    (models.cactus, 500), (models.dinosaur, 1000),
    pytest.param((models.cactus, 5430), marks=pytest.mark.campaign),
    pytest.param((models.cactus, 20_003), marks=pytest.mark.campaign),
    pytest.param((models.dinosaur, 4000), marks=pytest.mark.campaign),
]  # fmt: skip


@functools.cache
def made(make: Callable[[int], Mesh], n: int) -> Mesh:
    return make(n)


@pytest.fixture(params=BODIES, ids=lambda body: f"{body[0].__name__}-{body[1]}")
def body(request) -> tuple[Mesh, int]:
    make, n = request.param
    return made(make, n), n


def euler(mesh: Mesh) -> int:
    return mesh.n_vertices - len(mesh.edges) + mesh.n_faces


def least_angles(mesh: Mesh) -> np.ndarray:
    """Return the least angle of each triangle in degrees."""
    angles = []
    for k in range(3):
        a, b, c = (mesh.vertices[mesh.faces[:, (k + step) % 3]] for step in range(3))
        u, v = b - a, c - a
        across = np.linalg.norm(np.cross(u, v), axis=1)
        angles.append(np.degrees(np.arctan2(across, np.einsum("ij,ij->i", u, v))))
    return np.min(angles, axis=0)


def test_a_body_has_n_vertices_one_component_and_genus_zero(body):
    mesh, n = body
    assert mesh.n_vertices == n
    assert euler(mesh) == 2
    assert mesh.components.max() == 0
    assert len(np.unique(mesh.faces)) == n
    assert signed_volume(mesh.vertices, mesh.faces) > 0.02


def test_a_body_stands_on_the_ground_with_height_one(body):
    mesh, _ = body
    assert mesh.vertices[:, 2].min() == 0.0
    assert mesh.vertices[:, 2].max() == 1.0


def test_the_triangles_of_a_body_are_well_shaped(body):
    mesh, _ = body
    angles = least_angles(mesh)
    assert angles.min() > 15.0
    assert np.percentile(angles, 1.0) > 28.0
    edges = mesh.vertices[mesh.edges]
    length = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1)
    assert length.max() < 4.0 * length.min() ** 0.5 * np.median(length) ** 0.5


def test_models_are_deterministic():
    make, n = BODIES[0]  # not the one that the other tests share
    one, two = made(make, n), make(n)
    assert one is not two
    assert_array_equal(one.vertices, two.vertices)
    assert_array_equal(one.faces, two.faces)


@pytest.mark.parametrize("n", [4, 5, 50, 2562])
def test_a_sphere_of_any_number_of_vertices_is_closed_and_round(n):
    mesh = models.sphere(n, radius=3.0)
    assert (mesh.n_vertices, euler(mesh)) == (n, 2)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 3.0, rtol=1e-12)


def test_the_volumes_of_sphere_and_torus_converge_with_order_1_in_n():
    for make, exact in (
        (models.sphere, 4 / 3 * np.pi),
        (models.torus, 2 * np.pi**2 * 0.35**2),
    ):
        coarse, fine = make(2000), make(8000)
        errors = [exact - signed_volume(mesh.vertices, mesh.faces) for mesh in (coarse, fine)]
        assert 0 < errors[1] < errors[0]
        assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("n", [30, 31, 101, 3000])
def test_a_torus_of_any_number_of_vertices_has_one_hole_and_six_neighbours_everywhere(n):
    mesh = models.torus(n)
    assert (mesh.n_vertices, euler(mesh)) == (n, 0)
    assert (np.bincount(mesh.edges.ravel()) == 6).all()
    assert least_angles(mesh).min() > 20.0  # at the seam too


@pytest.mark.parametrize("divisions", [(1, 1, 1), (8, 8, 40), (3, 5, 7)])
def test_a_bar_has_the_volume_and_area_of_a_box(divisions):
    mesh = models.bar((0.5, 2.0, 3.0), divisions)
    a, b, c = divisions
    assert mesh.n_vertices == 2 * (a * b + b * c + c * a) + 2
    assert euler(mesh) == 2
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(3.0, rel=1e-14)
    assert mesh.face_areas.sum() == pytest.approx(17.0, rel=1e-14)


def test_vertices_of_an_implicit_surface_lie_on_it():
    mesh = implicit_surface(
        lambda x: np.linalg.norm(x, axis=1) - 1.0, np.array([[-1.0] * 3, [1.0] * 3]), 777
    )
    assert mesh.n_vertices == 777
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1.0, atol=1e-12)


def test_the_largest_of_several_components_is_used():
    def ball_and_crumb(x):
        ball = np.linalg.norm(x, axis=1) - 1.0
        return np.minimum(ball, np.linalg.norm(x - [1.6, 0.0, 0.0], axis=1) - 0.3)

    mesh = implicit_surface(ball_and_crumb, np.array([[-1.0] * 3, [2.0, 1.0, 1.0]]), 600)
    assert mesh.n_vertices == 600
    assert mesh.vertices[:, 0].max() < 1.01


def test_a_straight_limb_is_a_capsule():
    limb = Limb([(0, 0, 0), (0, 0, 1)], [0.1, 0.1])
    x = np.array([[0.15, 0, 0.5], [0, 0.05, 0.5], [0, 0, 1.12], [0, 0, -0.13], [5.0, 0, 0]])
    np.testing.assert_allclose(limb(x), [0.05, -0.05, 0.02, 0.03, 0.1], atol=1e-12)


def test_invalid_arguments_are_errors_with_advice():
    for call in (
        lambda: models.cactus(20),
        lambda: models.cactus("many"),
        lambda: models.cactus(np.nan),
        lambda: models.dinosaur(None),
        lambda: models.dinosaur(1000.5),
        lambda: models.sphere([100, 200]),
        lambda: models.sphere(100, radius=0.0),
        lambda: models.torus(100, minor="thin"),
        lambda: models.bar(5430),
        lambda: models.bar((1.0, np.nan, 1.0)),
        lambda: models.bar(divisions=(2, 2)),
        lambda: models.bar(divisions=(1.5, 2, 2)),
        lambda: models.sphere(3),
        lambda: models.torus(29),
        lambda: models.torus(100, major=1.0, minor=1.5),
        lambda: models.bar(divisions=(0, 1, 1)),
    ):
        with pytest.raises(ArgumentError, match=r"must be|needs"):
            call()
    for size in (1e-320, 1e300):
        with pytest.raises(ArgumentError, match="a mesh with radius 1e"):
            models.sphere(radius=size)
        with pytest.raises(ArgumentError, match=r"a mesh with size .1e"):
            models.bar((size, size, size))
        with pytest.raises(ArgumentError, match=r"a mesh with major 1e.* and minor"):
            models.torus(major=size, minor=size / 2)
