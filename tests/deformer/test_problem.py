"""The frozen problem: the map of the cages, and anchors of parts that nothing holds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import icosphere

from vtk_segdeform.cages import fit_cages
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.mesh import Mesh, SurfacePoint
from vtk_segdeform.regions import Regions

SCENE = sausage(2, is_coarse=True)


@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_the_map_is_exact_at_rest_and_has_the_motion_along_directions_beside_the_pose(shift):
    problem = SCENE.transformed(scale=3.0, shift=np.full(3, shift)).deformer()._problem
    rest, p, rng = problem.rest_pose.vertices, problem.rest_cages, np.random.default_rng(0)
    assert_array_equal(problem.map(p), rest)
    moved = p + 0.1 * rng.normal(size=p.shape)
    z = [rng.normal(size=p.shape) for _ in range(2)]
    rows = problem.subspace.at(np.arange(len(rest)))
    found = problem.map(moved, z)
    frame = problem.frame
    assert_allclose(found[:, :3], frame.about_origin(frame.outward(rows @ moved)), atol=1e-5)
    assert_allclose(found[:, 3:], frame.size * rows @ np.hstack(z), atol=1e-5)
    corners, shares = SCENE.mesh.faces[7], np.array([0.2, 0.3, 0.5])
    row = problem.row_of(SurfacePoint.of(corners, shares))
    assert_allclose(row @ moved, shares @ rows[corners] @ moved, atol=1e-12)


def test_cells_of_the_finish_are_by_the_vertices_of_a_cage_vertex():
    energy = SCENE.held()._problem.cell_energy
    assert (energy._rounds, energy._share) == (1, pytest.approx(0.1 * 258 / 36))


def test_parts_that_nothing_holds_have_anchors_and_the_others_none():
    """A body with a part beside it in the same region, and one in a region of its own."""
    (ball, faces), at = icosphere(1), np.array([[0.0, 0, 0], [2.5, 0, 0], [0, 9, 0]])
    n = len(ball)
    corners = np.concatenate([faces, faces + n, faces + 2 * n])
    mesh = Mesh((ball + at[:, None]).reshape(-1, 3), corners)
    regions = Regions.from_labels(mesh, mesh.components // 2)
    problem = Deformer(mesh, regions, fit_cages(mesh, regions, 60))._problem
    energy, split = problem.energy, len(problem.cages[0].vertices)
    found = problem.anchors_of_loose_parts(np.array([0]))
    own, alone = found[:split, :split], found[split:, split:]
    assert_array_equal(found[:split, split:], 0.0)
    rows = problem.subspace.at(np.arange(n, 2 * n))[:, :split]
    weight = 1e-4 * np.trace(energy.quadratic[:split, :split])
    assert_allclose(own, weight * rows.T @ rows / n, rtol=1e-9)  # as samples all are alike
    rows = problem.subspace.at(np.arange(2 * n, 3 * n))[:, split:]
    weight = 1e-4 * np.trace(energy.quadratic[split:, split:])
    still = energy.scale * np.eye(len(alone))
    assert_allclose(alone, still + weight * rows.T @ rows / n, rtol=1e-9)
    assert not problem.anchors_of_loose_parts(np.array([0, n, 2 * n])).any()
    assert not problem.anchors_of_loose_parts(np.array([], dtype=int)).any()
