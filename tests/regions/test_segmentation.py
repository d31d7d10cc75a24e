import itertools

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_array_equal
from open_meshes import combined
from scipy.sparse import csgraph
from solids import OCTAHEDRON, icosphere, rotation, torus, two_components

from vtk_segdeform.errors import ArgumentError, Cancelled, RegionError
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions import Regions, borders
from vtk_segdeform.regions.coarse import coarsen
from vtk_segdeform.regions.segmentation import segment
from vtk_segdeform.regions.slices import quotas


def tube(around, along, outline):
    """Return a closed tube about z; outline(s) is the radius at height 10 s, s in 0..1."""
    s = (np.arange(along) + 0.5) / along
    turn = 2 * np.pi * np.arange(around) / around
    r = outline(s)[:, None]
    z = np.broadcast_to(10 * s[:, None], (along, around))
    rings = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1).reshape(-1, 3)
    bottom, top = along * around, along * around + 1
    i, j = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    first, last = np.arange(around), (along - 1) * around + np.arange(around)
    faces = [
        np.stack([a, b, b + around], -1).reshape(-1, 3),
        np.stack([a, b + around, a + around], -1).reshape(-1, 3),
        np.stack([np.full(around, bottom), np.roll(first, -1), first], -1),
        np.stack([np.full(around, top), last, np.roll(last, -1)], -1),
    ]
    return Mesh(np.concatenate([rings, [[0, 0, 0], [0, 0, 10.0]]]), np.concatenate(faces))


def limbed(around=32, along=107):
    """Return a thick middle (3 < z < 7) with a thin limb at each end."""
    fat = 1.2
    return tube(around, along, lambda s: np.where(abs(s - 0.5) < 0.2, fat, 0.4))


BAR = tube(28, 84, lambda s: np.full_like(s, 0.9))


def cores(mesh, *arguments, **options):
    return segment(mesh, *arguments, overlap=0, **options)


def pieces(mesh, mask):
    ids = np.flatnonzero(mask)
    return csgraph.connected_components(mesh.adjacency[ids][:, ids], directed=False)[0]


def agreement(one, two):
    """Return the fraction of vertices in the same part, with parts matched by largest overlap."""
    table = np.zeros((one.max() + 1, two.max() + 1))
    np.add.at(table, (one, two), 1)
    return table.max(axis=1).sum() / len(one)


def test_two_limbs_are_cut_off_at_their_joints():
    mesh = limbed()
    regions = cores(mesh)
    assert regions.n_regions == 3
    z = mesh.vertices[:, 2]
    expected = np.digitize(z, [3.0, 7.0])
    assert agreement(regions.labels, expected) > 0.97


@pytest.mark.parametrize("n_regions", every(2, [2, 3, 5]))
def test_a_bar_is_cut_into_equal_slices_across_it(n_regions):
    labels = cores(BAR, n_regions).labels
    z = BAR.vertices[:, 2]
    order = np.argsort([z[labels == part].mean() for part in range(n_regions)])
    for below, above in itertools.pairwise(order):
        assert z[labels == below].max() - z[labels == above].min() < 0.7  # a third of its width
    assert np.bincount(labels).min() > 0.7 * len(z) / n_regions


@pytest.mark.parametrize(
    ("mesh", "n_regions"),
    every(
        4,
        itertools.product(
            [Mesh(*icosphere(3)), Mesh(*torus()), limbed(16, 60)], [1, 2, 3, 6, 17, 40]
        ),
    ),
)
def test_there_are_n_regions_each_connected(mesh, n_regions):
    regions = cores(mesh, n_regions)
    assert regions.n_regions == n_regions
    assert all(pieces(mesh, members) == 1 for members in regions.membership)


def test_fewer_regions_than_components_join_the_nearest():
    vertices, faces = two_components()
    far = icosphere(1, 0.2)[0] + [3.6, 0, 0]  # beside the second sphere
    shape = np.concatenate([vertices, far])
    mesh = Mesh(shape, np.concatenate([faces, icosphere(1)[1] + len(vertices)]))
    regions = segment(mesh, 2)
    assert regions.n_regions == 2
    assert len(np.unique(regions.labels[mesh.components == 2])) == 1
    second, third = (regions.labels[mesh.components == k][0] for k in (1, 2))
    assert second == third != regions.labels[mesh.components == 0][0]


def with_buttons(n=10, gap=0.05):
    """Return the limbed body with *n* small balls around its upper limb, and their vertices."""
    body, (ball, faces) = limbed(), icosphere(1)
    turn = np.arange(n) * 2.4
    z = np.linspace(7.8, 9.6, n)
    at = np.stack([(0.45 + gap) * np.cos(turn), (0.45 + gap) * np.sin(turn), z], axis=1)
    balls = (at[:, None] + 0.05 * ball).reshape(-1, 3)
    theirs = (np.arange(n)[:, None, None] * len(ball) + faces).reshape(-1, 3)
    vertices = np.concatenate([body.vertices, balls])
    mesh = Mesh(vertices, np.concatenate([body.faces, theirs + body.n_vertices]))
    return mesh, np.arange(body.n_vertices, mesh.n_vertices)


