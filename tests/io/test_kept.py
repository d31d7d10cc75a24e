"""What each format keeps: everything that is read is written again with a moved surface.

The table in docs/files.rst is made here; with SEGDEFORM_TABLES=1 it is written again.
"""

from __future__ import annotations

import os
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere

import vtk_segdeform as sd
from vtk_segdeform.io.array_names import get_names, set_names
from vtk_segdeform.io.convert import read_polydata, write_mesh
from vtk_segdeform.io.polygons import corner_values, padded_corners, polydata_of, polygons_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "files.rst"
FORMATS = [".ply", ".obj", ".off", ".stl", ".glb", ".vtp", ".vtk", ".vtu"]
SINGLE = {".stl", ".glb"}
FOLLOW = ("Normals", "NORMAL", "NormalCorners")
BEGIN, END = ".. table of kept data: begin\n", ".. table of kept data: end\n"


def body():
    """Return a closed prism of quadrangles and two pentagons, with doubled points and arrays."""
    angle = np.arange(5) * (2 * np.pi / 5)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1) / 3
    k, after = np.arange(5), (np.arange(5) + 1) % 5
    sides = np.stack([k, after, after + 5, k + 5], axis=-1)
    points = np.vstack([ring, ring + [0, 0, 1], ring, ring + [0, 0, 1]])  # lids of their own
    corners = np.concatenate([sides.ravel(), k[::-1] + 10, k + 15])
    surface = polydata_of(points, np.array([4] * 5 + [5] * 2), corners)
    normals = np.vstack([ring * 3, ring * 3, np.tile([0, 0, -1.0], (5, 1)),
                         np.tile([0, 0, 1.0], (5, 1))])  # fmt: skip
    rng = np.random.default_rng(4)
    surface.point_data["Normals"] = normals
    surface.point_data.active_normals_name = "Normals"
    surface.point_data["TextureCoordinates"] = rng.integers(0, 64, (20, 2)) / 64.0
    surface.point_data.active_texture_coordinates_name = "TextureCoordinates"
    surface.point_data["RGB"] = rng.integers(0, 256, (20, 3)).astype("u1")
    surface.point_data["warmth"] = rng.random(20)
    surface.cell_data["part"] = np.arange(7, dtype="i4")
    for key in ("Material", "Group"):
        surface.cell_data[key] = np.array([0, 0, 1, 1, 1, 2, 2])
        set_names(surface, f"{key}Names", ["skin", "Größe", "third_one"])
    return surface


def corners():
    """Return a cube with texture coordinates and normals of its corners."""
    cube = pv.Cube().clean()
    surface = polydata_of(np.asarray(cube.points), *polygons_of(cube))
    counts, ends = polygons_of(surface)
    a, b, c = (np.asarray(surface.points)[ends.reshape(-1, 4)[:, k]] for k in range(3))
    normals = np.repeat(np.cross(b - a, c - a), 4, axis=0)
    surface.cell_data["NormalCorners"] = padded_corners(counts, normals)
    texture = np.tile([[0, 0], [1, 0], [1, 1], [0, 0.25]], (6, 1))
    surface.cell_data["TextureCorners"] = padded_corners(counts, texture)
    return surface


def cells():
    """Return triangle strips, a quadrangle, lines and points."""
    vertices, faces = icosphere(1)
    surface = polydata_of(vertices / 3, np.full(len(faces), 3), faces.ravel()).strip()
    strips = surface.strips
    mixed = pv.PolyData()
    mixed.points = np.vstack(
        [np.asarray(surface.points), [[1, 0, 0], [1, 1, 0], [2, 1, 0], [2, 0, 0]]]
    )
    n = surface.n_points
    mixed.verts, mixed.lines = [1, 0, 2, n, n + 1], [2, 0, 1, 3, n, n + 1, n + 2]
    mixed.faces, mixed.strips = [4, n, n + 1, n + 2, n + 3], strips
    return mixed


MAKERS = {"body": body, "corners": corners, "cells": cells}


def bent(points):
    return np.asarray(points) + 0.1 * np.sin(2 * np.asarray(points)[:, [1, 2, 0]])


def same_cells(first, second):
    return all(
        np.array_equal(getattr(first, name), getattr(second, name))
        for name in ("verts", "lines", "faces", "strips")
    )


@pytest.fixture(scope="module")
def trips(tmp_path_factory):
    """Return a function that gives (made, read, moved, read again) of a format and a surface."""
    folder = tmp_path_factory.mktemp("kept")

    @cache
    def trip(suffix, name):
        made, path, out = MAKERS[name](), folder / f"{name}{suffix}", folder / f"out-{name}{suffix}"
        write_mesh(path, made)
        surface = sd.Surface.read(path)
        vertices = bent(surface.mesh.vertices)
        surface.write(out, vertices)
        return made, surface.given, surface.moved(vertices), read_polydata(out)

    return trip


