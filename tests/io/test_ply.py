"""PLY: reserved names, lists of any width, triangle strips, and checks of all counts."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import CUBE, TETRAHEDRON, icosphere
from test_round_trips import Warnings, prism

from vtk_segdeform import Mesh
from vtk_segdeform.errors import MeshError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io.convert import from_polydata, read_polydata, to_polydata, write_mesh
from vtk_segdeform.io.ply_tables import tables_of
from vtk_segdeform.io.surface import read_mesh

HEADER = (
    "ply\nformat {kind} 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n"
    "property float z\n{rest}end_header\n"
)
FACES = "element face {m}\nproperty list uchar int vertex_indices\n"


def text(vertices, rows, rest):
    """Return a text file of vertices, further rows, and their part of the header."""
    lines = [" ".join(map(repr, row)) for row in vertices.tolist()] + rows
    head = HEADER.format(kind="ascii", n=len(vertices), rest=rest)
    return head + "\n".join(lines) + "\n"


def test_a_face_of_300_corners_is_preserved(tmp_path):
    surface = prism(300)
    warnings = Warnings(tmp_path / "a.ply", surface)
    assert_array_equal(read_polydata(tmp_path / "a.ply").faces, surface.faces)
    assert warnings.texts == ["PLY faces of over 255 corners cannot be read by some programs"]


def test_64_bit_integers_are_exact_or_left_out(tmp_path):
    surface = to_polydata(Mesh(*TETRAHEDRON))
    surface.point_data["i"] = np.array([0, 1, -5, 2**31 - 1])
    surface.point_data["u"] = np.array([0, 1, 5, 2**32 - 1])
    surface.point_data["d"] = np.array([0, 1, 5, 2**53 - 1])
    surface.point_data["huge"] = np.array([0, 1, 5, 2**53 + 1])
    warnings = Warnings(tmp_path / "a.ply", surface)
    again = read_polydata(tmp_path / "a.ply").point_data
    assert_array_equal(again["i"], surface.point_data["i"])
    assert_array_equal(again["u_1"], surface.point_data["u"])
    assert_array_equal(again["d"], surface.point_data["d"])
    assert warnings.left_out("point", "huge")
    assert "huge" not in again


@pytest.mark.parametrize("reader", ["vtk", "pymeshlab"])
def test_other_programs_read_the_same_surface_whatever_its_arrays_are_called(tmp_path, reader):
    surface = prism(4)
    for name in ("x", "end_header", "comment", "element", "Größe", "a b", "\n", "#", "nx", "alpha"):
        surface.point_data[name] = np.arange(8.0)
        surface.cell_data[name] = np.arange(6)
    write_mesh(tmp_path / "a.ply", surface)
    if reader == "vtk":
        theirs = pv.read(tmp_path / "a.ply")
        points, n_triangles = theirs.points, len(from_polydata(theirs).faces)
    else:
        meshset = pytest.importorskip("pymeshlab").MeshSet(verbose=False)
        meshset.load_new_mesh(str(tmp_path / "a.ply"))
        points = meshset.current_mesh().vertex_matrix()
        n_triangles = meshset.current_mesh().face_number()
    np.testing.assert_allclose(points, surface.points, atol=1e-7)
    assert n_triangles == 12


def stripped(faces):
    """Return triangle strips of closed *faces* (m, 3), each one list, by VTK."""
    solid = to_polydata(Mesh(*faces)).strip()
    data, strips = solid.strips, []
    while len(data):
        strips.append(data[1 : data[0] + 1].tolist())
        data = data[data[0] + 1 :]
    solid.strips = None
    return strips + solid.regular_faces.tolist()


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("lists", ["one", "many"])
def test_triangle_strips_are_read_with_consistent_orientation(tmp_path, kind, lists):
    vertices, faces = icosphere(2)
    strips = stripped((vertices, faces))
    assert max(map(len, strips)) > 6
    if lists == "one":  # as the Stanford scans have it
        strips = [[k for strip in strips for k in [*strip, -1]]]
    rest = f"element tristrips {len(strips)}\nproperty list int int vertex_indices\n"
    order = ">" if kind.endswith("big_endian") else "<"
    if kind == "ascii":
        rows = [" ".join(map(str, [len(strip), *strip])) for strip in strips]
        (tmp_path / "a.ply").write_text(text(vertices, rows, rest))
    else:
        data = HEADER.format(kind=kind, n=len(vertices), rest=rest).encode()
        data += vertices.astype(f"{order}f4").tobytes()
        data += b"".join(np.array([len(s), *s], f"{order}i4").tobytes() for s in strips)
        (tmp_path / "a.ply").write_bytes(data)
    mesh = read_mesh(tmp_path / "a.ply")  # closed and outward, so every triangle is oriented
    assert mesh.n_faces == len(faces)
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(
        signed_volume(vertices, faces), rel=1e-6
    )
    assert {frozenset(f) for f in mesh.faces.tolist()} == {frozenset(f) for f in faces.tolist()}


def test_degenerate_triangles_that_join_strips_are_left_out(tmp_path):
    vertices, _ = TETRAHEDRON
    rest = "element tristrips 1\nproperty list int int vertex_indices\n"
    rows = ["8 0 1 2 2 3 3 1 0"]  # 012, (122, 223, 233), 331, 310 in turn
    (tmp_path / "a.ply").write_text(text(vertices, rows, rest))
    assert read_polydata(tmp_path / "a.ply").regular_faces.tolist() == [[0, 1, 2], [1, 3, 0]]


@pytest.mark.parametrize(
    ("rest", "rows", "message"),
    [
        (
            "element face 1000000000000\nproperty list uchar int vertex_indices\n",
            [],
            "which the rest of the file cannot hold",
        ),
        ("element nothing 1000000000000\n" + FACES.format(m=1), ["3 0 1 2"], None),
        (FACES.format(m=-1), [], "line: 'element face -1'"),
        (FACES.format(m=1), ["-3 0 1 2"], "length -3"),
        (FACES.format(m=1), ["3 0 1 9"], "use vertices 0 to 9"),
        (FACES.format(m=1), ["3 0 1 1.5"], "not an integer"),
        (FACES.format(m=1), ["3 0 1 nan"], "not an integer"),
        (FACES.format(m=1).replace("int v", "thing v"), ["3 0 1 2"], "unknown type"),
        (FACES.format(m=1).replace("vertex_indices", "x"), ["3 0 1 2"], "no faces"),
        (FACES.format(m=1).replace("list uchar ", ""), ["3"], "no faces"),
        (FACES.format(m=1) * 2, ["3 0 1 2"] * 2, "of the same name"),
        ("property list int int x\n", [], "of the same name"),
        ("property list int\n", [], "unknown type: 'property list int'"),
        (FACES.format(m=1) + "property int\n", ["3 0 1 2 4"], "line: 'property int'"),
    ],
)
def test_an_inconsistent_header_is_an_error(tmp_path, rest, rows, message):
    (tmp_path / "a.ply").write_text(text(TETRAHEDRON[0], rows, rest))
    if message is None:
        assert read_polydata(tmp_path / "a.ply").n_cells == 1
        return
    with pytest.raises(MeshError, match=message):
        read_polydata(tmp_path / "a.ply")


def test_colours_of_other_types_are_not_converted_to_bytes(tmp_path):
    rest = FACES.format(m=1)
    colours = "property {0} red\nproperty {0} green\nproperty {0} blue\n"
    for kind, row, name, value in [
        ("float", "0.2 0.4 1", "RGB", [51, 102, 255]),
        ("ushort", "300 1 2", "red", 300),
        ("uchar", "3 1 2", "RGB", [3, 1, 2]),
    ]:
        lines = [f"{x} {y} {z} {row}" for x, y, z in CUBE[0]]
        head = HEADER.format(kind="ascii", n=8, rest=colours.format(kind) + rest)
        (tmp_path / "a.ply").write_text(head + "\n".join([*lines, "3 0 1 2"]))
        assert np.asarray(read_polydata(tmp_path / "a.ply").point_data[name][0]).tolist() == value


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_a_truncated_file_says_so_wherever_it_ends(tmp_path, kind):
    vertices, faces = TETRAHEDRON
    if kind == "ascii":
        whole = text(vertices, [f"3 {a} {b} {c}" for a, b, c in faces], FACES.format(m=4)).encode()
        pieces = whole.split()
        cuts = [b" ".join(pieces[:-k]) for k in range(1, 4 * 4 + 4 * 3)]
        head = HEADER.format(kind=kind, n=4, rest=FACES.format(m=4)).encode()
        cuts = [head + cut[len(b" ".join(head.split())) :] for cut in cuts]
    else:
        write_mesh(tmp_path / "a.ply", Mesh(vertices, faces))
        whole = (tmp_path / "a.ply").read_bytes()
        cuts = [whole[:-k] for k in range(1, 4 * (1 + 3 * 4) + 4 * 3 * 8)]
    for cut in cuts:
        (tmp_path / "a.ply").write_bytes(cut)
        with pytest.raises(MeshError, match="is truncated or damaged, copy or export it again"):
            read_polydata(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(whole)
    assert read_mesh(tmp_path / "a.ply").n_faces == 4


def test_a_word_among_numbers_is_shown(tmp_path):
    whole = text(TETRAHEDRON[0], ["3 0 1 2"], FACES.format(m=1))
    (tmp_path / "a.ply").write_text(whole.replace("3 0 1 2", "3 0 one 2"))
    with pytest.raises(MeshError, match="'one' where a number is expected"):
        read_polydata(tmp_path / "a.ply")


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("length", ["char", "ushort", "double"])
@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_lists_of_any_lengths_between_numbers(kind, length):
    order, of_length = "<" if "little" in kind else ">", {"char": "b", "ushort": "H", "double": "d"}
    n = of_length[length]

    def packed(a, b, c, d, lengths):
        values = a, lengths[0], *b, lengths[1], *c, d
        if kind == "ascii":
            return (" ".join(map(str, values)) + "\n").encode()
        return struct.pack(f"{order}f{n}{len(b)}i{n}{len(c)}dh", *values)

    rows = [(1.5, [0, 1, 2], [], 7), (2.5, [], [0.5], -1), (3.5, [300, 4], [1.5, 2.5, -3.5], 0)]
    header = (
        f"ply\nformat {kind} 1.0\nelement face {len(rows)}\nproperty float a\n"
        f"property list {length} int b\nproperty list {length} double c\nproperty short d\n"
        "end_header\n"
    ).encode()
    *first, last = (packed(*row, (len(row[1]), len(row[2]))) for row in rows)
    table = tables_of(header + b"".join([*first, last]))["face"]
    assert table["a"].tolist() == [row[0] for row in rows]
    assert table["d"].tolist() == [row[3] for row in rows]
    for k, name in ((1, "b"), (2, "c")):
        assert table[name].lengths.tolist() == [len(row[k]) for row in rows]
        assert table[name].values.tolist() == [value for row in rows for value in row[k]]
    with pytest.raises(MeshError, match="ends in the middle of a row of 'face'"):
        tables_of(header + b"".join([*first, last[:-3]]))
    if length != "ushort":
        wrong = packed(*rows[-1], (2, -3))
        with pytest.raises(MeshError, match="a list of 'face' has the length -3"):
            tables_of(header + b"".join([*first, wrong, b"1 " * 3000]))


def test_lines_of_the_header_are_kept_and_lists_that_are_not_read_are_named(tmp_path, caplog):
    text = """ply
