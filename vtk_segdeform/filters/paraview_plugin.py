"""ParaView plugin of the filter: load this file with Tools > Manage Plugins > Load New.

    python -m vtk_segdeform.filters.paraview_plugin --path

prints its path, for PV_PLUGIN_PATH or LoadPlugin, too.  The filter is in the menu Filters > Mesh >
Segmented Cage Deform.  Point arrays "fixed" and "handle" mark the fixed vertices and the handle (a
Calculator creates them, for example coordsZ > 0.9); the properties translate and rotate the handle.

ParaView's Python needs recent versions of numpy and scipy.  If its own are too old:

    pip install --target FOLDER numpy scipy         with the same Python version as ParaView's
    PYTHONPATH=FOLDER paraview

If vtk_segdeform is not installed in it, the package that contains this file is used.
"""

from __future__ import annotations

import platform
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

if __name__ == "__main__":  # run from a shell, without ParaView
    if sys.argv[1:] == ["--path"]:
        print(Path(__file__).resolve())
        sys.exit(0)
    sys.exit("python -m vtk_segdeform.filters.paraview_plugin --path")

from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy

LOWEST = {"python": "3.10", "numpy": "1.26", "scipy": "1.15"}  # those of setup.cfg


def _missing() -> str:
    """Return what ParaView's Python lacks, and what to do about it."""
    package, python = Path(__file__).resolve().parent.parent, platform.python_version()
    if not _is_found() and (package / "__init__.py").is_file():
        sys.path.append(str(package.parent))  # last, so that no module of ParaView is replaced
    if not _is_found():
        return (
            f"the package vtk_segdeform, which ParaView's Python {python} does not find: load the "
            "file that python -m vtk_segdeform.filters.paraview_plugin --path prints, or start "
            "ParaView with PYTHONPATH=FOLDER, where FOLDER contains the package"
        )
    if _is_older(python, LOWEST["python"]):
        return f"a ParaView with Python {LOWEST['python']} or newer; this one has {python}"
    for name in ("numpy", "scipy"):
        try:
            version = import_module(name).__version__
        except ImportError as error:
            found = f"cannot import it ({error})"
        else:
            if not _is_older(version, LOWEST[name]):
                continue
            found = f"has {version}"
        return (
            f"{name} {LOWEST[name]} or newer; ParaView's Python {found}: "
            f"pip install --target FOLDER numpy scipy with Python {python}, then start ParaView "
            "with PYTHONPATH=FOLDER"
        )
    return ""


def _is_found() -> bool:
    spec = find_spec("vtk_segdeform")
    return spec is not None and spec.origin is not None  # no folder that is merely named so


def _is_older(version: str, lowest: str) -> bool:
    return [*map(int, version.split(".")[:2])] < [*map(int, lowest.split("."))]


if missing := _missing():
    # After an ImportError ParaView would load the file in a second way, and show how that failed.
    raise RuntimeError(f"the plugin needs {missing}")

# By its full name: ParaView executes this file alone, outside of the package.
from vtk_segdeform.filters import SegmentedCageDeformFilter  # noqa: E402

paraview_plugin_version = "0.1"


@smproxy.filter(name="SegmentedCageDeform", label="Segmented Cage Deform")
@smhint.xml('<ShowInMenu category="Mesh"/>')
@smproperty.input(name="Cages", port_index=1)
@smdomain.xml('<DataTypeDomain name="cages"><DataType value="vtkDataObject"/></DataTypeDomain>')
@smproperty.input(name="Input", port_index=0)
@smdomain.datatype(dataTypes=["vtkPolyData"], composite_data_supported=False)
class SegmentedCageDeform(SegmentedCageDeformFilter):
    """Properties of the filter for ParaView's panel; see `SegmentedCageDeformFilter`."""

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

    @smproperty.intvector(name="NumberOfRegions", default_values=0)
    @smdomain.intrange(min=0, max=24)
    def SetNumberOfRegions(self, count: int) -> None:  # noqa: N802
        super().SetNumberOfRegions(count)

    @smproperty.intvector(name="NumberOfCageVertices", default_values=0)
    @smdomain.intrange(min=0, max=2000)
    def SetNumberOfCageVertices(self, count: int) -> None:  # noqa: N802
        super().SetNumberOfCageVertices(count)

    @smproperty.intvector(name="Overlap", default_values=4)
    @smdomain.intrange(min=0, max=20)
    def SetOverlap(self, rings: int) -> None:  # noqa: N802
        super().SetOverlap(rings)

    @smproperty.stringvector(name="Attach", default_values="")
    def SetAttach(self, text: str) -> None:  # noqa: N802
        """Set the components that others follow, as 1=0 2=free."""
        pairs = (each.partition("=")[::2] for each in text.replace(",", " ").split())
        super().SetAttach({int(k): int(on) if on.isdecimal() else on for k, on in pairs})

    @smproperty.intvector(name="PreserveVolume", default_values=1)
    @smdomain.xml('<BooleanDomain name="bool"/>')
    def SetPreserveVolume(self, on: int) -> None:  # noqa: N802
        super().SetPreserveVolume(bool(on))

    @smproperty.intvector(name="Lids", default_values=0)
    @smdomain.xml(
        '<EnumerationDomain name="enum"><Entry value="0" text="Auto"/>'
        '<Entry value="1" text="Under lids"/><Entry value="2" text="Off"/></EnumerationDomain>'
    )
    def SetLids(self, choice: int) -> None:  # noqa: N802
        super().SetLids((None, True, False)[choice])

    @smproperty.doublevector(name="Stretch", default_values=1.0)
    @smdomain.doublerange(min=0.0, max=100.0)
    def SetStretch(self, strength: float) -> None:  # noqa: N802
        super().SetStretch(strength)