@pytest.mark.parametrize("name", list(MAKERS))
@pytest.mark.parametrize("suffix", FORMATS)
def test_only_coordinates_and_normals_differ(trips, suffix, name):
    _, given, moved, again = trips(suffix, name)
    assert same_cells(given, again)
    if suffix in SINGLE:
        assert_allclose(again.points, moved.points, atol=1e-6)
    else:
        assert_array_equal(again.points, moved.points)
    assert not np.allclose(again.points, given.points)
    for sort in ("point", "cell", "field"):
        before, after = getattr(given, f"{sort}_data"), getattr(again, f"{sort}_data")
        expected = getattr(moved, f"{sort}_data")
        assert set(before.keys()) == set(after.keys())
        for key in before.keys():  # noqa: SIM118
            if key in FOLLOW:
                assert_allclose(after[key], expected[key], atol=1e-6)
                assert not np.allclose(after[key], before[key], equal_nan=True, atol=1e-3)
            elif key != "glTF":
                assert_array_equal(after[key], before[key])
                assert after[key].dtype.kind == before[key].dtype.kind
    assert again.active_texture_coordinates is None or given.active_texture_coordinates is not None


# The table: by column, what is said of the surface that was made and the one that was read.


def digits(read):
    made, again, *_ = read("body")
    shown = np.asarray(again.points)
    if len(shown) == len(made.points):
        return "all" if np.array_equal(shown, made.points) else "single precision"
    return "single precision"


def points(read):
    made, again, *_ = read("body")
    return "yes" if len(again.points) == len(made.points) else "equal ones merged"


def polygons(read):
    made, again, *_ = read("body")
    return "yes" if np.array_equal(made.faces, again.faces) else "as triangles"


def strips(read):
    made, again, *_ = read("cells")
    if np.array_equal(made.strips, again.strips):
        return "yes"
    assert again.n_cells - again.n_lines - again.n_verts >= 33
    return "as triangles"


def lines(read):
    made, again, *_ = read("cells")
    kept = np.array_equal(made.lines, again.lines) and np.array_equal(made.verts, again.verts)
    return "yes" if kept else "no"


def texture(read):
    made, again, *_ = read("body")
    found = again.active_texture_coordinates
    kept = ["of points"] if found is not None else []
    if found is not None:
        flipped = (
            [[0, 1]] if again.point_data.active_texture_coordinates_name == "TEXCOORD_0" else 0
        )
        turned = found * [1, -1] + flipped if np.ndim(flipped) else found
        assert_allclose(turned, made.active_texture_coordinates, atol=1e-6)
    return _with_corners(kept, read, "TextureCorners", "TEXCOORD_0")


def normals(read):
    made, again, *_ = read("body")
    name = again.point_data.active_normals_name
    kept = ["of points"] if name in ("Normals", "NORMAL") else []
    if kept:
        assert_allclose(again.point_data[name], made.point_data["Normals"], atol=1e-6)
    return _with_corners(kept, read, "NormalCorners", "NORMAL")


def _with_corners(kept, read, name, doubled):
    made, again, *_ = read("corners")
    width = {"TextureCorners": 2, "NormalCorners": 3}[name]
    if name in again.cell_data:
        counts = polygons_of(made)[0]
        pair = (corner_values(np.asarray(s.cell_data[name]), counts, width) for s in (made, again))
        assert_allclose(*pair, atol=1e-6)
        kept.append("of corners")
    elif doubled in again.point_data and again.n_points > made.n_points:
        kept.append("of corners as doubled points")
    return ", ".join(kept) or "no"


def colours(read):
    made, again, *_ = read("body")
    found = again.point_data.get("RGB")
    return "yes" if found is not None and np.array_equal(found, made.point_data["RGB"]) else "no"


def materials(read):
    made, again, *_ = read("body")
    kept = []
    for key in ("Material", "Group"):
        names, others = (
            [re.sub("[^ -~]", "_", name) for name in get_names(each, f"{key}Names")]  # as in STL
            for each in (made, again)
        )
        if others and sorted(others) == sorted(names):
            kept.append({"Material": "materials", "Group": "groups"}[key])
    return ", ".join(kept) or "no"


def arrays(read):
    made, again, *_ = read("body")
    kept = "warmth" in again.point_data and "part" in again.cell_data
    if kept:
        assert_array_equal(again.point_data["warmth"], made.point_data["warmth"])
        assert_array_equal(again.cell_data["part"], made.cell_data["part"])
    return "yes" if kept else "no"


COLUMNS = {
    "digits": digits, "points": points, "polygons": polygons, "strips": strips,
    "lines, vertices": lines, "texture coordinates": texture, "normals": normals,
    "colours": colours, "groups": materials, "other arrays": arrays,
}  # fmt: skip


def table_of(trips):
    """Return the table in reStructuredText: one row per property, one column per format."""
    found = {  # by what the columns of the formats say, equal formats share one
        suffix: [column(lambda name, suffix=suffix: trips(suffix, name))
                 for column in COLUMNS.values()]
        for suffix in FORMATS
    }  # fmt: skip
    alike: dict[tuple[str, ...], list[str]] = {}
    for suffix, words in found.items():
        alike.setdefault(tuple(words), []).append(suffix)
    lines = [".. list-table::", "   :header-rows: 1", ""]
    heads = [" ".join(f"``{suffix}``" for suffix in group) for group in alike.values()]
    rows = [["", *heads]]
    rows += [[name, *(words[k] for words in alike)] for k, name in enumerate(COLUMNS)]
    for row in rows:
        lines += [f"   {'*' if k == 0 else ' '} - {word}".rstrip() for k, word in enumerate(row)]
    return "\n" + "\n".join(lines) + "\n\n"


def test_the_table_of_the_documentation_says_what_each_format_keeps(trips):
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    expected = before + BEGIN + table_of(trips) + END + after
    if os.environ.get("SEGDEFORM_TABLES"):
        PAGE.write_text(expected, encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == expected
