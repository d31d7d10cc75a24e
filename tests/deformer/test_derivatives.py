"""Derivatives of poses: remainders of second order, adjoints, and handles that are found again."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from limbed import crab
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from solids import icosphere

import vtk_segdeform as sd
from vtk_segdeform.errors import ArgumentError

pytestmark = pytest.mark.usefixtures("bound_once")

BENT = np.array([-0.4, 0.5, 0.1])


@pytest.fixture(autouse=True)
def _coarse_volume(request):
    if "coarse" in request.node.name:
        request.getfixturevalue("coarse")


@functools.cache
def bound(n_regions: int = 2) -> sd.Deformer:
    """Return a deformer of a body with limbs, held at one end."""
    mesh = crab(3)
    regions = sd.segment(mesh, n_regions)
    x = mesh.vertices[:, 0]
    ends = {"fixed": x < np.quantile(x, 0.04), "handle": x > np.quantile(x, 0.97)}
    cages = sd.fit_cages(mesh, regions, 50)
    return sd.Deformer(mesh, regions, cages, **ends, tolerance=1e-11)


def bent(deformer: sd.Deformer, share: float = 0.3) -> tuple[np.ndarray, sd.Solution]:
    mesh = deformer.mesh
    targets = mesh.vertices[deformer.handle] + share * mesh.diagonal * BENT
    return targets, deformer.solve(targets)


HELD = {
    "small": (2, {}),
    "coarse volume": (3, {}),
    "goal": (2, {"volumes": {"whole": "-15%"}}),
    "coarse goal": (3, {"volumes": {"whole": "+10%"}}),
    "bound": (2, {"volumes": {"whole": "at least 110%"}}),
    "free": (1, {"preserve_volume": False}),
    "regions": (2, {"preserve_region_volumes": True}),
    "centroid": (2, {"volumes": {"whole": "keep", "centroid z": "keep"}}),
    "slide": (2, {"slides": [sd.Slide(np.arange(5), "plane", (0.0, 0.0, 1.0))]}),
}


def held(name: str) -> tuple[sd.Deformer, dict]:
    """Return a deformer of `HELD`, and its options."""
    n_regions, options = HELD[name]
    base = bound(n_regions)
    return base.hold(fixed=base.fixed, handle=base.handle, **options), options


@functools.cache
def posed(name: str) -> tuple[sd.Deformer, dict, np.ndarray, sd.Solution]:
    """Return a deformer of `HELD`, its options, targets, and its pose there."""
    deformer, options = held(name)
    return deformer, options, *bent(deformer)


@pytest.mark.parametrize("name", HELD)
def test_remainders_are_of_second_order(name, rng):
    deformer, _, targets, solution = posed(name)
    surface = deformer._constraints.preserved.volumes.surface
    assert (surface.n_vertices < deformer.mesh.n_vertices) == ("coarse" in name)
    tangent = rng.normal(size=3) + 0.05 * rng.normal(size=targets.shape)
    tangent *= deformer.mesh.diagonal
    first = deformer.jvp(solution, tangent)
    off = []
    for step in (1e-3, 1e-4):
        there = deformer.copy().solve(targets + step * tangent).vertices
        off.append(np.abs(there - solution.vertices - step * first).max() / np.abs(first).max())
    assert off[0] < 1e-4
    assert off[1] < 0.02 * off[0] + 3e-7


@pytest.mark.parametrize("name", HELD)
def test_vjp_is_the_adjoint_of_jvp(name, rng):
    deformer, options, targets, solution = posed(name)
    tangent, cotangent = rng.normal(size=targets.shape), rng.normal(size=solution.vertices.shape)
    goals = [name for name, goal in options.get("volumes", {}).items() if "at" not in goal]
    gradient = deformer.vjp(solution, cotangent, volumes=goals)
    moved = np.vdot(cotangent, deformer.jvp(solution, tangent))
    assert np.vdot(gradient.targets, tangent) == pytest.approx(moved, rel=1e-8)
    for goal in goals:
        moved = np.vdot(cotangent, deformer.jvp(solution, volumes={goal: 1.0}))
        assert gradient.volumes[goal] == pytest.approx(moved, rel=1e-8)


@pytest.mark.parametrize("name", ["goal", "coarse goal", "centroid"])
def test_volumes_have_derivatives(name):
    deformer, options, targets, solution = posed(name)
    base, goal = bound(HELD[name][0]), list(options["volumes"])[-1]
    ends = {"fixed": base.fixed, "handle": base.handle}
    first = deformer.jvp(solution, volumes={goal: 1.0})
    value, _ = deformer.volume(goal, solution.vertices)
    step = 1e-3 * (deformer.mesh.diagonal if "centroid" in goal else value)
    ahead, back = (
        base.hold(**ends, volumes={**options["volumes"], goal: value + sign * step})
        .solve(targets)
        .vertices
        for sign in (1.0, -1.0)
    )
    assert_allclose((ahead - back) / (2.0 * step), first, atol=1e-4 * np.abs(first).max())


def test_stiffness_has_derivatives(rng):
    base = bound()
    mesh, ends = base.mesh, {"fixed": base.fixed, "handle": base.handle}
    stiffness = 1.0 + (mesh.vertices[:, 0] > mesh.vertices[:, 0].mean())
    change = stiffness * rng.uniform(size=mesh.n_vertices)
    deformer = base.stiffened(stiffness).hold(**ends)
    targets, solution = bent(deformer)
    first = deformer.jvp(solution, stiffness=change)
    ahead, back = (
        base.stiffened(stiffness + sign * 1e-3 * change).hold(**ends).solve(targets).vertices
        for sign in (1.0, -1.0)
    )
    assert_allclose((ahead - back) / 2e-3, first, atol=1e-3 * np.abs(first).max())
    assert np.abs(first).max() > 1e-3


def stiff(name: str, rng) -> tuple[sd.Deformer, np.ndarray]:
    """Return a deformer of `HELD` with a stiffness, and this; of "rigid" with a rigid part."""
    n_regions, options = HELD.get(name, HELD["small"])
    base = bound(n_regions)
    stiffness = 1.0 + rng.uniform(size=base.mesh.n_vertices)
    stiffness[:3] = 0.0, 1e-3, 1e3  # these are limited
    if name == "rigid":
        y = base.mesh.vertices[:, 1]
        stiffness[np.abs(y - np.median(y)) < 0.03 * np.ptp(y)] = np.inf
    ends = {"fixed": base.fixed, "handle": base.handle}
    return base.stiffened(stiffness).hold(**ends, **options), stiffness


@pytest.mark.parametrize("name", ["small", "coarse volume", "bound", "rigid"])
def test_the_gradient_by_the_stiffness_of_every_vertex_is_the_adjoint(name, rng):
    deformer, stiffness = stiff(name, rng)
    _, solution = bent(deformer)
    cotangent = rng.normal(size=solution.vertices.shape)
    gradient = deformer.vjp(solution, cotangent, stiffness=True).stiffness
    soft = np.where(np.isfinite(stiffness), stiffness, 0.0)
    assert abs(gradient @ soft) < 1e-12 * (np.abs(gradient) @ soft)  # only ratios matter
    assert not gradient[:3].any()
    assert not gradient[np.isinf(stiffness)].any()
    change = np.sign(gradient) * soft * rng.uniform(size=len(soft))
    moved = np.vdot(cotangent, deformer.jvp(solution, stiffness=change))
    # Points inside are blended with a rigid part by their nearest vertices, which may change.
    assert gradient @ change == pytest.approx(moved, rel=1e-6 if name == "rigid" else 1e-7)


def test_the_gradient_by_the_stiffness_leaves_a_remainder_of_second_order(rng):
    base = bound()
    ends = {"fixed": base.fixed, "handle": base.handle}
    stiffness = 1.0 + rng.uniform(size=base.mesh.n_vertices)
    targets, solution = bent(deformer := base.stiffened(stiffness).hold(**ends))
    cotangent = rng.normal(size=solution.vertices.shape)
    gradient = deformer.vjp(solution, cotangent, stiffness=True).stiffness
    change = stiffness * (base.regions.labels == 1)
    value, off = np.vdot(cotangent, solution.vertices), []
    for step in (0.1, 0.05):
        other = base.stiffened(stiffness + step * change).hold(**ends)
        off.append(np.vdot(cotangent, other.solve(targets).vertices) - value)
        off[-1] = abs(off[-1] - step * (gradient @ change))
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.15)
    assert off[0] < 0.2 * abs(0.1 * (gradient @ change))


def test_a_mirrored_deformer_has_derivatives(rng):
    vertices, faces = icosphere(3)
    mesh = sd.Mesh(vertices * [2.0, 1.0, 0.7], faces)
    regions = sd.segment(mesh, 1)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    deformer = sd.Deformer(
        mesh,
        regions,
        sd.fit_cages(mesh, regions, 60),
        fixed=np.abs(x) < 0.2,
        handle=(x > 1.7) & (y > -0.2),
        symmetry="y",
        tolerance=1e-11,
    )
    targets, solution = bent(deformer, 0.1)
    tangent, cotangent = rng.normal(size=targets.shape), rng.normal(size=solution.vertices.shape)
    first = deformer.jvp(solution, tangent)
    there = deformer.copy().solve(targets + 1e-4 * tangent).vertices
    assert_allclose(there - solution.vertices, 1e-4 * first, atol=1e-3 * 1e-4 * np.abs(first).max())
    gradient = deformer.vjp(solution, cotangent).targets
    assert np.vdot(gradient, tangent) == pytest.approx(np.vdot(cotangent, first), rel=1e-9)
    stiffness = np.where(y > 0.3, 1.0 + rng.uniform(size=len(y)), 1.0)
    stiffer = deformer.stiffened(stiffness).hold(fixed=deformer.fixed, handle=deformer.handle)
    solution = stiffer.solve(targets[: len(stiffer.handle)])
    gradient = stiffer.vjp(solution, cotangent, stiffness=True).stiffness
    assert not gradient[y < -0.35].any()  # the other side is stiffer
    change = np.sign(gradient) * rng.uniform(size=len(y))
    moved = np.vdot(cotangent, stiffer.jvp(solution, stiffness=change))
    assert gradient @ change == pytest.approx(moved, rel=1e-7)


@pytest.mark.campaign  # the gradient itself is tested every day
def test_three_handles_are_found_again_from_a_deformed_mesh(rng):
    base = bound()
    mesh, order = base.mesh, np.argsort(base.mesh.vertices @ [0.3, 1.0, -0.5])
    handle = np.concatenate([order[-1:], order[len(order) // 2 :][:1], base.handle[:1]])
    deformer = base.hold(fixed=base.fixed, handle=handle)
    rest = mesh.vertices[handle]
    truth = rest + 0.08 * mesh.diagonal * rng.normal(size=rest.shape)
    goal, unit, evaluated = deformer.copy().solve(truth).vertices, mesh.diagonal, []

    def loss(u: np.ndarray) -> tuple[float, np.ndarray]:
        solution = deformer.solve(rest + unit * u.reshape(-1, 3))
        off = (solution.vertices - goal) / unit
        evaluated.append(abs(solution.volume_change))
        gradient = deformer.vjp(solution, 2.0 * off).targets
        return float(np.vdot(off, off)), gradient.ravel()

    found = minimize(
        loss, np.zeros(9), jac=True, method="L-BFGS-B", options={"maxiter": 30, "ftol": 1e-16}
    )
    assert np.abs(rest + unit * found.x.reshape(-1, 3) - truth).max() < 1e-4 * unit
    assert found.nit <= 30
    assert max(evaluated) < 1e-12


def test_what_has_no_derivative_is_refused(rng):
    base = bound()
    ends = {"fixed": base.fixed, "handle": base.handle}
    deformer = base.hold(**ends)
    targets, solution = bent(deformer)
    cotangent = rng.normal(size=solution.vertices.shape)
    for wrong in (
        lambda: deformer.vjp(deformer.finish(solution), cotangent),
        lambda: deformer.vjp(solution, cotangent[:-1]),
        lambda: deformer.jvp(solution, targets[:-1]),
        lambda: deformer.jvp(solution, volumes={"whole": 1.0}),  # preserved, but no goal
        lambda: deformer.jvp(solution, stiffness=np.ones(3)),
        lambda: deformer.vjp(solution, cotangent, stiffness=1.0),
        lambda: base.hold(**ends).vjp(solution, cotangent),
    ):
        with pytest.raises((ArgumentError, ValueError)):
            wrong()
    stopped = deformer.solve(targets + 0.3 * deformer.mesh.diagonal, max_steps=1)
    with pytest.raises(ArgumentError, match="converged"):
        deformer.vjp(stopped, cotangent)
    grown, _, _, there = posed("goal")
    with pytest.raises(ArgumentError, match="jvp"):
        grown.vjp(there, cotangent, stiffness=True)
    area = base.hold(**ends, volumes={"area": "keep"})
    _, kept = bent(area, 0.05)
    with pytest.raises(ArgumentError, match="area"):
        area.vjp(kept, cotangent)
    sliding = base.hold(**ends, slides=[sd.Slide(np.arange(4), "surface")])
    _, slid = bent(sliding, 0.05)
    with pytest.raises(ArgumentError, match="surface"):
        sliding.vjp(slid, cotangent)


def test_torch_differentiates_poses():
    torch = pytest.importorskip("torch")
    from vtk_segdeform.autograd import deformed

    deformer = bound().hold(fixed=bound().fixed, handle=bound().handle[:2])
    rest = deformer.mesh.vertices[deformer.handle]
    targets = torch.tensor(rest + 0.1, dtype=torch.float64, requires_grad=True)
    some = [3, 200, 400]
    assert torch.autograd.gradcheck(lambda u: deformed(deformer, u)[some], (targets,))
