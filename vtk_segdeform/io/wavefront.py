"""OBJ, Wavefront's text format: read and write, every digit, number and texture seam kept.

VTK's own reader makes one point per corner where texture coordinates have seams, which opens a
closed mesh and renumbers it.  Here a vertex stays one vertex, in the order of the file:

    v  x y z [r g b]    positions; colours become the point array "RGB"
    vt u v              one per vertex: point array "TextureCoordinates".  Else, with seams, cell
                        array "TextureCorners": (u, v) of each corner in turn, NaN where it has none
    f  a/t/n ...        polygons; negative numbers count back from the last vertex
    o g usemtl          cell arrays "Object", "Group" and "Material": numbers into the field arrays
                        "ObjectNames", "GroupNames" and "MaterialNames"
    s                   cell array "Smoothing": the number of a smoothing group, 0 is off
    mtllib              field array "MaterialLibrary"

A name is the rest of its line, in UTF-8 or Latin-1; it is written in UTF-8.  Normals (vn), lines
and points are dropped.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from .array_names import get_names, plain_names, set_names, text_of, warn_left_out, warn_renamed
from .polygons import cells_of, corner_values, padded_corners, polydata_of, polygons_of, rows

_POINT_TEXTURE, _CORNER_TEXTURE = "TextureCoordinates", "TextureCorners"
_NAMED = {"o": "Object", "g": "Group", "usemtl": "Material"}
_SMOOTHING, _LIBRARY = "Smoothing", "MaterialLibrary"
_MOST = 2**62  # an index
_Runs: TypeAlias = dict[
    str, list[tuple[int, str]]
]  # by statement: the first face it applies to, and its value


def read_obj(path: Path) -> pv.PolyData:
    """Return the polygons of an OBJ file."""
    points: list[list[str]] = []
    textures: list[list[str]] = []
    counts: list[int] = []
    corners: list[int] = []
    texture_of: list[int] = []
    runs: _Runs = {word: [] for word in (*_NAMED, "s")}
    libraries = []
    text = text_of(path.read_bytes()).replace("\r\n", "\n").replace("\r", "\n")
    for line in text.replace("\\\n", " ").split("\n"):
        word, rest = (*line.split(None, 1), "", "")[:2]
        if word == "v":
            points.append(_words(rest))
        elif word == "vt":
            textures.append((_words(rest) + ["0", "0"])[:2])
        elif word == "f":
            face = _words(rest)
            counts.append(len(face))
            for corner in face:
                vertex, _, more = corner.partition("/")
                texture = more.partition("/")[0]
                corners.append(_number(vertex, len(points)))
                texture_of.append(_number(texture, len(textures)) if texture else -1)
        elif word in runs:
            runs[word].append((len(counts), rest.strip()))
        elif word == "mtllib":
            libraries.append(rest.strip())
    if max(corners, default=0) >= len(points):
        raise MeshError(
            f"a face refers to vertex {max(corners) + 1} of {len(points)}; the file is truncated "
            "or damaged, export it again"
        )
    table = _table("vertex", points, (3, 4, 6, 7))
    surface = polydata_of(
        table[:, :3], np.array(counts, dtype=np.int64), np.array(corners, dtype=np.int64)
    )
    if table.shape[1] >= 6:
        colour = np.nan_to_num(table[:, 3:6]).clip(0.0, 1.0)
        surface.point_data["RGB"] = np.round(255.0 * colour).astype(np.uint8)
    _keep_texture(
        surface, _table("texture coordinate", textures, (2,)), np.array(texture_of, dtype=np.int64)
    )
    _keep_runs(surface, runs)
    if libraries:
        set_names(surface, _LIBRARY, libraries)
    return surface


def _words(rest: str) -> list[str]:
    return rest.partition("#")[0].split()


def _number(word: str, count: int) -> int:
    """Return the index from 0 for one that counts from 1, or backwards from the last of *count*."""
    try:
        number = int(word)
    except ValueError:
        raise MeshError(f"a face refers to {word[:40]!r}; indices are whole numbers") from None
    if number == 0 or number < -count:
        raise MeshError(f"a face refers to {word[:40]}; indices start at 1, or at -1 from the end")
    if number > _MOST:
        raise MeshError(f"a face refers to {word[:40]}, which is too large; export the file again")
    return number - 1 if number > 0 else count + number


def _table(what: str, lines: list[list[str]], widths: tuple[int, ...]) -> FloatArray:
    if not lines:
        return np.empty((0, 3))
    if len({len(row) for row in lines}) > 1 or len(lines[0]) not in widths:
        lines = [row[: min(widths)] for row in lines]
    try:
        return np.array(lines, dtype=float)
    except ValueError:
        number = next(k for k, row in enumerate(lines, 1) if not _are_numbers(row, min(widths)))
        row = " ".join(lines[number - 1])[:60]
        raise MeshError(f"{what} {number} is {row!r}; must be {min(widths)} numbers") from None


def _are_numbers(words: list[str], least: int) -> bool:
    try:
        return len([float(word) for word in words]) >= least
    except ValueError:
        return False


def _keep_texture(surface: pv.PolyData, texture: FloatArray, texture_of: IntArray) -> None:
    """Store texture coordinates with the points if each has one place, else with the corners."""
    if not len(texture) or (texture_of < 0).all():
        return
    if texture_of.max() >= len(texture):
        raise MeshError(f"a face names texture coordinate {texture_of.max() + 1} of {len(texture)}")
    counts, corners = polygons_of(surface)
    place = np.full(surface.n_points, -1)
    if len(texture) == len(place) and (texture_of == corners).all():
        place = np.arange(len(place))
    place[corners] = texture_of
    if (place[corners] == texture_of).all() and (place >= 0).all():
        surface.point_data[_POINT_TEXTURE] = texture[place]
        surface.point_data.active_texture_coordinates_name = _POINT_TEXTURE
        return
    pairs = np.where(texture_of[:, None] >= 0, texture[texture_of], np.nan)
    surface.cell_data[_CORNER_TEXTURE] = padded_corners(counts, pairs)


def _keep_runs(surface: pv.PolyData, runs: _Runs) -> None:
    """Store the values that statements set for the faces after them, as cell and name arrays."""
    for word, said in runs.items():
        if not said:
            continue
        starts = [0, *(at for at, _ in said), surface.n_cells]
        lengths = np.diff(starts)
        texts = ["", *(text for _, text in said)]
        if word == "s":
            groups = [_smoothing_group(text) for text in texts]
            surface.cell_data[_SMOOTHING] = np.repeat(groups, lengths)
            continue
        texts = [text or "default" for text in texts]
        names = dict.fromkeys(t for t, n in zip(texts, lengths, strict=True) if n)
        numbers = {name: k for k, name in enumerate(names)}
        key = _NAMED[word]
        surface.cell_data[key] = np.repeat([numbers.get(text, 0) for text in texts], lengths)
        set_names(surface, f"{key}Names", names)


def _smoothing_group(text: str) -> int:
    if text.isdecimal() and len(text) < 10:
        return int(text)
    return int(text.lower() not in ("", "off"))


def write_obj(path: Path, surface: pv.PolyData) -> None:
    """Write an OBJ file that `read_obj` reads back unchanged.

    Warnings are logged for arrays that are left out and names that are changed.
    """
    counts, corners = polygons_of(surface)
    cells = cells_of(surface)
    polygons = rows(counts, corners + 1)
    kept: dict[str, list[str]] = {"point": [], "cell": [], "field": []}
    texture, texture_of = _texture(surface, counts, corners, kept)
    tags = _tags(surface, cells, kept)
    libraries = plain_names(get_names(surface, _LIBRARY))
    warn_renamed("material library", libraries)
    kept["field"] += [_LIBRARY] if libraries else []
    table = np.asarray(surface.points, dtype=float)
    colour = surface.point_data.get("RGB")
    if colour is not None and colour.dtype == np.uint8 and colour.shape == table.shape:
        table = np.hstack([table, np.asarray(colour) / 255.0])
        kept["point"].append("RGB")
    warn_left_out("OBJ", surface, kept)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"mtllib {name}\n" for name in libraries.values())
        file.writelines(f"v {' '.join(map(repr, row))}\n" for row in table.tolist())
        file.writelines(f"vt {u!r} {v!r}\n" for u, v in texture.tolist())
        at = 0
        for k, row in enumerate(polygons):
            file.write(tags.get(k, ""))
            slots = texture_of[at : at + len(row)]
            words = [f"{v}/{t}" if t else str(v) for v, t in zip(row, slots, strict=False)]
            file.write(f"f {' '.join(words or map(str, row))}\n")
            at += len(row)


def _texture(
    surface: pv.PolyData, counts: IntArray, corners: IntArray, kept: dict[str, list[str]]
) -> tuple[FloatArray, list[int]]:
    """Return the vt lines and, for each corner, which it uses, counted from 1; 0 for none."""
    wide = surface.cell_data.get(_CORNER_TEXTURE)
    each = None if wide is None else corner_values(np.asarray(wide)[cells_of(surface)], counts)
    if each is not None:
        kept["cell"].append(_CORNER_TEXTURE)
        known = ~np.isnan(each).any(axis=1)
        texture, which = np.unique(each[known], axis=0, return_inverse=True)
        slots = np.zeros(len(corners), dtype=np.int64)
        slots[known] = which.ravel() + 1
        return texture.astype(float), slots.tolist()
    texture = surface.active_texture_coordinates
    if texture is None or texture.ndim != 2 or texture.shape[1] < 2:
        return np.empty((0, 2)), []
    kept["point"].append(surface.point_data.active_texture_coordinates_name)
    return np.asarray(texture, dtype=float)[:, :2], (corners + 1).tolist()


def _tags(surface: pv.PolyData, cells: IntArray, kept: dict[str, list[str]]) -> dict[int, str]:
    """Return the lines to write before each face at which a statement changes, by face number.

    All statements are repeated after a new object, where some readers reset them.
    """
    lines: list[list[str]] = []  # by statement, of each face
    for word, key in _NAMED.items():
        names = get_names(surface, f"{key}Names")
        numbers = _whole_numbers(surface.cell_data.get(key), len(names))
        if numbers is None:
            continue
        written = plain_names(names)
        warn_renamed(key.lower(), written)
        lines.append([f"{word} {written[names[k]]}\n" for k in numbers[cells].tolist()])
        kept["cell"].append(key)
        kept["field"].append(f"{key}Names")
    groups = _whole_numbers(surface.cell_data.get(_SMOOTHING), 10**9)
    if groups is not None:
        lines.append([f"s {k or 'off'}\n" for k in groups[cells].tolist()])
        kept["cell"].append(_SMOOTHING)
    said = list(zip(*lines, strict=True))  # of each face
    tags = {0: "".join(said[0])} if said else {}
    objects = "Object" in kept["cell"]
    for k, (before, now) in enumerate(pairwise(said), start=1):
        if now != before:
            anew = objects and now[0] != before[0]
            pairs = zip(now, before, strict=True)
            tags[k] = "".join(line for line, old in pairs if anew or line != old)
    return tags


def _whole_numbers(values: Any, end: int) -> Any:
    """Return (m,) whole numbers from 0 to *end* - 1; None if *values* are anything else."""
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "biuf" or not len(array):
        return None
    if not ((array >= 0) & (array < end) & (array == np.rint(array))).all():
        return None
    return array.astype(np.int64)
