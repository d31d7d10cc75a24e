"""STL, a triangle soup in single precision, text or binary: reader that merges equal corners.

    binary   80 bytes, the number of triangles, and 50 bytes each: normal, corners, 2 more
    text     solid ... facet normal ... outer loop, vertex x y z three times, endloop ... endsolid

Vertices are numbered in the order of their first corner.  Normals, and triangles with a repeated
vertex, are ignored.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..errors import MeshError
from .polygons import polydata_of

_START, _SIZE = 84, 50  # bytes before the triangles, and per triangle
_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE | re.I)
_FACET = re.compile(rb"^[ \t]*facet\b", re.MULTILINE | re.I)
_END = re.compile(rb"^[ \t]*endsolid\b", re.MULTILINE | re.I)


def read_stl(path: Path) -> pv.PolyData:
    """Read the triangles of an STL file, with equal corners merged."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    text = data.lstrip()[:5].lower() == b"solid" and len(data) != _START + _SIZE * count
    corners = _of_text(data) if text else _of_bytes(data, count)
    with np.errstate(invalid="ignore"):  # NaN is reported when the mesh is checked
        corners = corners + np.float32(0.0)  # -0 becomes 0
    points, numbers = _merged(corners)
    faces = numbers.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    return polydata_of(points, np.full(len(faces), 3), faces.ravel())


def _of_bytes(data: bytes, count: int) -> Any:
    stored = (len(data) - _START) // _SIZE
    if len(data) < _START or stored != count:
        raise MeshError(
            f"declares {count} triangles, but its {len(data)} bytes contain {max(stored, 0)}"
        )
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    return np.frombuffer(data, row, count, _START)["corners"].reshape(-1, 3)


def _of_text(data: bytes) -> Any:
    data = data.replace(b"\r", b"\n")
    rows = _VERTEX.findall(data)
    if len(rows) != 3 * len(_FACET.findall(data)) or not _END.search(data):
        raise MeshError("is truncated, or has a facet without three vertices")
    with np.errstate(over="ignore"):
        return np.array(rows, dtype=float).reshape(-1, 3).astype(np.float32)


def _merged(corners: Any) -> tuple[Any, Any]:
    """Return the unique rows (n, 3), by first occurrence, and the index of each corner's row."""
    if not len(corners):
        return np.empty((0, 3)), np.empty(0, dtype=np.int64)
    x, y, z = corners.astype("<f4").view("<u4").astype("u8").T
    keys = (z, x | y << np.uint64(32))
    order = np.lexsort(keys)
    new = np.append(True, np.logical_or(*(np.diff(key[order]) != 0 for key in keys)))
    group = np.empty(len(corners), dtype=np.int64)
    group[order] = np.cumsum(new) - 1
    first = order[new]  # lexsort is stable: the first corner of each
    rank = np.empty(len(first), dtype=np.int64)
    by_first = np.argsort(first)
    rank[by_first] = np.arange(len(first))
    return corners[first[by_first]].astype(np.float64), rank[group]
