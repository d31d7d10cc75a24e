"""Bodies face outward, whatever the given orientation; sheets and fins keep theirs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from open_surfaces import moebius
from solids import CUBE, icosphere, rotation, together, torus

from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io.polygons import triangles_of
from vtk_segdeform.mesh import find_faults, mesh_of, winding_number
from vtk_segdeform.mesh.faults import Search
from vtk_segdeform.mesh.orientation import faces_to_flip
from vtk_segdeform.mesh.shells import shell_depths
from vtk_segdeform.mesh.topology import HalfEdges

SPHERE = icosphere(2)
TURN = rotation([1.0, 2.0, 3.0], 0.7).T


def flipped(faces, which):
    return np.where(which[:, None], faces[:, [0, 2, 1]], faces)


def box(open_sides=(), n=4):
    """Return the surface of n^3 cubes, each side of 2 n^2 triangles, without some sides."""
    grid = np.stack(np.meshgrid(*3 * [np.arange(n + 1)], indexing="ij"), axis=-1).reshape(-1, 3)
    step = np.array([(n + 1) ** 2, n + 1, 1])
    faces = []
    for axis, end in itertools.product(range(3), (0, 1)):
        if (axis, end) in open_sides:
            continue
        one, other = (axis + 1) % 3, (axis + 2) % 3
        i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n)))
        at = end * n * step[axis] + i * step[one] + j * step[other]
        quad = np.stack([at, at + step[one], at + step[one] + step[other], at + step[other]], 1)
        quad = quad if end else quad[:, ::-1]
        faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    faces = np.concatenate(faces)
    used = np.unique(faces)
    return grid[used] / n, np.searchsorted(used, faces)


@pytest.mark.parametrize("shift", [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 1.0]])
def test_cubes_that_share_an_edge_or_a_corner_both_face_outward(shift):
    vertices, faces = together(CUBE, (CUBE[0] + shift, CUBE[1]))
    for one, other in itertools.product([False, True], repeat=2):
        mesh = mesh_of(vertices @ TURN, flipped(faces, np.repeat([one, other], 12))).mesh
        assert_array_equal(mesh.faces, faces)
        assert mesh.is_closed


@pytest.mark.parametrize("seed", range(5))
def test_a_body_with_a_fin_faces_outward_and_the_fin_keeps_its_orientation(seed):
    vertices, faces = SPHERE
    ring = np.flatnonzero(np.abs(vertices[:, 2]) < 1e-9)  # the fin is a disc around the equator
    ring = ring[np.argsort(np.arctan2(*vertices[ring, :2].T))]
    n = len(ring)
    out = len(vertices) + np.arange(n)
    fin = np.concatenate(
        [
            np.stack([ring, np.roll(ring, -1), out], 1),
            np.stack([np.roll(ring, -1), np.roll(out, -1), out], 1),
        ]
    )
    vertices = np.concatenate([vertices, 1.5 * vertices[ring]])
    rng = np.random.default_rng(seed)
    fin = fin[:, :: rng.choice([1, -1])]
    some = rng.random(len(faces)) < rng.choice([0.0, 0.3, 1.0])
    given = np.concatenate([flipped(faces, some), fin])
    mesh = mesh_of(vertices @ TURN, given).mesh
    assert_array_equal(mesh.faces[: len(faces)], faces)
    assert_array_equal(mesh.faces[len(faces) :], fin)


@pytest.mark.parametrize("open_hull", [False, True])
@pytest.mark.parametrize("open_cavity", [False, True])
def test_a_cavity_faces_inward_also_where_the_shells_have_holes(open_hull, open_cavity):
    hull, inner = SPHERE, torus(12, 8)
    size = np.abs(inner[0]).max()
    inner = 0.4 * inner[0] / size, inner[1][:, [0, 2, 1]]
    hull = hull[0], hull[1][5:] if open_hull else hull[1]
    inner = inner[0], inner[1][1:] if open_cavity else inner[1]
    vertices, faces = together(hull, inner)
    assert find_faults(vertices, faces).ok
    m = len(hull[1])
    for one, other in itertools.product([False, True], repeat=2):
        turned = np.arange(len(faces)) < m
        given = flipped(faces, np.where(turned, one, other))
        assert_array_equal(mesh_of(vertices @ TURN, given).mesh.faces, faces)


def test_cavities_that_overlap_each_other_are_bodies():
    vertices, faces = SPHERE
    shells = [(vertices, faces)] + [(0.95 * vertices + [0.001 * k, 0, 0], faces) for k in (0, 1)]
    mesh = mesh_of(*together(*shells)).mesh
    assert signed_volume(mesh.vertices, mesh.faces) > signed_volume(*SPHERE)


def test_sheets_that_meet_along_a_line_agree_where_they_continue_each_other():
    # A floor in two halves and a wall on it: the halves agree, whatever their given orientation.
    x, y = (k.ravel() for k in np.meshgrid(np.arange(5.0), np.arange(5.0)))
    i = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    plane = np.concatenate([np.stack([i, i + 1, i + 5], 1), np.stack([i + 1, i + 6, i + 5], 1)])
    floor = np.stack([x, y, 0.0 * x], axis=1)
    wall = np.stack([2.0 + 0.0 * x, y, x], axis=1)
    vertices, faces = together((floor, plane), (wall, plane))
    left = (vertices[faces][:, :, 0] <= 2.0).all(axis=1) & (np.arange(len(faces)) < 32)
    for which in (left, ~left, np.zeros_like(left)):
        mesh = mesh_of(vertices @ TURN, flipped(faces, which)).mesh
        corners = (mesh.vertices @ TURN.T)[mesh.faces[:32]]
        up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
        assert (up > 0.0).all() or (up < 0.0).all()


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("around", ["closed", "holes", "turned", "branching", "box"])
def test_shells_are_found_inside_a_surface_by_its_winding_number(around):
    outer, faces = icosphere(3)
    rng = np.random.default_rng(2)
    flip = None
    if around == "holes":
        faces = faces[(rng.random(len(faces)) < 0.97) & (np.arange(len(faces)) > 100)]
    elif around == "turned":  # and most of them turned back
        turn = rng.random(len(faces)) < 0.3
        faces = flipped(faces, turn)[80:]
        flip = turn[80:] & (np.arange(len(faces)) > 60)
        flip = np.append(flip, np.zeros(80 * len(SPHERE[1]), dtype=bool))
    elif around == "branching":  # a disc across it, and a hole below
        disc = faces[outer[faces][:, :, 2].max(axis=1) < 0.1][:, ::-1]
        faces = np.concatenate([faces, disc])[30:]
    elif around == "box":
        outer, faces = box([(0, 1)])
        outer = 1.5 * outer - 0.75
    small, small_faces = SPHERE
    places = rng.normal(size=(80, 3))
    places *= (rng.choice([0.4, 0.8, 1.0, 1.2], size=80) / np.linalg.norm(places, axis=1))[:, None]
    points = np.concatenate([outer, *(0.02 * small + place for place in places)])
    many = [faces, *(small_faces + len(outer) + k * len(small) for k in range(80))]
    half_edges = HalfEdges(np.concatenate(many), len(points))
    depth = shell_depths(points, half_edges, np.ones(81, dtype=bool), flip)
    given = faces if flip is None else flipped(faces, flip[: len(faces)])
    extremes = points[len(outer) :].reshape(80, -1, 3)
    number = winding_number(extremes.reshape(-1, 3), outer, given).reshape(80, -1)
    assert_array_equal(depth[1:], (np.abs(number) > 0.5).all(axis=1))
    assert depth[0] == 0
    assert 10 < depth.sum() < 70


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["upright", "turned"])
def test_a_body_that_stands_on_the_ground_of_a_room_is_not_inside(turn):
    room, faces = box(n=3)
    for x, y in np.random.default_rng(5).random((30, 2)) / 2 + 0.1:
        for height in (0.0, 0.1):
            points, all_faces = together((room, faces), (0.3 * room + [x, y, height], faces))
            half_edges = HalfEdges(all_faces, len(points))
            depth = shell_depths(points @ turn.T + 7.0, half_edges, np.ones(2, dtype=bool))
            assert_array_equal(depth, [0, height > 0.0])


@pytest.mark.usefixtures("either")
def test_depths_known_after_flipping_are_those_of_the_flipped_shells():
    band = np.asarray(moebius().points, float), triangles_of(moebius())
    x, faces = together(SPHERE, torus(9, 6), (0.3 * SPHERE[0], SPHERE[1]), band, box([(0, 1)]))
    some = np.random.default_rng(3).random(len(faces)) < 0.1
    turned = (faces, faces[:, ::-1], flipped(faces, some))
    for given in (*turned, flipped(faces, np.arange(len(faces)) < len(SPHERE[1]))):
        half_edges = HalfEdges(given, len(x))
        flip, depth = faces_to_flip(x, half_edges)
        found = Search.known(x, half_edges.flipped(flip), depth)
        fresh = Search(x, flipped(given, flip))
        assert_array_equal(depth, fresh.depth)
        assert len(depth) == 5
        assert not flip[-len(box([(0, 1)])[1]) - len(band[1]) :][: len(band[1])].any()  # one-sided
        assert found.report == fresh.report
