"""Properties of every mesh, region, cage and drag, checked on examples drawn by hypothesis.

Each test draws a few examples; the campaign draws a thousand for each property.
"""

from __future__ import annotations

import os
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from scenes import sausage
from scipy.spatial import ConvexHull
from solids import icosphere

import vtk_segdeform as sd
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.session.state import State

pytestmark = pytest.mark.usefixtures("bound_once_in_memory")
FEW, MANY = 2, int(os.environ.get("SEGDEFORM_EXAMPLES", "1000"))
NUMBERS = st.floats(-1.0, 1.0, allow_nan=False, width=32)
SEEDS = st.integers(0, 2**32 - 1)
PROPERTIES = []


def holds_for(**given_):
    """Make a function a test of a few examples; `test_many_examples` draws more."""

    def mark(claim):
        PROPERTIES.append((claim, given_))
        return checked(claim, given_, FEW)

    return mark


def checked(claim, given_, count):
    """Return a test of *count* examples, the same in every run."""

    def check(**values):
        claim(**values)

    check.__name__ = claim.__name__
    quiet = settings(
        max_examples=count, deadline=None, derandomize=True, database=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    return quiet(given(**given_)(check))


@lru_cache(maxsize=4)
def scene(n_regions=2):
    """Return a complete scene, with a mesh of 1026 vertices."""
    return sausage(n_regions)


@lru_cache(maxsize=1)
def bound():
    """Return a deformer of the scene."""
    return scene().deformer()


def body(seed, subdivisions=2):
    """Return a closed star-shaped body with random radii, more or less uneven."""
    rng = np.random.default_rng(seed)
    vertices, faces = icosphere(subdivisions)
    waves = np.cos(vertices @ rng.normal(0, 3, (3, 6)) + rng.uniform(0, 6, 6)) @ rng.normal(0, 1, 6)
    radii = np.exp(rng.uniform(0.0, 0.4) * waves / 2.0)
    stretch = np.exp(rng.uniform(-1.0, 1.0, 3))
    return sd.Mesh(vertices * radii[:, None] * stretch, faces)


def cage(seed, points):
    """Return a convex cage around *points*: the hull of random directions, scaled."""
    rng = np.random.default_rng(seed)
    around = rng.normal(size=(int(rng.integers(8, 40)), 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    hull = ConvexHull(around)
    faces = hull.simplices.astype(np.int64)
    a, b, c = around[faces.T]
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward, ::-1]
    nearest = -hull.equations[:, 3].max()
    assume(nearest > 0.05)  # with the origin well inside
    centre = points.mean(axis=0)
    reach = np.linalg.norm(points - centre, axis=1).max() / nearest * rng.uniform(1.05, 2.0)
    return sd.Cage(around * reach + centre, faces)


@holds_for(seed=SEEDS)
def test_coordinates_in_any_convex_cage_sum_to_one_and_reproduce_the_points(seed):
    points = body(seed).vertices
    around = cage(seed, points)
    weights = sd.mean_value_coordinates(points, around.vertices, around.faces)
    size = np.abs(around.vertices).max()
    assert np.abs(weights.sum(axis=1) - 1.0).max() < 1e-12
    assert np.abs(weights @ around.vertices - points).max() < 1e-9 * size
    assert weights.min() > -1e-9  # inside a convex cage none is negative


@holds_for(move=st.tuples(NUMBERS, NUMBERS, NUMBERS), degrees=st.floats(-90, 90), axis=SEEDS)
def test_the_volume_is_exact_for_any_targets(move, degrees, axis):
    axis = np.random.default_rng(axis).normal(size=3)
    deformer = bound()
    solution = deformer.solve(scene().turned(degrees, axis) + move, max_steps=5)
    mesh = deformer.mesh
    now, rest = (signed_volume(x, mesh.faces) for x in (solution.vertices, mesh.vertices))
    assert np.isfinite(solution.vertices).all()
    assert abs(now - rest) <= 1e-12 * rest
    # Near rest the objective is the difference of two sums as large as its constant.
    rounding = 2e-13 * deformer._problem.energy.constant
    assert all(
        b <= a * (1 + 1e-12) + rounding
        for a, b in zip(solution.merits, solution.merits[1:], strict=False)
    )


@holds_for(seed=SEEDS)
def test_random_regions_cages_and_handles_preserve_the_volume(seed):
    mesh = body(seed)
    rng = np.random.default_rng(seed)
    x = mesh.vertices @ rng.normal(size=3)
    masks = np.array([x <= np.quantile(x, 0.7), x >= np.quantile(x, 0.3)])
    regions = sd.Regions.from_masks(mesh, masks)
    cages = [cage(seed + k, mesh.vertices[mask]) for k, mask in enumerate(masks)]
    ids = rng.permutation(mesh.n_vertices)
    fixed, handle = ids[: rng.integers(0, 20)], ids[20 : 21 + rng.integers(0, 20)]
    deformer = sd.Deformer(mesh, regions, cages, fixed=fixed, handle=handle)
    targets = mesh.vertices[handle] + rng.normal(0, 0.2, (len(handle), 3))
    solution = deformer.solve(targets, max_steps=20)
    now, rest = (signed_volume(v, mesh.faces) for v in (solution.vertices, mesh.vertices))
    assert np.isfinite(solution.vertices).all()
    assert abs(now - rest) <= 1e-12 * rest


def session():
    """Return a session of the scene, at rest."""
    result = sd.Session(scene().mesh, state=State(scene().regions, scene().cages))
    result.set_fixed(scene().fixed)
    result.handles.add(scene().handle, "tip")
    return result


ACTIONS = st.lists(
    st.tuples(
        st.sampled_from(["drag", "paint", "fix", "handle", "options", "undo", "redo", "rest"]),
        SEEDS,
    ),
    max_size=6,
)


def act(work, action, seed):
    """Perform one action of a user."""
    rng = np.random.default_rng(seed)
    some = rng.permutation(work.mesh.n_vertices)[: rng.integers(1, 30)]
    if action == "drag" and work.handles and work.cages:
        name = sorted(work.handles)[0]
        work.drag({name: work.targets[name] + rng.normal(0, 0.1, 3)}, max_steps=2)
        work.commit()
    elif action == "paint":
        work.painting.paint(int(rng.integers(0, work.regions.n_regions)), some)
    elif action == "fix":
        work.set_fixed(np.setdiff1d(some, work.state.handle))
    elif action == "handle":
        taken = np.concatenate([work.fixed, work.state.handle])
        free = np.setdiff1d(some, taken)
        if len(free):
            work.handles.add(free)
    elif action == "options":
        work.change_options(stretch=float(rng.uniform(0, 20)))
    elif action == "undo":
        work.undo()
    elif action == "redo":
        work.redo()
    elif action == "rest":
        work.reset_pose()


@holds_for(actions=ACTIONS)
def test_saving_and_loading_restore_any_session(actions):
    work = session()
    for action, seed in actions:
        act(work, action, seed)
    with tempfile.TemporaryDirectory() as folder:
        one, two = Path(folder) / "one", Path(folder) / "two"
        sd.save_session(one, work)
        again = sd.load_session(one)
        sd.save_session(two, again)
        assert one.read_bytes() == two.read_bytes()
    assert np.array_equal(again.vertices, work.vertices)
    assert again.options == work.options


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("claim", "given_"), PROPERTIES, ids=[c.__name__[5:] for c, _ in PROPERTIES]
)
def test_many_examples(claim, given_):
    checked(claim, given_, MANY)()
    print(f"\n{MANY} examples: {claim.__name__[5:].replace('_', ' ')}")
