"""Plain .vtp and .vtu files are read as VTK reads them; all others are left to VTK."""

from __future__ import annotations

import base64
import zlib

import numpy as np
import pytest
import pyvista as pv
from given_surfaces import save_raw
from numpy.testing import assert_array_equal
from solids import OCTAHEDRON
from vtkmodules.util.numpy_support import numpy_to_vtkIdTypeArray
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from vtk_segdeform import Mesh
from vtk_segdeform.io.convert import read_polydata, to_polydata, write_mesh
from vtk_segdeform.io.vtk_formats import _without_ranges
from vtk_segdeform.io.vtk_xml import read_plain_xml


def rich():
    """Return a surface with every kind of cell and array."""
    surface = pv.Sphere(theta_resolution=6, phi_resolution=5) + pv.Plane(
        i_resolution=2, j_resolution=2
    )
    surface = surface + pv.Line((9, 9, 9), (8, 8, 8)) + pv.PolyData([[7.0, 7.0, 7.0]])
    surface.points = surface.points.astype(float)
    n = surface.n_points
    rng = np.random.default_rng(1)
    for k, kind in enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "i8", "f4", "f8")):
        surface.point_data[kind] = (100 * rng.random((n, 1 + k % 3))).astype(kind)
    surface.point_data["odd"] = np.where(np.arange(n) % 2, np.nan, np.inf)
    surface.GetPointData().GetArray("u1").SetComponentName(1, "Süd 1%")
    surface.point_data.active_scalars_name = "i2"
    surface.point_data.active_texture_coordinates_name = "f8"
    surface.cell_data["colour"] = np.zeros((surface.n_cells, 3), dtype=np.uint8)
    surface.field_data["times"] = [0.1, 1e-300, -7.0]
    ids = numpy_to_vtkIdTypeArray(np.arange(n), 1)
    ids.SetName("ids")
    surface.GetPointData().AddArray(ids)
    return surface


def written(data, mode="Binary", compressor="ZLib", header="UInt32", order="Little"):
    """Return the bytes of an XML file, with small blocks."""
    writer = vtkXMLPolyDataWriter() if isinstance(data, pv.PolyData) else (
        vtkXMLUnstructuredGridWriter()
    )  # fmt: skip
    writer.SetInputData(data)
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    getattr(writer, f"SetHeaderTypeTo{header}")()
    getattr(writer, f"SetByteOrderTo{order}Endian")()
    writer.SetBlockSize(240)
    writer.WriteToOutputStringOn()
    writer.Write()
    return writer.GetOutputString()


def contents(data):
    """Return all of a data set, in comparable form."""
    found = [("points", data.points.dtype, data.points.tolist())]
    if isinstance(data, pv.PolyData):
        found += [each.tolist() for each in (data.verts, data.lines, data.faces, data.strips)]
    else:
        found += [data.cells.tolist(), data.celltypes.tolist()]
    for attributes in (data.GetPointData(), data.GetCellData(), data.GetFieldData()):
        for k in range(attributes.GetNumberOfArrays()):
            array = attributes.GetArray(k)
            names = [array.GetComponentName(j) for j in range(array.GetNumberOfComponents())]
            values = pv.convert_array(array)
            found.append((array.GetName(), array.IsA("vtkIdTypeArray"), names, values.dtype))
            found.append(repr(values.tolist()))
        if hasattr(attributes, "GetAbstractAttribute"):
            active = [attributes.GetAbstractAttribute(k) for k in range(attributes.NUM_ATTRIBUTES)]
            found.append([None if each is None else each.GetName() for each in active])
    return found


@pytest.mark.parametrize("order", ["Little", "Big"])
@pytest.mark.parametrize("grid", [False, True])
@pytest.mark.parametrize(
    ("mode", "compressor", "header"),
    [("Ascii", "None", "UInt32"), ("Binary", "None", "UInt32"), ("Binary", "ZLib", "UInt64"),
     ("Appended", "ZLib", "UInt32"), ("Appended", "None", "UInt64")],
)  # fmt: skip
def test_all_codings_are_read_as_vtk_reads_them(tmp_path, grid, mode, compressor, header, order):
    surface = rich().cast_to_unstructured_grid() if grid else rich()
    text = written(surface, mode, compressor, header, order)
    path = tmp_path / f"a.vt{'u' if grid else 'p'}"
    path.write_text(text, encoding="utf-8")
    plain = read_plain_xml(path.read_bytes())
    assert plain is not None
    assert contents(plain) == contents(pv.read(path))


