"""Symmetry: finished poses of mirrored bodies are mirrored; a mesh that is not is refused."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from campaign import every
from limbed import crab, torso
from numpy.testing import assert_allclose
from solids import rotation

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.deformer import Mirror
from vtk_segdeform.errors import ArgumentError, ConstraintError
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.mesh import Mesh, SurfacePoint, distance_to_surface

BODY = torso()
X = BODY.vertices
HAND, FEET = np.flatnonzero(X[:, 0] > 1.6), X[:, 2] < -1.3
TIP = int(X[:, 0].argmax())
UP = np.array([-0.3, 0.2, 0.7])
EXACT = 1e-9  # diagonals
FEW = {"n_regions": 1, "n_cage_vertices": 60}
pytestmark = pytest.mark.usefixtures("bound_once")


@functools.cache
def deformer() -> sd.Deformer:
    regions = sd.segment(BODY, 1)
    return sd.Deformer(BODY, regions, sd.fit_cages(BODY, regions, 60))


def off_mirror(x, mesh=BODY, normal=(1.0, 0.0, 0.0)) -> float:
    """Return how far displacements are from mirrored, in diagonals; vertices are paired exactly."""
    normal = np.asarray(normal)
    middle = mesh.vertices.mean(axis=0) if mesh is not BODY else np.zeros(3)
    reflection = np.eye(3) - 2.0 * np.outer(normal, normal)
    image = (mesh.vertices - middle) @ reflection + middle
    order, same = (np.lexsort(each.round(6).T) for each in (image, mesh.vertices))
    mate = np.empty(len(order), dtype=int)
    mate[order] = same
    assert_allclose(mesh.vertices[mate], image, atol=1e-9)
    u = x - mesh.vertices
    return float(np.abs(u - u[mate] @ reflection).max()) / mesh.diagonal


def require_mirrored(pose) -> None:
    assert off_mirror(pose.vertices) < EXACT
    assert abs(pose.volume_change) < 1e-12


@pytest.mark.parametrize("pins", [(), np.flatnonzero(FEET & (X[:, 0] < 0.0))])
def test_a_pull_moves_both_hands(pins):
    pose = sd.pull(BODY, TIP, X[TIP] + UP, pins=pins, symmetry="x", **FEW)
    require_mirrored(pose)
    other = int(X[:, 0].argmin())
    assert_allclose(pose.vertices[TIP] - X[TIP], UP, atol=1e-12)
    assert_allclose(pose.vertices[other] - X[other], UP * [-1, 1, 1], atol=1e-12)
    if len(pins):
        feet = np.flatnonzero(FEET)
        assert_allclose(pose.vertices[feet], X[feet], atol=1e-12)
    alone = sd.pull(BODY, TIP, X[TIP] + UP, pins=pins, refine=True, **FEW)
    assert off_mirror(alone.vertices) > 0.05


@pytest.mark.parametrize("shares", [(0.2, 0.5, 0.3), (0.5, 0.5, 0.0)])
def test_a_pulled_point_of_a_face_is_mirrored(shares):
    face = BODY.faces[np.flatnonzero((BODY.faces == TIP).any(axis=1))[0]]
    point = SurfacePoint.of(face, shares)
    pose = sd.pull(BODY, point, point.at(X) + UP, symmetry="x", **FEW)
    require_mirrored(pose)
    assert_allclose(point.at(pose.vertices) - point.at(X), UP, atol=1e-12)


@pytest.mark.parametrize("fixed", [FEET, FEET & (X[:, 0] < 0.0)])
def test_deform_mirrors_handles_and_fixed_vertices(fixed):
    pose = sd.deform(BODY, fixed, HAND, X[HAND] + UP, symmetry="x", refine=True, **FEW)
    require_mirrored(pose)
    assert pose.handle_error < 1e-12
    feet = np.flatnonzero(FEET)
    assert_allclose(pose.vertices[feet], X[feet], atol=1e-12)


def test_a_handle_across_the_plane_moves_along_it():
    head = np.flatnonzero(X[:, 2] > 1.5)
    assert np.ptp(X[head, 0]) > 0.2
    symmetric = deformer().hold(fixed=FEET, handle=head, symmetry="x")
    pose = symmetric.finish(symmetric.solve(X[head] + [0.3, 0.2, 0.1]))
    require_mirrored(pose)
    assert_allclose(
        pose.vertices[head] - X[head], np.tile([0.0, 0.2, 0.1], (len(head), 1)), atol=1e-12
    )
    assert pose.handle_error < 1e-12


def test_volumes_and_stiffness_of_one_side_are_mirrored():
    arm = X[:, 0] > 0.8
    volumes = {"arm": "+30%", "whole": "keep"}
    pose = sd.deform(
        BODY, FEET, volumes=volumes, parts={"arm": arm}, symmetry="x", refine=True, **FEW
    )
    require_mirrored(pose)
    changes = pose.volume_changes
    assert_allclose([changes["arm"], changes["arm, mirrored"]], 0.3, atol=1e-11)
    stiffness = np.where((X[:, 0] > 0.9) & (X[:, 0] < 1.3), np.inf, 1.0)
    pose = sd.deform(
        BODY, FEET, HAND, X[HAND] + UP, stiffness=stiffness, symmetry="x", refine=True, **FEW
    )
    require_mirrored(pose)
    for given in (stiffness, np.where(X[:, 0] > 0.5, 8.0, 1.0)):
        first = deformer().stiffened(given).hold(fixed=FEET, handle=HAND, symmetry="x")
        then = deformer().hold(symmetry="x").stiffened(given).hold(fixed=FEET, handle=HAND)
        finished = [each.finish(each.solve(X[HAND] + UP)) for each in (first, then)]
        require_mirrored(finished[0])
        assert_allclose(finished[0].vertices, finished[1].vertices, atol=1e-12)


@pytest.mark.parametrize("kind", every(2, ["y", "auto", "given"]))
def test_poses_are_mirrored_wherever_the_plane_is(kind):
    rng, body = np.random.default_rng(7), crab(3)
    turn = rotation(rng.normal(size=3), 2.0)
    if kind in ("x", "y", "z"):
        turn = np.roll(np.eye(3), "xyz".index(kind), axis=0)
    mesh = body.with_vertices(body.vertices @ turn.T + rng.normal(size=3))
    normal, centre = turn[:, 0], mesh.vertices.mean(axis=0)
    plane = (centre, 3.0 * normal) if kind == "given" else kind
    claw = int(((mesh.vertices - centre) @ turn @ [1.0, 1.0, 0.0]).argmax())
    to = mesh.vertices[claw] + turn @ [-0.2, 0.1, 0.3]
    pose = sd.pull(mesh, claw, to, symmetry=plane, **FEW)
    assert off_mirror(pose.vertices, mesh, normal) < EXACT
    assert abs(pose.volume_change) < 1e-12


@pytest.mark.parametrize("make", [torso, crab])
def test_the_plane_is_found_however_the_body_is_turned(make):
    """Also if two axes of the body are equally long, or another plane is a good one, too."""
    body = make(3)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        turn = rotation(rng.normal(size=3), np.pi * rng.uniform())
        mirror = Mirror.of(body.with_vertices(body.vertices @ turn.T + rng.normal(size=3)), "auto")
        assert np.abs(mirror.normal @ turn[:, 0]) == pytest.approx(1.0, abs=1e-12)
        assert mirror.error < 1e-12


def test_a_nearly_symmetric_scan_is_nearly_mirrored():
    """Noise of .3 % of the diagonal, and other triangles on one side than on the other."""
    rng = np.random.default_rng(1)
    noise = rng.normal(size=X.shape) * 0.003 * BODY.diagonal / np.sqrt(3.0)
    mesh = BODY.with_vertices((X + noise) @ rotation([1.0, 1.0, 0.0], 0.1).T)
    mirror = Mirror.of(mesh, "auto")
    assert 1e-4 < mirror.error < 3e-3
    to = mesh.vertices[TIP] + UP
    pose = sd.pull(mesh, TIP, to, symmetry="auto", **FEW)
    u = pose.vertices - mesh.vertices
    off = np.linalg.norm(u - mirror.mirrored(u), axis=1) / mesh.diagonal
    assert off.mean() < 1e-3
    assert off.max() < 5e-3
    assert pose.handle_error < 1e-12
    assert abs(pose.volume_change) < 1e-12


def test_a_point_of_a_face_of_a_nearly_symmetric_scan_is_pulled():
    """The mate of the point and that of its vertex are apart by something else than on its side."""
    noise = np.random.default_rng(0).normal(size=X.shape) * 0.004 * BODY.diagonal
    mesh = BODY.with_vertices(X + noise)
    face = mesh.faces[mesh.vertices[mesh.faces].mean(axis=1)[:, 0].argmax()]
    point = SurfacePoint.of(face, (0.6, 0.3, 0.1))
    at = point.at(mesh.vertices)
    pose = sd.pull(mesh, point, at + UP, symmetry="x", **FEW)
    assert pose.status is sd.Status.CONVERGED
    assert_allclose(point.at(pose.vertices), at + UP, atol=1e-12)
    assert len(pose.folds()) == 0


@functools.cache
def unsymmetric() -> Mesh:
    return models.random_limbs(600, seed=3)


@pytest.mark.parametrize("symmetry", ["x", "y", "z", "auto", ((0, 0, 0), (1, 0, 0))])
def test_a_mesh_that_is_not_symmetric_is_refused_and_its_error_told(symmetry):
    with pytest.raises(ConstraintError, match=r"off by \d(\.\d+)? % of the diagonal in the mean"):
        Mirror.of(unsymmetric(), symmetry)


def test_the_error_is_the_mean_distance_of_the_mirror_image():
    shifted = Mirror.of(BODY, ((0.05 * BODY.diagonal / 10, 0, 0), (1, 0, 0)))
    image = X * [-1, 1, 1] + [0.01 * BODY.diagonal, 0, 0]
    expected = distance_to_surface(image, X, BODY.faces).mean() / BODY.diagonal
    assert shifted.error == pytest.approx(expected, rel=0.01)


NO_PLANES = [
    "w", "", 3, (1, 0, 0), ((0, 0, 0), (0, 0, 0)), ((0, 0), (1, 0, 0)), ((0, 0, 0), (np.nan, 0, 1)),
    ((np.inf, 0, 0), (1, 0, 0)), ((0, 0, 0), "x"), [], ["x", "y"],
]  # fmt: skip


@pytest.mark.parametrize("symmetry", NO_PLANES)
def test_what_is_no_plane_is_named(symmetry):
    with pytest.raises((ConstraintError, ArgumentError), match="symmetry must be 'x', 'y', 'z'"):
        deformer().hold(symmetry=symmetry)


def test_symmetry_can_be_switched_off():
    symmetric = deformer().hold(fixed=FEET, handle=HAND, symmetry="x")
    assert symmetric.mirror is not None
    assert len(symmetric.handle) == len(HAND)
    again = symmetric.hold(fixed=FEET, handle=HAND, symmetry=None)
    assert again.mirror is None
    plain = deformer().hold(fixed=FEET, handle=HAND)
    targets = X[HAND] + UP
    assert np.array_equal(again.solve(targets).vertices, plain.solve(targets).vertices)


def test_a_body_beside_the_plane_and_its_twin_move_alike():
    """Two bodies, each the mirror image of the other; nothing is on the plane."""
    one = crab(3)
    faces = np.vstack([one.faces, one.faces[:, ::-1] + one.n_vertices])
    right = one.vertices + [3.0, 0.0, 0.0]
    mesh = Mesh(np.concatenate([right, right * [-1, 1, 1]]), faces)
    tip = int(mesh.vertices[:, 1].argmax())
    pose = sd.pull(
        mesh, tip, mesh.vertices[tip] + [0.1, 0.2, 0.4], symmetry="x", n_cage_vertices=120
    )
    u = np.split(pose.vertices - mesh.vertices, 2)
    assert_allclose(u[0], u[1] * [-1, 1, 1], atol=EXACT * mesh.diagonal)
    for own in np.split(pose.vertices, 2):
        volume = signed_volume(own, one.faces)
        assert abs(volume) == pytest.approx(signed_volume(one.vertices, one.faces), rel=1e-12)
