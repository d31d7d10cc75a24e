"""Slides: what slides is on its plane, line or surface after the finish, and moves along it."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from limbed import torso
from solids import icosphere, rotation

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.deformer import Stiffness
from vtk_segdeform.deformer.slides import checked_slides, guides
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.geometry import rigid_fit
from vtk_segdeform.mesh import Mesh, distance_to_surface

# A block that stands on an oblique plate: no axis is special.
TURN = rotation([1.0, 2.0, -0.5], 0.9)
UPRIGHT = models.bar((0.6, 0.4, 1.7), divisions=(7, 5, 18))
BLOCK = UPRIGHT.with_vertices(UPRIGHT.vertices @ TURN.T + [3.0, -1.0, 0.5])
HEIGHT = UPRIGHT.vertices[:, 2] - UPRIGHT.vertices[:, 2].min()
NORMAL = TURN[:, 2]
BASE, TOP = (np.flatnonzero(np.abs(HEIGHT - level) < 1e-9) for level in (0.0, HEIGHT.max()))
CORNER = int(TOP[0])
FLAT = 1e-9  # diagonals
pytestmark = pytest.mark.usefixtures("bound_once")


@functools.cache
def block() -> sd.Deformer:
    regions = sd.segment(BLOCK, 1)
    return sd.Deformer(BLOCK, regions, sd.fit_cages(BLOCK, regions, 100))


def off_plate(x: np.ndarray) -> float:
    """Return how far the base of the block is from its plate, in diagonals."""
    return float(np.abs((x - BLOCK.vertices)[BASE] @ NORMAL).max()) / BLOCK.diagonal


def along_plate(x: np.ndarray) -> float:
    """Return how far the base of the block has moved along its plate, in diagonals."""
    u = (x - BLOCK.vertices)[BASE]
    return float(np.linalg.norm(u - np.outer(u @ NORMAL, NORMAL), axis=1).max()) / BLOCK.diagonal


@pytest.mark.parametrize("direction", [None, 5.0 * NORMAL])
def test_a_base_stays_flat_while_the_top_is_dragged(direction):
    slide = sd.Slide(BASE, direction=direction)
    deformer = block().hold(handle=TOP, slides=[slide])
    worst = 0.0
    for k in range(1, 6):
        targets = BLOCK.vertices[TOP] + k / 5 * (TURN @ [0.7, 0.2, -0.2])
        pose = deformer.solve(targets, max_steps=8)
        worst = max(worst, off_plate(pose.vertices))
    assert worst < 2e-3  # of frames
    pose = deformer.finish(deformer.solve(targets))
    assert off_plate(pose.vertices) < FLAT
    assert along_plate(pose.vertices) > 0.05
    assert pose.handle_error < 1e-12
    assert abs(pose.volume_change) < 1e-12
    free = block().hold(handle=TOP, fixed=BASE[:3])
    assert off_plate(free.finish(free.solve(targets)).vertices) > 1e-3


def test_deform_and_pull_finish_what_slides():
    targets = BLOCK.vertices[TOP] + TURN @ [0.4, 0.1, 0.2]
    options = {"slides": [sd.Slide(BASE)], "n_regions": 1, "n_cage_vertices": 100}
    for pose in (
        sd.deform(BLOCK, [], TOP, targets, **options),
        sd.pull(BLOCK, CORNER, targets[0], **options),
        sd.pull(BLOCK, CORNER, targets[0], pins=BASE[:1], **options),
    ):
        assert off_plate(pose.vertices) < FLAT
        assert abs(pose.volume_change) < 1e-12
        assert pose.handle_error < 1e-12


def test_fixed_and_handle_vertices_take_precedence():
    lifted = BLOCK.vertices[BASE[:4]] + 0.1 * NORMAL
    ids = np.concatenate([BASE[:4], TOP])
    deformer = block().hold(handle=ids, slides=[sd.Slide(BASE)])
    pose = deformer.finish(deformer.solve(np.concatenate([lifted, BLOCK.vertices[TOP]])))
    assert pose.handle_error < 1e-12
    assert off_plate(pose.vertices) == pytest.approx(0.1 / BLOCK.diagonal)
    off = (pose.vertices - BLOCK.vertices)[BASE[4:]] @ NORMAL
    assert np.abs(off).max() < FLAT
    assert pose.slide_error < FLAT  # of those that may slide


def test_a_line_is_kept():
    """The middle of a rod slides along its axis, as in a bearing."""
    axis = TURN @ [0.0, 0.0, 1.0]
    ring = np.flatnonzero(np.abs(HEIGHT - 0.85) < 0.06)
    deformer = block().hold(handle=TOP, slides=[sd.Slide(ring, "line", axis)])
    pose = deformer.finish(deformer.solve(BLOCK.vertices[TOP] + TURN @ [0.2, 0.1, 0.4]))
    u = (pose.vertices - BLOCK.vertices)[ring]
    along = u @ axis
    assert np.linalg.norm(u - np.outer(along, axis), axis=1).max() < FLAT
    assert along.max() > 0.1
    assert abs(pose.volume_change) < 1e-12


def test_a_patch_of_a_sphere_slides_along_it():
    mesh = Mesh(*icosphere(3))
    x = mesh.vertices
    patch, side = np.flatnonzero(x[:, 2] < -0.75), np.flatnonzero(x[:, 0] > 0.93)
    regions = sd.segment(mesh, 1)
    deformer = sd.Deformer(
        mesh, regions, sd.fit_cages(mesh, regions, 80), handle=side,
        fixed=np.flatnonzero(x[:, 0] < -0.93), slides=[sd.Slide(patch, "surface")],
    )  # fmt: skip
    pose = deformer.solve(x[side] + [0.2, 0.3, 0.1])
    off = distance_to_surface(pose.vertices[patch], x, mesh.faces)
    assert off.max() < 2e-3 * mesh.diagonal  # 7e-3 with the planes of rest
    pose = deformer.finish(pose)
    off = distance_to_surface(pose.vertices[patch], x, mesh.faces)
    assert off.max() < FLAT
    assert np.linalg.norm((pose.vertices - x)[patch], axis=1).max() > 0.02
    assert abs(pose.volume_change) < 1e-12


def test_at_rest_nothing_moves():
    for kind in ("plane", "line", "surface"):
        deformer = block().hold(handle=TOP, slides=[sd.Slide(BASE, kind)])
        pose = deformer.finish(deformer.solve(BLOCK.vertices[TOP]))
        assert np.abs(pose.vertices - BLOCK.vertices).max() < 1e-7


def test_a_rigid_part_that_slides_is_rigid_and_flat():
    stiffness = np.where(HEIGHT < 0.35, np.inf, 1.0)
    deformer = block().stiffened(stiffness).hold(handle=TOP, slides=[sd.Slide(BASE)])
    pose = deformer.finish(deformer.solve(BLOCK.vertices[TOP] + TURN @ [0.5, 0.3, -0.1]))
    (ids,) = Stiffness.of(BLOCK, stiffness).rigid
    turn, shift = rigid_fit(BLOCK.vertices[ids], pose.vertices[ids])
    off = BLOCK.vertices[ids] @ turn.T + shift - pose.vertices[ids]
    assert np.abs(off).max() < 1e-12 * BLOCK.diagonal
    assert off_plate(pose.vertices) < FLAT
    assert along_plate(pose.vertices) > 0.02
    assert abs(pose.volume_change) < 1e-12


def test_a_rigid_part_that_is_held_and_slides_along_a_surface_is_rigid_and_on_it():
    ball = Mesh(*icosphere(3))
    x = ball.vertices
    rigid, fixed = x[:, 2] > 0.3, (x[:, 2] > 0.3) & (x[:, 0] > 0.7)
    slides = (x[:, 2] > 0.3) & (x[:, 0] < -0.4)
    handle = np.flatnonzero(x[:, 2] < -0.9)
    pose = sd.deform(
        ball, fixed, handle, x[handle] + [0.2, 0.1, -0.2],
        stiffness=np.where(rigid, np.inf, 1.0), slides=[sd.Slide(slides, "surface")],
    )  # fmt: skip
    assert str(pose.status) == "converged"
    assert pose.rigid_error < 1e-12  # where projections on the surface left 1e-6 and more
    assert pose.slide_error < FLAT
    assert distance_to_surface(pose.vertices[slides], x, ball.faces).max() < FLAT


def test_what_leaves_its_plane_is_told():
    deformer = block().hold(handle=TOP, slides=[sd.Slide(BASE)])
    pose = deformer.solve(BLOCK.vertices[TOP] + [0.3, 0.2, 0.1])
    assert pose.slide_error == pytest.approx(off_plate(pose.vertices), rel=1e-6)
    assert 0.0 < pose.slide_error < 1e-3
    assert deformer.finish(pose).slide_error < FLAT


def test_slides_of_one_side_of_a_symmetric_body_are_mirrored():
    mesh = torso()
    x = mesh.vertices
    foot = x[:, 2] < -1.3
    left = np.flatnonzero(foot & (x[:, 0] < 0.0))
    hand = np.flatnonzero(x[:, 0] > 1.6)
    direction = np.array([0.4, 0.1, 1.0]) / np.linalg.norm([0.4, 0.1, 1.0])
    pose = sd.deform(
        mesh, [], hand, x[hand] + [-0.3, 0.1, 0.8], slides=[sd.Slide(left, "plane", direction)],
        symmetry="x", n_regions=1, n_cage_vertices=100, refine=True,
    )  # fmt: skip
    u = pose.vertices - x
    mirrored = direction * [-1, 1, 1]
    right = np.flatnonzero(foot & (x[:, 0] > 0.0))
    assert len(left) == len(right) > 3
    assert np.abs(u[left] @ direction).max() < FLAT * mesh.diagonal
    assert np.abs(u[right] @ mirrored).max() < FLAT * mesh.diagonal
    assert np.abs(u[right]).max() > 0.01


def test_many_sliding_vertices_need_little_memory():
    """Their axes come from a (3, 3) matrix, not from one of as many rows as vertices squared."""
    mesh = models.bar((2.0, 2.0, 0.3), divisions=(90, 90, 2))
    base = np.flatnonzero(mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + 1e-9)
    assert len(base) == 91**2
    (guide,) = guides(checked_slides(mesh, [sd.Slide(base)]), mesh)
    assert (
        np.abs(guide.track(mesh.vertices[base] + 0.1)[0][:, 2] - mesh.vertices[base, 2]).max()
        < 1e-12
    )


@pytest.mark.parametrize(
    ("slides", "text"),
    [
        (5, "slides must be a sequence of Slide; got 5"),
        (np.array(5), "slides must be a sequence of Slide; got an array of int64 and shape ()"),
        ([5], "slides must be"),
        ([sd.Slide([0], "curve")], "along a plane, line or surface; got 'curve'"),
        ([sd.Slide([len(HEIGHT)])], f"vertices of a slide must index 0..{len(HEIGHT) - 1}"),
        ([sd.Slide([0.5])], "vertices of a slide"),
        ([sd.Slide([0], "plane", [0, 0, 0])], r"direction of a slide must be a vector \(3,\), not"),
        ([sd.Slide([0], "plane", [0, 1])], "direction of a slide"),
        ([sd.Slide([0], "plane", [0, np.nan, 1])], "direction of a slide"),
        ([sd.Slide([0], "plane", "up")], "direction of a slide"),
        ([sd.Slide([0], "plane", [1j, 0, 1])], "direction of a slide"),
        ([sd.Slide([0], ["plane"])], "along a plane, line or surface"),
        (range(10**12), "slides must be a Slide; got 0"),
    ],
)
def test_what_is_no_slide_is_named(slides, text):
    with pytest.raises((ConstraintError, sd.errors.ArgumentError), match=text):
        block().hold(slides=slides)
