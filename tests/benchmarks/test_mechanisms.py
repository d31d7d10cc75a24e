"""Every mechanism that `segdeform bench --only mechanisms` turns off makes a difference."""

from __future__ import annotations

import contextlib
import functools

import numpy as np
import pytest

from vtk_segdeform import sizes
from vtk_segdeform.benchmarks import mechanisms
from vtk_segdeform.benchmarks.drags import frames, ready
from vtk_segdeform.benchmarks.mechanisms import MECHANISMS, Mechanism
from vtk_segdeform.benchmarks.tasks import Hand, with_loose_parts
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.models import random_limbs, sphere
from vtk_segdeform.models.implicit import implicit_surface
from vtk_segdeform.session import Session

FEW = 6  # frames


class Body:
    """A small body, bound once."""

    def __init__(self, mesh):
        self.own, self.preparation = Hand.on(mesh), Session(mesh).preparation()
        self.given = functools.cache(self.poses)

    def poses(self, case, mechanism=None):
        """Return poses (k, n, 3) of *case*, with *mechanism* turned off."""
        preparation = self.preparation
        if mechanism is not None:
            preparation = mechanisms.bound_again(self.own, preparation)
        if case == "bend":
            session = ready(preparation, self.own, handle=True)
            mechanisms.turn_and_finish(session, self.own)
            return np.array([session.vertices])
        if case == "beside":  # a fixed vertex
            session = ready(preparation, self.own, handle=False)
            mesh = self.own.mesh
            session.set_fixed(mesh.adjacency[[self.own.tip]].indices[:1])
            return np.array([session.pull(self.own.tip, self.own.pulled_to(0.3)).vertices])
        session, goals, pulled = mechanisms.begun(case, self.own, preparation)
        drag = frames(session, goals[::9][:FEW], pulled, 8)
        return np.array([session.vertices for _ in drag])

    def differs(self, mechanism):
        """Tell whether *mechanism* makes a difference to any of its cases."""
        for case in (*mechanism.cases, *["beside"] * ("pull" in mechanism.cases)):
            given = self.given(case)
            with mechanism.off():
                without = self.poses(case, mechanism)
            if given.shape != without.shape or np.abs(given - without).max() > 1e-12:
                return True
        return False


def bowl(n_vertices):
    """Return half a sphere with a thin wall."""

    def field(x):
        wall = np.abs(np.linalg.norm(x, axis=1) - 0.5) - 0.5 * 0.07
        return np.asarray(np.maximum(wall, x[:, 2]))

    reach = 0.5 + 0.07
    return implicit_surface(field, np.array([[-reach] * 3, [reach, reach, 0.07]]), n_vertices)


def apart():
    """Return two spheres that share no region."""
    large, small = sphere(500), sphere(200)
    vertices = [large.vertices, 0.3 * small.vertices + [3.0, 0.0, 0.0]]
    return Mesh(np.concatenate(vertices), np.concatenate([large.faces, small.faces + 500]))


@pytest.fixture(scope="module")
def bodies():
    meshes = with_loose_parts(random_limbs(700, 4), 4), random_limbs(700, 1), bowl(700)
    with pytest.MonkeyPatch.context() as patch:  # small meshes are computed like large ones
        patch.setattr(sizes, "COARSE_VOLUME", 300)
        patch.setattr(sizes, "COARSE_VOLUME_POINTS", 200)
        patch.setattr(sizes, "SCALED_VOLUME", 300)
        yield [Body(mesh) for mesh in (*meshes, apart())]


@pytest.mark.campaign
@pytest.mark.parametrize("mechanism", MECHANISMS, ids=lambda each: each.name)
def test_without_the_mechanism_poses_differ(bodies, mechanism):
    assert any(body.differs(mechanism) for body in bodies)


@pytest.mark.campaign
def test_a_patch_that_patches_nothing_is_noticed(bodies):
    known = MECHANISMS[0]
    same = Mechanism(
        "nothing", "", known.place, known.attribute, vars(known.owner)[known.attribute], known.cases
    )
    assert not any(body.differs(same) for body in bodies)


@pytest.mark.parametrize("mechanism", MECHANISMS, ids=lambda each: each.name)
def test_afterwards_everything_is_as_before(mechanism):
    before = vars(mechanism.owner)[mechanism.attribute]
    with contextlib.suppress(ZeroDivisionError), mechanism.off():
        assert vars(mechanism.owner)[mechanism.attribute] is mechanism.instead
        raise ZeroDivisionError
    assert vars(mechanism.owner)[mechanism.attribute] is before
