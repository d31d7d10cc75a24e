"""The method in one call: its stages, its way, and what becomes of a failed finish."""

from __future__ import annotations

import logging
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import joined, rod
from numpy.testing import assert_array_equal
from scenes import sausage
from solids import rotation

from vtk_segdeform import sizes
from vtk_segdeform.deformer import deform, pull
from vtk_segdeform.deformer.deform import finished, is_finished, solved_along, stages_of
from vtk_segdeform.errors import ArgumentError, CageError, Cancelled, ConstraintError, MeshError
from vtk_segdeform.mesh import Mesh

SCENE = sausage(2, is_coarse=True)
X = SCENE.mesh.vertices
OPTIONS = {"n_regions": 1, "n_cage_vertices": 40, "refine": False}


@pytest.mark.parametrize(
    ("finishes", "ends"),
    [(True, [0.06, 0.22, 0.4, 0.6, 1.0]), (False, [0.1, 0.22 / 0.6, 0.4 / 0.6, 1.0, 1.0])],
)
def test_the_stages_span_the_progress_one_after_the_other(finishes, ends):
    told = []
    stages = stages_of(lambda share, _: told.append(share), finishes=finishes)
    assert len(stages) == 5
    for stage in stages:
        stage(0.0, "begin")
        stage(1.0, "end")
    assert told[1::2] == pytest.approx(ends)
    assert told[::2] == pytest.approx([0.0, *ends[:-1]])
    assert stages_of(None, finishes=True) == [None] * 5


def test_small_meshes_are_finished_unless_it_is_asked_not_to(monkeypatch):
    mesh = SCENE.mesh
    monkeypatch.setattr(sizes, "FINISHED", mesh.n_vertices)
    assert [is_finished(mesh, each) for each in (None, True, False)] == [True, True, False]
    monkeypatch.setattr(sizes, "FINISHED", mesh.n_vertices - 1)
    assert [is_finished(mesh, each) for each in (None, True, False)] == [False, True, False]


def test_a_way_is_solved_target_by_target():
    way, told = [SCENE.turned(degrees) for degrees in (30, 60, 90)], []
    solution = solved_along(SCENE.held(), way, progress=lambda share, _: told.append(share))
    one, steps = SCENE.held(), 0
    for targets in way:
        last = one.solve(targets)
        steps += last.steps
    assert_array_equal(solution.vertices, last.vertices)
    assert solution.steps == steps > last.steps
    assert told == sorted(told)
    assert 0.0 == told[0] < 1.0 / 3.0 < told[-1] < 1.0
    begins = [min(share for share in told if share >= k / 3.0) for k in range(3)]
    assert begins == pytest.approx([0.0, 1.0 / 3.0, 2.0 / 3.0])


def test_a_body_is_wound_up_the_way_through_which_it_is_led():
    """Three quarters of a turn at once would be a quarter the other way.

    With half as many cage vertices the body springs back.
    """
    options = {**OPTIONS, "n_cage_vertices": 80}
    axis = (1.0, 0.0, 0.0)
    way = [SCENE.turned(degrees, axis) for degrees in (90, 180, 270)]
    given = SCENE.mesh, SCENE.fixed, SCENE.handle
    wound = deform(*given, way[-1], through=way[:-1], **options).vertices
    short = deform(*given, way[-1], **options).vertices
    middle = np.flatnonzero(np.abs(X[:, 0]) < 0.3)

    def turned(x):
        return np.mean(X[middle, 1] * x[middle, 2] - X[middle, 2] * x[middle, 1])  # ~ its sine

    assert turned(wound) > 0.1
    assert turned(short) < -0.1
    with pytest.raises(ConstraintError, match="through must give one point for each"):
        deform(*given, way[-1], through=[way[0][:1]], **OPTIONS)
    with pytest.raises(ArgumentError, match="n_cage_vertices"):
        deform(*given, way[-1], n_cage_vertices=3)


def failing(error):
    """Return something like a deformer, whose finish raises."""

    def finish(solution, progress=None):
        raise error

    return SimpleNamespace(mesh=SCENE.mesh, finish=finish)


def test_a_pose_that_cannot_be_finished_is_an_error_only_if_it_was_asked_for(caplog):
    solution, told = object(), []
    with caplog.at_level(logging.INFO):
        assert finished(failing(MeshError("singular")), solution, None) is solution
    assert "not finished on the mesh: singular" in caplog.text
    with pytest.raises(MeshError, match="singular"):
        finished(failing(MeshError("singular")), solution, True)
    for refine in (None, True):
        with pytest.raises(Cancelled):
            finished(failing(Cancelled()), solution, refine)
    same = finished(failing(None), solution, False, progress=lambda *given: told.append(given))
    assert same is solution
    assert told == [(1.0, "solved")]


@pytest.mark.parametrize("option", ["lids", "avoid_contact", "refine", "preserve_volume", "mesh"])
def test_wrong_options_are_refused_before_the_work(option):
    def work(*_):
        raise AssertionError("it has begun")

    given = {"mesh": SCENE.mesh, option: "yes", "progress": work}
    with pytest.raises((ArgumentError, MeshError), match=rf"^{option} must be"):
        deform(fixed=[0], handle=[1], targets=X[[1]], **given)
    if option != "preserve_volume":
        with pytest.raises((ArgumentError, MeshError), match=rf"^{option} must be"):
            pull(vertex=1, to=X[1], **given)
    with pytest.raises(CageError, match=r"^n_cage_vertices must be"):
        pull(SCENE.mesh, 1, X[1], n_regions=1, n_cage_vertices=3)
    with pytest.raises(ConstraintError, match=r"1 vertex is both pins and handle"):
        pull(SCENE.mesh, 1, X[1], pins=[1], progress=work)


def test_the_inner_side_of_a_bent_body_does_not_wrinkle_in_its_finish():
    """A skin of small cells on a soft foundation does: its dihedral angles change by 1.7 times."""
    body = joined(rod(0.5, 0.0, 3.0, n=32))
    x, middle = body.vertices, np.array([0.0, 0.0, 1.5])
    low, high = np.flatnonzero(x[:, 2] < 0.4), np.flatnonzero(x[:, 2] > 2.6)
    targets = (x[high] - middle) @ rotation([0, 1, 0], np.radians(60.0)).T + middle
    by_cages, finished = (
        dihedral_angles(
            body, deform(body, low, high, targets, n_cage_vertices=60, refine=refine).vertices
        )
        for refine in (False, True)
    )
    rest = dihedral_angles(body, x)
    changes = [np.sqrt(np.mean((each - rest) ** 2)) for each in (by_cages, finished)]
    assert changes[1] < changes[0]


def dihedral_angles(mesh: Mesh, x: np.ndarray) -> np.ndarray:
    """Return the angle between the normals of the faces at each edge, at vertices *x* (n, 3)."""
    a, b, c = (x[corner] for corner in mesh.faces.T)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    beside = np.lexsort(edges.T).reshape(-1, 2) // 3  # of a closed mesh
    return np.arccos(np.einsum("ij,ij->i", *normals[beside.T]).clip(-1.0, 1.0))
