import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csgraph
from solids import CUBE, icosphere, two_components

from vtk_segdeform.errors import RegionError
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.blending import blend_weights, borders
from vtk_segdeform.regions.regions import Regions, cage_distance_weights

SPHERE = Mesh(*icosphere(4))


def thirds(mesh):
    """Return labels 0, 1, 2 by the angle about z."""
    angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0]) + np.pi
    return np.minimum((angle / (2 * np.pi) * 3).astype(int), 2)


def bands(mesh):
    """Return two masks with fixed borders in space: they overlap for |z| < 0.3."""
    z = mesh.vertices[:, 2]
    return np.array([z > -0.3, z < 0.3])


def biggest_jump(mesh, weights):
    i, j = mesh.edges.T
    return np.abs(weights[:, i] - weights[:, j]).max()


@pytest.mark.parametrize("overlap", [0, 1, 2, 4, 9])
@pytest.mark.parametrize("smoothness", [0.5, 1.0, 2.0, 40.0])
def test_weights_sum_to_one_and_are_zero_outside(overlap, smoothness):
    grown = Regions.from_labels(SPHERE, thirds(SPHERE), overlap)
    regions = Regions(SPHERE, grown.membership, smoothness)
    assert_allclose(regions.weights.sum(axis=0), 1.0, rtol=1e-14)
    assert regions.weights.min() >= 0.0
    assert not regions.weights[~regions.membership].any()


@pytest.mark.parametrize("overlap", [1, 4])
def test_the_weight_of_a_region_is_zero_on_its_border(overlap):
    regions = Regions.from_labels(SPHERE, thirds(SPHERE), overlap)
    edge = borders(SPHERE, regions.membership)
    others = regions.membership.sum(axis=0) > 1
    elsewhere = (regions.membership & ~edge).any(axis=0)  # the vertex is inside another region
    assert (edge & others & elsewhere).sum() > 20
    assert not regions.weights[edge & others & elsewhere].any()


def test_regions_have_equal_weights_where_every_distance_is_zero():
    everywhere = np.ones((3, 1), dtype=bool)
    assert_allclose(blend_weights(everywhere, np.zeros((3, 1))), 1 / 3)
    assert_allclose(
        blend_weights(everywhere, np.array([[0.0], [1.0], [3.0]])).ravel(), [0, 0.25, 0.75]
    )


def test_a_region_that_covers_a_component_has_no_border_there():
    mesh = Mesh(*two_components())
    first = mesh.components == 0
    part = first & (mesh.vertices[:, 0] > 0)
    regions = Regions.from_masks(mesh, [first, ~first | part])
    assert np.isinf(regions.border_distance[0, first]).all()
    assert np.isinf(regions.border_distance[1, ~first]).all()
    assert_allclose(regions.weights[0, first], 1.0)


def test_distances_and_weights_of_any_regions_are_shortest_paths_and_their_ratios():
    mesh = Mesh(*two_components())
    masks = np.random.default_rng(3).random((9, mesh.n_vertices)) < 0.7
    masks[8] |= ~masks.any(axis=0) | (mesh.components == 1)
    regions = Regions(mesh, masks)
    edge = borders(mesh, masks)
    for r, members in enumerate(masks):
        expected = csgraph.dijkstra(mesh.adjacency, indices=np.flatnonzero(edge[r])).min(axis=0)
        found = regions.border_distance[r]
        assert_allclose(found, np.where(members, expected, 0.0), rtol=1e-12)
    assert np.isinf(regions.border_distance[8]).any()
    assert_allclose(regions.weights, blend_weights(masks, regions.border_distance), atol=1e-14)


def test_weights_by_the_distance_to_cages_are_their_ratios_as_printed():
    mesh = Mesh(CUBE[0] - 0.5, CUBE[1])
    cages = [Mesh(2.0 * mesh.vertices, CUBE[1]), Mesh(4.0 * mesh.vertices, CUBE[1])]
    left = mesh.vertices[:, 0] < 0.0
    regions = Regions.from_masks(mesh, [np.ones(8, dtype=bool), left])
    weights = cage_distance_weights(regions, cages)
    assert_allclose(weights[:, left], np.repeat([[0.25], [0.75]], 4, axis=1))
    assert_allclose(weights[:, ~left], np.repeat([[1.0], [0.0]], 4, axis=1))
    with pytest.raises(RegionError, match="cages must be one cage for each of the 2"):
        cage_distance_weights(regions, cages[:1])


