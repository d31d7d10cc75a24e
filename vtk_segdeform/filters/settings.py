"""What a deforming filter is told, by setters in VTK's manner."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase

from ..arrays import is_number, is_whole, plain
from ..checks import as_switch, as_text, shown
from ..errors import ArgumentError


@dataclass(frozen=True)
class Settings:
    """All that may be set, as it is before anything is."""

    n_regions: int = 3
    n_cage_vertices: int = 155
    overlap: int = 4
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
    stretch: float = 10.0
    local_volume: bool = True


class SettingsOfAFilter(VTKPythonAlgorithmBase):  # type: ignore[misc]
    """A filter with these settings; setting what is set already changes nothing."""

    def __init__(self, **ports: Any) -> None:
        super().__init__(**ports)
        self._settings = Settings()

    def SetNumberOfRegions(self, count: int) -> None:  # noqa: N802 - VTK's manner
        """Find so many regions; 0 leaves the choice to `segment`."""
        self._set(n_regions=_whole(count, "count"))

    def SetNumberOfCageVertices(self, count: int) -> None:  # noqa: N802
        """Fit cages of so many vertices, all together."""
        self._set(n_cage_vertices=_whole(count, "count"))

    def SetRegionArrayName(self, name: str) -> None:  # noqa: N802
        """Name the point array of labels that makes regions; "" finds regions instead."""
        self._set(region_array=_name(name))

    def SetOverlap(self, rings: int) -> None:  # noqa: N802
        """Let regions of labels grow by rings of edges; see `Regions.from_labels`."""
        self._set(overlap=_whole(rings, "rings"))

    def SetFixedArrayName(self, name: str) -> None:  # noqa: N802
        """Name the point array that is not 0 where points stay; it may be missing."""
        self._set(fixed_array=_name(name), fixed=None)

    def SetHandleArrayName(self, name: str) -> None:  # noqa: N802
        """Name the point array that is not 0 where points are moved."""
        self._set(handle_array=_name(name), handle=None)

    def SetFixed(self, points: ArrayLike) -> None:  # noqa: N802
        """Tell the points that stay by their numbers, instead of by an array."""
        self._set(fixed=_numbers(points))

    def SetHandle(self, points: ArrayLike) -> None:  # noqa: N802
        """Tell the points that are moved by their numbers, instead of by an array."""
        self._set(handle=_numbers(points))

    def SetTargets(self, targets: ArrayLike | None) -> None:  # noqa: N802
        """Send the handle's points, in their order, to (k, 3) places; None for a motion instead."""
        rows = None if targets is None else _places(targets)
        self._set(targets=None if rows is None else tuple(map(tuple, rows)))

    def SetTranslation(self, x: float, y: float, z: float) -> None:  # noqa: N802
        """Shift the handle."""
        self._set(translation=_vector(x, y, z))

    def SetRotationAxis(self, x: float, y: float, z: float) -> None:  # noqa: N802
        """Turn the handle about an axis through its centre."""
        self._set(axis=_vector(x, y, z))

    def SetRotationAngle(self, degrees: float) -> None:  # noqa: N802
        """Turn it by so much, the right hand's thumb along the axis."""
        self._set(angle=_real(degrees, "degrees"))

    def SetPreserveVolume(self, hold: bool) -> None:  # noqa: N802
        """Hold the enclosed volume exactly."""
        self._set(preserve_volume=as_switch(hold, "hold"))

    def SetStretch(self, strength: float) -> None:  # noqa: N802
        """See `Deformer`."""
        self._set(stretch=_real(strength, "strength"))

    def SetComputeLocalVolumeChange(self, on: bool) -> None:  # noqa: N802
        """Add "LocalVolumeChange"; see `local_volume_change`."""
        self._set(local_volume=as_switch(on, "on"))

    def _set(self, **changes: Any) -> None:
        settings = replace(self._settings, **changes)
        if settings != self._settings:
            self._settings = settings
            self.Modified()


def _whole(value: int, name: str) -> int:
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


def _places(targets: ArrayLike) -> list[list[float]]:
    array = plain(targets, "targets")
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iuf":
        raise ArgumentError(
            f"targets must be (k, 3) real numbers; got {array.dtype} of shape {array.shape}"
        )
    rows: list[list[float]] = array.astype(np.float64).tolist()
    return rows  # whether they are finite, the pipeline tells


def _numbers(points: ArrayLike) -> tuple[int, ...]:
    """Return numbers of points, or those a mask marks; whether they are there, the input tells."""
    array = plain(points, "points")
    if array.dtype == bool and array.ndim == 1:
        array = np.flatnonzero(array)
    if array.size and (array.ndim > 1 or array.dtype.kind not in "iu"):
        raise ArgumentError(
            "points must be one row of vertex numbers, or a mask; "
            f"got {array.dtype} of shape {array.shape}"
        )
    return tuple(array.astype(np.int64).ravel().tolist())
