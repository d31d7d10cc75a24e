"""STL: the same mesh as by VTK's reader, solids as groups, errors for wrong counts and cut text."""

from __future__ import annotations

import re

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import OCTAHEDRON, icosphere

from vtk_segdeform import Mesh, Surface
from vtk_segdeform.errors import MeshError
from vtk_segdeform.io.array_names import get_names, set_names
from vtk_segdeform.io.convert import read_polydata, to_polydata, write_mesh


@pytest.mark.parametrize("binary", [True, False])
def test_corners_are_merged_and_numbered_as_vtk_does(tmp_path, binary):
    to_polydata(Mesh(*icosphere(2))).save(tmp_path / "a.stl", binary=binary)
    ours, theirs = read_polydata(tmp_path / "a.stl"), pv.read(tmp_path / "a.stl")
    assert_array_equal(ours.points, theirs.points)
    assert_array_equal(ours.faces, theirs.faces)


def octahedron(tmp_path, *, binary=True):
    """Write an octahedron; return the path and its bytes."""
    path = tmp_path / "a.stl"
    to_polydata(Mesh(*OCTAHEDRON)).save(path, binary=binary)
    return path, path.read_bytes()


@pytest.mark.parametrize("title", [b"", b"solid x"])
@pytest.mark.parametrize("count", [0, 7, 9, 2**31, 2**32 - 1])
def test_a_wrong_count_of_triangles_is_an_error(tmp_path, count, title):
    path, data = octahedron(tmp_path)
    path.write_bytes(title.ljust(80) + count.to_bytes(4, "little") + data[84:])
    why = "it was cut off" if count > 8 else "its header is wrong"
    with pytest.raises(
        MeshError, match=rf"a\.stl: declares {count} triangles, but its 484 bytes contain 8: {why}"
    ):
        read_polydata(path)


def test_a_file_that_ends_in_its_header_says_so(tmp_path):
    path, data = octahedron(tmp_path)
    path.write_bytes(data[:80])
    with pytest.raises(MeshError, match=r"a\.stl: ends after 80 bytes, in its header: it was cut"):
        read_polydata(path)


TITLES = [b"", b"solid", b"solid x", b"SOLID facet vertex 1 2 3 endsolid", b"  solid x"]
REST = [b"", b"\n", b"\r\n\r\n", b"\0", b"x", 700 * b"\n", 512 * b"\0", b"\x1a", b"endsolid"]


@pytest.mark.parametrize("blank", [b" ", b"\0"])
@pytest.mark.parametrize("title", TITLES)
def test_binary_files_may_start_like_text_and_have_blanks_at_their_end(tmp_path, title, blank):
    path, data = octahedron(tmp_path)
    for rest in REST:
        path.write_bytes(title.ljust(80, blank) + data[80:] + rest)
        again = read_polydata(path)
        assert again.n_cells == 8
        assert get_names(again, "Header") == ([title.decode().strip()] if title else [])
    path.write_bytes(title.ljust(80, blank) + data[80:-1])
    with pytest.raises(MeshError, match="declares 8 triangles, but its 483 bytes contain 7"):
        read_polydata(path)


def test_text_in_any_case_with_any_ends_of_lines_is_read(tmp_path):
    path, data = octahedron(tmp_path, binary=False)
    lines = data.split(b"\n")
    unnamed = b"\n".join([b"solid", *lines[1:-2], b"endsolid"])
    for text in (
        data, data.upper(), data.replace(b"\n", b"\r\n"), data.replace(b"\n", b"\r"),
        b"\n \r\n\t" + data, b"\xef\xbb\xbf" + data, data + b"\n\n", data + 100 * b"\0",
        data.replace(b"\n", b"\n    "), unnamed,
    ):  # fmt: skip
        path.write_bytes(text)
        again = read_polydata(path)
        assert again.n_cells == 8
        assert ("Group" in again.cell_data) == (text is not unnamed)


def test_text_in_utf_16_says_so(tmp_path):
    path, data = octahedron(tmp_path, binary=False)
    path.write_text(data.decode(), encoding="utf-16")
    with pytest.raises(MeshError, match=r"a\.stl: is UTF-16 text; save it as UTF-8"):
        read_polydata(path)


def test_a_vertex_that_is_not_numbers_is_named(tmp_path):
    path, data = octahedron(tmp_path, binary=False)
    path.write_bytes(re.sub(rb"vertex (\S+) (\S+)", rb"vertex \1 x\2", data, count=1))
    with pytest.raises(
        MeshError, match=r"a\.stl: has the vertex '\S+ x\S+ \S+'; must be 3 numbers"
    ):
        read_polydata(path)


