"""Plain legacy .vtk files are read as VTK reads them; all others are left to VTK."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
import pyvista as pv
from test_vtk_xml import contents, rich
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkDataSetAttributes
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkUnstructuredGridWriter

from vtk_segdeform.errors import MeshError
from vtk_segdeform.io import read_polydata, write_mesh
from vtk_segdeform.io.vtk_legacy import read_plain_legacy

_OLD, _NEW = 42, 51


def written(path, data, *, binary, version):
    """Write a legacy file, and return its bytes."""
    writer = vtkPolyDataWriter() if isinstance(data, pv.PolyData) else vtkUnstructuredGridWriter()
    writer.SetInputData(data)
    writer.SetFileName(str(path))
    writer.SetFileType(2 if binary else 1)
    writer.SetFileVersion(version)
    writer.Write()
    return path.read_bytes()


def with_attributes():
    """Return a surface with each of VTK's attributes, and colours."""
    surface = pv.Plane(i_resolution=3, j_resolution=2).triangulate().strip()
    surface.clear_data()
    n, rng = surface.n_points, np.random.default_rng(2)
    for k, (kind, width) in enumerate((("SCALARS", 4), ("VECTORS", 3), ("NORMALS", 3),
                                       ("TCOORDS", 2), ("TENSORS", 9))):  # fmt: skip
        values = numpy_to_vtk(rng.random((n, width)).astype("f4" if k % 2 else "f8"), 1)
        values.SetName(f"its {kind}")
        number = getattr(vtkDataSetAttributes, kind)
        surface.GetPointData().SetActiveAttribute(surface.GetPointData().AddArray(values), number)
    surface.cell_data["colour"] = np.arange(surface.n_cells * 3).reshape(-1, 3).astype(np.uint8)
    surface.point_data["wide"] = rng.random((n, 7))
    return surface


def with_an_array_of_two_uses():
    """Return a surface with an array that is its scalars and its normals, and so written twice."""
    surface = pv.Plane(i_resolution=3, j_resolution=2)
    surface.clear_data()
    surface.point_data["n"] = np.tile([0.0, np.nan, 1.0], (surface.n_points, 1))
    surface.point_data.active_normals_name = "n"
    assert surface.point_data.active_scalars_name == "n"
    return surface


@pytest.mark.parametrize("version", [_OLD, _NEW])
@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize(
    "make",
    [
        rich, with_attributes, with_an_array_of_two_uses, lambda: pv.Sphere().triangulate(),
    ],
)  # fmt: skip
@pytest.mark.parametrize("grid", [False, True])
def test_all_versions_are_read_as_vtk_reads_them(tmp_path, grid, make, binary, version):
    surface = make().cast_to_unstructured_grid() if grid else make()
    if not binary and pv.vtk_version_info < (9, 7) and make in (rich, with_an_array_of_two_uses):
        pytest.skip("this VTK reads neither inf nor nan in a text")
    path = tmp_path / "a.vtk"
    plain = read_plain_legacy(written(path, surface, binary=binary, version=version))
    assert plain is not None
    assert contents(plain) == contents(pv.read(path))


def test_shares_of_colours_are_rounded_as_vtk_rounds_them(tmp_path):
    surface = pv.Plane(i_resolution=31, j_resolution=15)
    surface.clear_data()
    surface.point_data["c"] = np.zeros(512, dtype=np.uint8)
    path = tmp_path / "a.vtk"
    data = written(path, surface, binary=False, version=_NEW)
    head = data[: data.index(b"COLOR_SCALARS c 1\n") + 18]
    path.write_bytes(head + b" ".join(b"%.7g" % (k / 511) for k in range(512)) + b"\n")
    assert contents(read_plain_legacy(path.read_bytes())) == contents(pv.read(path))