def test_small_components_join_the_region_that_they_are_nearest_to():
    mesh, buttons = with_buttons()
    labels = cores(mesh, None).labels
    body = limbed()
    assert_array_equal(labels[: body.n_vertices], cores(body, None).labels)
    limb = labels[np.argmax(body.vertices[:, 2])]
    assert (labels[buttons] == limb).all()


def test_the_result_is_invariant_under_translation_rotation_and_scaling():
    mesh = limbed()
    rough = np.random.default_rng(0).normal(0.0, 0.01, mesh.vertices.shape)  # no symmetries
    mesh = mesh.with_vertices(mesh.vertices + rough)
    turned = 37.0 * mesh.vertices @ rotation([1, 2, 3], 1.1).T + [5, -3, 100]
    one, two = cores(mesh, 5).labels, cores(mesh.with_vertices(turned), 5).labels
    assert np.mean(one == two) > 0.999


def test_overlaps_are_as_wide_in_space_on_a_finer_mesh():
    widths = []
    for mesh in (limbed(24, 75), limbed(48, 150)):
        shared = segment(mesh, 3).membership.sum(axis=0) > 1
        widths.append(shared.mean())
    assert widths[1] == pytest.approx(widths[0], rel=0.35)


def test_the_coarse_copy_keeps_the_area_and_connected_cells():
    mesh = limbed()
    cell, surface = coarsen(mesh, 400, np.random.default_rng(0))
    assert surface.areas.sum() == pytest.approx(mesh.face_areas.sum())
    assert 100 < len(surface.areas) < 800
    assert all(pieces(mesh, cell == k) == 1 for k in range(0, len(surface.areas), 7))


def test_smoothing_near_the_borders_equals_smoothing_everywhere(monkeypatch):
    mesh = limbed(48, 150)
    x, y, z = mesh.vertices.T
    x = z + 2.0 * np.sin(3.0 * np.arctan2(y, x))  # a wavy border
    labels = (x > np.quantile(x, 0.7)).astype(int)
    near = borders.smooth_borders(mesh, labels)
    everything = np.arange(mesh.n_vertices)
    within = borders.within_rings

    def wide(graph, ids, rings):
        return everything if graph is mesh.adjacency else within(graph, ids, rings)

    monkeypatch.setattr(borders, "within_rings", wide)
    np.testing.assert_array_equal(near, borders.smooth_borders(mesh, labels))
    assert (near != labels).any()


def test_quotas_are_proportional_to_area_and_sum_to_the_count():
    many = np.array([99, 99, 99])
    np.testing.assert_array_equal(quotas(np.array([6.0, 3.0, 1.0]), many, 10), [6, 3, 1])
    np.testing.assert_array_equal(quotas(np.array([1.0, 1e-6]), many[:2], 3), [2, 1])
    np.testing.assert_array_equal(quotas(np.array([1.0, 1e-6]), np.array([2, 9]), 5), [2, 3])


def test_invalid_arguments_are_errors():
    for wrong in (0, -1, 2.5, 7):
        with pytest.raises(RegionError, match=r"whole number in 1\.\.6"):
            segment(Mesh(*OCTAHEDRON), wrong)
    for wrong in (-1, 1.5):
        with pytest.raises(RegionError, match="overlap must be a whole number, 0 or more"):
            segment(Mesh(*OCTAHEDRON), 2, overlap=wrong)
        with pytest.raises(ArgumentError, match="seed must be a whole number, 0 or more"):
            segment(Mesh(*OCTAHEDRON), 2, seed=wrong)


def test_progress_increases_to_one_and_can_cancel():
    seen = []
    segment(limbed(), 5, progress=lambda fraction, _: seen.append(fraction))
    assert seen == sorted(seen)
    assert seen[-1] == 1.0

    def stop(_, message):
        raise Cancelled(message)

    with pytest.raises(Cancelled):
        segment(limbed(), 5, progress=stop)