def test_text_without_its_last_line_is_read_with_a_warning(tmp_path, caplog):
    path, data = octahedron(tmp_path, binary=False)
    whole = read_polydata(path)
    assert not caplog.records
    text = data[: data.index(b"endsolid")]
    for ending in (text, text.upper().rstrip()):
        caplog.clear()
        path.write_bytes(ending)
        assert_array_equal(read_polydata(path).points, whole.points)
        assert "a.stl: there is no endsolid" in caplog.text
    end = text.rindex(b"endfacet")
    for cut in (end, text.rindex(b"endloop"), text.rindex(b"vertex") + 9):
        path.write_bytes(text[:cut])
        with pytest.raises(MeshError, match=r"a\.stl: is truncated"):
            read_polydata(path)
    path.write_bytes(b"solid nothing\n")
    with pytest.raises(MeshError, match=r"a\.stl: is truncated"):
        read_polydata(path)


def test_minus_zero_is_zero_and_nan_is_kept(tmp_path):
    path, _ = octahedron(tmp_path)
    write_mesh(path, Mesh(OCTAHEDRON[0] + 0.0, OCTAHEDRON[1]))
    rows = np.frombuffer(path.read_bytes()[84:], "u1").reshape(-1, 50).copy()
    corners = rows[:, 12:48].copy().view("<f4")
    corners[corners == 0] = np.random.default_rng(1).choice([0.0, -0.0], (corners == 0).sum())
    rows[:, 12:48] = corners.view("u1")
    head = path.read_bytes()[:84]
    path.write_bytes(head + rows.tobytes())
    assert read_polydata(path).n_points == 6
    rows[0, 12:16] = np.frombuffer(b"\1\0\x80\x7f", "u1")  # a NaN that signals
    path.write_bytes(head + rows.tobytes())
    assert np.isnan(read_polydata(path).points).sum() == 1


def test_normals_and_attributes_belong_to_the_triangles_of_their_polygon(tmp_path):
    surface = pv.Cube().clean()
    surface.verts, surface.lines = [1, 0, 1, 1], [2, 0, 1]
    cells = np.arange(surface.n_cells, dtype=np.uint16) + 7
    surface.cell_data["Attribute"] = cells
    write_mesh(tmp_path / "a.stl", surface)
    rows = np.frombuffer((tmp_path / "a.stl").read_bytes(), "u1", offset=84).reshape(12, 50)
    assert_array_equal(rows[:, 48:].copy().view("<u2").ravel(), np.repeat(cells[3:], 2))
    normals = rows[:, :12].copy().view("<f4")
    middle = rows[:, 12:48].copy().view("<f4").reshape(12, 3, 3).mean(axis=1)
    assert_array_equal(np.linalg.norm(normals, axis=1), 1.0)
    assert (np.einsum("ix,ix->i", normals, middle) == 0.5).all()  # outward


def patches():
    """Return an octahedron whose lower half is a patch, and its upper half another one."""
    surface = to_polydata(Mesh(*OCTAHEDRON))
    low = surface.cell_centers().points[:, 2] < 0
    surface.cell_data["Group"] = np.where(low, 1, 0)
    set_names(surface, "GroupNames", ["inlet", "outer wall"])
    return surface


def names_of(surface):
    """Return the name of the group of each cell."""
    names = get_names(surface, "GroupNames")
    return [names[k] for k in surface.cell_data["Group"]]


def save_solids(path, surface):
    """Write one solid for each group, as a program for fluids does."""
    corners = surface.points[surface.regular_faces]
    lines = []
    for k, name in enumerate(get_names(surface, "GroupNames")):
        lines.append(f"solid {name}")
        for triangle in corners[np.asarray(surface.cell_data["Group"]) == k]:
            vertices = [f"      vertex {x:e} {y:e} {z:e}" for x, y, z in triangle]
            lines += ["  facet normal 0 0 0", "    outer loop", *vertices, "    endloop"]
            lines.append("  endfacet")
        lines.append(f"endsolid {name}")
    path.write_text("\n".join(lines), encoding="utf-8")


