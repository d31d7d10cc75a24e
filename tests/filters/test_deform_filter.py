"""The filter gives the results of `deform`, recomputes changes only, reports errors like VTK."""

from __future__ import annotations

import importlib
import sys

import bodies
import numpy as np
import pytest
import pyvista as pv
from campaign import every
from given_surfaces import GIVEN, require_only_moved, tube
from numpy.testing import assert_allclose, assert_array_equal
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

import vtk_segdeform as sd
from vtk_segdeform.cages import suggested_size
from vtk_segdeform.filters import deform_filter
from vtk_segdeform.filters.deform_filter import SegmentedCageDeformFilter
from vtk_segdeform.io.convert import to_polydata

pytestmark = pytest.mark.usefixtures("bound_once", "fitted_once")

MESH = sd.models.bar(divisions=(2, 2, 8))
HEIGHT = MESH.vertices[:, 2]
FIXED, HANDLE = np.flatnonzero(HEIGHT < 0.1), np.flatnonzero(HEIGHT > 0.9)
SHIFT = np.array([0.25, 0.0, -0.05])


@pytest.fixture(scope="module")
def fitted_once():
    """Let the filter fit cages to equal regions once."""
    known, fit = {}, deform_filter.fit_cages

    def fitted(mesh, regions, n_vertices, **options):
        key = mesh.vertices.tobytes(), regions.membership.tobytes(), n_vertices
        if key not in known:
            known[key] = fit(mesh, regions, n_vertices, **options)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(deform_filter, "fit_cages", fitted)
        yield


@pytest.fixture
def surface():
    """Return the cactus with arrays of fixed vertices and the handle."""
    polydata = to_polydata(MESH)
    polydata.point_data["fixed"] = (HEIGHT < 0.1).astype(np.uint8)
    polydata.point_data["handle"] = (HEIGHT > 0.9).astype(float)
    polydata.cell_data["number"] = np.arange(MESH.n_faces)
    return polydata


def filter_of(surface, **settings):
    made = SegmentedCageDeformFilter()
    made.SetInputDataObject(0, surface)
    made.faults = []

    def heard(_caller, _event, text):
        made.faults.append(text)

    heard.CallDataType = "string0"
    made.AddObserver("ErrorEvent", heard)
    for name, value in {"NumberOfCageVertices": 40, **settings}.items():
        getattr(made, f"Set{name}")(*value if isinstance(value, tuple) else [value])
    return made


def output(made):
    made.Update()
    return pv.wrap(made.GetOutputDataObject(0))


@pytest.fixture(scope="module")
def expected():
    regions = sd.segment(MESH)
    cages = sd.fit_cages(MESH, regions, suggested_size(regions))
    deformer = sd.Deformer(MESH, regions, cages, fixed=FIXED, handle=HANDLE)
    return deformer.solve(MESH.vertices[HANDLE] + SHIFT)


def test_its_results_are_those_of_a_deformer(surface, expected):
    before = surface.copy()
    made = filter_of(surface, Translation=tuple(SHIFT), NumberOfCageVertices=0)
    out = output(made)
    assert_allclose(out.points, expected.vertices, rtol=0, atol=1e-12)
    assert out.points.dtype == np.float64
    assert_allclose(out["VolumeChange"], [0.0], atol=1e-12)
    assert out["Steps"] == [expected.steps]
    assert "converged" in str(out.field_data["Status"][0])
    assert_allclose(
        out["LocalVolumeChange"], sd.local_volume_change(MESH, expected.vertices), atol=1e-9
    )
    assert_array_equal(out["number"], surface["number"])  # arrays are passed on
    assert_array_equal(out.faces, surface.faces)
    assert surface == before  # the input is unchanged
    targets = MESH.vertices[HANDLE] + SHIFT
    by_numbers = filter_of(
        surface, Fixed=FIXED, Handle=HANDLE, Targets=targets, NumberOfCageVertices=0
    )
    assert_allclose(output(by_numbers).points, out.points, rtol=0, atol=1e-12)


def test_only_changes_are_computed_again(surface):
    made = filter_of(surface, Translation=tuple(SHIFT))
    first = np.array(output(made).points)
    made.SetTranslation(0.1, 0.0, 0.0)
    made.SetRotationAxis(0.0, 1.0, 0.0)
    made.SetRotationAngle(20.0)
    other = np.array(output(made).points)
    made.SetPreserveVolume(False)
    assert abs(output(made)["VolumeChange"][0]) > 1e-6
    made.SetHandle(HANDLE[:20])
    output(made)
    surface.point_data["temperature"] = HEIGHT  # another array does not change the surface
    surface.Modified()
    assert "temperature" in output(made).point_data
    assert made.rebinds == 1
    made.SetHandleArrayName("handle")
    made.SetPreserveVolume(True)
    assert_array_equal(output(made).points, other)  # independent of the earlier execution
    made.SetTranslation(*SHIFT)
    made.SetRotationAngle(0.0)
    assert_array_equal(output(made).points, first)
    made.SetNumberOfCageVertices(50)
    output(made)
    assert made.rebinds == 2
    surface.points = surface.points * [1.0, 1.0, 1.1]
    output(made)
    assert made.rebinds == 3


