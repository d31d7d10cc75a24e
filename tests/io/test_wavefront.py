"""OBJ: names in any encoding, objects, groups and smoothing are preserved; losses are reported."""

from __future__ import annotations

import re

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import TETRAHEDRON
from test_round_trips import Warnings, prism

from vtk_segdeform import Mesh
from vtk_segdeform.errors import MeshError
from vtk_segdeform.io.array_names import get_names, set_names
from vtk_segdeform.io.convert import read_polydata, to_polydata, with_vertices, write_mesh
from vtk_segdeform.io.surface import read_mesh

BLENDER = """# Blender 4.2
mtllib Körper.mtl
o 身体
v 1 1 1
v 1 -1 -1
v -1 1 -1
v -1 -1 1
usemtl Haut #1
s 0
f 1 2 3
g links oben
s 1
f 1 3 4
o Körper
f 1 4 2
usemtl a\\b
f 2 4 3
"""


def names_of(surface, key):
    """Return the name of each face."""
    names = get_names(surface, f"{key}Names")
    return [names[k] for k in surface.cell_data[key]]


def test_comments_above_the_vertices_are_kept(tmp_path, caplog):
    text = BLENDER.replace("# Blender 4.2\n", "# Blender 4.2\n#\n#  für alle \n")
    (tmp_path / "a.obj").write_text(text.replace("usemtl a", "# later\nusemtl a"), encoding="utf-8")
    (tmp_path / "Körper.mtl").touch()
    surface = read_polydata(tmp_path / "a.obj")
    assert get_names(surface, "Comments") == ["Blender 4.2", "", "für alle"]
    write_mesh(tmp_path / "b.obj", surface)
    lines = (tmp_path / "b.obj").read_text(encoding="utf-8").split("\n")
    assert lines[:4] == ["# Blender 4.2", "#", "# für alle", "mtllib Körper.mtl"]
    (tmp_path / "plain.obj").write_text("# by hand\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    write_mesh(tmp_path / "plain.stl", read_polydata(tmp_path / "plain.obj"))
    assert caplog.text == ""  # comments are no data
    set_names(surface, "Comments", ["one\ntwo", "C:\\"])  # must not continue on the next line
    write_mesh(tmp_path / "b.obj", surface)
    assert get_names(read_polydata(tmp_path / "b.obj"), "Comments") == ["one", "two", "C:"]
    surface.field_data["Comments"] = [1.0]
    write_mesh(tmp_path / "b.obj", surface)
    assert "Comments" in caplog.text


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_names_that_are_not_ascii_are_read_and_written(tmp_path, encoding, newline):
    text = BLENDER.replace("身体", "Füße") if encoding == "latin-1" else BLENDER
    (tmp_path / "a.obj").write_bytes(text.replace("\n", newline).encode(encoding))
    (tmp_path / "Körper.mtl").touch()
    for path in ("a.obj", "b.obj"):
        surface = read_polydata(tmp_path / path)
        body = "Füße" if encoding == "latin-1" else "身体"
        assert names_of(surface, "Object") == [body, body, "Körper", "Körper"]
        assert names_of(surface, "Group") == ["default"] + 3 * ["links oben"]
        assert names_of(surface, "Material") == ["Haut #1"] * 3 + ["a\\b"]
        assert surface.cell_data["Smoothing"].tolist() == [0, 1, 1, 1]
        assert get_names(surface, "MaterialLibrary") == ["Körper.mtl"]
        assert read_mesh(tmp_path / path).n_faces == 4
        warnings = Warnings(tmp_path / "b.obj", with_vertices(surface, surface.points))
        assert not warnings.texts


def test_only_line_feeds_and_carriage_returns_end_a_line(tmp_path):
    text = BLENDER.replace("身体", "a\x85v 9 9 9")  # NEL in Latin-1, an ellipsis on Windows
    (tmp_path / "a.obj").write_bytes(text.encode("latin-1"))
    surface = read_polydata(tmp_path / "a.obj")
    assert surface.n_points == 4
    assert names_of(surface, "Object")[0] == "a\x85v 9 9 9"


def test_smoothing_and_materials_are_repeated_after_each_object(tmp_path):
    (tmp_path / "a.obj").write_text(BLENDER, encoding="utf-8")
    write_mesh(tmp_path / "b.obj", read_polydata(tmp_path / "a.obj"))
    lines = (tmp_path / "b.obj").read_text(encoding="utf-8").splitlines()
    at = lines.index("o Körper")
    assert lines[at : at + 4] == ["o Körper", "g links oben", "usemtl Haut #1", "s 1"]
    assert lines.count("s off") == 1
    assert lines[:2] == ["# Blender 4.2", "mtllib Körper.mtl"]


def test_a_newline_in_a_name_does_not_start_a_line(tmp_path):
    surface = to_polydata(Mesh(*TETRAHEDRON))
    surface.cell_data["Group"] = [0, 1, 2, 3]
    names = ["a\nv 9 9 9\nf 1 2 3", "b\\", "b_", "  "]
    set_names(surface, "GroupNames", names)
    set_names(surface, "MaterialLibrary", ["x.mtl\nf 3 2 1"])
    warnings = Warnings(tmp_path / "a.obj", surface)
    again = read_polydata(tmp_path / "a.obj")
    assert_array_equal(again.points, surface.points)
    assert_array_equal(again.faces, surface.faces)
    assert names_of(again, "Group") == ["a_v 9 9 9_f 1 2 3", "b__1", "b_", "unnamed"]
    assert "group 'b\\\\' is written as 'b__1'" in warnings.texts
    assert get_names(again, "MaterialLibrary") == ["x.mtl_f 3 2 1"]


BAD = {
    "1-D RGB": ("point", "RGB", np.zeros(4, dtype=np.uint8)),
    "RGB of floats": ("point", "RGB", np.zeros((4, 3))),
    "1-D corners": ("cell", "TextureCorners", np.zeros(4)),
    "odd corners": ("cell", "TextureCorners", np.zeros((4, 5))),
    "few corners": ("cell", "TextureCorners", np.zeros((4, 4))),
    "groups without names": ("cell", "Group", np.array([0, 1, 2, 3])),
    "negative groups": ("cell", "Object", np.array([0, -1, 0, 0])),
    "fractions of groups": ("cell", "Material", np.array([0, 0.5, 0, 0])),
    "NaN groups": ("cell", "Material", np.array([0, np.nan, 0, 0])),
    "2-D groups": ("cell", "Object", np.zeros((4, 2), dtype=int)),
    "2-D smoothing": ("cell", "Smoothing", np.zeros((4, 2), dtype=int)),
    "negative smoothing": ("cell", "Smoothing", np.array([0, -1, 0, 0])),
}


@pytest.mark.parametrize("what", list(BAD))
def test_an_array_of_the_wrong_type_is_left_out_with_a_warning(tmp_path, what):
    sort, name, values = BAD[what]
    surface = to_polydata(Mesh(*TETRAHEDRON))
    getattr(surface, f"{sort}_data")[name] = values
    for key in ("Object", "Material"):
        set_names(surface, f"{key}Names", ["a"])
    warnings = Warnings(tmp_path / "a.obj", surface)
    assert warnings.left_out(sort, name)
    again = read_polydata(tmp_path / "a.obj")
    assert_array_equal(again.points, surface.points)
    assert not list(again.point_data) + list(again.cell_data)


@pytest.mark.parametrize("corner", ["0", "-5", "1/0", "1/-9"])
def test_indices_before_the_first_are_errors(tmp_path, corner):
    (tmp_path / "a.obj").write_text(f"vt 0 0\n{BLENDER}f {corner} 2 3\n", encoding="utf-8")
    with pytest.raises(MeshError, match=r"a\.obj: a face refers to (0|-5|-9)"):
        read_polydata(tmp_path / "a.obj")


@pytest.mark.parametrize("reader", ["vtk", "pymeshlab"])
def test_other_programs_read_the_same_surface_whatever_its_groups_are_called(tmp_path, reader):
    surface = prism(5)
    for key, names in [
        ("Object", ["身体", "b#"]),
        ("Group", ["a b", "#"]),
        ("Material", ["f", "v"]),
    ]:
        surface.cell_data[key] = np.arange(surface.n_cells) % 2
        set_names(surface, f"{key}Names", names)
    surface.cell_data["Smoothing"] = np.arange(surface.n_cells) % 3
    write_mesh(tmp_path / "a.obj", surface)
    if reader == "vtk":
        theirs = pv.read(tmp_path / "a.obj")
        points, n_faces = theirs.points, theirs.n_cells
    else:
        meshset = pytest.importorskip("pymeshlab").MeshSet(verbose=False)
        meshset.load_new_mesh(str(tmp_path / "a.obj"))
        points, n_faces = meshset.current_mesh().vertex_matrix(), surface.n_cells
        assert meshset.current_mesh().face_number() == 5 * 2 + 2 * 3
    np.testing.assert_allclose(points, surface.points, atol=1e-6)
    assert n_faces == surface.n_cells


TETRA = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
HUGE = "99999999999999999999999"


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        ("f 3 1 4", f"f 3 1 {HUGE}", f"refers to {HUGE}, which is too large"),
        ("f 3 1 4", f"f 3/{HUGE} 1 4", f"refers to {HUGE}, which is too large"),
        ("f 3 1 4", f"f 3 1 -{HUGE}", f"refers to -{HUGE}; indices start at 1"),
        ("f 3 1 4", "f 3 1 4294967295", "refers to vertex 4294967295 of 4"),
        ("f 3 1 4", "f 3 a 4", "refers to 'a'; indices are whole numbers"),
        ("v 0 0 1", "v 0 x 1", "vertex 4 is '0 x 1'; must be 3 numbers"),
        ("v 0 1 0", "v 0 1", "vertex 3 is '0 1'; must be 3 numbers"),
        ("f 1 3 2", "vt 0 0\nvt 0 y\nf 1 3 2", "texture coordinate 2 is '0 y'; must be 2 numbers"),
    ],
)
def test_a_number_that_cannot_be_is_named(tmp_path, good, bad, message):
    (tmp_path / "a.obj").write_text(TETRA)
    assert read_mesh(tmp_path / "a.obj").n_faces == 4
    (tmp_path / "a.obj").write_text(TETRA.replace(good, bad))
    with pytest.raises(MeshError, match=message):
        read_polydata(tmp_path / "a.obj")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