SOUND = b"""# vtk DataFile Version 3.0
a title
ASCII
DATASET POLYDATA
POINTS 4 float
1 1 1 1 -1 -1 -1 1 -1 -1 -1 1
POLYGONS 4 16
3 0 1 2 3 0 3 1 3 0 2 3 3 1 3 2
POINT_DATA 4
SCALARS a short 1
LOOKUP_TABLE b
1 2 3 4
LOOKUP_TABLE b 2
0 0 0 1 1 1 1 1
FIELD FieldData 1
c 1 4 int
5 6 7 8
"""


def test_lookup_tables_are_left_out(tmp_path):
    (tmp_path / "a.vtk").write_bytes(SOUND)
    plain = read_plain_legacy(SOUND)
    assert contents(plain) == contents(pv.read(tmp_path / "a.vtk"))


DAMAGE = {
    "corner out of range": (b"1 3 2\n", b"1 9 2\n"),
    "negative corner": (b"1 3 2\n", b"1 -3 2\n"),
    "a polygon longer than the list": (b"3 1 3 2\n", b"4 1 3 2\n"),
    "a polygon without corners": (b"3 0 1 2 3 0 3 1", b"0 6 1 2 3 0 3 1"),
    "a polygon of negative length": (b"16\n3 0 1 2", b"16\n-1 0 1 2"),
    "a false number of polygons": (b"POLYGONS 4", b"POLYGONS 5"),
    "a count that is not decimal": (b"POINTS 4", b"POINTS 4.0"),
    "points twice": (b"POLYGONS 4", b"POINTS 1 float\n0 0 0\nPOLYGONS 4"),
    "points that are integers": (b"4 float", b"4 int"),
    "an unknown type": (b"4 float", b"4 bit"),
    "an unknown data set": (b"POLYDATA", b"RECTILINEAR_GRID"),
    "an unknown version": (b"3.0", b"5.0"),
    "an unknown attribute": (b"SCALARS a short", b"EDGE_FLAGS a short"),
    "another number of rows": (b"POINT_DATA 4", b"POINT_DATA 3"),
    "too few rows of a field": (b"c 1 4 int\n5 6 7 8", b"c 1 3 int\n5 6 7"),
    "five components": (b"short 1", b"short 5"),
    "another array of the same name": (b"c 1 4 int", b"a 1 4 short"),
    "the same numbers of another type": (b"c 1 4 int\n5 6 7 8", b"a 1 4 unsigned_short\n1 2 3 4"),
    "a wider array of the same name": (b"c 1 4 int\n5 6 7 8", b"a 2 4 short\n1 2 3 4 1 2 3 4"),
    "numbers too large for their type": (b"1 2 3 4", b"1 2 3 99999"),
    "text in numbers": (b"5 6 7 8", b"5 x 7 8"),
    "metadata of an unknown kind": (b"LOOKUP_TABLE b 2", b"METADATA\nOTHER\n\nLOOKUP_TABLE b 2"),
    "more after the end": (b"5 6 7 8\n", b"5 6 7 8\nmore"),
}


@pytest.mark.parametrize("what", list(DAMAGE))
def test_everything_unusual_is_left_to_vtk(what):
    assert read_plain_legacy(SOUND) is not None
    before, after = DAMAGE[what]
    assert before in SOUND
    assert read_plain_legacy(SOUND.replace(before, after, 1)) is None


@pytest.mark.parametrize(
    ("before", "after"),
    [(b"POLYGONS 4 16", b"POLYGONS 4 999999999999999"), (b"POINTS 4", b"POINTS 999999999999"),
     (b"c 1 4", b"c 999999999999 4"),
     (b"5 6 7 8\n", b"5 6"), (b"c 1 4 int\n5 6 7 8\n", b"c 1 4"), (b"c 1 4 int\n5 6 7 8\n", b"")],
)  # fmt: skip
def test_fewer_numbers_than_declared_are_refused(before, after):
    assert before in SOUND
    with pytest.raises(MeshError, match="cut off"):
        read_plain_legacy(SOUND.replace(before, after, 1))