def test_components_tell_where_each_region_has_vertices():
    mesh = Mesh(*two_components())
    first, right = mesh.components == 0, mesh.vertices[:, 0] > 0.0
    regions = Regions.from_masks(mesh, [first, first & right, ~first, np.ones_like(first)])
    expected = [[True, False], [True, False], [False, True], [True, True]]
    np.testing.assert_array_equal(regions.components, expected)
    assert not regions.components.flags.writeable
    one = Regions.from_labels(SPHERE, thirds(SPHERE)).components
    np.testing.assert_array_equal(one, np.ones((3, 1), dtype=bool))


def test_the_label_of_a_vertex_is_the_region_of_largest_weight_and_the_first_of_equal_ones():
    mesh = Mesh(*CUBE)
    halves = Regions.from_masks(mesh, [np.ones(8, dtype=bool), np.ones(8, dtype=bool)])
    np.testing.assert_array_equal(halves.labels, np.zeros(8))
    regions = Regions.from_labels(SPHERE, thirds(SPHERE), 4)
    clear = regions.weights.max(axis=0) > 0.51
    np.testing.assert_array_equal(regions.labels[clear], regions.weights.argmax(axis=0)[clear])
    for r in range(3):
        np.testing.assert_array_equal(regions.members(r), np.flatnonzero(regions.membership[r]))
    for wrong in (-1, 3, 1.5):
        with pytest.raises(RegionError, match=r"region must be one of 0\.\.2"):
            regions.members(wrong)
    with pytest.raises(RegionError, match="rings must be a whole number"):
        regions.grow(-1)


def test_refining_the_mesh_makes_the_weights_continuous_and_the_printed_formula_not():
    jumps, printed = [], []
    cages = [Mesh(*icosphere(1, 1.3)), Mesh(*icosphere(1, 1.3))]
    for level in (3, 4, 5):
        mesh = Mesh(*icosphere(level))
        regions = Regions.from_masks(mesh, bands(mesh))
        jumps.append(biggest_jump(mesh, regions.weights))
        printed.append(biggest_jump(mesh, cage_distance_weights(regions, cages)))
    assert jumps[1] < 0.7 * jumps[0]
    assert jumps[2] < 0.7 * jumps[1]
    assert jumps[2] < 0.15
    assert min(printed) >= 0.49


def test_growing_adds_the_vertices_within_that_many_edges():
    labels = (np.arange(SPHERE.n_vertices) == 17).astype(int)
    regions = Regions.from_labels(SPHERE, labels, 3)
    steps = csgraph.dijkstra(SPHERE.adjacency, indices=17, unweighted=True)
    np.testing.assert_array_equal(regions.membership[1], steps <= 3)
    np.testing.assert_array_equal(
        regions.grow(2).membership, Regions.from_labels(SPHERE, labels, 5).membership
    )


def test_weights_are_invariant_under_rotation_and_scaling():
    regions = Regions.from_labels(SPHERE, thirds(SPHERE), 3)
    scaled = Regions.from_labels(SPHERE.with_vertices(1e3 * SPHERE.vertices), thirds(SPHERE), 3)
    assert_allclose(scaled.border_distance, 1e3 * regions.border_distance, rtol=1e-9)
    assert_allclose(scaled.weights, regions.weights, atol=1e-12)


@pytest.mark.parametrize(
    ("masks", "message"),
    [
        (np.ones((2, 7), dtype=bool), "shape"),
        (np.ones((2, 8), dtype=float), "bool"),
        (np.array([[True] * 8, [False] * 8]), "1 region has no vertices: 1;"),
        (np.array([[True] * 6 + [False] * 2]), "2 vertices are in no region: 6, 7;"),
        (np.array([[True] * 7 + [False]]), "1 vertex is in no region: 7;"),
        (np.array([[False] * 8] * 2 + [[True] * 8]), "2 regions have no vertices: 0, 1;"),
        (np.array([[False] * 8] * 9 + [[True] * 8]), "0, 1, 2, 3, 4, 5, 6, 7, ...;"),
    ],
)
def test_the_error_lists_empty_regions_and_uncovered_vertices(masks, message):
    with pytest.raises(RegionError, match=message):
        Regions.from_masks(Mesh(*CUBE), masks)


def test_other_invalid_arguments_are_errors():
    mesh = Mesh(*CUBE)
    with pytest.raises(RegionError, match="one integer for each of the 8"):
        Regions.from_labels(mesh, np.zeros(8))
    with pytest.raises(RegionError, match="overlap"):
        Regions.from_labels(mesh, np.zeros(8, int), overlap=-1)
    with pytest.raises(RegionError, match="smoothness"):
        Regions(mesh, np.ones((1, 8), dtype=bool), smoothness=0.0)
    with pytest.raises(RegionError, match="one cage for each of the 1"):
        cage_distance_weights(Regions.single(mesh), [])
