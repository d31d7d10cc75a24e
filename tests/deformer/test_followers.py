"""A body without fixed or handle vertices follows the one that it is around, inside of or against.

Every vertex of a follower is within twice its gap and 5 % of the diagonal of where the surface of
its carrier takes it, nothing crosses that did not at rest, and each body keeps its own volume: in
the pose of the cages and in the finished one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import Scene, ball, bent, off_carrier, revolved, rod, tube, with_cast
from numpy.testing import assert_allclose, assert_array_equal

from vtk_segdeform import models
from vtk_segdeform.deformer import deform, on_volumes
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.geometry import Carrying, signed_volume
from vtk_segdeform.mesh import Mesh, new_crossings
from vtk_segdeform.models import random_limbs
from vtk_segdeform.regions import segment
from vtk_segdeform.solver import Solution, total_volume

pytestmark = pytest.mark.usefixtures("bound_once")


def arm(**meshing: float) -> tuple[np.ndarray, np.ndarray]:
    return rod(0.5, 0.0, 4.0, **meshing)


SCENES = {
    "sleeve": lambda: bent(arm(n=16, step=0.25), tube(0.54, 0.6, 1.0, 3.0, n=16, step=0.25)),
    "wide sleeve": lambda: bent(arm(n=32), tube(0.7, 0.8, 1.2, 2.7, step=0.15)),
    "tight fine sleeve": lambda: bent(arm(step=0.2), tube(0.51, 0.53, 0.8, 2.9, n=40, step=0.06)),
    "open sleeve": lambda: bent(arm(), revolved([(0.58, 0.8), (0.62, 3.1)], 28, 0.12)),
    "lining": lambda: bent(
        tube(0.5, 0.65, 0.0, 4.0, n=16, step=0.25), tube(0.37, 0.41, 0.2, 3.8, n=16, step=0.25)
    ),
    "rod in a tube": lambda: bent(tube(0.5, 0.65, 0.0, 4.0), rod(0.3, 0.2, 3.8)),
    "beads": lambda: bent(
        arm(n=32),
        ball(0.3, [0.82, 0.0, 2.0]),
        ball(0.05, [-0.555, 0.0, 2.3], 1),
        ball(0.15, [0.0, -0.66, 1.6]),
        follows={1: 0, 2: 0, 3: 0},
    ),
    "arm in shirt in jacket": lambda: bent(
        rod(0.4, 0.0, 4.0), tube(0.43, 0.48, 0.8, 3.2), tube(0.51, 0.58, 0.6, 2.8, n=30),
        follows={1: 0, 2: 1},
    ),
    "cast": lambda: with_cast(random_limbs(4000, seed=3), 0.012, 0.01),
    "tight cast": lambda: with_cast(random_limbs(4000, seed=11), 0.004, 0.006),
}  # fmt: skip


def volumes(mesh: Mesh, x: np.ndarray) -> np.ndarray:
    owner = mesh.components[mesh.faces[:, 0]]
    return np.array([signed_volume(x, mesh.faces[owner == k]) for k in range(owner.max() + 1)])


def check(scene: Scene, solution: Solution) -> None:
    mesh, x = scene.mesh, solution.vertices
    for one, other in scene.follows.items():
        off, gap = off_carrier(scene, x, one, other)
        assert (off <= 2.0 * gap + 0.05 * mesh.diagonal).all()
    assert len(solution.crossings()) == 0
    if mesh.is_closed:
        assert_allclose(volumes(mesh, x) / volumes(mesh, mesh.vertices), 1.0, atol=1e-12)
    assert abs(solution.volume_change) < 1e-12


# The wall of a tube with another body inside folds in the finish of a bend by 60 degrees.
HOLLOW = "lining", "rod in a tube"


OFTEN = "sleeve", "lining"
RARE = sorted({*SCENES} - {*OFTEN})


@pytest.mark.parametrize(
    "name", [*OFTEN, *(pytest.param(n, marks=pytest.mark.campaign) for n in RARE)]
)
def test_followers_keep_their_place_on_a_body_that_is_bent(name):
    scene = SCENES[name]()
    given = scene.mesh, scene.fixed, scene.handle
    for is_finished in (True,) if name in HOLLOW else (False, True):
        angle = 50.0 if name in HOLLOW and is_finished else 60.0
        solution = deform(*given, scene.targets(angle), refine=is_finished)
        check(scene, solution)
        assert solution.is_finished == is_finished


def test_bodies_that_stand_near_each_other_do_not_follow():
    thin = rod(0.3, 0.0, 4.0, n=8, step=0.4)
    for gap in (0.2, 1.0):
        scene = bent(thin, (thin[0] - [0.6 + gap, 0.0, 0.0], thin[1]))
        given = scene.mesh, scene.fixed, scene.handle, scene.targets(50.0)
        solution = deform(*given, n_cage_vertices=80)
        other = scene.mesh.components == 1
        moved = np.linalg.norm(solution.vertices - scene.mesh.vertices, axis=1)[other]
        assert moved.max() < 1e-12
        assert_array_equal(solution.unmoved, [1])


def test_what_is_attached_by_hand_follows_and_what_is_free_stays():
    scene = bent(
        arm(n=12, step=0.25),
        ball(0.3, [1.6, 0.0, 2.0]),
        tube(0.55, 0.62, 1.0, 3.0, n=12, step=0.25),
    )
    mesh, is_ball = scene.mesh, scene.mesh.components == 1
    given = mesh, scene.fixed, scene.handle, scene.targets(45.0)
    few = {"n_cage_vertices": 80, "refine": False}
    x = deform(*given, attach={1: 2, 2: "free"}, **few).vertices
    assert_allclose(x[mesh.components != 0], mesh.vertices[mesh.components != 0], atol=1e-9)
    x = deform(*given, attach={1: 0, 2: "free"}, **few).vertices
    assert np.linalg.norm(x - mesh.vertices, axis=1)[is_ball].max() > 0.2
    assert_allclose(x[mesh.components == 2], mesh.vertices[mesh.components == 2], atol=1e-9)
    x = deform(*given, **few).vertices
    assert_allclose(x[is_ball], mesh.vertices[is_ball], atol=1e-12)


@pytest.mark.parametrize(
    ("attach", "says"),
    [
        ({1: 1}, "attach must map components"),
        ({2: 0}, "attach must map components"),
        ({1: "loose"}, "attach must map components"),
        ({0: 1, 1: 0}, "lead back"),
        ([(1, 0)], "attach must be"),
    ],
)
def test_attachments_are_checked(attach, says):
    scene = bent(rod(0.5, 0.0, 4.0, n=8, step=0.5), rod(0.1, 5.0, 6.0, n=8, step=0.5))
    with pytest.raises(ArgumentError, match=says):
        segment(scene.mesh, attach=attach)


def test_needles_at_a_sharp_rim_do_not_cross_when_a_follower_regains_its_volume():
    """Vertices of a side are next to a rim, where normals turn by 45 degrees."""
    box = models.bar((1.0, 1.0, 1.0), divisions=(6, 6, 6))
    x = box.vertices - box.vertices.mean(axis=0)
    on_top, middle = x[:, 2] > 0.49, np.abs(x[:, 1]) < 0.4
    rim = np.flatnonzero(on_top & middle & (x[:, 0] > 0.49))
    beside = np.flatnonzero(on_top & middle & (np.abs(x[:, 0] - 1.0 / 3.0) < 0.01))
    x[beside] = x[rim] - [2e-4, 0.0, 0.0]
    carrier = models.sphere(40)
    n = carrier.n_vertices
    both = Mesh(
        np.concatenate([0.01 * carrier.vertices + [2.0, 0.0, 0.0], x]),
        np.concatenate([carrier.faces, box.faces + n]),
    )
    whole, carrying = total_volume(both), Carrying(both, np.array([0, 0]))
    smaller = replace(whole, target=0.97 * whole.target)
    moved = on_volumes(both.vertices, [smaller], np.arange(n), carrying.evened)
    assert smaller.relative(moved) == pytest.approx(0.0, abs=1e-13)
    assert not len(new_crossings(moved, both.vertices, both.faces))