@pytest.mark.parametrize("order", ["Little", "Big"])
@pytest.mark.parametrize("compressor", ["None", "ZLib"])
def test_what_is_left_to_vtk_may_have_either_order_of_bytes(tmp_path, order, compressor):
    surface = rich()
    surface.field_data["names"] = ["one", "two"]
    path = tmp_path / "a.vtp"
    path.write_text(written(surface, compressor=compressor, order=order), encoding="utf-8")
    assert read_plain_xml(path.read_bytes()) is None
    assert_array_equal(read_polydata(path).points, surface.points)


def test_raw_bytes_may_look_like_tags(tmp_path):
    surface = to_polydata(Mesh(*OCTAHEDRON))
    bait = np.frombuffer(6 * b"</AppendedData></VTKFile><a b='", dtype=np.uint8)
    surface.point_data["a"] = bait.reshape(6, -1)
    path = tmp_path / "a.vtp"
    save_raw(path, surface)
    plain = read_plain_xml(path.read_bytes())
    assert plain is not None
    assert contents(plain) == contents(pv.read(path))


def test_what_has_been_read_can_be_changed():
    plain = read_plain_xml(written(to_polydata(Mesh(*OCTAHEDRON))).encode())
    plain.points[0] = 7.0
    assert_array_equal(plain.points[0], [7.0, 7.0, 7.0])


SOUND = """<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt32" {coding}>
<PolyData><Piece NumberOfPoints="4" NumberOfPolys="4"><PointData>{arrays}</PointData>
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">
1 1 1 1 -1 -1 -1 1 -1 -1 -1 1</DataArray></Points>
<Polys><DataArray type="Int64" Name="connectivity" format="ascii">
0 1 2 0 3 1 0 2 3 1 3 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3 6 9 12</DataArray></Polys>
</Piece></PolyData></VTKFile>
"""
ARRAY = '<DataArray type="UInt8" Name="a" format="binary">{}</DataArray>'
ZLIB = 'compressor="vtkZLibDataCompressor"'


def plain_text(code=b"", coding=""):
    """Return a file with a binary array."""
    arrays = ARRAY.format(code.decode()) if code else ""
    return SOUND.format(coding=coding, arrays=arrays)


def stored(declared, data=b"abcd"):
    return base64.b64encode(np.array([declared], "<u4").tobytes() + data)


def compressed(counts, data=b"abcd"):
    block = zlib.compress(data)
    head = [len(block) if each is None else each for each in counts]
    return base64.b64encode(np.array(head, "<u4").tobytes()) + base64.b64encode(block)


DAMAGE = {
    "corner out of range": ("1 3 2<", "1 9 2<"),
    "negative corner": ("1 3 2<", "1 -3 2<"),
    "end before its start": ("3 6 9 12", "6 3 9 12"),
    "end out of range": ("3 6 9 12", "3 6 9 99"),
    "too many points": ('Points="4"', 'Points="999999999999"'),
    "no points": ('Points="4"', 'Points="0"'),
    "a count that is not decimal": ('Points="4"', 'Points="+4"'),
    "two pieces": ("</Piece>", '</Piece><Piece NumberOfPoints="0"></Piece>'),
    "a comment": ("<Points>", "<!-- <Points> --><Points>"),
    "an entity": ("<PolyData>", "<!ENTITY a><PolyData>"),
    "an unknown attribute": ("<Points>", '<Points a="1">'),
    "an attribute that is there twice": ('type="Float32"', 'type="Float32" type="Float64"'),
    "an unknown element": ("<Points>", "<Other></Other><Points>"),
    "elements that overlap": ("</Points>", "</Polys>"),
    "elements in each other": ("<Points>", 9999 * "<Points>"),
    "an open element": ("</VTKFile>", ""),
    "an unknown byte order": ("LittleEndian", "MiddleEndian"),
    "numbers too large for their type": ("1 1 1 1", "1 1e39 1 1"),
    "characters that are not UTF-8": ("</Piece>", "\udcff</Piece>"),
    "control characters": ("3 6 9 12", "3 6\0 9 12"),
    "text between elements": ("</Piece>", "x</Piece>"),
    "text in numbers": ("1 1 1 1", "1 x 1 1"),
    "integers as fractions": ("3 6 9 12", "3. 6 9 12"),
    "another text after it": ("</VTKFile>", "</VTKFile><VTKFile></VTKFile>"),
}


