"""The paper's cages, by simplification and scaling."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import sausage
from solids import torus

from vtk_segdeform.cages import Cage, scaled_cages
from vtk_segdeform.cages.cage import encloses_region
from vtk_segdeform.errors import CageError
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions

SCENE = sausage(2)


def test_cages_are_closed_and_around_their_convex_regions():
    cages = scaled_cages(SCENE.regions, 100, 1.3)
    assert sum(cage.n_vertices for cage in cages) == 100
    assert abs(cages[0].n_vertices - cages[1].n_vertices) <= 2  # regions of equal area
    assert all(cage.is_two_manifold for cage in cages)
    for r, cage in enumerate(cages):
        assert encloses_region(Cage(cage.vertices, cage.faces), SCENE.regions, r)


def test_the_scale_is_that_of_the_simplified_patch():
    small, large = (scaled_cages(SCENE.regions, 100, scale) for scale in (1.0, 2.0))
    for a, b in zip(small, large, strict=True):
        assert_allclose(b.vertices.mean(axis=0), a.vertices.mean(axis=0))
        ratio = signed_volume(b.vertices, b.faces) / signed_volume(a.vertices, a.faces)
        assert ratio == pytest.approx(8.0)


def test_a_patch_that_cannot_be_closed_is_refused():
    """Two triangles that share a corner and nothing else."""
    mesh = Mesh(*torus())
    corner, everything = mesh.faces[0, 0], np.ones(mesh.n_vertices, dtype=bool)
    ring = mesh.faces[(mesh.faces == corner).any(axis=1)]
    pairs = (np.isin(everything.cumsum() - 1, [ring[0], other]) for other in ring[1:])
    bow = next(
        pair for pair in pairs if pair.sum() == 5 and pair[mesh.faces].all(axis=1).sum() == 2
    )
    with pytest.raises(CageError, match="cannot be closed"):
        scaled_cages(Regions(mesh, np.stack([everything, bow])), 60, 1.2)
