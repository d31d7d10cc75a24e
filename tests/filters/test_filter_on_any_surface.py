"""The filter over surfaces as users have them: the output is the input, only moved."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from given_surfaces import GIVEN, require_only_moved, tube
from numpy.testing import assert_allclose, assert_array_equal

from vtk_segdeform.filters.deform_filter import SegmentedCageDeformFilter

EXTRAS = {"LocalVolumeChange": "point_data", "VolumeChange": "field_data"}
EXTRAS |= dict.fromkeys(("HandleError", "Steps", "Status", "HasVolume", "Lids"), "field_data")


def bent(surface, **settings):
    """Return the output of the filter, and its own arrays apart."""
    made = SegmentedCageDeformFilter()
    made.SetInputDataObject(0, surface)
    z = surface.points[:, 2]
    made.SetFixed(np.flatnonzero(z < 0.3))
    made.SetHandle(np.flatnonzero(z > 2.7))
    made.SetTranslation(0.2, 0.0, 0.0)
    made.SetNumberOfRegions(1)
    made.SetNumberOfCageVertices(40)
    for name, value in settings.items():
        getattr(made, f"Set{name}")(value)
    faults = []

    def heard(_caller, _event, text):
        faults.append(text)

    heard.CallDataType = "string0"
    made.AddObserver("ErrorEvent", heard)
    made.Update()
    assert faults == []
    out = pv.wrap(made.GetOutputDataObject(0)).copy()
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


def test_cell_normals_turn_with_their_cells():
    surface = tube()
    del surface.point_data["Normals"]
    surface = surface.compute_normals(point_normals=False, cell_normals=True)
    out, _ = bent(surface)
    fresh = out.copy()
    del fresh.cell_data["Normals"]
    fresh = fresh.compute_normals(point_normals=False, consistent_normals=False)
    cosines = (fresh.cell_data["Normals"] * out.cell_data["Normals"]).sum(axis=1)
    assert np.abs(cosines).min() > 0.99
    assert np.abs(out.cell_data["Normals"] - surface.cell_data["Normals"]).max() > 0.03


def test_a_sheet_has_no_volume():
    plane = pv.Plane(i_resolution=12, j_resolution=12).rotate_y(90.0).translate((0, 0, 1.5))
    plane.points[:, 2] = 3 * (plane.points[:, 2] - 1.0)
    del plane.point_data["Normals"]
    out, own = bent(plane)
    require_only_moved(plane, out)
    assert own["HasVolume"] == [0]
    assert own["VolumeChange"] == [0.0]


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
