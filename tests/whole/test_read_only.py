"""Arrays that properties and fields return by reference are read-only."""

from __future__ import annotations

import numpy as np
import public_calls
import pytest
from shared_arrays import CLASSES, writable_shared_arrays

import vtk_segdeform as sd

WIDGETS = ["CageDisplay", "HandleDragger", "RegionSelector", "SurfaceDisplay", "VolumeOverlay"]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_an_array_returned_by_reference_is_read_only(cls):
    thing = public_calls.instance(cls)
    if isinstance(thing, sd.Session):
        thing.drag(public_calls.ARGUMENTS["targets"]())
    assert writable_shared_arrays(thing) == []


@pytest.mark.parametrize("name", WIDGETS)
def test_an_array_of_a_widget_is_read_only(name):
    widget = public_calls.instance(getattr(sd.widgets, name))
    if name == "VolumeOverlay":
        widget.show()
    try:
        assert writable_shared_arrays(widget) == []
    finally:
        public_calls.tidy()


def test_the_arguments_stay_writable():
    x, faces = np.array(public_calls.mesh().vertices), np.array(public_calls.mesh().faces)
    masks, points = np.array(public_calls.regions().membership), x[:3].copy()
    mesh = sd.Mesh(x, faces)
    regions = sd.Regions(mesh, masks)
    passengers = public_calls.bound().passengers(points)
    for array in (x, faces, masks, points):
        array[:1] = 0
    assert passengers.points[0].any()
    assert mesh.vertices[0].any()
    assert regions.membership.any(axis=0).all()
