"""A component follows what it lies against, is around or inside of; values are carried to it."""

import numpy as np
import pytest
from bodies import ball, joined, rod, tube
from numpy.testing import assert_allclose, assert_array_equal
from solids import rotation

from vtk_segdeform.geometry import Carrying, carriers, towards
from vtk_segdeform.mesh import Mesh

BAR = rod(0.5, 0.0, 4.0)


def beside(gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a thinner bar beside the `BAR`."""
    vertices, faces = rod(0.3, 0.5, 3.5)
    return vertices + [0.8 + gap, 0.0, 0.0], faces


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        ([tube(0.6, 0.7, 1.0, 3.0)], [0, 0]),
        ([tube(1.5, 1.6, 1.0, 3.0)], [0, 0]),  # around, with a gap of twice the radius
        ([beside(0.01)], [0, 0]),
        ([beside(0.1)], [0, 1]),
        ([beside(2.0)], [0, 1]),
        ([ball(0.2, [0.72, 0.0, 2.0])], [0, 0]),
        ([ball(0.2, [0.9, 0.0, 2.0])], [0, 1]),
        ([ball(0.2, [0.57, 0.57, 2.0])], [0, 1]),
        ([ball(0.05, [0.6, 0.0, 2.0], 1)], [0, 0]),  # a speck, although the gap is its radius
        ([ball(0.05, [1.5, 0.0, 2.0], 1)], [0, 1]),
        ([tube(0.73, 0.8, 1.0, 3.0), tube(0.6, 0.7, 1.0, 3.0)], [0, 2, 0]),
    ],
)
def test_what_lies_against_or_around_a_body_follows_it(others, expected):
    mesh = joined(BAR, *others)
    assert_array_equal(carriers(mesh, roots=np.array([0])), expected)
    assert (carriers(mesh) == np.arange(len(expected))).sum() == len({0, *expected} - {2})


def test_what_is_inside_follows():
    inner = rod(0.15, 1.0, 3.0)
    assert_array_equal(carriers(joined(tube(0.5, 0.6, 0.0, 4.0), inner)), [0, 0])
    assert_array_equal(carriers(joined(BAR, (inner[0], inner[1][:, ::-1]))), [0, 0])


def test_a_wall_follows_the_wall_around_it_and_not_a_bubble_between_them():
    outer, inner = ball(1.0, [0.0, 0.0, 0.0], 3), ball(0.9, [0.0, 0.0, 0.0], 3)
    bubble = ball(0.02, [0.0, 0.0, 0.94], 1)  # nearer to both than they are to each other
    mesh = joined(outer, (inner[0], inner[1][:, ::-1]), (bubble[0], bubble[1][:, ::-1]))
    assert_array_equal(carriers(mesh)[:2], [0, 0])
    assert carriers(mesh)[2] in (0, 1)


def test_what_is_inside_follows_wherever_it_is():
    wide = ball(2.0, [0.0, 0.0, 0.0], 3)
    for place in ([0.0, 0.0, 0.0], [0.0, 0.0, -0.9], [0.7, 0.5, 0.4]):
        x, faces = ball(0.5, place)
        assert_array_equal(carriers(joined(wide, (x, faces[:, ::-1]))), [0, 0])
    assert_array_equal(carriers(joined(wide, ball(0.5, [0.0, 0.0, 2.9]))), [0, 1])


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_followers_do_not_depend_on_the_frame(scale):
    mesh = joined(BAR, tube(0.6, 0.7, 1.0, 3.0), beside(0.1), ball(0.1, [0.0, -0.62, 3.5]))
    turn = rotation([1.0, 2.0, -0.5], 0.8)
    moved = mesh.with_vertices(scale * (mesh.vertices @ turn.T + [5.0, -7.0, 2.0]))
    assert_array_equal(carriers(mesh), [0, 0, 1, 0])
    assert_array_equal(carriers(moved), carriers(mesh))


def test_many_small_components_follow_the_nearest_large_one():
    at = [[0.53 * np.cos(k), 0.53 * np.sin(k), 0.2 + 0.09 * k] for k in range(40)]
    far = [[3.0, 0.0, z] for z in (0.0, 1.0, 2.0)]
    mesh = joined(BAR, beside(0.5), *(ball(0.03, place, 0) for place in [*at, *far]))
    assert_array_equal(carriers(mesh), [0, 1, *[0] * 40, *range(42, 45)])


def test_a_root_carries_and_a_free_component_is_alone():
    mesh = joined(BAR, tube(0.6, 0.7, 1.0, 3.0), tube(0.73, 0.8, 1.0, 3.0))
    assert_array_equal(carriers(mesh), [0, 0, 1])
    assert_array_equal(carriers(mesh, roots=np.array([1])), [1, 1, 1])
    assert_array_equal(carriers(mesh, roots=np.array([0, 2])), [0, 2, 2])
    assert_array_equal(carriers(mesh, {1: "free"}), [0, 1, 0])
    assert_array_equal(carriers(mesh, {2: 0}, roots=np.array([0, 2])), [0, 2, 0])


def test_trees_can_be_turned_towards_other_roots():
    assert_array_equal(towards(np.array([0, 0, 1, 3, 3]), np.array([2])), [1, 2, 2, 3, 4])
    assert_array_equal(towards(np.array([0, 0, 1]), np.array([0, 2])), [0, 0, 2])


def test_a_follower_has_the_values_of_the_nearest_points():
    """Close to the carrier; a linear function is carried as far as the gap allows."""
    mesh = joined(BAR, tube(0.51, 0.53, 1.0, 3.0, n=40, step=0.07))
    z = mesh.vertices[:, 2:]
    both = Carrying(mesh, np.array([0, 0])).carried(np.where(mesh.components == 0, z.T, 9.0).T)
    assert_allclose(both, z, atol=1e-9)


def test_inside_a_body_values_are_smooth_between_its_sides():
    """A rod in the middle of a bar sees both sides of it; nearest points jump between them."""
    inner, faces = rod(0.1, 0.5, 3.5, n=16)
    mesh = joined(BAR, (inner, faces[:, ::-1]))
    x, own = mesh.vertices, mesh.components == 1
    values = Carrying(mesh, np.array([0, 0])).carried(x[:, :1])[own, 0]
    i, j = mesh.edges[own[mesh.edges[:, 0]]].T
    every = np.zeros(len(x))
    every[own] = values
    assert np.abs(every[i] - every[j]).max() < 0.12  # the sides differ by 1
    assert values.min() > -0.5
    assert values.max() < 0.5


def test_carried_weights_sum_to_one():
    mesh = joined(BAR, tube(0.7, 0.9, 1.0, 3.0))
    share = np.clip(mesh.vertices[:, 2:] - 1.5, 0.0, 1.0)
    given = np.where((mesh.components == 0)[:, None], np.hstack([share, 1.0 - share]), np.nan)
    carried = Carrying(mesh, np.array([0, 0])).carried(given)
    assert_allclose(carried.sum(axis=1), 1.0, atol=1e-9)
    assert carried.min() > -1e-9


def test_a_mesh_of_one_component_has_no_followers():
    mesh = Mesh(*BAR)
    assert_array_equal(carriers(mesh), [0])
    assert not Carrying(mesh, carriers(mesh)).is_carried.any()