@pytest.mark.parametrize("what", list(DAMAGE))
def test_everything_unusual_is_left_to_vtk(what):
    assert read_plain_xml(plain_text().encode()) is not None
    before, after = DAMAGE[what]
    assert before in plain_text()
    assert (
        read_plain_xml(plain_text().replace(before, after, 1).encode(errors="surrogateescape"))
        is None
    )


@pytest.mark.parametrize(
    ("code", "coding"),
    [(stored(5), ""), (stored(3), ""), (stored(2**32 - 1), ""), (b"!!!!!!!!", ""),
     (stored(4), ZLIB), (stored(4)[:-4], ""), (compressed([1, 9, 0, None]), ZLIB),
     (compressed([1, 3, 0, None]), ZLIB), (compressed([2**31, 4, 0, None]), ZLIB),
     (compressed([1, 4, 0, 2**31]), ZLIB), (compressed([1, 2**31, 0, None]), ZLIB),
     (compressed([1, 4, 3, None]), ZLIB), (compressed([1, 4, 0, 3]), ZLIB),
     (compressed([1, 10**6, 0, None], bytes(10**6)), ZLIB)],
)  # fmt: skip
def test_false_counts_of_arrays_are_left_to_vtk(code, coding):
    for sound, its in ((stored(4), ""), (compressed([1, 4, 0, None]), ZLIB)):
        plain = read_plain_xml(plain_text(sound, its).encode())
        assert bytes(plain.point_data["a"]) == b"abcd"
    assert read_plain_xml(plain_text(code, coding).encode()) is None


def test_more_bytes_than_a_share_of_the_file_are_left_to_vtk(monkeypatch):
    text = plain_text(compressed([1, 4, 0, None]), ZLIB).encode()
    assert read_plain_xml(text) is not None
    monkeypatch.setattr("vtk_segdeform.io.vtk_xml._DENSEST", 0)
    assert read_plain_xml(text) is None


@pytest.mark.parametrize("suffix", [".vtp", ".vtu"])
@pytest.mark.parametrize("is_ours", [True, False])
def test_integers_whose_norms_overflow_are_read_back(tmp_path, suffix, is_ours):
    surface = pv.Cube()
    values = np.full((surface.n_points, 3), 2**31 - 9, dtype=np.int32)
    surface.point_data["ids"] = values
    surface.field_data["text"] = ["left to VTK"]
    surface.field_data["large"] = values[:2]
    path = tmp_path / f"a{suffix}"
    if is_ours:
        write_mesh(path, surface)
        assert b"L2_NORM" not in path.read_bytes()
    else:
        (surface if suffix == ".vtp" else surface.cast_to_unstructured_grid()).save(path)
    again = read_polydata(path)
    assert_array_equal(again.point_data["ids"], values)
    assert list(again.field_data["text"]) == ["left to VTK"]


def test_unclosed_ranges_of_norms_take_no_quadratic_time():
    begun = b'<InformationKey name="L2_NORM_RANGE" location="vtkDataArray" length="2">'
    for data in (100_000 * begun, 10_000_000 * b" "):
        assert _without_ranges(data) == data
    closed = begun + b"<Value> -nan </Value></InformationKey>"
    assert _without_ranges(b"a" + closed + b"b<AppendedData>" + closed) == (
        b"ab<AppendedData>" + closed
    )
