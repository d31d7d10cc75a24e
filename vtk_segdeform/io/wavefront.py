"""OBJ, Wavefront's text format: reader and writer that preserve vertices and texture seams.

VTK's reader creates one point per corner at texture seams, which opens a closed mesh and renumbers
its vertices.  Here vertices remain as in the file:

    v  x y z [r g b]    positions; colours, fractions or bytes, become the point array "RGB"
    vt u v              one per vertex: point array "TextureCoordinates".  Else, with seams, cell
                        array "TextureCorners": (u, v) per corner in sequence, NaN if it has none
    vn x y z            likewise: point array "Normals", or cell array "NormalCorners"
    f  a/t/n ...        polygons; negative indices count back from the last vertex
    l  a b ...  p a ... lines and points
    o g usemtl          cell arrays "Object", "Group" and "Material": indices into the field arrays
                        "ObjectNames", "GroupNames" and "MaterialNames"
    s                   cell array "Smoothing": smoothing group, 0 is off
    mtllib              field array "MaterialLibrary"
    # ...               above the first vertex: field array "Comments"; others are ignored

A name is the rest of its line, in UTF-8 or Latin-1; names are written in UTF-8.  Lines have no
texture coordinates.

Long because the reader and the writer of each statement are beside each other.
"""

from __future__ import annotations

import logging
import os
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from .array_names import (
    COMMENTS,
    decoded,
    get_names,
    plain_names,
    set_names,
    text_bytes,
    warn_left_out,
    warn_renamed,
)
from .groups import GROUP, MATERIAL, OBJECT, groups_of, names_key, set_groups, whole_numbers
from .moving import CORNER_NORMALS
from .number_lines import Lines, are_numbers, colour_bytes
from .polygons import cells_of, corner_values, padded_corners, polydata_of, polygons_of, texture_of

_log = logging.getLogger(__name__)
_CORNER_TEXTURE = "TextureCorners"
_OF_CORNERS = {
    "texture coordinate": ("TextureCoordinates", _CORNER_TEXTURE),
    "normal": ("Normals", CORNER_NORMALS),
}
_WORDS = ("v", "vt", "vn", "f")
_NAMED = {"o": OBJECT, "g": GROUP, "usemtl": MATERIAL}
_SMOOTHING, _LIBRARY = "Smoothing", "MaterialLibrary"
_MOST = 2**62  # an index
# By statement: the first point, line and face it applies to, and its value.
_Runs: TypeAlias = dict[str, list[tuple[tuple[int, int, int], str]]]


def read_obj(path: Path) -> pv.PolyData:
    """Read the polygons of an OBJ file."""
    text = text_bytes(path.read_bytes())
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\\" in text:
        text = text.replace(b"\\\n", b" ")
    lines = Lines(text, _WORDS)
    statements = [(number, *_statement(line)) for number, line in lines.others()]
    if any(word in _WORDS for _, word, _ in statements):  # with other blanks before or after it
        parted = (" ".join(_statement(line)) for line in decoded(text).split("\n"))
        lines = Lines("\n".join(parted).encode(), _WORDS)
        statements = [(number, *_statement(line)) for number, line in lines.others()]
    above = np.stack([lines.above(word) for word in _WORDS], axis=1)
    cells: dict[str, list[list[int]]] = {"p": [], "l": []}
    runs: _Runs = {word: [] for word in (*_NAMED, "s")}
    libraries, comments = [], []
    for number, word, rest in statements:
        n_points, *_, n_faces = above[number].tolist()
        if word.startswith("#"):
            comments += [f"{word} {rest}"[1:].strip()] if not n_points else []
        elif word in cells:
            ends = [each.partition("/")[0] for each in _words(rest)]
            if len(ends) > (word == "l"):
                cells[word].append([_number(each, n_points) for each in ends])
        elif word in runs:
            begun = len(cells["p"]), len(cells["l"]), n_faces
            runs[word].append((begun, rest.strip()))
        elif word == "mtllib":
            libraries.append(rest.strip())
    counts, indices = _faces(lines, above[lines.at("f"), :3])
    table = _table("vertex", lines, "v", (3, 4, 6, 7))
    corners = np.ascontiguousarray(indices[:, 0])
    most = max([corners.max(initial=-1), *map(max, (*cells["p"], *cells["l"]))])
    if most >= len(table):
        raise MeshError(
            f"a face refers to vertex {most + 1} of {len(table)}; the file is truncated "
            "or damaged, export it again"
        )
    surface = polydata_of(table[:, :3], counts, corners)
    if table.shape[1] >= 6:
        surface.point_data["RGB"] = colour_bytes(table[:, 3:6])
    for name, rows in (("verts", cells["p"]), ("lines", cells["l"])):
        if rows:
            setattr(surface, name, [n for row in rows for n in (len(row), *row)])
    texture = _table("texture coordinate", lines, "vt", (2, 3))[:, :2]
    _keep_corners(surface, "texture coordinate", texture, counts, indices[:, [0, 1]])
    normals = _table("normal", lines, "vn", (3,))
    _keep_corners(surface, "normal", normals, counts, indices[:, [0, 2]])
    _keep_runs(surface, runs)
    for name, kept in ((_LIBRARY, libraries), (COMMENTS, comments)):
        if kept:
            set_names(surface, name, kept)
    return surface