format ascii 1.0
comment made by hand
obj_info num_cols 2
obj_info num_rows  2
element vertex 4
property float x
property float y
property float z
property list uchar int near
element face 4
property list uchar int vertex_indices
property list uchar float weights
end_header
0 0 0 2 1 2
1 0 0 0
0 1 0 0
0 0 1 1 1
3 0 2 1 1 .5
3 0 1 3 0
3 1 2 3 0
3 2 0 3 0
"""
    (tmp_path / "a.ply").write_text(text)
    surface = read_polydata(tmp_path / "a.ply")
    assert "vertex property 'near', face property 'weights'" in caplog.text
    caplog.clear()
    write_mesh(tmp_path / "b.ply", surface)
    lines = (tmp_path / "b.ply").read_bytes().split(b"\n")[2:5]
    assert lines == [b"comment made by hand", b"obj_info num_cols 2", b"obj_info num_rows 2"]
    assert caplog.text == ""


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("length", ["-1", "2.5", "-0.7", "0.7", "nan", "inf", "1e300"])
def test_a_length_that_is_not_whole_is_an_error(tmp_path, monkeypatch, length, compiled):
    if compiled:
        for name in ("COMPILED_CHECKS", "COMPILED_LATE"):
            monkeypatch.setattr(f"vtk_segdeform.sizes.{name}", 0)
    faces = [f"3 {a} {b} {c}" for a, b, c in TETRAHEDRON[1]]
    for row in range(5):
        rows = [*faces[:row], length, *faces[row:]]
        (tmp_path / "a.ply").write_text(text(TETRAHEDRON[0], rows, FACES.format(m=5)))
        with pytest.raises(MeshError, match=r"a\.ply: a list of 'face' has the length|end.* row"):
            read_polydata(tmp_path / "a.ply")
