"""STL, a triangle soup in single precision, text or binary: reader and writer of binary files.

    binary   80 bytes, the number of triangles, and 50 bytes each: normal, corners, 2 more
    text     solid ... facet normal ... outer loop, vertex x y z three times, endloop ... endsolid

Equal corners are merged; vertices are numbered in the order of their first corner.  All triangles
are kept, in their order.  Normals are ignored and computed again.  The 2 bytes are the cell array
"Attribute" unless all are 0, the name or the 80 bytes the field array "Header".

A text without "endsolid" is read with a warning if its last triangle is complete.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ..errors import MeshError
from ..kernels import compiled_checks, inputs
from ..mesh import first_equal_row
from .array_names import (
    HEADER,
    cut,
    decoded,
    get_names,
    set_names,
    warn_left_out,
    warn_of_rounding,
    warn_renamed,
)
from .polygons import cells_of, cut_into_triangles, polydata_of, polygons_of

_SHORTEST = len("vertex 0 0 0")
_START, _SIZE = 84, 50  # bytes before the triangles, and per triangle
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
_NAME = re.compile(rb"solid[ \t]*([^\r\n]*)", re.I)
_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE | re.I)
_FACET = re.compile(rb"^[ \t]*facet\b", re.MULTILINE | re.I)
_END = re.compile(rb"^[ \t]*endsolid\b", re.MULTILINE | re.I)
_END_FACET = re.compile(rb"^[ \t]*endfacet\b", re.MULTILINE | re.I)
_log = logging.getLogger(__name__)


def read_stl(path: Path) -> pv.PolyData:
    """Read the triangles of an STL file, with equal corners merged."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    text = data.lstrip()[:5].lower() == b"solid" and len(data) != _START + _SIZE * count
    attributes: Any = np.empty(0)
    if text:
        corners, name = _of_text(path, data), _NAME.match(data.lstrip())
        header = name[1] if name else b""
    else:
        rows = _of_bytes(data, count)
        corners, attributes = rows["corners"].reshape(-1, 3), rows["more"]
        header = data[:80].partition(b"\0")[0]
    with np.errstate(invalid="ignore"):  # NaN is reported when the mesh is checked
        corners = corners + np.float32(0.0)  # -0 becomes 0
    points, numbers = _merged(corners)
    surface = polydata_of(points, np.full(len(corners) // 3, 3), numbers)
    if attributes.any():
        surface.cell_data["Attribute"] = attributes
    if title := decoded(header).strip():
        set_names(surface, HEADER, [title])
    return surface


def write_stl(path: Path, surface: pv.PolyData) -> None:
    """Write the triangles, in their order, to a binary STL file; polygons are cut."""
    counts, corners = polygons_of(surface)
    points = np.asarray(surface.points, dtype=float)
    faces, polygon = cut_into_triangles(points, counts, corners)
    with np.errstate(over="ignore"):
        single = points.astype("<f4")
    if (np.isinf(single) & np.isfinite(points)).any():
        raise MeshError("has positions that STL cannot store: over 3e38")
    kept: dict[str, list[str]] = {"cell": [], "field": []}
    rows = np.zeros(len(faces), _ROW)
    rows["corners"] = single[faces]
    a, b, c = np.moveaxis(rows["corners"].astype(float), 1, 0)
    with np.errstate(invalid="ignore", over="ignore"):
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        rows["normal"] = normals / np.where(length > 0, length, 1.0)
    attributes = surface.cell_data.get("Attribute")
    if attributes is not None and attributes.dtype == np.uint16 and attributes.ndim == 1:
        rows["more"] = np.asarray(attributes)[cells_of(surface)][polygon]
        kept["cell"].append("Attribute")
    title = " ".join(get_names(surface, HEADER))
    sound = f"_{title}" if title.lower().startswith("solid") else title  # it would be text
    header = cut(sound, 80)
    warn_renamed("header", {title: header.decode()})
    kept["field"] += [HEADER] if header else []
    warn_left_out("STL", surface, kept)
    warn_of_rounding("STL stores single precision", faces, points, single)
    with path.open("wb") as file:
        file.write(header.ljust(80, b"\0") + len(rows).to_bytes(4, "little"))
        file.write(rows.tobytes())


def _of_bytes(data: bytes, count: int) -> Any:
    if len(data) < _START:
        raise MeshError(f"ends after {len(data)} bytes, in its header: it was cut off")
    if (stored := (len(data) - _START) // _SIZE) != count:
        raise MeshError(f"declares {count} triangles, but its {len(data)} bytes contain {stored}")
    return np.frombuffer(data, _ROW, count, _START)


def _of_text(path: Path, data: bytes) -> Any:
    rows, facets, ends, has_end = _rows_of_text(data.replace(b"\r", b"\n"))
    is_complete = has_end or facets == ends > 0
    if len(rows) != 3 * facets or not is_complete:
        raise MeshError("is truncated, or has a facet without three vertices")
    if not has_end:
        _log.warning(
            "%s: there is no endsolid; the file may be truncated after %d triangles", path, facets
        )
    with np.errstate(over="ignore"):
        return np.array(rows, dtype=float).reshape(-1, 3).astype(np.float32)


def _rows_of_text(data: bytes) -> tuple[Any, int, int, bool]:
    """Return the corners, the numbers of facet and endfacet, and whether there is an endsolid."""
    kernels = compiled_checks(len(data) // _SHORTEST)
    if kernels is not None:
        (text,) = inputs(np.frombuffer(data, dtype=np.uint8))
        corners, counts = np.empty((len(data) // _SHORTEST, 3), np.float32), np.empty(4, np.int64)
        if kernels.facet_corners(text, corners, counts):
            n_rows, facets, ends, n_ends = counts.tolist()
            return corners[:n_rows], facets, ends, n_ends > 0
    rows, facets = _VERTEX.findall(data), len(_FACET.findall(data))
    return rows, facets, len(_END_FACET.findall(data)), _END.search(data) is not None


def _merged(corners: Any) -> tuple[Any, Any]:
    """Return the unique rows (n, 3), by first occurrence, and the index of each corner's row."""
    points = corners.astype(np.float64)
    first = first_equal_row(points)
    is_first = first == np.arange(len(first))
    return points[is_first], (np.cumsum(is_first) - 1)[first]