def _statement(line: str) -> tuple[str, str]:
    """Return the first word of a line, and the rest."""
    parts = line.split(None, 1)
    return (*parts, "", "")[0], (*parts, "", "")[1]


def _words(rest: str) -> list[str]:
    return rest.partition("#")[0].split()


def _number(word: str, count: int) -> int:
    """Return the index from 0 of an index from 1, or from -1 backwards from the last of *count*."""
    try:
        number = int(word)
    except ValueError:
        raise MeshError(f"a face refers to {word[:40]!r}; indices are whole numbers") from None
    if number == 0 or number < -count:
        raise MeshError(f"a face refers to {word[:40]}; indices start at 1, or at -1 from the end")
    if number > _MOST:
        raise MeshError(f"a face refers to {word[:40]}, which is too large; export the file again")
    return number - 1 if number > 0 else count + number


def _faces(lines: Lines, above: IntArray) -> tuple[IntArray, IntArray]:
    """Return the number of corners (m,) of the faces, and the indices (c, 3); -1 for none.

    *above* (m, 3) are the numbers of vertices, texture coordinates and normals above each line.
    """
    plain = lines.corners("f")
    if plain is not None:
        counts, corners = plain
        indices = corners - 1
        if (corners < 0).any():
            indices = np.where(corners < 0, corners + np.repeat(above, counts, axis=0), indices)
        if ((indices >= 0) | (corners == 0)).all():
            return counts, indices
    n_corners, each = [], []
    for line, sizes in zip(decoded(lines.of("f")).split("\n"), above.tolist(), strict=False):
        words = _words(line)[1:]
        n_corners.append(len(words))
        for word in words:
            parts = (*word.split("/", 2), "", "")[:3]
            vertex = _number(parts[0], sizes[0])
            others = zip(parts[1:], sizes[1:], strict=True)
            each.append((vertex, *(_number(part, n) if part else -1 for part, n in others)))
    return np.array(n_corners, dtype=np.int64), np.array(each, dtype=np.int64).reshape(-1, 3)


def _table(what: str, lines: Lines, word: str, widths: tuple[int, ...]) -> FloatArray:
    """Return the numbers (k, w) of lines, as many as the least of *widths* if they differ."""
    table = lines.table(word)
    if table is not None and table.shape[1] in widths:
        return table
    rows = [_words(line)[1:] for line in decoded(lines.of(word)).split("\n")[:-1]]
    if not rows:
        return np.empty((0, min(widths)))
    if word == "vt":
        rows = [(row + ["0", "0"])[:2] for row in rows]
    if len({len(row) for row in rows}) > 1 or len(rows[0]) not in widths:
        if word == "v" and any(len(row) in widths[2:] for row in rows):
            _log.warning("only some vertices have a colour: the colours are not read")
        rows = [row[: min(widths)] for row in rows]
    try:
        table = np.array(rows, dtype=float)
        if table.shape[1] < min(widths):
            raise ValueError
        return table
    except ValueError:
        sound = (len(row) >= min(widths) and are_numbers(row) for row in rows)
        number = list(sound).index(False) + 1
        row = " ".join(rows[number - 1])[:60]
        raise MeshError(f"{what} {number} is {row!r}; must be {min(widths)} numbers") from None


