"""OBJ, Wavefront's text format: read and write, every digit, number and texture seam kept.

VTK's own reader makes one point per corner where texture coordinates have seams, which opens a
closed mesh and renumbers it.  Here a vertex stays one vertex, in the order of the file:

    v  x y z [r g b]    positions; colours become the point array "RGB"
    vt u v              one per vertex: point array "TextureCoordinates".  Else, with seams, cell
                        array "TextureCorners": (u, v) of each corner in turn, NaN where it has none
    f  a/t/n ...        polygons; negative numbers count back from the last vertex
    g o usemtl mtllib   cell arrays "Group" and "Material", numbers into the field data of names

Normals (vn), lines, points and smoothing groups are dropped.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from .polygons import polydata_of, polygons_of, rows

_POINT_TEXTURE, _CORNER_TEXTURE = "TextureCoordinates", "TextureCorners"
_NAMED = {"g": "Group", "o": "Group", "usemtl": "Material"}


def read_obj(path: Path) -> pv.PolyData:
    """Return the polygons of an OBJ file."""
    points: list[list[str]] = []
    textures: list[list[str]] = []
    counts: list[int] = []
    corners: list[int] = []
    texture_of: list[int] = []
    names: dict[str, dict[str, int]] = {"Group": {}, "Material": {}}
    numbers: dict[str, list[int]] = {"Group": [], "Material": []}
    now = {"Group": "default", "Material": "default"}
    library = ""
    for line in path.read_text(errors="replace").replace("\\\n", " ").splitlines():
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            points.append(rest)
        elif word == "vt":
            textures.append(rest[:2] + ["0"] * (2 - len(rest)))
        elif word == "f":
            counts.append(len(rest))
            for corner in rest:
                vertex, _, more = corner.partition("/")
                texture = more.partition("/")[0]
                corners.append(_number(vertex, len(points)))
                texture_of.append(_number(texture, len(textures)) if texture else -1)
            for key, name in now.items():
                numbers[key].append(names[key].setdefault(name, len(names[key])))
        elif word in _NAMED:
            now[_NAMED[word]] = " ".join(rest) or "default"
        elif word == "mtllib":
            library = " ".join(rest)
    table = _table(points, (3, 4, 6, 7))
    surface = polydata_of(
        table[:, :3], np.array(counts, dtype=np.int64), np.array(corners, dtype=np.int64)
    )
    if table.shape[1] >= 6:
        surface.point_data["RGB"] = np.round(255.0 * table[:, 3:6].clip(0.0, 1.0)).astype(np.uint8)
    _keep_texture(surface, _table(textures, (2,)), np.array(texture_of, dtype=np.int64))
    for key, known in names.items():
        if set(known) - {"default"}:
            surface.cell_data[key] = np.array(numbers[key], dtype=np.int64)
            surface.field_data[f"{key}Names"] = list(known)
    if library:
        surface.field_data["MaterialLibrary"] = [library]
    return surface


def write_obj(path: Path, surface: pv.PolyData) -> None:
    """Write an OBJ file that `read_obj` gives back unchanged; other arrays are left out."""
    counts, corners = polygons_of(surface)
    polygons = rows(counts, corners + 1)
    texture, texture_of = _texture(surface, counts, corners)
    tags = [_tags(surface, "g", "Group"), _tags(surface, "usemtl", "Material")]
    with path.open("w") as file:
        if "MaterialLibrary" in surface.field_data:
            file.write(f"mtllib {surface.field_data['MaterialLibrary'][0]}\n")
        table = np.asarray(surface.points, dtype=float)
        if "RGB" in surface.point_data:
            table = np.hstack([table, surface.point_data["RGB"][:, :3] / 255.0])
        file.writelines(f"v {' '.join(map(repr, row))}\n" for row in table.tolist())
        file.writelines(f"vt {u!r} {v!r}\n" for u, v in texture.tolist())
        at = 0
        for k, row in enumerate(polygons):
            for tag in tags:
                if tag and (k == 0 or tag[k] != tag[k - 1]):
                    file.write(tag[k])
            slots = texture_of[at : at + len(row)]
            words = [f"{v}/{t}" if t else str(v) for v, t in zip(row, slots, strict=False)]
            file.write(f"f {' '.join(words or map(str, row))}\n")
            at += len(row)


def _number(word: str, count: int) -> int:
    number = int(word)
    return number - 1 if number > 0 else count + number


def _table(lines: list[list[str]], widths: tuple[int, ...]) -> FloatArray:
    if not lines:
        return np.empty((0, 3))
    if len({len(row) for row in lines}) > 1 or len(lines[0]) not in widths:
        lines = [row[: min(widths)] for row in lines]
    return np.array(lines, dtype=float)


def _keep_texture(surface: pv.PolyData, texture: FloatArray, texture_of: IntArray) -> None:
    """Store texture coordinates with the points if each has one place, else with the corners."""
    if not len(texture) or (texture_of < 0).all():
        return
    if texture_of.max() >= len(texture):
        raise MeshError(f"a face names texture coordinate {texture_of.max() + 1} of {len(texture)}")
    counts, corners = polygons_of(surface)
    place = np.full(surface.n_points, -1)
    place[corners] = texture_of
    if (place[corners] == texture_of).all() and (place >= 0).all():
        surface.point_data[_POINT_TEXTURE] = texture[place]
        surface.point_data.active_texture_coordinates_name = _POINT_TEXTURE
        return
    wide = np.full((len(counts), counts.max(), 2), np.nan)
    here = np.arange(counts.max()) < counts[:, None]
    wide[here] = np.where(texture_of[:, None] >= 0, texture[texture_of], np.nan)
    surface.cell_data[_CORNER_TEXTURE] = wide.reshape(len(counts), -1)


def _texture(
    surface: pv.PolyData, counts: IntArray, corners: IntArray
) -> tuple[FloatArray, list[int]]:
    """Return the vt lines and, for each corner, which it uses, counted from 1; 0 for none."""
    wide = surface.cell_data.get(_CORNER_TEXTURE)
    if wide is not None and len(wide) == len(counts):
        here = np.arange(wide.shape[1] // 2) < counts[:, None]
        each = np.asarray(wide).reshape(len(counts), -1, 2)[here]
        known = ~np.isnan(each).any(axis=1)
        texture, which = np.unique(each[known], axis=0, return_inverse=True)
        slots = np.zeros(len(corners), dtype=np.int64)
        slots[known] = which.ravel() + 1
        return texture, slots.tolist()
    texture = surface.active_texture_coordinates
    if texture is None:
        return np.empty((0, 2)), []
    return np.asarray(texture, dtype=float)[:, :2], (corners + 1).tolist()


def _tags(surface: pv.PolyData, word: str, key: str) -> list[str]:
    numbers, names = surface.cell_data.get(key), surface.field_data.get(f"{key}Names")
    if numbers is None or names is None or len(numbers) != surface.n_cells:
        return []
    return [f"{word} {names[int(k)]}\n" for k in numbers]
