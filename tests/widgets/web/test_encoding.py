"""What a page computes from the messages is the pose, within the stated bound.

The messages are read here by numpy alone, by the layout that their docstrings state.
"""

from __future__ import annotations

import struct
from types import SimpleNamespace

import numpy as np
import pytest
from posed_scenes import random_cages, sausage_session
from scenes import sausage
from sheets import moebius

from vtk_segdeform import Regions, fit_cages
from vtk_segdeform.geometry import VertexNormals
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.session import Session, State
from vtk_segdeform.widgets.web.drawing import SurfaceStream, encode_surface, encoding

ROUNDING = 1e-6  # diagonals, of single precision


def split(data: bytes, *types: tuple[str, int]) -> list[np.ndarray]:
    """Return the arrays of a message, each given by its type and length."""
    magic, version, _, length, _ = struct.unpack_from("<4sHHII", data)
    assert (magic, version, length) == (b"SDFM", 3, len(data))
    arrays, at = [], 16
    for kind, count in types:
        arrays.append(np.frombuffer(data, kind, count, at))
        at += -(-arrays[-1].nbytes // 4) * 4
    assert at == len(data)
    return arrays


def read_surface(data: bytes) -> SimpleNamespace:
    """Return the arrays of the message of a surface."""
    n, t, f, m, sets, columns, weights = np.frombuffer(data, "<u4", 7, 16)
    rest, steps, of_set, lengths, which, q, faces, twice = split(
        data, ("<u4", 7), ("<f4", 3 * n), ("<f4", n), ("<u2", n), ("<u4", sets), ("<u2", columns),
        ("<i2", weights), ("<u4", 3 * f), ("<u4", t),
    )[1:]  # fmt: skip
    ends = np.cumsum(lengths)
    own = [which[end - length : end] for end, length in zip(ends, lengths, strict=True)]
    rows = np.split(q, np.cumsum(lengths[of_set])[:-1])
    return SimpleNamespace(
        rest=rest.reshape(-1, 3), steps=steps, columns=[own[k] for k in of_set], rows=rows,
        faces=faces.reshape(-1, 3), twice=twice, m=m,
    )  # fmt: skip


def posed(surface: SimpleNamespace, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (n, 3) of a pose, and the bound (n,) on the error of each."""
    x, bound = surface.rest.astype(float), np.empty(len(surface.rest))
    lengths = np.linalg.norm(moves, axis=1)
    for k, (own, q, step) in enumerate(
        zip(surface.columns, surface.rows, surface.steps, strict=True)
    ):
        x[k] += step * (q.astype(float) @ moves[own])
        bound[k] = 0.5 * step * lengths[own].sum()
    return x, bound


def encoded(session: Session):
    turned = VertexNormals(session.mesh).turned
    return encode_surface(session.mesh, session.deformer.subspace, session.cages, turned)


@pytest.fixture(scope="module")
def session():
    return sausage_session()


@pytest.mark.parametrize("seed", range(3))
def test_a_pose_differs_from_w_p_by_no_more_than_the_bound_and_a_ten_thousandth(session, seed):
    surface = encoded(session)
    p = random_cages(session, seed)
    received = read_surface(surface.message(1))
    _, moves = split(surface.cage_message(1, 5, p), ("<u4", 1), ("<f4", 3 * received.m))
    x, bound = posed(received, moves.reshape(-1, 3).astype(float))
    exact = (session.deformer.surface(p) - surface.centre) / surface.scale
    error = np.linalg.norm(x - exact[surface.order], axis=1)
    assert (error <= bound + ROUNDING).all()
    assert error.max() <= 1e-4


def test_every_entry_of_w_is_sent_to_half_a_step(session):
    surface = encoded(session)
    received = read_surface(surface.message(1))
    exact = session.deformer.subspace.at(surface.order)
    for w, own, q, step in zip(exact, received.columns, received.rows, received.steps, strict=True):
        assert np.count_nonzero(w) <= len(own)
        used = q != 0
        assert np.abs(w[own[used]] - step * q[used].astype(float)).max() <= 0.5001 * step


def test_faces_are_those_of_the_mesh(session):
    surface = encoded(session)
    received = read_surface(surface.message(1))
    mine = np.sort(surface.order[received.faces], axis=1)
    theirs = np.sort(session.mesh.faces, axis=1)
    assert not len(received.twice)
    np.testing.assert_array_equal(np.unique(mine, axis=0), np.unique(theirs, axis=0))


def test_far_from_the_origin_no_digits_are_lost():
    scene = sausage().transformed(shift=(1e7, 0.0, 0.0))
    session = Session(scene.mesh, state=State(scene.regions, scene.cages))
    surface = encoded(session)
    p = random_cages(session, 1)
    moves = np.frombuffer(surface.cage_message(1, 0, p), "<f4", offset=20).reshape(-1, 3)
    x, bound = posed(read_surface(surface.message(1)), moves.astype(float))
    exact = (session.deformer.surface(p) - surface.centre) / surface.scale
    error = np.linalg.norm(x - exact[surface.order], axis=1)
    assert (error <= bound + 1e-6).all()


def test_offsets_and_colours_come_back_in_the_order_of_the_message(session):
    surface = encoded(session)
    n = session.mesh.n_vertices
    offsets = np.random.default_rng(2).normal(scale=0.05, size=(n, 3)) * surface.scale
    step, q = split(surface.offset_message(1, offsets), ("<f4", 1), ("<i2", 3 * n))
    back = surface.scale * step * q.reshape(-1, 3)
    np.testing.assert_allclose(
        back, offsets[surface.order], atol=0.51 * float(step[0]) * surface.scale
    )
    colours = np.random.default_rng(3).integers(0, 256, (n, 3)).astype(np.uint8)
    (rgba,) = split(surface.colour_message(1, colours), ("u1", 4 * n))
    np.testing.assert_array_equal(rgba.reshape(-1, 4)[:, :3], colours[surface.order])
    assert len(surface.colour_message(1, None)) == 16


def test_the_seam_of_a_surface_with_one_side_is_drawn_twice():
    mesh = Mesh(*moebius())
    regions = Regions.single(mesh)
    session = Session(mesh, state=State(regions, fit_cages(mesh, regions, 30)))
    received = read_surface(encoded(session).message(1))
    assert len(received.twice) == 5
    assert received.faces.max() == mesh.n_vertices + 4


def test_what_is_too_large_for_a_page_is_not_drawable(session, monkeypatch):
    assert SurfaceStream(session).is_possible
    monkeypatch.setattr(encoding, "MOST_WEIGHTS", 100)
    assert not SurfaceStream(session).is_possible