@pytest.mark.parametrize("name", ["a.obj", "a.off"])
def test_text_in_utf_16_is_named_and_what_to_save_it_as(tmp_path, encoding, name):
    off = "OFF\n4 1 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n"
    (tmp_path / name).write_text(TETRA if name == "a.obj" else off, encoding=encoding)
    with pytest.raises(MeshError, match="UTF-16 text, or not text at all; save it as UTF-8"):
        read_polydata(tmp_path / name)
    (tmp_path / name).write_text(TETRA if name == "a.obj" else off, encoding="utf-8-sig")
    assert read_polydata(tmp_path / name).n_points == 4


FORMS = ("{0}", "{0}/{1}", "{0}//{2}", "{0}/{1}/{2}", "-{0}", "-{0}//-{2}")


@pytest.mark.parametrize("form", FORMS)
def test_lines_parsed_at_once_are_those_parsed_one_by_one(tmp_path, form):
    rng = np.random.default_rng(4)
    v, vt, vn = rng.normal(size=(9, 6)), rng.normal(size=(5, 2)), rng.normal(size=(7, 3))
    rows = [(word, row) for word, rows in (("v", v), ("vn", vn), ("vt", vt)) for row in rows]
    lines = [f"{word} {' '.join(map(repr, row.tolist()))}" for word, row in rows]
    for size in (3, 5, 4):
        ends = rng.permutation(9)[:size], rng.integers(5, size=size), rng.integers(7, size=size)
        corners = zip(*(end + 1 for end in ends), strict=True)
        lines.append("f " + " ".join(form.format(*corner) for corner in corners))
    (tmp_path / "a.obj").write_text("\n".join(lines))
    once = read_polydata(tmp_path / "a.obj")
    (tmp_path / "a.obj").write_text("\n".join(f"  {line}\t# comment" for line in lines))
    slowly = read_polydata(tmp_path / "a.obj")
    assert np.abs(once.points - v[:, :3]).max() == 0.0
    assert once == slowly
    assert once.n_cells == 3


