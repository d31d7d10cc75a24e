"""Mean value coordinates agree with exact ones and with VTK, and have their known properties."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solids import OCTAHEDRON, SOLIDS, TETRAHEDRON, icosphere, rotation, somewhere, torus
from solids import two_components as two_spheres
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkMeanValueCoordinatesInterpolator

from vtk_segdeform.cages.mean_value import mean_value_coordinates
from vtk_segdeform.errors import CageError, Cancelled

TURN = rotation([1, 2, 3], 0.7)  # axis-aligned coordinates hide faults
CAGES = {
    **SOLIDS,
    "turned octahedron": (OCTAHEDRON[0] @ TURN.T * 1.3 + [0.1, 0.2, 0.3], OCTAHEDRON[1]),
    "turned cube": (SOLIDS["cube"][0] @ TURN.T - 0.4, SOLIDS["cube"][1]),
    "sphere": icosphere(1),
    "torus": torus(9, 6),
    "two spheres": two_spheres(),
}
DISTANCES = [0.0, *10.0 ** np.arange(-17, -2)]

every_cage = pytest.mark.parametrize("cage", CAGES.values(), ids=CAGES.keys())


def barycentric(x, corners):
    """Return the unique four weights that sum to 1 and reproduce *x*."""
    rows = np.vstack([corners.T, np.ones(4)])
    return np.linalg.solve(rows, np.vstack([x.T, np.ones(len(x))])).T


def places(cage, n=40, seed=0):
    """Return points on faces, in their planes, on edges, on their lines, on vertices."""
    vertices, faces = cage
    rng = np.random.default_rng(seed)
    a, b, c = vertices[faces[rng.integers(len(faces), size=n)]].transpose(1, 0, 2)
    share = rng.dirichlet([1, 1, 1], n)[..., None]
    t, s = rng.uniform(-2, 3, (2, n, 1))
    return {
        "face": share[:, 0] * a + share[:, 1] * b + share[:, 2] * c,
        "plane": a + t * (b - a) + s * (c - a),
        "edge": a + share[:, 0] * (b - a),
        "line": a + t * (b - a),
        "vertex": a,
    }


def split(cage, face, share):
    """Return the cage with a vertex sum(share_i p_i) inside one face, which becomes three."""
    vertices, faces = cage
    a, b, c = faces[face]
    new = len(vertices)
    more = [[a, b, new], [b, c, new], [c, a, new]]
    return (
        np.vstack([vertices, share @ vertices[[a, b, c]]]),
        np.vstack([np.delete(faces, face, axis=0), more]),
    )


@every_cage
def test_weights_sum_to_one_and_reproduce_every_point(cage):
    for x in (somewhere(200), *places(cage).values()):
        weights = mean_value_coordinates(x, *cage)
        assert_allclose(weights.sum(axis=1), 1.0, atol=1e-11)
        assert_allclose(weights @ cage[0], x, atol=1e-11)


@pytest.mark.parametrize("place", ["face", "plane", "edge", "line", "vertex"])
def test_weights_are_accurate_at_any_distance_from_a_tetrahedron(place):
    vertices, faces = TETRAHEDRON[0] @ TURN.T * 1.3 + 0.1, TETRAHEDRON[1]
    off = np.random.default_rng(3).normal(size=(40, 3))
    off /= np.linalg.norm(off, axis=1, keepdims=True)
    for distance in DISTANCES:
        x = places((vertices, faces))[place] + distance * off
        assert_allclose(
            mean_value_coordinates(x, vertices, faces), barycentric(x, vertices), atol=1e-11
        )


@pytest.mark.parametrize("place", ["plane", "line"])
@pytest.mark.parametrize("name", ["turned octahedron", "turned cube", "sphere", "torus"])
def test_splitting_a_face_changes_nothing(name, place):
    """The weights integrate a function that is linear on each face, also on the parts of a face."""
    cage, share = CAGES[name], np.array([0.2, 0.3, 0.5])
    finer = split(cage, 0, share)
    off = np.random.default_rng(4).normal(size=(40, 3))
    off /= np.linalg.norm(off, axis=1, keepdims=True)
    for distance in (0.0, 1e-16, 1e-12, 1e-8, 1e-4, 1.0):
        x = places(cage)[place] + distance * off
        weights = mean_value_coordinates(x, *finer)
        weights[:, cage[1][0]] += weights[:, -1:] * share
        assert_allclose(weights[:, :-1], mean_value_coordinates(x, *cage), atol=1e-10)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_weights_are_invariant_under_similarities_and_flipped_faces(scale):
    vertices, faces = CAGES["torus"]
    x = somewhere()
    expected = mean_value_coordinates(x, vertices, faces)

    def moved(points):
        return scale * (points @ TURN.T + [1.0, -2.0, 0.5])

    for triangles in (faces, faces[:, ::-1]):
        weights = mean_value_coordinates(moved(x), moved(vertices), triangles)
        assert_allclose(weights, expected, atol=1e-12)


@pytest.mark.parametrize(
    "name", ["octahedron", "turned octahedron", "turned cube", "sphere", "torus"]
)
def test_weights_agree_with_vtk(name):
    vertices, faces = CAGES[name]
    x = somewhere(100, size=1.5)
    points, triangles = vtkPoints(), vtkIdList()
    points.SetDataTypeToDouble()
    points.SetData(numpy_to_vtk(vertices, deep=True))
    for corner in faces.ravel():
        triangles.InsertNextId(int(corner))
    expected = np.empty((len(x), len(vertices)))
    for point, row in zip(x, expected, strict=True):
        vtkMeanValueCoordinatesInterpolator.ComputeInterpolationWeights(
            point, points, triangles, row
        )
    assert_allclose(mean_value_coordinates(x, vertices, faces), expected, atol=1e-9)


def test_memory_is_bounded_for_any_size():
    x = somewhere(20_000)
    mean_value_coordinates(x, *icosphere(1))  # loads the kernels
    tracemalloc.start()
    weights = mean_value_coordinates(x, *icosphere(1))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak - weights.nbytes < 16e6


def test_an_open_cage_is_an_error():
    vertices, faces = OCTAHEDRON
    with pytest.raises(CageError, match="3 edges border only one face"):
        mean_value_coordinates([[0, 0, 0]], vertices, faces[1:])


def test_a_face_without_area_is_an_error():
    cage = split(TETRAHEDRON, 0, np.array([0.5, 0.5, 0.0]))
    with pytest.raises(CageError, match="1 face has no area"):
        mean_value_coordinates([[0, 0, 0]], *cage)


def test_progress_increases_to_one_and_can_cancel():
    seen = []
    mean_value_coordinates(somewhere(5000), *icosphere(1), progress=lambda f, _: seen.append(f))
    assert len(seen) > 1
    assert seen == sorted(seen)
    assert seen[-1] == 1.0

    def stop(_, message):
        raise Cancelled(message)

    with pytest.raises(Cancelled):
        mean_value_coordinates(somewhere(5000), *icosphere(1), progress=stop)
