"""OFF, the Object File Format of Geomview: read and write, every digit kept.

OFF             or COFF, NOFF, STOFF, ...: what follows each position
n m e           vertices, faces, edges (the last is not used)
x y z [...]     n lines
k i j l [...]   m lines: a polygon with k corners, counted from 0, perhaps a colour
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyvista as pv

from ..arrays import IntArray
from ..errors import MeshError
from .array_names import text_of, warn_left_out
from .polygons import polydata_of, polygons_of, rows

_KIND = re.compile(r"(ST)?(C)?(N)?OFF\b", re.IGNORECASE)
_WIDTHS = {"N": 3, "C": 4, "ST": 2}


def read_off(path: Path) -> pv.PolyData:
    """Return the surface in an OFF file; colours of vertices as "RGBA", normals are dropped."""
    text = re.sub(r"#[^\r\n]*", "", text_of(path.read_bytes()))
    lines = [line for line in re.split(r"[\r\n]+", text) if line.strip()]
    kind = _KIND.match(lines[0].strip()) if lines else None
    if kind is None:
        raise MeshError("the first line is not OFF")
    rest = lines[0].strip()[kind.end() :]
    lines[:1] = [rest] if rest.strip() else []
    n, m = (int(word) for word in lines[0].split()[:2])
    if n < 0 or m < 0:
        raise MeshError(f"declares {n} vertices and {m} faces")
    if len(lines) < 1 + n + m:
        raise MeshError(
            f"declares {n} vertices and {m} faces, but ends after {len(lines) - 1} lines"
        )
    table = np.array([line.split() for line in lines[1 : 1 + n]], dtype=float).reshape(
        n, -1 if n else 3
    )
    counts, corners = _polygons(lines[1 + n : 1 + n + m])
    surface = polydata_of(table[:, :3], counts, corners)
    extra = table[:, 3:]
    if kind[3]:
        extra = extra[:, 3:]
    if kind[2] and extra.shape[1] >= 3:
        colour = extra[:, : min(extra.shape[1], 4)]
        scale = 255.0 if colour.max(initial=0.0) <= 1.0 and "." in lines[1] else 1.0
        colour = np.nan_to_num(scale * colour).clip(0.0, 255.0)
        surface.point_data["RGBA"] = np.round(colour).astype(np.uint8)
    return surface


def write_off(path: Path, surface: pv.PolyData) -> None:
    """Write positions with every digit, polygons as they are; OFF holds no other arrays."""
    polygons = rows(*polygons_of(surface))
    warn_left_out("OFF", surface, {})
    with path.open("w", newline="\n") as file:
        file.write(f"OFF\n{surface.n_points} {len(polygons)} 0\n")
        file.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in surface.points.tolist())
        file.writelines(f"{len(row)} {' '.join(map(str, row))}\n" for row in polygons)


def _polygons(lines: list[str]) -> tuple[IntArray, IntArray]:
    words = [line.split() for line in lines]
    counts = np.array([int(row[0]) for row in words], dtype=np.int64)
    if any(len(row) <= int(row[0]) for row in words):
        raise MeshError("a face line ends before its last corner")
    corners = [
        int(word) for row, k in zip(words, counts.tolist(), strict=True) for word in row[1 : k + 1]
    ]
    return counts, np.array(corners, dtype=np.int64)
