from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import CUBE, SOLIDS, icosphere, somewhere, torus

from vtk_segdeform.geometry.volume import (
    outer_components,
    signed_volume,
    step_to_volume,
    volume_along,
    volume_gradient,
)

MESHES = {**SOLIDS, "sphere": icosphere(3), "torus": torus()}


@pytest.fixture(params=MESHES, ids=str)
def mesh(request):
    return MESHES[request.param]


@pytest.mark.usefixtures("either")
def test_compiled_kernels_and_numpy_give_the_volumes_of_known_solids():
    vertices, faces = CUBE[0] + 7.0, CUBE[1]
    assert signed_volume(vertices, faces) == pytest.approx(1.0, rel=1e-14)
    # Moved by t along the outward diagonal of every corner, the cube has sides 1 + 2 t.
    terms = volume_along(vertices, 2.0 * CUBE[0] - 1.0, faces)
    assert_allclose(terms, [1.0, 6.0, 12.0, 8.0], rtol=1e-13)
    gradient = volume_gradient(vertices, faces)
    assert_allclose(gradient.sum(axis=0), 0.0, atol=1e-15)
    assert np.vdot(gradient, 2.0 * CUBE[0] - 1.0) == pytest.approx(6.0, rel=1e-14)


def test_icospheres_converge_to_the_ball_with_order_two():
    errors = [4 * np.pi / 3 - signed_volume(*icosphere(level)) for level in (2, 3, 4, 5)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert_allclose(orders, 2.0, atol=0.1)
    assert orders[-1] == pytest.approx(2.0, abs=0.01)


def test_far_from_the_origin_only_coordinates_lose_digits(mesh):
    vertices, faces = mesh
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    far = vertices + 1e4 * diagonal * np.array([0.6, -0.64, 0.48])
    # The coordinates have an error of 1e4 * 2^-53 = 1e-12 of the diagonal, and so has V.
    assert signed_volume(far, faces) == pytest.approx(signed_volume(vertices, faces), rel=1e-11)
    assert_allclose(
        volume_gradient(far, faces), volume_gradient(vertices, faces), atol=1e-11 * diagonal**2
    )
    # The cubic of the far mesh agrees with the volume of the far mesh to the last digits.
    move = somewhere(len(vertices), seed=3, size=0.1 * diagonal)
    at_one = volume_along(far, move, faces).sum()
    assert at_one == pytest.approx(signed_volume(far + move, faces), rel=1e-11)


def test_scaling_by_s_scales_the_volume_by_s_cubed(mesh):
    vertices, faces = mesh
    for scale in (1e-100, 1e-3, 7.0, 1e3, 1e90):
        expected = scale**3 * signed_volume(vertices, faces)
        assert signed_volume(scale * vertices, faces) == pytest.approx(expected, rel=1e-13, abs=0.0)


def test_the_gradient_sums_to_zero_and_times_the_positions_is_three_volumes(mesh):
    vertices, faces = mesh
    gradient = volume_gradient(vertices, faces)
    assert_allclose(gradient.sum(axis=0), 0.0, atol=1e-13)  # a translation changes no volume
    assert np.sum(gradient * vertices) == pytest.approx(3 * signed_volume(*mesh), rel=1e-13)


def test_the_cubic_is_the_volume_along_the_path(mesh):
    vertices, faces = mesh
    d = somewhere(len(vertices), seed=7, size=0.5) + [10.0, 0.0, 0.0]  # translated, too
    for t in (-2.0, -0.3, 0.0, 1e-3, 0.7, 1.0, 5.0):
        terms = volume_along(vertices, d, faces) * t ** np.arange(4)
        volume = signed_volume(vertices + t * d, faces)
        assert abs(terms.sum() - volume) <= 1e-14 * max(1.0, abs(volume), np.abs(terms).sum()) * 4


def test_the_step_reaches_the_target_volume(mesh):
    vertices, faces = mesh
    volume = signed_volume(vertices, faces)
    for seed in range(20):
        d = somewhere(len(vertices), seed=seed, size=0.2) + 0.3 * vertices
        target = volume * (1.0 + np.random.default_rng(seed).uniform(-0.3, 0.3))
        t = step_to_volume(volume_along(vertices, d, faces), target)
        assert signed_volume(vertices + t * d, faces) == pytest.approx(target, rel=1e-14 * 4)


def test_the_step_is_zero_if_the_target_is_met():
    assert step_to_volume(np.array([3.0, 1.0, 1.0, 1.0]), 3.0) == 0.0
    assert step_to_volume(np.array([3.0, 0.0, 0.0, 1.0]), 3.0) == pytest.approx(0.0, abs=1e-15)


def test_the_step_is_zero_if_the_volume_is_constant():
    assert step_to_volume(np.zeros(4), 0.0) == 0.0
    assert step_to_volume(np.array([5.0, 0.0, 0.0, 0.0]), 6.0) == 0.0


def test_an_unreachable_target_gives_the_closest_step():
    # 4 + 2 t - t^2 is at most 5, at t = 1.
    assert step_to_volume(np.array([4.0, 2.0, -1.0, 0.0]), 9.0) == pytest.approx(1.0, rel=1e-12)


def test_the_step_scales_with_the_mesh_and_the_path():
    vertices, faces = icosphere(2)
    d = somewhere(len(vertices), seed=1, size=0.2) + 0.5 * vertices
    expected = step_to_volume(
        volume_along(vertices, d, faces), 1.2 * signed_volume(vertices, faces)
    )
    for size, path in itertools.product((1e-60, 1e-9, 1e-3, 1e6, 1e60), (1e-30, 1.0, 1e30)):
        scaled = volume_along(size * vertices, size * path * d, faces)
        t = step_to_volume(scaled, 1.2 * signed_volume(size * vertices, faces))
        assert t * path == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("slope", [1e-6, 1e-17, -1e-17, 1e-60])
def test_the_step_is_exact_for_a_path_with_a_small_initial_slope(slope):
    assert step_to_volume(np.array([1.0, slope, 0.0, 1.0]), 9.0) == pytest.approx(2.0, rel=1e-6)


def test_a_target_at_an_extremum_of_the_cubic_is_found():
    # (t - 1)^2 (t + 2) = t^3 - 3 t + 2: a double root at 1, complex after rounding.
    assert step_to_volume(np.array([2.0, -3.0, 0.0, 1.0]), 0.0) == pytest.approx(1.0, abs=1e-7)


def test_a_cavity_is_in_the_smallest_body_around_it():
    ball, _ = icosphere(1)
    sizes_of = [4.0, 2.0, -1.0, -3.0, 1.0, -0.5, -0.5]  # negative: a cavity of that radius
    places = np.array(
        [[0, 0, 0], [0, 0, 0], [0.2, 0, 0], [0, 0.1, 0], [9, 0, 0], [9, 0, 0], [30, 0, 0]]
    )
    x = np.concatenate([abs(r) * ball + at for r, at in zip(sizes_of, places, strict=True)])
    component = np.repeat(np.arange(7), len(ball))
    volumes = np.array(sizes_of) ** 3
    found = outer_components(x, component, volumes)
    assert found.tolist() == [0, 1, 1, 0, 4, 4, 6]
    assert outer_components(x, component, np.abs(volumes)).tolist() == list(range(7))