def _keep_corners(
    surface: pv.PolyData, what: str, values: FloatArray, counts: IntArray, indices: IntArray
) -> None:
    """Store values of corners per point if every point has a unique one, else per corner.

    *indices* (c, 2) are the point and the value of each corner.
    """
    corners, of_corner = indices.T
    if not len(values) or (of_corner < 0).all():
        return
    if of_corner.max() >= len(values):
        raise MeshError(f"a face refers to {what} {of_corner.max() + 1} of {len(values)}")
    of_point_name, of_corner_name = _OF_CORNERS[what]
    of_point = np.full(surface.n_points, -1)
    if len(values) == len(of_point) and (of_corner == corners).all():
        of_point = np.arange(len(of_point))
    of_point[corners] = of_corner
    if (of_point[corners] == of_corner).all() and (of_point >= 0).all():
        surface.point_data[of_point_name] = values[of_point]
        if what == "normal":
            surface.point_data.active_normals_name = of_point_name
        else:
            surface.point_data.active_texture_coordinates_name = of_point_name
        return
    each = np.where(of_corner[:, None] >= 0, values[of_corner], np.nan)
    wide = padded_corners(counts, each)
    table = np.full((surface.n_cells, wide.shape[1]), np.nan)
    table[cells_of(surface)] = wide
    surface.cell_data[of_corner_name] = table


def _keep_runs(surface: pv.PolyData, runs: _Runs) -> None:
    """Store the values of statements, which apply to the faces after them, as cell arrays."""
    for word, statements in runs.items():
        if not statements:
            continue
        sizes = surface.n_verts, surface.n_lines, surface.GetNumberOfPolys()  # VTK's order
        starts = np.array([(0, 0, 0), *(at for at, _ in statements), sizes])
        order = [np.repeat(np.arange(len(starts) - 1), each) for each in np.diff(starts, axis=0).T]
        which = np.concatenate(order)
        lengths = np.bincount(which, minlength=len(starts) - 1)
        texts = ["", *(text for _, text in statements)]
        if word == "s":
            groups = np.array([_smoothing_group(text) for text in texts])
            surface.cell_data[_SMOOTHING] = groups[which]
            continue
        texts = [text or "default" for text in texts]
        names = dict.fromkeys(t for t, n in zip(texts, lengths, strict=True) if n)
        numbers = {name: k for k, name in enumerate(names)}
        of_texts = np.array([numbers.get(text, 0) for text in texts])
        set_groups(surface, _NAMED[word], of_texts[which], names)


def _smoothing_group(text: str) -> int:
    if text.isdecimal() and len(text) < 10:
        return int(text)
    return int(text.lower() not in ("", "off"))


def write_obj(path: Path, surface: pv.PolyData) -> None:
    """Write an OBJ file that `read_obj` reads unchanged.

    Warnings are logged for arrays that are left out and names that are changed.
    """
    counts, corners = polygons_of(surface)
    lines, verts = _cells(surface.lines), _cells(surface.verts)
    elements = [*(("l", row) for row in lines), *(("p", row) for row in verts)]
    n, k = len(verts), len(lines)
    cells = np.concatenate([cells_of(surface), np.arange(n, n + k), np.arange(n)])
    kept: dict[str, list[str]] = {"point": [], "cell": [], "field": []}
    texture, texture_of = _texture(surface, counts, corners, kept)
    normals, normal_of = _normals(surface, counts, corners, kept)
    tags = _tags(surface, cells, kept)
    libraries = plain_names(get_names(surface, _LIBRARY))
    warn_renamed("material library", libraries)
    kept["field"] += [_LIBRARY] if libraries else []
    comments = [line for text in get_names(surface, COMMENTS) for line in text.splitlines() or [""]]
    kept["field"] += [COMMENTS] if comments else []
    if missing := [name for name in libraries.values() if not os.path.exists(path.parent / name)]:
        _log.warning(
            "the OBJ file refers to %s: copy it to the same folder", ", ".join(map(repr, missing))
        )
    table = np.asarray(surface.points, dtype=float)
    colour = surface.point_data.get("RGB")
    if colour is not None and colour.dtype == np.uint8 and colour.shape == table.shape:
        table = np.hstack([table, np.asarray(colour) / 255.0])
        kept["point"].append("RGB")
    warn_left_out("OBJ", surface, kept, cells=True)
    words = _corner_words(corners, texture_of, normal_of)
    ends = np.cumsum(counts).tolist()
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"# {line}".rstrip(" \\") + "\n" for line in comments)
        file.writelines(f"mtllib {name}\n" for name in libraries.values())
        file.writelines(f"v {' '.join(map(repr, row))}\n" for row in table.tolist())
        file.writelines(f"vt {u!r} {v!r}\n" for u, v in texture.tolist())
        file.writelines(f"vn {x!r} {y!r} {z!r}\n" for x, y, z in normals.tolist())
        for face, (start, end) in enumerate(pairwise([0, *ends])):
            file.write(f"{tags.get(face, '')}f {' '.join(words[start:end])}\n")
        for number, (word, row) in enumerate(elements, start=len(counts)):
            file.write(f"{tags.get(number, '')}{word} {' '.join(str(v + 1) for v in row)}\n")


