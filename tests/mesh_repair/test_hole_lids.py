"""Lids close holes with any border, without flat triangles or intersections."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere

from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.intersections import self_intersections
from vtk_segdeform.mesh.topology import HalfEdges
from vtk_segdeform.mesh.triangles import least_angle
from vtk_segdeform.mesh_repair.hole_borders import border_loops
from vtk_segdeform.mesh_repair.lids import clip_ears
from vtk_segdeform.mesh_repair.repair import repair


def tube(loop, height=1.0, rows=6):
    """Return a tube below the counter-clockwise *loop* (n, 3), open at both ends."""
    n, i = len(loop), np.arange(len(loop))
    vertices = np.concatenate([loop - [0.0, 0.0, height * r / rows] for r in range(rows + 1)])
    faces = []
    for r in range(rows):
        here, there = r * n + i, r * n + (i + 1) % n
        faces += [np.stack([here, here + n, there], 1), np.stack([there, here + n, there + n], 1)]
    return vertices, np.concatenate(faces)


def straight(corners, divisions):
    """Return a polygon (n, 2) as a loop in the plane z = 0, each side divided into *divisions*."""
    start = np.asarray(corners, dtype=float)
    along = np.roll(start, -1, axis=0) - start
    share = np.arange(divisions) / divisions
    flat = (start[:, None] + share[None, :, None] * along[:, None]).reshape(-1, 2)
    return np.column_stack([flat, np.zeros(len(flat))])


def polar(radius, angle, height=0.0):
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height + 0.0 * angle], axis=1)


def star(divisions):
    angle = np.arange(10) * np.pi / 5
    return straight(polar(np.where(np.arange(10) % 2, 0.35, 1.0), angle)[:, :2], divisions)


def spiral():
    t = np.linspace(0.0, 1.0, 60)
    inner, outer = (polar(r + t, 5.0 * np.pi * t) for r in (0.3, 0.52))
    return np.concatenate([outer, inner[::-1]])


def comb():
    teeth = [[x + dx, y] for x in range(6) for dx, y in ((0, 3), (0.5, 3), (0.5, 1), (1, 1))]
    return straight([[0, 0], [6, 0], *teeth[::-1][:-1], [0, 3]], 4)


TURN = 2.0 * np.pi * np.arange(64) / 64
PLANE = {
    "square": straight([[0, 0], [1, 0], [1, 1], [0, 1]], 15),
    "corner on each side": straight([[0, 0], [1, 0], [1, 1], [0, 1]], 2),
    "star": star(1),
    "fine star": star(12),
    "spiral": spiral(),
    "comb": comb(),
    "circle": polar(1.0, TURN),
    "long square": straight([[0, 0], [1, 0], [1, 1], [0, 1]], 60),
}


def closed(vertices, faces, least, largest=10_000):
    """Repair, check that all angles of the lids are at least *least* degrees; return the result."""
    assert not len(self_intersections(vertices, faces))
    result = repair(vertices, faces, largest_hole=largest)
    assert result.report.is_closed, str(result.report)
    lids = result.faces[result.face_map < 0]
    assert np.rad2deg(least_angle(result.vertices[lids])).min() > least
    assert not len(self_intersections(result.vertices, result.faces))
    assert_array_equal(result.vertices[: len(vertices)], vertices)
    return result


@pytest.mark.parametrize("name", every(2, PLANE))
def test_a_planar_hole_gets_a_planar_lid_of_well_shaped_triangles(name):
    loop = PLANE[name]
    onward = np.roll(loop, -1, axis=0)
    area = 0.5 * (loop[:, 0] * onward[:, 1] - loop[:, 1] * onward[:, 0]).sum()
    result = closed(*tube(loop), least=12.0)
    assert signed_volume(result.vertices, result.faces) == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize("share", every(3, [0.2, 0.5, 0.8]))
def test_a_window_in_a_cylinder_gets_a_curved_lid(share):
    n, rows = 48, 16
    vertices, faces = tube(polar(1.0, 2.0 * np.pi * np.arange(n) / n), 2.0, rows)
    column, row = np.arange(n), np.repeat(np.arange(rows), 2 * n)
    gone = (np.tile(column, 2 * rows) < share * n) & (row >= 3) & (row < rows - 3)
    used, faces = np.unique(faces[~gone], return_inverse=True)
    result = closed(vertices[used], faces.reshape(-1, 3), least=12.0)
    assert len(result.steps) == 1
    whole = 24.0 * np.sin(np.pi / 24.0) * 2.0
    assert 0.3 * whole < signed_volume(result.vertices, result.faces) < whole


@pytest.mark.parametrize("seed", every(12, range(24)))
def test_a_random_border_is_closed_without_a_crossing(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(6, 90))
    angle = 2.0 * np.pi * np.arange(n) / n
    waves = rng.normal(size=(4, 5)) / np.arange(2, 7)
    phase = np.arange(2, 7)[:, None] * angle
    radius = np.exp(0.4 * (waves[0] @ np.cos(phase) + waves[1] @ np.sin(phase)))
    height = 0.5 * (waves[2] @ np.cos(phase) + waves[3] @ np.sin(phase))
    loop = polar(radius, angle) + height[:, None] * [0.0, 0.0, 1.0]
    closed(*tube(loop, 6.0), least=0.2)


def test_ears_are_clipped_along_the_mean_normal_unless_the_loop_crosses_itself_there():
    loop = spiral() @ np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    triangles, view = clip_ears(loop)
    assert_allclose(view @ view.T, np.eye(3), atol=1e-14)
    flat = (loop @ view.T)[:, :2]
    u, v = (flat[triangles[:, i]] - flat[triangles[:, 0]] for i in (1, 2))
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0.0).all()
    knot = np.array([np.sin(TURN) + 2 * np.sin(2 * TURN), np.cos(TURN) - 2 * np.cos(2 * TURN),
                     -np.sin(3 * TURN)]).T  # fmt: skip
    assert clip_ears(knot) is None


def test_every_new_vertex_has_weights_of_border_vertices():
    vertices, faces = tube(PLANE["square"])
    result = closed(vertices, faces, least=12.0)
    weights = result.vertex_weights
    assert weights.shape == (len(result.vertices), len(vertices))
    assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    assert_array_equal((weights @ vertices)[: len(vertices)], vertices)
    new = weights[np.flatnonzero(result.vertex_map < 0)]
    assert new.data.min() >= 0.0
    around = np.unique(new.indices)
    assert np.isin(vertices[around, 2], [0.0, -1.0]).all()  # border vertices only
    top = result.vertices[result.vertex_map < 0][:, 2] == 0.0
    assert_allclose((new @ vertices[:, 2])[top], 0.0, atol=1e-15)


def test_thousands_of_touching_holes_are_filled_together():
    vertices, faces = icosphere(5)
    keep = np.random.default_rng(3).random(len(faces)) > 0.05
    result = repair(vertices, faces[keep])
    assert result.report.is_closed, str(result.report)
    assert len(result.vertices) == len(vertices)
    assert len(result.faces) == len(faces)
    volume = signed_volume(result.vertices, result.faces)
    assert volume == pytest.approx(signed_volume(vertices, faces), rel=1e-4)


def test_an_unavoidable_intersection_is_reported():
    knot = np.array([np.sin(TURN) + 2 * np.sin(2 * TURN), np.cos(TURN) - 2 * np.cos(2 * TURN),
                     -np.sin(3 * TURN)]).T  # fmt: skip
    result = repair(*tube(knot, 0.3))
    assert result.report.is_closed
    assert (
        "2 lids cross the surface or another lid; no better triangulation was found" in result.steps
    )


def test_touching_holes_are_separated():
    vertices, faces = icosphere(2)
    at = np.flatnonzero((faces == 2).any(axis=1))
    other = [f for f in at if len(np.intersect1d(faces[f], faces[at[0]])) == 1]
    left = np.delete(faces, [at[0], other[0]], axis=0)
    half_edges = HalfEdges(left, len(vertices))
    loops = border_loops(half_edges, 100)
    found = sorted(sorted(half_edges.head[loop].tolist()) for loop in loops)
    assert found == sorted(sorted(faces[f].tolist()) for f in (at[0], other[0]))