def test_setting_an_unchanged_value_does_not_execute(surface):
    made = filter_of(surface, Translation=tuple(SHIFT))
    made.Update()
    before = made.GetMTime()
    made.SetTranslation(*SHIFT)
    made.SetNumberOfRegions(0)
    made.SetFixedArrayName("fixed")
    assert made.GetMTime() == before


def test_given_regions_and_cages_are_used(surface):
    regions = sd.segment(MESH, n_regions=2)
    surface.point_data["label"] = regions.labels
    made = filter_of(surface, RegionArrayName="label", Overlap=3, Translation=tuple(SHIFT))
    own = sd.Regions.from_labels(MESH, regions.labels, overlap=3)
    cages = sd.fit_cages(MESH, own, 40)
    solution = sd.Deformer(MESH, own, cages, fixed=FIXED, handle=HANDLE).solve(
        MESH.vertices[HANDLE] + SHIFT
    )
    assert_allclose(output(made).points, solution.vertices, rtol=0, atol=1e-12)
    blocks = pv.MultiBlock([to_polydata(cage) for cage in cages])
    made.SetInputDataObject(1, blocks)
    assert_allclose(output(made).points, solution.vertices, rtol=0, atol=1e-12)
    assert made.rebinds == 2
    blocks[1].points *= 1.01
    blocks.Modified()
    output(made)
    assert made.rebinds == 3
    assert made.faults == []


def test_a_sleeve_follows_unless_it_is_free():
    sleeve = bodies.tube(0.55, 0.62, 1.0, 3.0, n=12, step=0.4)
    scene = bodies.bent(bodies.rod(0.5, 0.0, 4.0, n=12, step=0.4), sleeve)
    mesh, height = scene.mesh, scene.mesh.vertices[:, 2]
    surface = to_polydata(mesh)
    surface.point_data["fixed"] = (height < 0.4).astype(int)
    surface.point_data["handle"] = (height > 3.6).astype(int)
    made = filter_of(surface, Translation=(0.8, 0.0, -0.1))
    is_sleeve, far = mesh.components == 1, []
    for attach in ({}, {1: "free"}, {1: 0}):
        made.SetAttach(attach)
        far.append(np.abs(output(made).points - mesh.vertices)[is_sleeve].max())
    assert far[1] < 0.1 < far[0] == far[2]
    assert made.rebinds == 3
    made.SetAttach({1: 7})
    assert output(made).n_points == 0
    assert "0..1" in made.faults[-1]
    made.SetRegionArrayName("fixed")
    made.Update()
    assert "SetAttach is for automatic regions only" in made.faults[-1]


def test_polygons_are_kept_and_normals_computed_again():
    cube = pv.Box(level=6).clean()
    cube = cube.compute_normals(cell_normals=False, split_vertices=False)
    top = cube.points[:, 2] > 0.99
    cube.point_data["handle"], cube.point_data["fixed"] = top, cube.points[:, 2] < -0.99
    made = filter_of(cube, NumberOfRegions=1, Translation=(0.5, 0.0, 0.0))
    out = output(made)
    assert made.faults == []
    assert out.n_cells == cube.n_cells
    assert out.points[top, 0].mean() == pytest.approx(0.5, abs=1e-2)
    side = np.abs(cube.points - [1.0, 0.0, 0.0]).max(axis=1) < 0.5
    normals = out.point_data["Normals"][side]
    assert (normals[:, 2] < -0.1).all()  # inclined like the side
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda f, s: f.SetHandleArrayName("nothing"), "no point array 'nothing'"),
        (lambda f, s: f.SetRegionArrayName("nothing"), "no point array 'nothing'"),
        (lambda f, s: f.SetHandle([10**6]), "points"),
        (lambda f, s: f.SetHandle(FIXED), "both fixed and handle"),
        (lambda f, s: f.SetTargets([[0.0, 0.0, np.nan]]), "targets"),
        (lambda f, s: f.SetRotationAxis(0.0, 0.0, 0.0), "axis"),
        (lambda f, s: f.SetInputDataObject(0, pv.Plane().triangulate()), "no point array"),
        (lambda f, s: f.SetInputDataObject(0, pv.PolyData()), "no surface"),
        (lambda f, s: f.SetInputDataObject(1, pv.Sphere(radius=0.1).triangulate()), "cage"),
        (lambda f, s: f.SetInputDataObject(1, pv.MultiBlock([s, s])), "2 cages need regions"),
    ],
)
def test_errors_are_reported_and_the_output_is_empty(surface, spoil, says, capfd):
    made = filter_of(surface, Translation=tuple(SHIFT))
    spoil(made, surface)
    assert output(made).n_points == 0
    (text,) = made.faults
    assert says in text
    assert capfd.readouterr().err == ""
    spoiled = made.GetInputDataObject(1, 0)
    if spoiled is None and made.GetInputDataObject(0, 0) is surface:
        made.SetHandleArrayName("handle")
        made.SetRegionArrayName("")
        made.SetTargets(None)
        made.SetRotationAxis(0.0, 0.0, 1.0)
        assert output(made).n_points == MESH.n_vertices  # and works again