def test_the_lines_of_a_coarse_surface_are_edges_and_straight_ways_over_two_triangles():
    n = 5
    x, y = (each.ravel() for each in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    points = np.stack([x, y, np.zeros(n * n)], axis=1).astype(float)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + n, a + n + 1], 1), np.stack([a, a + n + 1, a + 1], 1)])
    cell, surface = coarsen(Mesh(points, faces), 10**6, np.random.default_rng(0))
    np.testing.assert_array_equal(cell, np.arange(n * n))
    np.testing.assert_array_equal(surface.graph.toarray(), surface.graph.toarray().T)
    i, j = surface.lines
    length = np.linalg.norm(points[i] - points[j], axis=1)
    np.testing.assert_allclose(surface.graph.toarray()[i, j], length)
    # edges, both diagonals of each square, and those of each parallelogram of two triangles
    steps = {tuple(sorted(abs(step))) for step in (points[i] - points[j])[:, :2].astype(int)}
    assert steps == {(0, 1), (1, 1), (1, 2)}
    assert len(i) == 2 * (2 * n * (n - 1) + 2 * (n - 1) ** 2 + 2 * (n - 1) * (n - 2))
    np.testing.assert_allclose(surface.areas.sum(), (n - 1) ** 2)
    inside = (x < 4) & (np.arange(n * n) != 7)
    np.testing.assert_array_equal(surface.two_pieces(inside), x < 4)  # the hole is filled
    apart = (x == 0) | (np.arange(n * n) == n * n - 1)
    np.testing.assert_array_equal(surface.two_pieces(apart), x == 0)  # the largest piece
    np.testing.assert_array_equal(surface.two_pieces(x < 2), x < 2)
    part = surface.part(np.array([12, 7, 6]))
    np.testing.assert_array_equal(part.vertices, points[[12, 7, 6]])
    np.testing.assert_array_equal(part.faces, [[2, 0, 1]])
    assert [len(piece) for piece in surface.pieces(np.isin(x, [0, 3, 4]))] == [10, 5]
    away = surface.distance(np.array([0]))
    np.testing.assert_allclose(away[[1, 6, 11, 24]], [1, np.sqrt(2), np.sqrt(5), 4 * np.sqrt(2)])
    assert np.isinf(surface.distance(np.array([0]), 1.1)[6])
    borders_of = np.zeros((n * n, n * n))  # from the middle of an edge to those of its triangles
    for face in faces:
        for one, other in itertools.permutations(face, 2):
            middle = 0.5 * (points[one] + points[other])
            borders_of[one, other] += np.linalg.norm(middle - points[face].mean(axis=0))
    np.testing.assert_allclose(surface.contact.toarray(), np.pi / 4 * borders_of, atol=1e-12)


def test_a_component_has_a_region_of_its_own_unless_it_follows_another():
    ball, faces = icosphere(3)
    n = len(ball)
    for radius, gap, given, expected in (
        (0.7, 0.3, {}, 2),
        (0.7, 0.02, {}, 1),
        (0.7, 0.02, {"held": [0, n]}, 2),
        (0.7, 0.02, {"held": [0]}, 1),
        (0.7, 0.02, {"attach": {1: "free"}}, 2),
        (0.7, 0.3, {"attach": {1: 0}, "held": [n]}, 1),
        (0.02, 0.02, {}, 1),
    ):
        both = np.concatenate([ball, radius * ball + [1.0 + gap + radius, 0, 0]])
        mesh = Mesh(both, np.concatenate([faces, faces + n]))
        regions = segment(mesh, **given)
        assert regions.n_regions == expected
        assert (regions.carrier is None) == (expected == 2)


def test_pieces_of_a_part_join_the_part_of_the_nearest_vertex():
    mesh = limbed()
    labels = np.digitize(mesh.vertices[:, 2], [3.0, 7.0])
    stray = labels.copy()
    stray[np.argmin(mesh.vertices[:, 2])] = 1
    stray[np.argmin(np.abs(mesh.vertices[:, 2] - 5.0))] = 0
    np.testing.assert_array_equal(borders.connected_parts(mesh, labels), labels)
    np.testing.assert_array_equal(borders.connected_parts(mesh, stray), labels)


def test_components_that_change_have_regions_of_their_own_and_leaders():
    x, faces = icosphere(2)
    shells = [Mesh(radius * x, faces) for radius in (1.0, 0.8, 0.6)]
    mesh = combined(*shells, Mesh(x + [5.0, 0.0, 0.0], faces))
    regions = segment(mesh)
    assert_array_equal(regions.carrier, [0, 0, 1, 3])
    assert regions.leader is None
    for apart in ([2], [0], [1, 2]):
        regions = segment(mesh, apart=apart)
        assert_array_equal(regions.carrier, [0, 1, 2, 3])
        assert_array_equal(regions.leader, [0, 0, 1, 3])
        assert_array_equal(regions.components.sum(axis=0), 1)
        assert_array_equal(regions.grow(1).leader, regions.leader)
    assert segment(mesh, apart=[3]).leader is None
    with pytest.raises(ArgumentError, match="apart"):
        segment(mesh, apart=[4])
    with pytest.raises(RegionError, match="leader must be one of"):
        Regions(mesh, regions.membership, leader=[1, 0, 2, 3])