@pytest.mark.parametrize(
    "way", [[".stl"], [".obj", ".stl"], [".vtp", ".stl"], [".vtk", ".obj", ".vtu", ".stl"]]
)
def test_named_solids_are_groups_of_one_welded_mesh_and_keep_their_names(tmp_path, way):
    save_solids(tmp_path / "a.stl", patches())
    given = read_polydata(tmp_path / "a.stl")
    assert names_of(given) == 4 * ["inlet"] + 4 * ["outer wall"]
    assert np.sign(given.cell_centers().points[:, 2]).tolist() == 4 * [1] + 4 * [-1]
    surface = Surface(given)
    assert surface.mesh.is_closed
    assert surface.mesh.n_vertices == 6
    again = surface.moved(2 * surface.mesh.vertices)
    for k, suffix in enumerate(way):
        write_mesh(tmp_path / f"{k}{suffix}", again)
        again = read_polydata(tmp_path / f"{k}{suffix}")
    assert_array_equal(again.points, 2 * given.points)
    assert_array_equal(again.faces, given.faces)
    # In STL a name is one word: MeshLab loses triangles after others.
    assert names_of(again) == [name.replace(" ", "_") for name in names_of(given)]
    text = (tmp_path / f"{len(way) - 1}.stl").read_text(encoding="utf-8")
    lines = [line for line in text.split("\n") if "solid" in line]
    assert lines == ["solid inlet", "endsolid inlet", "solid outer_wall", "endsolid outer_wall"]
    assert len(pv.read(tmp_path / f"{len(way) - 1}.stl").points) == 6
    if ".obj" in way:
        text = (tmp_path / f"{way.index('.obj')}.obj").read_text(encoding="utf-8")
        assert [line for line in text.split("\n") if line[:1] == "g"] == [
            "g inlet", "g outer wall",
        ]  # fmt: skip


def test_text_has_all_digits_and_the_order_of_the_triangles(tmp_path):
    vertices, faces = icosphere(2)
    vertices = vertices * (1.0 + 0.1 * np.random.default_rng(2).random((len(vertices), 1)))
    surface = to_polydata(Mesh(vertices * np.array([1e-7, 1.0, 3e8]), faces))
    write_mesh(tmp_path / "a.stl", surface)
    binary = read_polydata(tmp_path / "a.stl")
    surface.cell_data["Group"] = np.random.default_rng(1).integers(0, 5, len(faces))
    set_names(surface, "GroupNames", ["a", "b\nsolid c", "b_solid c", "Größe", "Gr__e"])
    write_mesh(tmp_path / "a.stl", surface)
    again = read_polydata(tmp_path / "a.stl")
    assert_array_equal(again.points, binary.points)
    assert_array_equal(again.faces, binary.faces)
    written = {"a": "a", "b\nsolid c": "b_solid_c", "b_solid c": "b_solid_c_1",
               "Größe": "Gr__e_1", "Gr__e": "Gr__e"}  # fmt: skip
    assert names_of(again) == [written[name] for name in names_of(surface)]


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_names_that_are_not_ascii_are_read(tmp_path, encoding):
    save_solids(tmp_path / "a.stl", patches())
    text = (tmp_path / "a.stl").read_text(encoding="utf-8").replace("outer wall", "Außenwand")
    (tmp_path / "a.stl").write_text(text, encoding=encoding)
    assert get_names(read_polydata(tmp_path / "a.stl"), "GroupNames") == ["inlet", "Außenwand"]


def test_a_solid_that_is_cut_off_is_an_error_or_told(tmp_path, caplog):
    save_solids(tmp_path / "a.stl", patches())
    lines = (tmp_path / "a.stl").read_text(encoding="utf-8").split("\n")
    middle = lines.index("solid outer wall")
    for cut in (lines[:10] + lines[12:], lines[:10] + lines[middle:], lines[: middle + 10]):
        (tmp_path / "a.stl").write_text("\n".join(cut))
        with pytest.raises(MeshError, match=r"a\.stl: is truncated"):
            read_polydata(tmp_path / "a.stl")
    assert not caplog.records
    for cut in (lines[:-1], lines[: middle + 1]):
        caplog.clear()
        (tmp_path / "a.stl").write_text("\n".join(cut))
        n_cells = read_polydata(tmp_path / "a.stl").n_cells
        assert f"there is no endsolid; the file may be truncated after {n_cells} tri" in caplog.text
    without_ends = [line for line in lines if not line.startswith("endsolid i")]
    (tmp_path / "a.stl").write_text("\n".join(without_ends))
    assert names_of(read_polydata(tmp_path / "a.stl")) == 4 * ["inlet"] + 4 * ["outer wall"]


def test_positions_beyond_single_precision_are_refused(tmp_path):
    far = to_polydata(Mesh(OCTAHEDRON[0] * 1e39, OCTAHEDRON[1]))
    with pytest.raises(MeshError, match=r"a\.stl: has positions that STL cannot store"):
        write_mesh(tmp_path / "a.stl", far)
    assert not (tmp_path / "a.stl").exists()
