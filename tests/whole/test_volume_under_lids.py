"""The volume of open surfaces: exact under lids, nothing to preserve for sheets."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from open_meshes import bottle, open_box, revolved, sheet, tube, with_holes
from solids import rotation

import vtk_segdeform as sd
from vtk_segdeform import models, sizes
from vtk_segdeform.solver import exact_volume, region_volumes, total_volume
from vtk_segdeform.subspace import interpolated

EXACT = 4e-14
BODIES = {
    "cup": lambda: revolved([0.02, 1.0, 1.0], [0.0, 0.0, 2.0], 20, 20),
    "bottle": lambda: bottle(20, 24),
    "tube": lambda: tube(8.0, 16, 30),
    "body with 12 holes": lambda: with_holes(models.cactus(500), 12, 0.03),
    "open box": lambda: open_box(5),
}


def flat(n=24):
    return sheet(lambda u, v: (2 * u, v, 0.02 * np.sin(5 * u)), n, n // 2)


@functools.lru_cache(maxsize=16)
def caged(name, n_regions):
    mesh = BODIES[name]()
    regions = sd.segment(mesh, n_regions)
    return mesh, regions, sd.fit_cages(mesh, regions, 60)


@functools.lru_cache(maxsize=16)
def bound(name, n_regions):
    return bind(*caged(name, n_regions))


def bind(mesh, regions, cages=None, **options):
    """Return a deformer with its ends along its longest axis as fixed vertices and handle."""
    x = mesh.vertices
    along = x[:, np.ptp(x, axis=0).argmax()]
    share = (along - along.min()) / np.ptp(along)
    if cages is None:
        regions = sd.segment(mesh, regions)
        cages = sd.fit_cages(mesh, regions, 60)
    ends = {"fixed": np.flatnonzero(share < 0.1), "handle": np.flatnonzero(share > 0.9)}
    return sd.Deformer(mesh, regions, cages, **ends, **options)


def bent(deformer, degrees=35.0):
    """Return targets: the handle turned about the middle of the mesh."""
    x = deformer.mesh.vertices
    axis, about = np.roll(np.eye(3)[np.ptp(x, axis=0).argmax()], 1), x.mean(axis=0)
    turn = rotation(axis, np.radians(degrees))
    return (x[deformer.handle] - about) @ turn.T + about


def held(deformer, **options):
    return deformer.hold(fixed=deformer.fixed, handle=deformer.handle, **options)


@pytest.mark.parametrize(
    ("name", "n_regions"),
    every(7, [*((name, 3) for name in BODIES), ("bottle", 1), ("bottle", 6)]),
)
def test_every_pose_has_the_volume_of_the_rest_shape(name, n_regions):
    deformer = bound(name, n_regions)
    assert deformer.has_volume
    solution = deformer.solve(bent(deformer))
    free = held(deformer, preserve_volume=False).solve(bent(deformer))
    each = held(deformer, preserve_region_volumes=True).solve(bent(deformer))
    print(
        f"{name}, {n_regions} regions: {solution.volume_change:.1e}, of regions "
        f"{np.abs(each.region_volume_change).max():.1e}, not preserved {free.volume_change:.1e}"
    )
    assert abs(solution.volume_change) < EXACT
    assert abs(each.volume_change) < EXACT
    assert np.abs(each.region_volume_change).max() < EXACT
    assert abs(free.volume_change) > 1e-5
    # Computed anew, from the returned vertices.
    mesh = deformer.mesh
    assert abs(total_volume(mesh).relative(solution.vertices)) < EXACT
    for volume in region_volumes(mesh, deformer.regions.labels):
        assert abs(volume.relative(each.vertices)) < EXACT


@pytest.mark.parametrize(
    ("way", "per_region"),
    every(
        4,
        [
            *((way, per_region) for way in ("coarse", "gpu") for per_region in (False, True)),
            *(
                (way, per_region)
                for way in ("scaled", "interpolated")
                for per_region in (True, False)
            ),
        ],
    ),
)
def test_the_volume_is_exact_at_every_size(monkeypatch, way, per_region):
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 200)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 300)
    monkeypatch.setattr(sizes, "VOLUME_HESSIAN_POINTS", 200)
    if way != "coarse":
        monkeypatch.setattr(sizes, "SCALED_VOLUME", 200)
    if way == "interpolated":
        monkeypatch.setattr(sizes, "INTERPOLATED", 200)
        monkeypatch.setattr(interpolated, "_MOST_NODES", np.inf)
    if way == "gpu":
        monkeypatch.setattr(exact_volume, "gpu_arrays", lambda: np)
    deformer = bind(*caged("body with 12 holes", 3), preserve_region_volumes=per_region)
    solution = deformer.solve(bent(deformer))
    assert str(solution.status) == "converged"
    assert abs(solution.volume_change) < 1e-12
    assert abs(total_volume(deformer.mesh).relative(solution.vertices)) < 1e-12
    if per_region:
        assert np.abs(solution.region_volume_change).max() < 1e-12


def test_a_sheet_has_nothing_to_preserve():
    deformer = bind(flat(), 2)
    assert not deformer.has_volume
    solution = deformer.solve(bent(deformer))
    free = held(deformer, preserve_volume=False).solve(bent(deformer))
    each = held(deformer, preserve_region_volumes=True).solve(bent(deformer))
    assert_array_equal(solution.vertices, free.vertices)
    assert_array_equal(solution.vertices, each.vertices)
    assert solution.volume_change == 0.0
    assert solution.region_volume_change.shape == (0,)


def session_of(mesh):
    session = sd.Session(mesh)
    z = mesh.vertices[:, 2]
    session.set_fixed(z < z.min() + 0.1 * np.ptp(z))
    session.handles.add(z > z.max() - 0.1 * np.ptp(z), "end")
    session.segment(1)
    session.change_options(n_cage_vertices=40)
    session.fit_cages()
    return session


def dragged(session):
    session.drag({"end": session.targets["end"] + [0.5, 0.0, 0.1]})
    session.commit()


def test_a_session_keeps_the_volume_under_lids_and_its_option(tmp_path):
    session = session_of(BODIES["bottle"]())
    dragged(session)
    assert session.has_volume
    assert session.volume_summary == "2 holes: volume kept under lids"
    assert abs(session.volume_change) < EXACT
    pose = session.vertices

    session.change_options(lids=False)
    assert session.volume_summary == "Open surface, lids off: no volume to preserve"
    assert (session.has_volume, session.volume_change) == (False, 0.0)
    assert_array_equal(session.vertices, pose)
    sd.save_session(tmp_path / "bottle.segd", session)
    assert sd.load_session(tmp_path / "bottle.segd").options.lids is False
    session.change_options(lids=None)  # no step: undo leaves settings
    assert abs(session.volume_change) < EXACT

    session.change_options(preserve_volume=False)
    assert session.volume_summary == "2 holes: volume measured under lids"


def test_moving_a_cage_keeps_the_volume_under_lids():
    session = session_of(BODIES["bottle"]())
    (cage,) = session.cage_vertices
    session.move_cage(0, cage * [1.0, 1.2, 1.0])
    assert abs(session.volume_change) < EXACT
    session.change_options(lids=False)
    session.move_cage(0, cage * [1.3, 1.2, 1.0])
    assert session.volume_change == 0.0
    assert_allclose(session.cage_vertices[0], cage * [1.3, 1.2, 1.0])