def _cells(flat: Any) -> list[list[int]]:
    """Return cells of pyvista, each preceded by its number of points, as lists."""
    values, found, at = np.asarray(flat).tolist(), [], 0
    while at < len(values):
        found.append(values[at + 1 : at + 1 + values[at]])
        at += 1 + values[at]
    return found


def _corner_words(corners: IntArray, texture_of: list[int], normal_of: list[int]) -> list[str]:
    """Return the words for the corners of faces: vertex/texture/normal."""
    words = [str(v + 1) for v in corners.tolist()]
    if not texture_of and not normal_of:
        return words
    textures = [str(t) if t else "" for t in texture_of or [0] * len(words)]
    normals = [f"/{n}" if n else "" for n in normal_of or [0] * len(words)]
    return [
        f"{v}/{t}{n}" if t or n else v for v, t, n in zip(words, textures, normals, strict=True)
    ]


def _normals(
    surface: pv.PolyData, counts: IntArray, corners: IntArray, kept: dict[str, list[str]]
) -> tuple[FloatArray, list[int]]:
    """Return normals (k, 3) and the index of each corner's one from 1; 0 for none."""
    wide = surface.cell_data.get(CORNER_NORMALS)
    each = None
    if wide is not None:
        each = corner_values(np.asarray(wide)[cells_of(surface)], counts, 3)
    if each is not None:
        kept["cell"].append(CORNER_NORMALS)
        return _unique(each)
    for name in dict.fromkeys(("Normals", "NORMAL", surface.point_data.active_normals_name)):
        values = surface.point_data.get(name) if name else None
        if values is not None and values.shape[1:] == (3,) and values.dtype.kind == "f":
            kept["point"].append(str(name))
            return np.asarray(values, dtype=float), (corners + 1).tolist()
    return np.empty((0, 3)), []


def _unique(each: FloatArray) -> tuple[FloatArray, list[int]]:
    """Return the different rows of *each*, and the number of each row from 1; 0 for NaN."""
    known = ~np.isnan(each).any(axis=1)
    values, which = np.unique(each[known], axis=0, return_inverse=True)
    slots = np.zeros(len(each), dtype=np.int64)
    slots[known] = which.ravel() + 1
    return values.astype(float), slots.tolist()


def _texture(
    surface: pv.PolyData, counts: IntArray, corners: IntArray, kept: dict[str, list[str]]
) -> tuple[FloatArray, list[int]]:
    """Return texture coordinates (k, 2) and the index of each corner's one from 1; 0 for none."""
    wide = surface.cell_data.get(_CORNER_TEXTURE)
    each = None if wide is None else corner_values(np.asarray(wide)[cells_of(surface)], counts)
    if each is not None:
        kept["cell"].append(_CORNER_TEXTURE)
        return _unique(each)
    texture = texture_of(surface)
    if texture is None:
        return np.empty((0, 2)), []
    name, pairs = texture
    kept["point"].append(name)
    return pairs.astype(float), (corners + 1).tolist()


def _tags(surface: pv.PolyData, cells: IntArray, kept: dict[str, list[str]]) -> dict[int, str]:
    """Return the statements to write before faces at which they change, by face index.

    All statements are repeated for a new object, since some readers reset them.
    """
    lines: list[list[str]] = []  # per statement and face
    for word, key in _NAMED.items():
        if (found := groups_of(surface, key)) is None:
            continue
        numbers, names = found
        written = plain_names(names)
        warn_renamed(key.lower(), written)
        lines.append([f"{word} {written[names[k]]}\n" for k in numbers[cells].tolist()])
        kept["cell"].append(key)
        kept["field"].append(names_key(key))
    groups = whole_numbers(surface.cell_data.get(_SMOOTHING), 10**9)
    if groups is not None:
        lines.append([f"s {k or 'off'}\n" for k in groups[cells].tolist()])
        kept["cell"].append(_SMOOTHING)
    by_face = list(zip(*lines, strict=True))
    tags = {0: "".join(by_face[0])} if by_face else {}
    objects = "Object" in kept["cell"]
    for k, (before, now) in enumerate(pairwise(by_face), start=1):
        if now != before:
            repeat = objects and now[0] != before[0]
            pairs = zip(now, before, strict=True)
            tags[k] = "".join(line for line, old in pairs if repeat or line != old)
    return tags
