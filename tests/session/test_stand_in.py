"""The stand-in: rough poses with the exact volume, long before the session is bound."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose

from vtk_segdeform import Mesh, Session, sizes
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.io.convert import from_polydata, to_polydata
from vtk_segdeform.models import cactus, sphere
from vtk_segdeform.session import StandIn
from vtk_segdeform.solver import total_volume
from vtk_segdeform.subspace import InterpolatedBlock

CACTUS = cactus(1250)
TOP = int(CACTUS.vertices[:, 2].argmax())
SIDE = 0.2 * CACTUS.diagonal * np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def stand_in():
    return StandIn.of(CACTUS)


def off(pose, place, mesh=CACTUS):
    """Return the distance of a point from a place in diagonals."""
    return np.linalg.norm(pose - place, axis=-1) / mesh.diagonal


def test_a_pose_has_the_volume_and_the_grabbed_point_is_near_the_pointer(stand_in):
    rest = CACTUS.vertices
    for share in (0.25, 0.5, 0.75, 1.0):
        x = stand_in.pulled(TOP, rest[TOP] + share * SIDE)
        assert abs(signed_volume(x, CACTUS.faces) / signed_volume(rest, CACTUS.faces) - 1) < 1e-13
        assert off(x[TOP], rest[TOP] + share * SIDE) < 0.01
    foot = rest[:, 2] < np.quantile(rest[:, 2], 0.05)
    assert off(x[foot], rest[foot]).max() < 0.02
    stand_in.release()
    assert_allclose(stand_in.pulled(TOP, rest[TOP]), rest, atol=1e-9)
    stand_in.release()


def test_a_pose_is_near_that_of_the_session(stand_in):
    session = Session(CACTUS)
    session.accept(session.preparation())
    for to in (CACTUS.vertices[TOP] + SIDE, CACTUS.vertices[TOP] - SIDE):
        for _ in range(5):
            x = stand_in.pulled(TOP, to)
        stand_in.release()
        exact = session.pull(TOP, to).vertices
        session.revert()
        # The top has moved by 0.2 diagonals.
        assert off(x, exact).mean() < 0.01
        assert off(x, exact).max() < 0.1


def test_an_affine_motion_turns_the_surface_around_the_vertex(stand_in):
    turn = np.eye(4)
    turn[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    centre = CACTUS.vertices[TOP]
    turn[:3, 3] = centre - turn[:3, :3] @ centre
    for _ in range(10):
        x = stand_in.pulled(TOP, turn)
    stand_in.release()
    near = np.argsort(off(CACTUS.vertices, centre))[:30]
    turned = (CACTUS.vertices[near] - centre) @ turn[:3, :3].T + centre
    assert off(x[near], turned).max() < 0.3 * off(CACTUS.vertices[near], turned).max()


@pytest.mark.parametrize("scale", every(2, [1e-6, 1e5]))
def test_scale_and_place_do_not_matter(stand_in, scale):
    mesh = CACTUS.with_vertices(scale * (CACTUS.vertices + [1e3, 0.0, 0.0]))
    other = StandIn.of(mesh)
    shift = SIDE / 2.0
    for _ in range(20):  # until it has converged
        x = stand_in.pulled(TOP, CACTUS.vertices[TOP] + shift)
        y = other.pulled(TOP, mesh.vertices[TOP] + scale * shift) / scale - [1e3, 0.0, 0.0]
    stand_in.release()
    assert off(y, x).max() < 5e-3  # rounding decides between equal clusters of vertices


def test_an_open_mesh_keeps_the_volume_under_lids_unless_it_has_none():
    ball = sphere(1500)
    faces = ball.faces[ball.vertices[ball.faces][:, :, 2].max(axis=1) < 0.95]
    used, faces = np.unique(faces, return_inverse=True)
    open_ball = Mesh(ball.vertices[used], faces.reshape(-1, 3))
    top = int(open_ball.vertices[:, 2].argmax())
    to = open_ball.vertices[top] + [0.5, 0.0, 0.0]
    x = StandIn.of(open_ball).pulled(top, to)
    assert abs(total_volume(open_ball).relative(x)) < 1e-13
    without = StandIn.of(open_ball, lids=False)
    assert not without.volume.has_volume
    assert off(without.pulled(top, to)[top], to, open_ball) < 0.02


def test_a_large_mesh_is_decimated_twice_and_its_rows_are_interpolated(monkeypatch):
    monkeypatch.setattr(sizes, "DECIMATED", 5000)
    monkeypatch.setattr(sizes, "DECIMATED_POINTS", 4000)
    mesh = from_polydata(to_polydata(CACTUS).subdivide(2, subfilter="linear"))
    assert mesh.n_vertices > 3 * sizes.DECIMATED
    large = StandIn.of(mesh)
    assert large.session.mesh.n_vertices < 1500
    (block,) = large.subspace.blocks
    assert isinstance(block, InterpolatedBlock)
    top = int(mesh.vertices[:, 2].argmax())
    to = mesh.vertices[top] + SIDE
    x = large.pulled(top, to)
    assert off(x[top], to, mesh) < 0.02
    assert abs(total_volume(mesh).relative(x)) < 1e-13
    # Neighbours stay together: clusters are not visible in the pose.
    i, j = mesh.edges.T
    lengths = [np.linalg.norm(p[i] - p[j], axis=1) for p in (mesh.vertices, x)]
    assert (lengths[1] / lengths[0]).max() < 3.0
