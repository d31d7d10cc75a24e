"""What the commands tell and hand out: lines for people, surfaces with colours and arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..cages import Cage
from ..io import polydata_of
from ..pictures import COLOURS, rgb
from ..regions import Regions
from ..solver import Solution

Say = Callable[[str], None]

_PALETTE = np.array([rgb(colour) for colour in COLOURS])


def tell_regions(regions: Regions, say: Say) -> None:
    """Say how many vertices each region has, and how many lie in more than one."""
    shared = int(np.count_nonzero(regions.membership.sum(axis=0) > 1))
    sizes = " + ".join(str(size) for size in regions.membership.sum(axis=1))
    say(f"regions         {regions.n_regions}: {sizes} vertices, {shared} of them shared")


def tell_cages(cages: Sequence[Cage], say: Say) -> None:
    """Say how many vertices each cage has."""
    counts = [cage.n_vertices for cage in cages]
    say(f"cages           {' + '.join(map(str, counts))} = {sum(counts)} vertices")


def tell_solution(solution: Solution, seconds: float, say: Say) -> None:
    """Say how the volume fared, how well the handles were met, and what it took."""
    each = 1e3 * seconds / max(solution.steps, 1)
    say(f"volume          changed by {solution.volume_change:+.1e} of itself")
    say(f"handles         met to {solution.handle_error:.1e} of the mesh's diagonal")
    say(f"solved          {solution.steps} steps, {1e3 * seconds:.0f} ms, {each:.1f} ms a step")
    say(f"status          {solution.status}")


def coloured_regions(surface: pv.PolyData, regions: Regions) -> pv.PolyData:
    """Return a copy of *surface* with point arrays ``region`` (n,), ``regions_here`` and ``RGB``.

    The colours are blended by the regions' weights, so that overlaps show.
    """
    coloured = surface.copy()
    colours = regions.weights.T @ _colours(np.arange(regions.n_regions)).astype(float)
    coloured.point_data["region"] = regions.labels
    coloured.point_data["regions_here"] = regions.membership.sum(axis=0)
    coloured.point_data["RGB"] = np.rint(colours).clip(0, 255).astype(np.uint8)
    return coloured


def coloured_cages(cages: Sequence[Cage], poses: Sequence[FloatArray] | None = None) -> pv.PolyData:
    """Return all cages as one surface, with point arrays ``region`` and ``RGB``.

    Parameters
    ----------
    cages : sequence of Cage
        One per region.
    poses : sequence of (m_r, 3) float, optional
        Where their vertices are; without it, where the cages were made.
    """
    vertices = [cage.vertices for cage in cages] if poses is None else list(poses)
    starts = np.cumsum([0, *(cage.n_vertices for cage in cages)])
    faces = [cage.faces + start for cage, start in zip(cages, starts, strict=False)]
    corners = np.concatenate(faces)
    merged = polydata_of(np.concatenate(vertices), np.full(len(corners), 3), corners.ravel())
    region = np.repeat(np.arange(len(cages)), [cage.n_vertices for cage in cages])
    merged.point_data["region"] = region
    merged.point_data["RGB"] = _colours(region)
    return merged


def _colours(region: IntArray) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return _PALETTE[region % len(_PALETTE)]
