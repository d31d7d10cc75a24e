"""The boundary of a mesh and its loops, on any triangles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import CUBE, icosphere, torus

from vtk_segdeform.mesh import Mesh, mesh_of
from vtk_segdeform.mesh.loops import loops_of
from vtk_segdeform.mesh.topology import HalfEdges


def edges_of(loops):
    """Return the directed edges of loops, sorted."""
    pairs = [(a, b) for loop in loops for a, b in zip(loop, np.roll(loop, -1), strict=True)]
    return sorted((int(a), int(b)) for a, b in pairs)


def soups():
    """Yield random faces, most of them with non-manifold edges and loops that share vertices."""
    rng = np.random.default_rng(4)
    for _ in range(150):
        n = int(rng.integers(3, 12))
        faces = rng.integers(0, n, (rng.integers(1, 14), 3))
        a, b, c = faces.T
        yield faces[(a != b) & (b != c) & (c != a)], n
    for vertices, faces in (icosphere(2), torus(12, 8)):
        for share in (0.1, 0.5, 0.9):
            yield faces[rng.random(len(faces)) < share], len(vertices)


def test_the_boundary_of_a_boundary_is_zero():
    for faces, n in soups():
        tail, head = HalfEdges(faces, n).net_boundary.T
        assert_array_equal(np.bincount(tail, minlength=n), np.bincount(head, minlength=n))


def test_the_boundary_is_the_sum_of_the_edges_of_the_faces():
    for faces, n in soups():
        total = np.zeros((n, n), dtype=int)
        for a, b, c in faces:
            for tail, head in ((a, b), (b, c), (c, a)):
                total[tail, head] += 1
                total[head, tail] -= 1
        tail, head = HalfEdges(faces, n).net_boundary.T
        found = np.zeros((n, n), dtype=int)
        np.add.at(found, (tail, head), 1)
        assert_array_equal(found, np.maximum(total, 0))


def test_loops_cover_the_boundary_once_and_pass_no_vertex_twice():
    for faces, n in soups():
        boundary = HalfEdges(faces, n).net_boundary
        loops = loops_of(boundary)
        assert edges_of(loops) == sorted(map(tuple, boundary.tolist()))
        assert all(len(np.unique(loop)) == len(loop) >= 3 for loop in loops)


def test_reversing_the_faces_reverses_the_boundary():
    for faces, n in soups():
        forth, back = HalfEdges(faces, n).net_boundary, HalfEdges(faces[:, ::-1], n).net_boundary
        assert sorted(map(tuple, forth.tolist())) == sorted(map(tuple, back[:, ::-1].tolist()))


def test_faces_are_on_the_left_of_a_border():
    vertices, faces = CUBE
    top = (vertices[faces][:, :, 2] == 1.0).all(axis=1)
    used = np.unique(faces[top])
    mesh = Mesh(vertices[used], np.searchsorted(used, faces[top]))
    (loop,) = mesh.borders
    x, y, _ = mesh.vertices[loop].T
    assert 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() == pytest.approx(1.0)


def test_a_fin_has_a_border_and_its_body_has_none():
    vertices, faces = CUBE
    a, b, _ = faces[0]
    vertices = np.append(vertices, [[3.0, 3.0, 3.0]], axis=0)
    mesh = mesh_of(vertices, np.append(faces, [[a, b, 8]], axis=0)).mesh
    assert not mesh.is_closed
    (loop,) = mesh.borders
    assert sorted(loop.tolist()) == sorted([a, b, 8])


def test_edges_at_a_border_are_listed_whatever_their_direction():
    for face in ([0, 1, 2], [2, 1, 0]):
        mesh = Mesh(np.eye(3), [face])
        assert mesh.edges.tolist() == [[0, 1], [0, 2], [1, 2]]
