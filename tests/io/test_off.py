"""OFF: colours of bytes and of fractions, all kinds of headers, and losses that are told."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from solids import OCTAHEDRON, TETRAHEDRON

from vtk_segdeform.errors import MeshError
from vtk_segdeform.io.convert import from_polydata, read_polydata, write_mesh
from vtk_segdeform.io.polygons import polydata_of

VERTICES, FACES = TETRAHEDRON[0] / 3, TETRAHEDRON[1]
BYTES = np.array([[0, 7, 255, 9], [2, 128, 0, 255], [254, 1, 0, 0], [40, 50, 60, 70]])


LOW = np.array([[0, 1, 1, 1], [1, 0, 0, 1], [0, 0, 0, 0], [1, 1, 1, 0]])  # bytes as well


def save(path, *, header="OFF", columns=None, colours=None):
    """Write a tetrahedron, with words after each position and after each face."""
    lines = [header, "4 4 6"]
    for k, point in enumerate(VERTICES.tolist()):
        lines.append(" ".join([*map(repr, point), *(columns[k] if columns else ())]))
    for k, face in enumerate(FACES.tolist()):
        lines.append(" ".join(["3", *map(str, face), *(colours[k] if colours else ())]))
    path.write_text("\n".join(lines) + "\n")
    return path


def words(table, shown=str):
    return [[shown(value) for value in row] for row in table.tolist()]


WAYS = {
    "bytes": lambda table: words(table),
    "bytes with a point": lambda table: words(table.astype(float), lambda v: f"{v:.1f}"),
    "fractions": lambda table: words(table / 255.0, repr),
    "fractions with exponents": lambda table: words(table / 255.0, lambda v: f"{v:.8e}"),
}


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize("where", ["vertices", "faces", "both"])
@pytest.mark.parametrize("way", list(WAYS))
def test_colours_of_bytes_and_of_fractions_are_the_same(tmp_path, way, where, width):
    table = BYTES[:, :width]
    columns = WAYS[way](table) if where != "faces" else None
    colours = WAYS[way](table[::-1]) if where != "vertices" else None
    path = save(tmp_path / "a.off", header="COFF" if columns else "OFF", columns=columns,
                colours=colours)  # fmt: skip
    surface = read_polydata(path)
    name = "RGB" if width == 3 else "RGBA"
    assert list(surface.point_data) == ([name] if columns else [])
    assert list(surface.cell_data) == ([name] if colours else [])
    if columns:
        assert surface.point_data[name].dtype == np.uint8
        assert_array_equal(surface.point_data[name], table)
    if colours:
        assert surface.cell_data[name].dtype == np.uint8
        assert_array_equal(surface.cell_data[name], table[::-1])
    assert_array_equal(surface.points, VERTICES)
    assert_array_equal(from_polydata(surface).faces, FACES)


@pytest.mark.parametrize("of_faces", [False, True])
@pytest.mark.parametrize("table", [BYTES, LOW, 0 * LOW, BYTES[:, :3], LOW[:, :3], LOW + 1])
def test_colours_that_are_written_are_read_back(tmp_path, table, of_faces):
    surface = polydata_of(VERTICES, np.full(4, 3), FACES.ravel())
    name = "RGB" if table.shape[1] == 3 else "RGBA"
    attributes = surface.cell_data if of_faces else surface.point_data
    attributes[name] = table.astype(np.uint8)
    write_mesh(tmp_path / "a.off", surface)
    again = read_polydata(tmp_path / "a.off")
    assert_array_equal((again.cell_data if of_faces else again.point_data)[name], table)


NORMAL, COLOUR, TEXTURE = ["0.6", "0.8", "0.0"], ["255", "7", "9", "200"], ["0.25", "0.5"]


@pytest.mark.parametrize(
    ("letters", "columns"),
    [
        ("", []),
        ("N", NORMAL),
        ("C", COLOUR),
        ("ST", TEXTURE),
        ("CN", NORMAL + COLOUR),
        ("STC", COLOUR + TEXTURE),
        ("STN", NORMAL + TEXTURE),
        ("STCN", NORMAL + COLOUR + TEXTURE),
        ("NC", COLOUR + NORMAL),  # by MeshLab
        ("NST", NORMAL + TEXTURE),
        ("CST", COLOUR + TEXTURE),
        ("NCST", COLOUR + NORMAL + TEXTURE),
    ],
)
@pytest.mark.parametrize("lower", [False, True])
def test_numbers_after_positions_are_those_of_the_header(tmp_path, letters, columns, lower):
    header = f"{letters}OFF".lower() if lower else f"{letters}OFF"
    surface = read_polydata(save(tmp_path / "a.off", header=header, columns=4 * [columns]))
    assert_array_equal(surface.points, VERTICES)
    data = surface.point_data
    assert len(list(data)) == len(letters.replace("ST", "T"))
    if "N" in letters:
        assert data.active_normals[2].tolist() == [0.6, 0.8, 0.0]
    if "C" in letters:
        assert data["RGBA"][2].tolist() == [255, 7, 9, 200]
    if "ST" in letters:
        assert surface.active_texture_coordinates[2].tolist() == [0.25, 0.5]


def binary():
    head = b"OFF BINARY\n" + struct.pack(">3i", 6, 8, 12)
    faces = [struct.pack(">5i", 3, *face, 0) for face in OCTAHEDRON[1].tolist()]
    return head + OCTAHEDRON[0].astype(">f4").tobytes() + b"".join(faces)


OTHERS = {
    "binary": (binary(), "is a binary OFF file; save it as text"),
    "coloured binary": (b"C" + binary(), "is a binary OFF file; save it as text"),
    "4OFF": (b"4OFF\n1 0 0\n0 0 0 1\n", "is 4OFF, with positions in other than three dim"),
    "nOFF": (b"# four\nnOFF 4\n1 0 0\n0 0 0 1\n", "is nOFF, with positions in other"),
    "STC4nOFF": (b"STC4nOFF\n3\n1 0 0\n0 0 0 1\n", "is 4nOFF, with positions in other"),
}


@pytest.mark.parametrize("name", list(OTHERS))
def test_other_kinds_of_off_are_named(tmp_path, name):
    data, message = OTHERS[name]
    (tmp_path / "a.off").write_bytes(data)
    with pytest.raises(MeshError, match=rf"a\.off: {message}"):
        read_polydata(tmp_path / "a.off")


def test_comments_counts_on_the_first_line_and_a_missing_header_are_read(tmp_path):
    text = "COFF 4 4 0 # four\n\n0 0 0 255 0 0 255\n1 0 0 0 9 0 255\n0 1 0 1 2 3 4\n0 0 1 5 6 7 8\n"
    faces = "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    (tmp_path / "a.off").write_text(text + faces)
    surface = read_polydata(tmp_path / "a.off")
    assert from_polydata(surface).n_faces == 4
    assert surface.point_data["RGBA"].tolist()[1] == [0, 9, 0, 255]
    (tmp_path / "a.off").write_text("# none\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + faces)
    assert from_polydata(read_polydata(tmp_path / "a.off")).n_faces == 4


@pytest.mark.parametrize(
    ("header", "columns", "colours", "told"),
    [
        ("OFF", 4 * [["1", "0", "0"]], None, "the vertices of OFF have 6 numbers"),
        ("NOFF", 4 * [["1", "0"]], None, "the vertices of NOFF have 5 numbers"),
        ("COFF", 4 * [["9", "9"]], None, "the vertices of COFF have 5 numbers"),
        ("OFF", None, 4 * [["5"]], "the faces have colours of 1 numbers"),
        ("OFF", None, [["255", "0", "0"], [], [], []], "only some faces have a colour"),
        ("OFF", None, 4 * [["red", "0", "0"]], "or not of numbers"),
    ],
)
def test_numbers_that_are_not_read_are_told(tmp_path, header, columns, colours, told, caplog):
    path = save(tmp_path / "a.off", header=header, columns=columns, colours=colours)
    surface = read_polydata(path)
    assert told in caplog.text
    assert surface.array_names == []
    assert_array_equal(surface.points, VERTICES)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("4 4 6", "4", "declares '4' vertices and faces; must be two whole"),
        ("4 4 6", "-4 4 6", "declares '-4 4' vertices and faces; must be two whole"),
        ("4 4 6", "4 4.5 6", "declares '4 4.5' vertices and faces"),
        ("4 4 6", "4 9 6", "declares 4 vertices and 9 faces, but ends after 8 lines"),
        ("0.3333333333333333", "0.333x", "vertex 0 is '0.333x .*'; must be 3 numbers"),
        ("0.3333333333333333 ", "", "vertex 0 is '.*'; must be 3 numbers"),
        ("3 0 1 2", "3 0 x 2", "face 0 is '3 0 x 2'; must be whole numbers"),
        ("3 0 1 2", "3 0 1.5 2", "face 0 is '3 0 1.5 2'; must be whole numbers"),
        ("3 0 1 2", "3 0 99999999999999999999 2", "faces use vertices 0 to .*, but there are 4"),
        ("3 0 1 2", "4 0 1 2", "the line of face 0 ends before its last corner"),
        ("3 0 1 2", "-3 0 1 2", "the line of face 0 ends before its last corner"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, old, new, told):
    path = save(tmp_path / "a.off")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(MeshError, match=rf"a\.off: {told}"):
        read_polydata(path)
