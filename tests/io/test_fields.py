"""Vectors and tensors on a surface that turn with it, or are pushed forward."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from solids import rotation

from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.io import Surface

TURN = rotation([1.0, -2.0, 0.5], 2.2)


def symmetric_six(full: np.ndarray) -> np.ndarray:
    """Return xx, yy, zz, xy, yz, xz of tensors (k, 3, 3)."""
    return np.stack([full[:, a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))], 1)


def block(kind: str) -> pv.PolyData:
    """Return a block of triangles or quadrilaterals with arrays at points and in cells."""
    grid = pv.ImageData(dimensions=(4, 3, 5), spacing=(0.5, 0.7, 0.3)).extract_surface(
        algorithm="dataset_surface"
    )
    block = grid.triangulate() if kind == "triangles" else grid
    block.clear_data()
    rng = np.random.default_rng(0)
    for data, count in ((block.point_data, block.n_points), (block.cell_data, block.n_cells)):
        full = rng.normal(size=(count, 3, 3))
        data["vector"] = rng.normal(size=(count, 3))
        data["single"] = rng.normal(size=(count, 3)).astype(np.float32)
        data["whole"] = rng.integers(-5, 5, (count, 3))
        data["tensor"] = full.reshape(-1, 9)
        data["six"] = symmetric_six(full + full.transpose(0, 2, 1))
        data["scalar"] = rng.normal(size=count)
        data["pair"] = rng.normal(size=(count, 2))
    return block


def full_of(values: np.ndarray) -> np.ndarray:
    """Return tensors (k, 3, 3) of six or nine components."""
    if values.shape[1] == 9:
        return values.reshape(-1, 3, 3)
    return values[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(-1, 3, 3)


ARRAYS = ["vector", "single", "whole", "tensor", "six"]


@pytest.mark.parametrize("kind", ["triangles", "quadrilaterals"])
@pytest.mark.parametrize("how", ["turn", "push"])
def test_under_a_rotation_everything_turns_exactly(kind, how):
    given = block(kind)
    surface = Surface(given)
    moved = surface.moved(surface.mesh.vertices @ TURN.T + 3.0, **{how: ARRAYS})
    for before, after in ((given.point_data, moved.point_data), (given.cell_data, moved.cell_data)):
        for name in ("vector", "single", "whole"):
            error = 1e-6 if name == "single" else 1e-12
            assert_allclose(after[name], before[name] @ TURN.T, atol=error)
        assert after["single"].dtype == np.float32
        assert after["whole"].dtype == np.float64
        for name in ("tensor", "six"):
            expected = TURN @ full_of(before[name]) @ TURN.T
            assert_allclose(full_of(after[name]), expected, atol=1e-12)
        for name in ("scalar", "pair"):
            assert_array_equal(after[name], before[name])


def plate(counts=(7, 5)) -> pv.PolyData:
    """Return an open plate in z = 0 of triangles."""
    return pv.Plane(
        i_size=2.0, j_size=1.0, i_resolution=counts[0], j_resolution=counts[1]
    ).triangulate()


def test_fibres_of_a_stretched_plate_are_as_long_as_the_stretch():
    given = plate()
    given["fibre"] = np.tile([3.0, 4.0, 2.0], (given.n_points, 1))
    given.cell_data["fibre"] = np.tile([3.0, 4.0, 2.0], (given.n_cells, 1))
    given["stress"] = np.tile(np.diag([1.0, 2.0, 5.0]).ravel(), (given.n_points, 1))
    surface = Surface(given)
    stretched = surface.mesh.vertices * [2.0, 0.5, 1.0]
    pushed = surface.moved(stretched, push=["fibre", "stress"])
    assert_allclose(
        pushed.point_data["fibre"], np.tile([6.0, 2.0, 2.0], (given.n_points, 1)), atol=1e-12
    )
    assert_allclose(pushed.cell_data["fibre"][0], [6.0, 2.0, 2.0], atol=1e-12)
    expected = np.diag([4.0, 0.5, 5.0]).ravel()  # the normal keeps its length
    assert_allclose(pushed.point_data["stress"], np.tile(expected, (given.n_points, 1)), atol=1e-12)
    turned = surface.moved(stretched, turn=["fibre", "stress"])
    assert_allclose(
        turned.point_data["fibre"], given.point_data["fibre"], atol=1e-12
    )  # no rotation


def test_fibres_of_a_bent_plate_are_along_it():
    """A plate that is rolled into an arc: fibres along it turn with its tangent."""
    given = plate((60, 4))
    x = given.points[:, 0].astype(float)
    given["along"] = np.tile([1.0, 0.0, 0.0], (given.n_points, 1))
    given["across"] = np.tile([0.0, 0.0, 1.0], (given.n_points, 1))
    surface = Surface(given)
    angle = surface.mesh.vertices[:, 0]  # curvature 1
    rolled = np.stack([np.sin(angle), surface.mesh.vertices[:, 1], 1.0 - np.cos(angle)], axis=1)
    moved = surface.moved(rolled, turn=["along", "across"])
    tangent = np.stack([np.cos(x), 0.0 * x, np.sin(x)], axis=1)
    normal = np.stack([-np.sin(x), 0.0 * x, np.cos(x)], axis=1)
    # At borders the mean of the triangles is that of one side.
    inside = (np.abs(x) < 0.95) & (np.abs(given.points[:, 1]) < 0.45)
    assert_allclose(moved.point_data["along"][inside], tangent[inside], atol=2e-4)
    assert_allclose(moved.point_data["across"][inside], normal[inside], atol=2e-4)
    assert_allclose(moved.point_data["along"], tangent, atol=0.03)


def test_the_displacement_is_an_array():
    given = block("quadrilaterals")
    surface = Surface(given)
    moved = surface.moved(surface.mesh.vertices * 2.0 + 1.0, displacement="u")
    assert_allclose(moved.point_data["u"], given.points + 1.0, atol=1e-6)
    assert "u" not in given.point_data


def test_points_of_degenerate_faces_and_of_no_face_stay_finite():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 0.5, 0], [7, 7, 7]], float)
    faces = np.array([[3, 0, 1, 2], [3, 1, 3, 2], [3, 1, 4, 2]]).ravel()  # the last has no area
    given = pv.PolyData(points, faces)
    given["v"] = np.tile([1.0, 2.0, 3.0], (6, 1))
    given.cell_data["v"] = np.tile([1.0, 2.0, 3.0], (3, 1))
    surface = Surface(given)
    for how in ("turn", "push"):
        moved = surface.moved(surface.mesh.vertices @ TURN.T, **{how: ["v"]})
        assert np.isfinite(moved.point_data["v"]).all()
        assert np.isfinite(moved.cell_data["v"]).all()
        assert_array_equal(moved.point_data["v"][5], given.point_data["v"][5])
        assert_array_equal(moved.cell_data["v"][2], given.cell_data["v"][2])
        used = [0, 1, 2, 3]
        assert_allclose(
            moved.point_data["v"][used], given.point_data["v"][used] @ TURN.T, atol=1e-12
        )


@pytest.mark.parametrize(
    ("name", "how"), [("nothing", "turn"), ("scalar", "turn"), ("pair", "push")]
)
def test_what_is_no_array_of_vectors_is_named(name, how):
    surface = Surface(block("triangles"))
    with pytest.raises(ArgumentError, match=f"no array '{name}' of vectors or tensors"):
        surface.moved(surface.mesh.vertices, **{how: [name]})
