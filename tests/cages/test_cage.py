"""`Cage` accepts valid surfaces and names the fault of invalid ones, for known solids."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import CUBE, OCTAHEDRON, SOLIDS, TETRAHEDRON, icosphere, rotation, somewhere, torus
from solids import two_components as two_spheres

from vtk_segdeform import models
from vtk_segdeform.cages.cage import Cage, cage_faults, encloses_region
from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.errors import CageError
from vtk_segdeform.mesh.inside import distance_to_surface, winding_number
from vtk_segdeform.regions.regions import Regions

TURN = rotation([1, 2, 3], 0.7)
VALID = {
    **SOLIDS,
    "turned cube": (CUBE[0] @ TURN.T + 0.3, CUBE[1]),
    "sphere": icosphere(2),
    "torus": torus(24, 12),
    "two spheres": two_spheres(),
}
every_valid = pytest.mark.parametrize("solid", VALID.values(), ids=VALID.keys())


def joined(*solids):
    """Return several solids as one surface."""
    vertices, faces, n = [], [], 0
    for points, triangles in solids:
        vertices.append(points)
        faces.append(triangles + n)
        n += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def moved(solid, offset, scale=1.0):
    return solid[0] * scale + offset, solid[1]


def flipped(solid):
    return solid[0], solid[1][:, ::-1]


@every_valid
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_good_surface_has_no_faults(solid, scale):
    vertices, faces = solid
    assert cage_faults(scale * vertices, faces) == ()
    assert cage_faults(scale * (vertices @ TURN.T + 5.0), faces) == ()


def test_the_volume_is_that_of_the_solid():
    assert_allclose(Cage(*moved(CUBE, 1e4)).volume, 1.0, rtol=1e-9)
    assert_allclose(Cage(*TETRAHEDRON).volume, 8 / 3)
    assert_allclose(Cage(*joined(CUBE, moved(CUBE, 3.0, 2.0))).volume, 9.0)


def test_an_open_surface_is_an_error_with_the_number_of_open_edges():
    vertices, faces = OCTAHEDRON
    with pytest.raises(CageError, match="3 edges border only one face: the cage is open"):
        Cage(vertices, faces[1:])


def test_an_inside_out_surface_is_an_error():
    (fault,) = cage_faults(*flipped(CUBE))
    assert fault == "it is inside-out, volume -1: reverse its faces"


def test_a_face_without_area_is_found():
    vertices, faces = OCTAHEDRON
    a, b, c = faces[0]
    split = np.vstack([faces[1:], [[a, b, 6], [b, c, 6], [c, a, 6]]])
    (fault,) = cage_faults(np.vstack([vertices, vertices[[a, b]].mean(axis=0)]), split)
    assert fault == "1 face has no area"


def test_a_vertex_moved_through_the_opposite_side_is_found():
    vertices, faces = icosphere(2)
    assert cage_faults(vertices, faces) == ()
    through = vertices.copy()
    through[0] *= -1.2
    (fault,) = cage_faults(through, faces)
    assert "intersects itself" in fault


def test_components_may_be_disjoint_or_a_cavity_but_not_nested_or_crossing():
    small = moved(icosphere(1), 0.0, 0.5)
    outer = icosphere(2)
    assert cage_faults(*joined(outer, moved(small, 2.0))) == ()
    assert cage_faults(*joined(outer, flipped(small))) == ()
    assert cage_faults(*joined(flipped(small), outer)) == ()
    (fault,) = cage_faults(*joined(outer, small))
    assert fault == "component 2 of 2 is inside another and faces outward"
    (fault,) = cage_faults(*joined(outer, flipped(moved(small, 3.0))))
    assert fault == "component 2 of 2 faces inward"
    (fault,) = cage_faults(*joined(outer, moved(small, [0.8, 0, 0])))
    assert "intersects itself" in fault


def test_points_inside_agree_with_the_formula_of_the_solid():
    x = somewhere(2000, size=0.9)
    inside = np.abs(x).sum(axis=1) < 1
    assert_array_equal(Cage(*OCTAHEDRON).contains(x), inside)
    x = somewhere(2000, size=1.5)
    inside = ((x > 0) & (x < 1)).all(axis=1)
    assert_array_equal(Cage(*CUBE).contains(x), inside)


def test_points_outside_are_reported_with_their_distance():
    cage = Cage(*CUBE)
    cage.require_encloses([[0.5, 0.5, 0.5], [1e-9, 0.5, 0.5]], "points")
    x = [[0.5, 0.5, 0.5], [0.5, 0.5, 1.25], [1.3, 1.4, 0.5]]
    message = "2 of 3 points are outside the cage, the farthest by 0.5; enlarge the cage"
    with pytest.raises(CageError, match=message):
        cage.require_encloses(x, "points")


def test_a_region_is_tested_once_and_others_anew(monkeypatch):
    mesh = models.torus(400)
    half = mesh.vertices[:, 0] > 0.0
    regions = Regions.from_masks(mesh, [half, ~half])
    cages = fit_cages(mesh, regions, 40)
    tested = []
    contains = Cage.contains
    monkeypatch.setattr(Cage, "contains", lambda *args: (tested.append(1), contains(*args))[1])
    assert encloses_region(cages[0], regions, 0)
    assert encloses_region(cages[0], regions, 0)
    assert len(tested) == 1
    assert not encloses_region(cages[0], regions, 1)
    assert not encloses_region(cages[0], Regions.from_masks(mesh, [~half, half]), 0)
    assert len(tested) == 3


@pytest.mark.parametrize("name", ["cube", "octahedron", "torus", "hollow"])
def test_many_points_are_inside_where_each_one_is(name, monkeypatch):
    hollow = joined(icosphere(2), flipped(moved(icosphere(1), 0.0, 0.5)))
    cage = Cage(*{**VALID, "hollow": hollow, "torus": torus(16, 8)}[name])
    low, high = cage.vertices.min(axis=0), cage.vertices.max(axis=0)
    x = np.random.default_rng(1).uniform(low - 0.2, high + 0.2, (2000, 3))
    x = np.concatenate([x, 0.99 * cage.vertices, 1.01 * cage.vertices, [low, high]])
    x = x[distance_to_surface(x, cage.vertices, cage.faces) > 1e-6]
    expected = winding_number(x, cage.vertices, cage.faces) > 0.5
    assert_array_equal(cage.contains(x), expected)
    for boxes in (8, 32):
        monkeypatch.setattr("vtk_segdeform.cages.cage._BOXES", boxes)
        monkeypatch.setattr("vtk_segdeform.cages.cage._BOXED_FROM", 10)
        assert_array_equal(cage.contains(x), expected)


def test_coordinates_too_large_to_compute_with_are_refused():
    vertices, faces = CUBE
    assert cage_faults(9e69 * vertices, faces) == ()
    (fault,) = cage_faults(1.1e70 * (vertices - 1.0), faces)
    assert fault == "its coordinates exceed 1e+70; scale it down"
    with pytest.raises(CageError, match="points are too large to compute with"):
        Cage(vertices, faces).require_encloses([[0.0, 0.0, -1.1e70]], "points")