def test_without_observers_errors_appear_in_the_output_window(surface):
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    try:
        made = SegmentedCageDeformFilter()
        made.SetInputDataObject(0, surface)
        made.SetHandleArrayName("nothing")
        made.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
    assert "no point array 'nothing'" in window.GetOutput()


def test_it_reports_progress_and_can_be_aborted(surface):
    made = filter_of(surface, Translation=tuple(SHIFT))
    seen = []
    made.AddObserver("ProgressEvent", lambda *_: seen.append(made.GetProgress()))
    output(made)
    assert len(seen) > 4
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    made.SetNumberOfCageVertices(50)
    made.AddObserver("ProgressEvent", lambda *_: made.SetAbortExecute(1))
    assert output(made).n_points == 0
    assert made.faults == []


# Surfaces as users have them: the output is the input, only moved.

EXTRAS = {"LocalVolumeChange": "point_data", "VolumeChange": "field_data"}
EXTRAS |= dict.fromkeys(("HandleError", "Steps", "Status", "HasVolume", "Lids"), "field_data")


def bent(surface, **settings):
    """Return the output of the filter over a surface 3 high, and its own arrays apart."""
    z = surface.points[:, 2]
    shift = {"Translation": (0.2, 0.0, 0.0), "NumberOfRegions": 1}
    ends = {"Fixed": np.flatnonzero(z < 0.3), "Handle": np.flatnonzero(z > 2.7)}
    made = filter_of(surface, **{**shift, **ends, **settings})
    out = output(made).copy()
    assert made.faults == []
    own = {name: np.array(getattr(out, place)[name]) for name, place in EXTRAS.items()}
    for name, place in EXTRAS.items():
        del getattr(out, place)[name]
    return out, own


@pytest.mark.parametrize("name", every(2, ["tube", "holed", "soup"]))
def test_the_output_is_the_input_only_moved(name):
    surface = GIVEN[name]()
    out, own = bent(surface)
    require_only_moved(surface, out)
    top = surface.points[:, 2] > 2.7
    step = out.points - surface.points.astype(float)
    assert_allclose(step[top], np.tile([0.2, 0, 0], (top.sum(), 1)), atol=5e-3)
    assert own["HasVolume"] == [1]
    assert own["Lids"] == {"tube": 2, "holed": 4, "soup": 0}[name]
    assert abs(own["VolumeChange"][0]) < 1e-12
    assert len(own["LocalVolumeChange"]) == surface.n_points


def test_points_at_a_seam_move_together_and_their_normals_agree():
    surface = tube()
    out, own = bent(surface)
    first, last = np.arange(25) * 17, np.arange(25) * 17 + 16
    assert_array_equal(out.points[first], out.points[last])
    assert_array_equal(own["LocalVolumeChange"][first], own["LocalVolumeChange"][last])
    normals = out.point_data["Normals"]
    assert normals.dtype == np.float32
    assert_allclose(normals[first], normals[last], atol=1e-6)
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    there = out.compute_normals(split_vertices=False, auto_orient_normals=False)
    inner = np.setdiff1d(np.arange(out.n_points), np.concatenate([first, last]))
    cosines = (there.point_data["Normals"][inner] * normals[inner]).sum(axis=1)
    assert np.abs(cosines).min() > 0.98


@pytest.mark.parametrize(("lids", "count"), [(True, 4), (None, 4), (False, 0)])
def test_lids_are_chosen(lids, count):
    _, own = bent(GIVEN["holed"](), Lids=lids)
    assert own["Lids"] == count
    assert own["HasVolume"] == [count > 0]


def test_targets_are_those_of_given_points():
    surface = tube()
    top = np.flatnonzero(surface.points[:, 2] > 2.7)[::-1]
    targets = surface.points[top] + [0.2, 0.0, 0.0]
    by_targets, _ = bent(surface, Handle=top, Targets=targets)
    by_motion, _ = bent(surface)
    assert_allclose(by_targets.points, by_motion.points, atol=1e-9)


def ours():
    """Return the modules of the package that are imported, by name."""
    return {name: m for name, m in sys.modules.items() if name.partition(".")[0] == sd.__name__}


def test_it_needs_no_pyvista(monkeypatch):
    """Neither does any module that it imports, all being imported again."""
    before = ours()
    monkeypatch.setitem(sys.modules, "pyvista", None)
    try:
        for name in before:
            del sys.modules[name]
        made = importlib.import_module("vtk_segdeform.filters").SegmentedCageDeformFilter()
        assert not isinstance(made, SegmentedCageDeformFilter)
    finally:
        for name in ours():
            del sys.modules[name]
        sys.modules.update(before)
