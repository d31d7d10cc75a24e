"""Chambers behind common walls: their volumes against label maps, boxes and shells."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from numpy.testing import assert_allclose
from open_meshes import combined
from organs import mesh_from, nearest_labels, surface_of
from scipy import ndimage
from solids import icosphere, rotation

from vtk_segdeform.geometry import lids_of, signed_volume
from vtk_segdeform.mesh import HalfEdges, Mesh, mesh_of
from vtk_segdeform.solver import total_volume


def pieces(seed: int, size: int) -> np.ndarray:
    return in_pieces(nearest_labels(seed, size))


def in_pieces(labels: np.ndarray) -> np.ndarray:
    """Return *labels* with another one for each connected piece."""
    found, count = np.zeros_like(labels), 0
    for label in np.unique(labels[labels > 0]):
        pieces, more = ndimage.label(labels == label)
        found += np.where(pieces > 0, pieces + count, 0)
        count += more
    return found


def volumes_of(mesh: Mesh) -> np.ndarray:
    """Return the volumes of all chambers, ascending."""
    lids = lids_of(mesh)
    x = lids.extension @ mesh.vertices
    return np.sort([signed_volume(x, faces) for faces in lids.chambers.inside])


def by_label(surface: pv.PolyData, labels: np.ndarray) -> np.ndarray:
    """Return the volume of each label from the labels at both sides of each face, ascending."""
    sides = surface.cell_data["boundary_labels"]

    def summed(label: int) -> float:
        own = [surface.regular_faces[sides[:, side] == label] for side in (0, 1)]
        return abs(np.subtract(*(signed_volume(surface.points.astype(float), f) for f in own)))

    return np.sort([summed(label) for label in np.unique(labels[labels > 0])])


@pytest.mark.parametrize("seed", every(6, range(18)))
def test_chambers_of_a_label_map_have_the_volumes_of_its_voxels(seed):
    labels = pieces(seed, 16)
    counts = np.sort(np.bincount(labels.ravel())[1:])
    assert_allclose(volumes_of(mesh_from(surface_of(labels))), counts[counts > 0], rtol=1e-9)


@pytest.mark.parametrize(("seed", "size"), every(4, [(k, n) for k in range(8) for n in (10, 20)]))
def test_chambers_of_a_smoothed_label_map_are_its_labels(seed, size):
    surface = surface_of(labels := pieces(seed, size), 16)
    expected, found = by_label(surface, labels), volumes_of(mesh_from(surface))
    # Single voxels may be smoothed to nothing and become part of a neighbour.
    found, expected = (each[each > 1e-3 * expected.sum()] for each in (found, expected))
    assert_allclose(found, expected, rtol=1e-3)


def with_slivers(seed: int, size: int) -> np.ndarray:
    """Return labels as `nearest_labels`, whose distances are weighted: some are slivers."""
    rng = np.random.default_rng(seed)
    count, scale = rng.integers(2, 9), size / 15
    points = rng.uniform(2 * scale, 12 * scale, (count, 3))
    places = np.moveaxis(np.indices((size,) * 3), 0, -1)
    distance = np.linalg.norm(places[..., None, :] - points, axis=-1)
    labels = (distance * rng.uniform(0.8, 1.2, count)).argmin(axis=-1) + 1
    radius = np.linalg.norm((places - 7 * scale) * [1.0, 1.0, 1.2], axis=-1)
    return in_pieces(np.where(radius > 6 * scale, 0, labels))


@pytest.mark.parametrize(
    ("seed", "size"), every(8, [(2, 15), (73, 12), (2, 24), (5, 24), (6, 12), (12, 12), (90, 15)])
)
def test_folded_slivers_do_not_open_the_chambers_around_them(seed, size):
    """Of these maps faces at slivers are not in the order of their sides."""
    surface = surface_of(labels := with_slivers(seed, size), 16)
    mesh = mesh_from(surface)
    assert_allclose(volumes_of(mesh).sum(), by_label(surface, labels).sum(), rtol=1e-4)
    require_closed(mesh)


def require_closed(mesh: Mesh) -> None:
    found = lids_of(mesh).chambers
    for faces in (*found.inside, *found.hulls):
        assert not len(HalfEdges(faces, mesh.n_vertices).net_boundary)


def compartments(*cuts: tuple[float, ...]) -> Mesh:
    """Return a box from 0 to 1 with inner walls at the *cuts* of each axis: blocks, welded."""
    edges = [np.array([0.0, *cut, 1.0]) for cut in cuts]
    counts = [len(edge) for edge in edges]
    number = np.arange(np.prod(counts)).reshape(counts)
    quads = []
    for axis in range(3):
        n = np.moveaxis(number, axis, 0)
        quads.append(
            np.stack([n[:, :-1, :-1], n[:, 1:, :-1], n[:, 1:, 1:], n[:, :-1, 1:]], -1)
            .reshape(-1, 4)
        )  # fmt: skip
    a, b, c, d = np.concatenate(quads).T
    x = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return mesh_of(x, triangles).mesh


CUTS = [((0.3,), (), ()), ((0.3,), (0.6,), ()), ((0.25, 0.7), (0.4,), (0.1,))]


def blocks(cuts) -> np.ndarray:
    """Return the volumes of the compartments in closed form, ascending."""
    x, y, z = (np.diff([0.0, *cut, 1.0]) for cut in cuts)
    return np.sort(np.einsum("i,j,k", x, y, z).ravel())


@pytest.mark.parametrize("cuts", CUTS)
def test_compartments_of_a_box_have_their_volumes(cuts):
    """Three faces meet at the edges of one wall, four where two walls cross, six at corners."""
    mesh = compartments(*cuts)
    assert_allclose(volumes_of(mesh), blocks(cuts), rtol=1e-12)
    lids = lids_of(mesh)
    assert_allclose(signed_volume(mesh.vertices, lids.closed(mesh)), 1.0, rtol=1e-12)
    count = len(blocks(cuts))
    assert lids.summary() == f"{count} chambers with common walls: volume of each kept"


@pytest.mark.parametrize("far", [0.0, 1e5])
def test_motion_order_of_faces_and_turned_walls_change_nothing(far):
    surface = surface_of(labels := pieces(3, 12), 16)
    expected = by_label(surface, labels)
    rng = np.random.default_rng(1)
    faces = rng.permutation(surface.regular_faces)
    faces = np.stack(
        [np.roll(f, k) for f, k in zip(faces, rng.integers(0, 3, len(faces)), strict=True)]
    )
    faces[::2] = faces[::2, [0, 2, 1]]  # `mesh_of` turns the faces of each wall alike
    x = surface.points.astype(float) @ rotation([1, 2, 3], 0.7).T + [far, -far, 2 * far]
    assert_allclose(volumes_of(mesh_of(x, faces).mesh), expected, rtol=1e-9 if far else 1e-11)


def test_a_cavity_in_a_chamber_and_a_divided_body_in_a_cavity():
    outer, inner = compartments((0.5,), (), ()), compartments((), (0.4,), ())
    small = inner.with_vertices(0.1 * inner.vertices + [0.2, 0.45, 0.45])
    x, faces = icosphere(2)
    ball = Mesh(0.2 * x + [0.25, 0.5, 0.5], faces)
    hole = signed_volume(ball.vertices, ball.faces)
    mesh = combined(outer, ball, small)
    assert_allclose(volumes_of(mesh), [0.4e-3, 0.6e-3, 0.5, 0.5])
    lids = lids_of(mesh)
    assert lids.encloses.all()
    assert_allclose(signed_volume(mesh.vertices, lids.closed(mesh)), 1.001 - hole)


def test_a_flap_on_a_body_is_no_chamber_and_its_lid_no_hole(rng):
    x, faces = icosphere(2)
    points = x @ rotation([1, 2, 3], 0.7).T
    for reach in (1.3, 0.7):  # outside and inside
        edge = faces[rng.integers(len(faces)), :2]
        tip = reach * points[edge].mean(axis=0)
        flapped = Mesh(np.append(points, [tip], axis=0), [*faces, [*edge, len(points)]])
        lids = lids_of(flapped)
        (inside,) = lids.chambers.inside
        assert_allclose(
            signed_volume(lids.extension @ flapped.vertices, inside), signed_volume(points, faces)
        )
        assert_allclose(total_volume(flapped).target, signed_volume(points, faces))
        assert lids.summary() == "Closed surface: volume kept"
        assert not lids.is_open.any()
