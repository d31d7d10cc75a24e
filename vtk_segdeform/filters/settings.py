"""Settings of the filter, with setters in the style of VTK."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase

from ..arrays import is_number, is_whole, plain
from ..checks import as_switch, as_text, require, shown
from ..errors import ArgumentError
from ..geometry import Attach, checked_attach


@dataclass(frozen=True)
class Settings:
    """The settings and their defaults."""

    n_regions: int = 0
    n_cage_vertices: int = 0
    overlap: int = 4
    attach: tuple[tuple[int, int | str], ...] = ()
    region_array: str = ""
    fixed_array: str = "fixed"
    handle_array: str = "handle"
    fixed: tuple[int, ...] | None = None
    handle: tuple[int, ...] | None = None
    targets: tuple[tuple[float, ...], ...] | None = None
    translation: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    angle: float = 0.0
    preserve_volume: bool = True
    lids: bool | None = None
    stretch: float = 1.0
    local_volume: bool = True


class FilterSettings(VTKPythonAlgorithmBase):  # type: ignore[misc]
    """A filter with setters; setting an unchanged value does not modify the filter."""

    def __init__(self, **ports: Any) -> None:
        super().__init__(**ports)
        self._settings = Settings()

    def SetNumberOfRegions(self, count: int) -> None:  # noqa: N802 - VTK's style
        """Set the number of regions of the automatic segmentation; 0 means automatic."""
        self._set(n_regions=_integer(count, "count"))

    def SetNumberOfCageVertices(self, count: int) -> None:  # noqa: N802
        """Set the total number of vertices of fitted cages; 0 means by the number of regions."""
        self._set(n_cage_vertices=_integer(count, "count"))

    def SetRegionArrayName(self, name: str) -> None:  # noqa: N802
        """Set the name of the point array of region labels; "" for automatic segmentation."""
        self._set(region_array=_name(name))

    def SetOverlap(self, rings: int) -> None:  # noqa: N802
        """Set the overlap of regions from labels, in edge rings; see `Regions.from_labels`."""
        self._set(overlap=_integer(rings, "rings"))

    def SetAttach(self, attach: Attach | None) -> None:  # noqa: N802
        """Set the components that others follow, as {1: 0, 2: "free"}; see `deform`."""
        given = {} if attach is None else dict(require(attach, Mapping, "attach"))
        largest = max([k for pair in given.items() for k in pair if is_whole(k, 0)], default=0)
        self._set(attach=tuple(sorted(checked_attach(given, largest + 1).items())))

    def SetFixedArrayName(self, name: str) -> None:  # noqa: N802
        """Set the name of the point array that is nonzero at fixed vertices; it may be missing."""
        self._set(fixed_array=_name(name), fixed=None)

    def SetHandleArrayName(self, name: str) -> None:  # noqa: N802
        """Set the name of the point array that is nonzero at the handle."""
        self._set(handle_array=_name(name), handle=None)

    def SetFixed(self, points: ArrayLike) -> None:  # noqa: N802
        """Set the fixed vertices as point indices, instead of an array."""
        self._set(fixed=_point_ids(points))

    def SetHandle(self, points: ArrayLike) -> None:  # noqa: N802
        """Set the handle as point indices, instead of an array."""
        self._set(handle=_point_ids(points))

    def SetTargets(self, targets: ArrayLike | None) -> None:  # noqa: N802
        """Set the targets (k, 3) of the handle, in its order; None for a rigid motion instead."""
        rows = None if targets is None else _positions(targets)
        self._set(targets=None if rows is None else tuple(map(tuple, rows)))

    def SetTranslation(self, x: float, y: float, z: float) -> None:  # noqa: N802
        """Set the translation of the handle."""
        self._set(translation=_vector(x, y, z))

    def SetRotationAxis(self, x: float, y: float, z: float) -> None:  # noqa: N802
        """Set the axis for rotating the handle about its centre."""
        self._set(axis=_vector(x, y, z))

    def SetRotationAngle(self, degrees: float) -> None:  # noqa: N802
        """Set the angle for rotating the handle, by the right-hand rule."""
        self._set(angle=_real(degrees, "degrees"))

    def SetPreserveVolume(self, on: bool) -> None:  # noqa: N802
        """Set whether the enclosed volume is preserved exactly."""
        self._set(preserve_volume=as_switch(on, "on"))

    def SetLids(self, on: bool | None) -> None:  # noqa: N802
        """Set whether open parts enclose a volume under lids; None decides by their shape."""
        self._set(lids=None if on is None else as_switch(on, "on"))

    def SetStretch(self, strength: float) -> None:  # noqa: N802
        """Set the stretch resistance; see `Deformer`."""
        self._set(stretch=_real(strength, "strength"))

    def SetComputeLocalVolumeChange(self, on: bool) -> None:  # noqa: N802
        """Set whether to compute "LocalVolumeChange"; see `local_volume_change`."""
        self._set(local_volume=as_switch(on, "on"))

    def _set(self, **changes: Any) -> None:
        settings = replace(self._settings, **changes)
        if settings != self._settings:
            self._settings = settings
            self.Modified()


def _integer(value: int, name: str) -> int:
    if not is_whole(value, -np.inf):
        raise ArgumentError(f"{name} must be a whole number; got {shown(value)}")
    return int(value)


def _real(value: float, name: str) -> float:
    if not is_number(value):
        raise ArgumentError(f"{name} must be a finite number; got {shown(value)}")
    return float(value)


def _vector(x: float, y: float, z: float) -> tuple[float, float, float]:
    return _real(x, "x"), _real(y, "y"), _real(z, "z")


def _name(name: str | None) -> str:
    return "" if name is None else as_text(name, "name")


def _positions(targets: ArrayLike) -> list[list[float]]:
    array = plain(targets, "targets")
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iuf":
        raise ArgumentError(
            f"targets must be (k, 3) real numbers; got {array.dtype} of shape {array.shape}"
        )
    rows: list[list[float]] = array.astype(np.float64).tolist()
    return rows  # checked for finite values when the pipeline executes


def _point_ids(points: ArrayLike) -> tuple[int, ...]:
    """Return point indices, also of a mask; their range is checked with the input."""
    array = plain(points, "points")
    if array.dtype == bool and array.ndim == 1:
        array = np.flatnonzero(array)
    if array.size and (array.ndim > 1 or array.dtype.kind not in "iu"):
        raise ArgumentError(
            "points must be a list of vertex numbers or a mask; "
            f"got {array.dtype} of shape {array.shape}"
        )
    return tuple(array.astype(np.int64).ravel().tolist())
