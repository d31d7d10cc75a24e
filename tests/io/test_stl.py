"""STL: the same mesh as by VTK's reader, and errors for wrong counts and truncated text."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import OCTAHEDRON, icosphere

from vtk_segdeform import Mesh
from vtk_segdeform.errors import MeshError
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


@pytest.mark.parametrize("count", [0, 7, 9, 2**31, 2**32 - 1])
def test_a_wrong_count_of_triangles_is_an_error(tmp_path, count):
    path, data = octahedron(tmp_path)
    path.write_bytes(data[:80] + count.to_bytes(4, "little") + data[84:])
    with pytest.raises(
        MeshError, match=rf"a\.stl: declares {count} triangles, but its 484 bytes contain 8"
    ):
        read_polydata(path)


def test_a_file_that_ends_in_its_header_says_so(tmp_path):
    path, data = octahedron(tmp_path)
    path.write_bytes(data[:80])
    with pytest.raises(MeshError, match=r"a\.stl: ends after 80 bytes, in its header: it was cut"):
        read_polydata(path)


def test_binary_files_may_start_like_text_and_have_trailing_bytes(tmp_path):
    path, data = octahedron(tmp_path)
    path.write_bytes(b"solid facet vertex 1 2 3 endsolid".ljust(80) + data[80:])
    assert read_polydata(path).n_cells == 8
    path.write_bytes(data + b"\0\0")
    assert read_polydata(path).n_cells == 8


def test_text_in_any_case_with_any_ends_of_lines_is_read(tmp_path):
    path, data = octahedron(tmp_path, binary=False)
    for text in (data, data.upper(), data.replace(b"\n", b"\r\n"), b"\n " + data):
        path.write_bytes(text)
        assert read_polydata(path).n_cells == 8


def test_truncated_text_is_an_error(tmp_path):
    path, data = octahedron(tmp_path, binary=False)
    for text in (data[: len(data) // 2], data.replace(b"vertex", b"corner", 1), data[:-12]):
        path.write_bytes(text)
        with pytest.raises(MeshError, match=r"a\.stl: is truncated"):
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
