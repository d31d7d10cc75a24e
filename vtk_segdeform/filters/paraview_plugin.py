"""The filter in ParaView: load this file by Tools > Manage Plugins > Load New.

    python -m vtk_segdeform.filters.paraview_plugin --path

prints where it is; PV_PLUGIN_PATH or LoadPlugin take it as well.  In the menu it is Filters >
Mesh > Segmented Cage Deform: mark what stays and what is moved by point arrays "fixed" and
"handle" (a Calculator makes them, coordsZ > 0.9), then shift and turn the handle.

ParaView's Python needs a numpy and scipy as new as this package does; where its own are older:

    pip install --target FOLDER numpy scipy         with the same Python version as ParaView's
    PYTHONPATH=FOLDER paraview

Where it has no vtk_segdeform of its own, the one that this file lies in is used.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

if __name__ == "__main__":  # asked from a shell, where there is no ParaView
    if sys.argv[1:] == ["--path"]:
        print(Path(__file__).resolve())
        sys.exit(0)
    sys.exit("python -m vtk_segdeform.filters.paraview_plugin --path")

import scipy
from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy

if tuple(map(int, scipy.__version__.split(".")[:2])) < (1, 13):
    raise ImportError(
        f"ParaView's Python has scipy {scipy.__version__}, vtk_segdeform needs 1.13 or newer: "
        "pip install --target FOLDER numpy scipy, then start ParaView with PYTHONPATH=FOLDER"
    )

if find_spec("vtk_segdeform") is None:
    # Last, so that nothing of ParaView's own is replaced by what lies beside it.
    sys.path.append(str(Path(__file__).resolve().parent.parent))

from .deform_filter import SegmentedCageDeformFilter

paraview_plugin_version = "0.1"


@smproxy.filter(name="SegmentedCageDeform", label="Segmented Cage Deform")
@smhint.xml('<ShowInMenu category="Mesh"/>')
@smproperty.input(name="Cages", port_index=1)
@smdomain.xml('<DataTypeDomain name="cages"><DataType value="vtkDataObject"/></DataTypeDomain>')
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkPolyData"], composite_data_supported=False)
class SegmentedCageDeform(SegmentedCageDeformFilter):
    """What may be set, for ParaView's panel; see `SegmentedCageDeformFilter`."""

    @smproperty.stringvector(name="HandleArray", default_values="handle")
    def SetHandleArrayName(self, name: str) -> None:  # noqa: N802
        super().SetHandleArrayName(name)

    @smproperty.stringvector(name="FixedArray", default_values="fixed")
    def SetFixedArrayName(self, name: str) -> None:  # noqa: N802
        super().SetFixedArrayName(name)

    @smproperty.stringvector(name="RegionArray", default_values="")
    def SetRegionArrayName(self, name: str) -> None:  # noqa: N802
        super().SetRegionArrayName(name)

    @smproperty.doublevector(name="Translation", default_values=[0.0, 0.0, 0.0])
    def SetTranslation(self, x: float, y: float, z: float) -> None:  # noqa: N802
        super().SetTranslation(x, y, z)

    @smproperty.doublevector(name="RotationAxis", default_values=[0.0, 0.0, 1.0])
    def SetRotationAxis(self, x: float, y: float, z: float) -> None:  # noqa: N802
        super().SetRotationAxis(x, y, z)

    @smproperty.doublevector(name="RotationAngle", default_values=0.0)
    @smdomain.doublerange(min=-180.0, max=180.0)
    def SetRotationAngle(self, degrees: float) -> None:  # noqa: N802
        super().SetRotationAngle(degrees)

    @smproperty.intvector(name="NumberOfRegions", default_values=3)
    @smdomain.intrange(min=0, max=24)
    def SetNumberOfRegions(self, count: int) -> None:  # noqa: N802
        super().SetNumberOfRegions(count)

    @smproperty.intvector(name="NumberOfCageVertices", default_values=155)
    @smdomain.intrange(min=12, max=2000)
    def SetNumberOfCageVertices(self, count: int) -> None:  # noqa: N802
        super().SetNumberOfCageVertices(count)

    @smproperty.intvector(name="Overlap", default_values=4)
    @smdomain.intrange(min=0, max=20)
    def SetOverlap(self, rings: int) -> None:  # noqa: N802
        super().SetOverlap(rings)

    @smproperty.intvector(name="PreserveVolume", default_values=1)
    @smdomain.xml('<BooleanDomain name="bool"/>')
    def SetPreserveVolume(self, hold: int) -> None:  # noqa: N802
        super().SetPreserveVolume(bool(hold))

    @smproperty.doublevector(name="Stretch", default_values=10.0)
    @smdomain.doublerange(min=0.0, max=100.0)
    def SetStretch(self, strength: float) -> None:  # noqa: N802
        super().SetStretch(strength)