@pytest.mark.parametrize("word", ["1-2/", "1+2/", "1/2-", "1-2"])
def test_a_word_of_several_numbers_is_no_index(tmp_path, word):
    text = f"vt 0 0\nvt 1 0\n{TETRA}".replace("f 1 3 2", f"f {word} 3/1 2/1")
    (tmp_path / "a.obj").write_text(re.sub(r"f (\d) (\d) (\d)", r"f \1/1 \2/1 \3/1", text))
    with pytest.raises(MeshError, match=r"a face refers to '[12]"):
        read_polydata(tmp_path / "a.obj")


def test_corners_of_one_face_may_be_of_different_forms(tmp_path):
    (tmp_path / "a.obj").write_text(f"vt 5 6\nvn 0 0 1\n{TETRA[: TETRA.index('f')]}f 1/1 2 3/1/1")
    surface = read_polydata(tmp_path / "a.obj")
    assert_array_equal(surface.regular_faces[-1], [0, 1, 2])
    assert_array_equal(surface.cell_data["TextureCorners"][-1], [5, 6, np.nan, np.nan, 5, 6])


def test_a_plane_is_no_surface_in_space(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3")
    with pytest.raises(MeshError, match="vertex 1 is '0 0'; must be 3 numbers"):
        read_polydata(tmp_path / "a.obj")


@pytest.mark.parametrize(
    ("colours", "expected"),
    [
        (["255 0 7", "0 128 0", "2 0 1", "40 50 60"], "255 0 7 0 128 0 2 0 1 40 50 60"),
        (["255.0 0 7.4", "0 127.6 0", "2 0 1", "40 50 60"], "255 0 7 0 128 0 2 0 1 40 50 60"),
        (["2 0 1", "0 0 0", "0 0 0", "1 1 1"], "2 0 1 0 0 0 0 0 0 1 1 1"),
        (["1 0 0", "0 1 0", "0 0 1", "1 1 1"], "255 0 0 0 255 0 0 0 255 255 255 255"),
        (["0.2 0 1", "0 1.0000001 0", "0 0 1", "1 1 1"], "51 0 255 0 255 0 0 0 255 255 255 255"),
        (["0.5 nan inf", "0 0 0", "0 0 0", "1e-3 0 0"], "128 0 0 0 0 0 0 0 0 0 0 0"),
    ],
)
def test_colours_are_fractions_or_bytes(tmp_path, colours, expected):
    lines = [f"v {x} {y} {z} {c}" for (x, y, z), c in zip(TETRAHEDRON[0], colours, strict=True)]
    lines += [f"f {a} {b} {c}" for a, b, c in TETRAHEDRON[1] + 1]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    surface = read_polydata(tmp_path / "a.obj")
    assert surface.point_data["RGB"].ravel().tolist() == list(map(int, expected.split()))
    assert_array_equal(surface.points, TETRAHEDRON[0])
    write_mesh(tmp_path / "b.obj", surface)
    again = read_polydata(tmp_path / "b.obj")
    assert_array_equal(again.point_data["RGB"], surface.point_data["RGB"])


def test_colours_of_some_vertices_are_not_read_and_told(tmp_path, caplog):
    lines = [f"v {x} {y} {z}" for x, y, z in TETRAHEDRON[0]]
    lines += [f"f {a} {b} {c}" for a, b, c in TETRAHEDRON[1] + 1]
    (tmp_path / "a.obj").write_text("\n".join([lines[0] + " 255 0 0", *lines[1:]]))
    surface = read_polydata(tmp_path / "a.obj")
    assert surface.array_names == []
    assert_array_equal(surface.points, TETRAHEDRON[0])
    assert "only some vertices have a colour: the colours are not read" in caplog.text
