"""How layers look in MeshLab: colours by quality, and cages as wires.

MeshLab shows a layer in one grey unless its vertices have colours, and all faces opaque.  So a
layer with a quality and without colours gets colours, and a cage is written twice: as a surface
that is not visible, and as its edges, which MeshLab draws as lines since that file has no faces.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import FloatArray
from .polygons import polygons_of

# The colours of regions in pictures and in the editor.
_REGIONS = ["E69F00", "56B4E9", "009E73", "CC79A7", "F0E442", "0072B2", "D55E00"]
_LOSS, _NONE, _GAIN = [0, 114, 178], [255, 255, 255], [213, 94, 0]
_WIRE = (40, 40, 40, 255)
_COLOURS = {"RGB", "RGBA"}


def is_cage(label: str) -> bool:
    """Return whether this is the name of the layer of a cage, "cage 1", "cage 2" ..."""
    return re.fullmatch(r"cage \d+", label) is not None


def coloured(surface: pv.PolyData) -> pv.PolyData:
    """Return a surface with colours of its quality, unless it has colours or no quality.

    Whole numbers, such as regions, get distinct colours; other numbers blue below and red above 0.
    """
    points = surface.point_data
    if "quality" not in points or _COLOURS & {*points.keys(), *surface.cell_data.keys()}:
        return surface
    surface = surface.copy(deep=False)
    colours = colours_of_quality(np.asarray(points["quality"], dtype=np.float64))
    surface.point_data["RGBA"] = colours
    return surface


def colours_of_quality(quality: FloatArray) -> Any:
    """Return colours (n, 4) uint8 of a quality (n,).

    >>> colours_of_quality(np.array([0.0, 1.0, 7.0]))[:, :3].tolist()
    [[230, 159, 0], [86, 180, 233], [230, 159, 0]]
    >>> colours_of_quality(np.array([-0.5, 0.0, 0.25]))[:, :3].tolist()
    [[0, 114, 178], [255, 255, 255], [234, 174, 128]]
    """
    quality = np.nan_to_num(quality, nan=0.0, posinf=0.0, neginf=0.0)
    if (quality == np.rint(quality)).all():
        palette = np.array([list(bytes.fromhex(colour)) for colour in _REGIONS])
        colours = palette[quality.astype(np.int64) % len(palette)]
    else:
        share = (quality / np.abs(quality).max())[:, None]
        towards = np.where(share < 0.0, _LOSS, _GAIN)
        colours = _NONE + np.abs(share) * (towards - np.array(_NONE))
    opaque = np.full((len(quality), 1), 255)
    return np.rint(np.hstack([colours, opaque])).astype(np.uint8)


def wires_of(surface: pv.PolyData) -> bytes:
    """Return a PLY file of the edges of a surface, without faces."""
    counts, corners = polygons_of(surface)
    counts = counts[counts > 0]
    ends = np.roll(corners, -1)
    last = np.cumsum(counts) - 1
    ends[last] = corners[last - counts + 1]
    edges = np.unique(np.sort(np.stack([corners, ends], axis=1), axis=1), axis=0)
    vertex = np.zeros(surface.n_points, [("x", "<f8", 3), ("colour", "u1", 4)])
    vertex["x"], vertex["colour"] = surface.points, _WIRE
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertex)}"]
    header += [f"property double {name}" for name in "xyz"]
    header += [f"property uchar {name}" for name in ("red", "green", "blue", "alpha")]
    header += [f"element edge {len(edges)}", "property int vertex1", "property int vertex2"]
    data = "\n".join([*header, "end_header", ""]).encode()
    return bytes(data + vertex.tobytes() + edges.astype("<i4").tobytes())