@pytest.mark.parametrize("version", [_OLD, _NEW])
@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("is_plain", [True, False])
def test_a_file_that_was_cut_off_is_refused(tmp_path, binary, version, is_plain):
    surface = rich()
    if not is_plain:
        surface.field_data["names"] = ["one", "two"]
    sound = written(tmp_path / "a.vtk", surface, binary=binary, version=version)
    assert (read_plain_legacy(sound) is not None) == is_plain
    for left in (0.3, 0.6, 0.9) if is_plain else (0.55, 0.97):
        (tmp_path / "a.vtk").write_bytes(sound[: int(left * len(sound))])
        with pytest.raises(MeshError):
            read_polydata(tmp_path / "a.vtk")


@pytest.mark.parametrize(
    ("before", "after"),
    [(b"", b""), (b"SCALARS a short 1", b"SCALARS a short 2"), (b"5 6 7", b"5 6")],
)
def test_a_text_that_vtk_reads_in_part_only_is_refused(tmp_path, before, after):
    text = SOUND.replace(b"\n", b"\r\n")  # so that it is left to VTK
    assert before in text
    (tmp_path / "a.vtk").write_bytes(text.replace(before, after, 1))
    if not before:
        assert read_polydata(tmp_path / "a.vtk").n_cells == 4
        return
    with pytest.raises(MeshError, match="is not a readable"):
        read_polydata(tmp_path / "a.vtk")


@pytest.mark.parametrize("version", [_OLD, _NEW])
@pytest.mark.parametrize("binary", [False, True])
def test_a_damaged_file_is_read_soundly_or_left_to_vtk(tmp_path, binary, version):
    rng = np.random.default_rng(3)
    sound = written(tmp_path / "a.vtk", rich(), binary=binary, version=version)
    for _ in range(40):
        data = bytearray(sound)
        for at in rng.integers(len(data), size=rng.integers(1, 9)):
            data[at] = rng.integers(256)
        plain = None
        with suppress(MeshError):
            plain = read_plain_legacy(bytes(data[: rng.integers(len(data) // 2, 2 * len(data))]))
        if plain is not None:
            contents(plain)  # reads all arrays
            assert plain.GetPolys().GetConnectivityArray().GetRange()[1] < plain.n_points


def test_text_arrays_are_read_by_vtk(tmp_path):
    surface = pv.Sphere(theta_resolution=5, phi_resolution=5)
    surface.field_data["names"] = ["one", "two"]
    path = tmp_path / "a.vtk"
    assert read_plain_legacy(written(path, surface, binary=True, version=_NEW)) is None
    assert read_polydata(path).field_data["names"].tolist() == ["one", "two"]


@pytest.mark.parametrize("as_grid", [False, True])
@pytest.mark.parametrize("binary", [False, True])
def test_the_title_is_kept(tmp_path, as_grid, binary):
    surface = rich().cast_to_unstructured_grid() if as_grid else rich()
    data = written(tmp_path / "a.vtk", surface, binary=binary, version=_NEW)
    assert data.count(b"vtk output") == 1
    for title in ("Körper 7, scanned", "vtk output"):
        (tmp_path / "a.vtk").write_bytes(data.replace(b"vtk output", title.encode(), 1))
        read = read_polydata(tmp_path / "a.vtk")
        assert ("Header" in read.field_data) == (title != "vtk output")
        write_mesh(tmp_path / "b.vtk", read)
        assert (tmp_path / "b.vtk").read_bytes().split(b"\n")[1] == title.encode()
        assert list(pv.read(tmp_path / "b.vtk").field_data) == ["times"]


def test_a_field_array_of_the_same_name_is_not_replaced_by_the_title(tmp_path):
    surface = rich()
    surface.field_data["Header"] = [1.0, 2.0]
    data = written(tmp_path / "a.vtk", surface, binary=True, version=_NEW)
    (tmp_path / "a.vtk").write_bytes(data.replace(b"vtk output", b"scan of mine", 1))
    assert read_polydata(tmp_path / "a.vtk").field_data["Header"].tolist() == [1.0, 2.0]
