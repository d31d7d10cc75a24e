"""Two hundred random bodies are segmented, fitted with cages, bound and bent.

A body is the smooth union of a few limbs and balls, sometimes with a bore: one closed implicit
surface of any genus and of 1000 to 3000 vertices.
"""

from __future__ import annotations

import time

import numpy as np
import pytest
from solids import rotation

import vtk_segdeform as sd
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.models.implicit import Limb, implicit_surface


def body(seed):
    """Return the body number *seed*."""
    rng = np.random.default_rng([seed, 6])
    limbs = []
    for _ in range(int(rng.integers(1, 5))):
        start = rng.uniform(-0.25, 0.25, 3)
        way = np.cumsum(rng.normal(0.0, 0.28, (int(rng.integers(2, 5)), 3)), axis=0)
        points = np.vstack([start, start + way])
        thick = rng.uniform(0.1, 0.24)
        radii = thick * rng.uniform(0.6, 1.2, len(points))
        ribs = int(rng.choice([0, 0, 6]))
        limbs.append(Limb([tuple(p) for p in points], radii.tolist(), ribs, 0.05 if ribs else 0.0))
    balls = rng.uniform(-0.3, 0.3, (int(rng.integers(0, 3)), 3)), rng.uniform(0.15, 0.3, 3)
    bore = rng.uniform() < 0.25
    axis, through = rng.normal(size=3), rng.uniform(0.03, 0.06)
    axis /= np.linalg.norm(axis)
    blend = rng.uniform(0.03, 0.1)

    def field(x):
        value = limbs[0](x)
        for limb in limbs[1:]:
            value = smooth(value, limb(x), blend)
        for centre, radius in zip(*balls, strict=False):
            value = smooth(value, np.linalg.norm(x - centre, axis=1) - radius, blend)
        if bore:
            side = x - np.outer(x @ axis, axis)
            value = -smooth(-value, np.linalg.norm(side, axis=1) - through, 0.05)  # no sharp edges
        return value

    points = np.concatenate([np.asarray(limb.points) for limb in limbs])
    box = np.stack([points.min(axis=0) - 0.7, points.max(axis=0) + 0.7])
    return implicit_surface(field, box, int(rng.integers(1000, 3001)))


def smooth(a, b, width):
    """Return the smooth minimum of *a* and *b*."""
    gap = np.maximum(1.0 - np.abs(a - b) / width, 0.0)
    return np.minimum(a, b) - 0.25 * width * gap**2


def bend_body(seed):
    """Bend a body and check each step; return the number of regions, the genus and the solution."""
    mesh = body(seed)
    rng = np.random.default_rng([seed, 7])
    regions = sd.segment(mesh, None if seed % 2 else int(rng.integers(1, 6)))
    cages = sd.fit_cages(mesh, regions, 45 * regions.n_regions + 30)
    for members, cage in zip(regions.membership, cages, strict=True):
        sd.Cage(cage.vertices, cage.faces).require_encloses(mesh.vertices[members], "members")
    x = mesh.vertices @ np.linalg.eigh(np.cov(mesh.vertices.T))[1][:, -1]
    low, high = np.quantile(x, [0.1, 0.9])
    fixed, handle = np.flatnonzero(x <= low), np.flatnonzero(x >= high)
    deformer = sd.Deformer(mesh, regions, cages, fixed=fixed, handle=handle)
    middle = mesh.vertices.mean(axis=0)
    turn = rotation(rng.normal(size=3), np.radians(rng.uniform(20, 60)))
    solution = deformer.solve((mesh.vertices[handle] - middle) @ turn.T + middle)
    rest, now = (signed_volume(v, mesh.faces) for v in (mesh.vertices, solution.vertices))
    assert np.isfinite(solution.vertices).all()
    assert abs(now - rest) <= 1e-12 * rest, f"volume changed by {(now - rest) / rest:.1e}"
    assert solution.handle_error <= 1e-3 or solution.status is not sd.Status.CONVERGED
    euler = mesh.n_vertices - len(mesh.edges) + mesh.n_faces
    return regions.n_regions, (2 - euler) // 2, solution


@pytest.mark.campaign
def test_two_hundred_random_bodies_are_bent():
    began, failed, results = time.perf_counter(), [], []
    for seed in range(200):
        try:
            results.append(bend_body(seed))
        except Exception as error:  # noqa: BLE001 - to count them all
            failed.append(f"body {seed}: {type(error).__name__}: {error}")
    regions, genus, solutions = zip(*results, strict=True)
    converged = sum(s.status is sd.Status.CONVERGED for s in solutions)
    seconds = time.perf_counter() - began
    worst = max(abs(s.volume_change) for s in solutions)
    print(
        f"\n{len(results)} of 200 bodies, genus 0 to {max(genus)}, {min(regions)} to "
        f"{max(regions)} regions: volume within {worst:.0e}; "
        f"{converged} converged, {len(results) - converged} not; {seconds:.0f} s"
    )
    assert not failed, "\n".join(failed)
