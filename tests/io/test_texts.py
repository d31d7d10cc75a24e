"""Texts of any kind, wherever a file has some: what is written can be read, in every format.

Names of arrays and components, texts in arrays, titles, comments, groups, materials and objects are
read back as they were, or a warning says what became of them.  Null characters and invalid bytes
are replaced before any format sees them (`array_names.storable`).
"""

from __future__ import annotations

import json
import logging

import numpy as np
import pytest
from gltf_files import octahedron
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from solids import CUBE, OCTAHEDRON
from vtkmodules.vtkCommonCore import vtkStringArray

import vtk_segdeform as sd
from vtk_segdeform.io.array_names import set_names, storable
from vtk_segdeform.io.convert import read_polydata, to_polydata, write_mesh

FORMATS = [".ply", ".obj", ".off", ".stl", ".glb", ".gltf", ".vtp", ".vtu", ".vtk", ".vtkhdf"]
TEXTS = [
    "\0", "a\0b", "a\nb", "a\r\nb", "a\tb", "\x1b[31mred\x1b[0m", "%00", "%41", "\"'<&>", "]]>",
    "&amp;", "&#10;", "😀", "👩\u200d🔬", "\ud800", "a\udcffb", "x" * 300, "é" * 150, "1a", "#",
    "# a", ".", "..", "", "\\", "a\\", " a ", "a  b", "\x85", "\u2028", "a\x0bb", "\x7f", "\ufeffa",
    "end_header", "solid", "{}", "%s", "\u202eabc", "/", "a/b", "a.b", "default", "off", "unnamed",
    b"\xff\xfe", "Größe".encode("latin-1"),
]  # fmt: skip


def encoded(text):
    """Return *text* as VTK takes it: lone surrogates would abort the process."""
    return text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass")


def add_texts(attributes, name, texts):
    array = vtkStringArray()
    array.SetName(name)
    for text in texts:
        array.InsertNextValue(encoded(text))
    attributes.AddArray(array)


def add_numbers(attributes, texts, count):
    """Add an array of *count* rows for each of *texts*, which is its name."""
    for k, text in enumerate(texts):
        array = numbers(np.arange(count) + float(k))
        array.SetName(encoded(text))
        attributes.AddArray(array)


def numbers(values):
    from vtkmodules.util.numpy_support import numpy_to_vtk

    return numpy_to_vtk(values, deep=True)


def in_arrays(surface, texts):
    for sort, count in (("Point", surface.n_points), ("Cell", surface.n_cells), ("Field", 3)):
        add_numbers(getattr(surface, f"Get{sort}Data")(), texts, count)


def in_components(surface, texts):
    for k, text in enumerate(texts):
        array = numbers(np.zeros((surface.n_points, 3)))
        array.SetName(f"of three {k}")
        for c in range(3):
            array.SetComponentName(c, encoded(text) + b" %d" % c)
        surface.GetPointData().AddArray(array)


def in_statements(surface, texts):
    for key in ("Object", "Group", "Material"):
        surface.cell_data[key] = np.arange(surface.n_cells) % len(texts)
        add_texts(surface.GetFieldData(), f"{key}Names", texts)


def in_headers(surface, texts):
    for key in ("Header", "Comments", "ObjectInfo", "MaterialLibrary"):
        add_texts(surface.GetFieldData(), key, texts)


def in_values(surface, texts):
    add_texts(surface.GetFieldData(), "notes", texts)
    for attributes, count in (
        (surface.GetPointData(), surface.n_points),
        (surface.GetCellData(), surface.n_cells),
    ):
        add_texts(attributes, "labels", [texts[k % len(texts)] for k in range(count)])


def in_elements(surface, texts):
    add_numbers(surface.GetFieldData(), [encoded(text) + b".q" for text in texts], 3)
    add_numbers(surface.GetFieldData(), [b"q." + encoded(text) for text in texts], 3)


def in_attributes(surface, texts):
    add_numbers(surface.GetPointData(), [b"_" + encoded(text) for text in texts], surface.n_points)


PLACES = [in_arrays, in_components, in_statements, in_headers, in_values, in_elements,
          in_attributes]  # fmt: skip


def cube():
    vertices, faces = CUBE
    return to_polydata(sd.Mesh(vertices / 3, faces))


def contents(surface):
    """Return what is in the arrays of a surface, by kind and name."""
    found = {}
    for sort in ("Point", "Cell", "Field"):
        attributes = getattr(surface, f"Get{sort}Data")()
        for k in range(attributes.GetNumberOfArrays()):
            array = attributes.GetAbstractArray(k)
            key = sort, storable(array.GetName())
            if array.IsA("vtkStringArray"):
                texts = [array.GetValue(j) for j in range(array.GetNumberOfValues())]
                found[key] = [" ".join(storable(text).split()) for text in texts]
                continue
            width = array.GetNumberOfComponents() * array.HasAComponentName()
            parts = [storable(array.GetComponentName(j)) for j in range(width)]
            values = [array.GetTuple(j) for j in range(array.GetNumberOfTuples())]
            found[key] = [values, parts if any(parts) else []]
    return found


def changed(folder, suffix, surface):
    """Write and read; return what is neither the same nor in a warning.

    White space in texts may differ, and comments are no data.
    """
    told: list[str] = []
    handler, logger = logging.Handler(logging.WARNING), logging.getLogger("vtk_segdeform")
    handler.emit = lambda record: told.append(record.getMessage())
    logger.addHandler(handler)
    try:
        write_mesh(folder / f"a{suffix}", surface)
    finally:
        logger.removeHandler(handler)
    again = read_polydata(folder / f"a{suffix}")
    assert again.n_points == surface.n_points
    before, after, told = contents(surface), contents(again), " ".join(told)
    if suffix in (".glb", ".gltf"):  # triangles are sorted by material
        before.pop(("Cell", "Material"), None)
    if suffix == ".stl" and ("Field", "Header") in before:  # one line
        before["Field", "Header"] = [" ".join(" ".join(before["Field", "Header"]).split())]
    return [
        (key, value, after.get(key))
        for key, value in before.items()
        if after.get(key) != value and key[1] not in ("Comments", "ObjectInfo")
        and not reported(told, key[1], value)
    ]  # fmt: skip


def reported(told, name, value):
    """Return whether a warning has the name of an array, or one of its texts or components."""
    of_it = [name, *(value[1] if value and isinstance(value[0], list) else value)]
    kinds = {
        "ObjectNames": "object", "GroupNames": "group", "MaterialNames": "material",
        "Header": "header", "MaterialLibrary": "material library",
    }  # fmt: skip
    return any(repr(text) in told for text in of_it) or (
        name in kinds and f"{kinds[name]} " in told
    )


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.__name__)
def test_every_text_is_read_back_or_a_warning_says_what_became_of_it(tmp_path, suffix, place):
    surface = cube()
    place(surface, TEXTS)
    assert changed(tmp_path, suffix, surface) == []


@pytest.mark.parametrize("suffix", FORMATS)
def test_unnamed_arrays_are_given_names(tmp_path, suffix):
    surface = cube()
    for sort, count in (("Point", 8), ("Cell", 12), ("Field", 3)):
        for _ in range(2):
            getattr(surface, f"Get{sort}Data")().AddArray(numbers(np.arange(float(count))))
    write_mesh(tmp_path / f"a{suffix}", surface)
    assert read_polydata(tmp_path / f"a{suffix}").n_points == 8
    if suffix == ".vtp":
        again = read_polydata(tmp_path / "a.vtp")
        assert list(again.point_data) == ["unnamed", "unnamed_"]


def ply_with(text):
    header = [
        b"ply", b"format ascii 1.0", b"comment " + text, b"obj_info " + text,
        b"element vertex 4", b"property double x", b"property double y", b"property double z",
        b"property double a" + b"".join(text.split()), b"element face 4",
        b"property list uchar int vertex_indices", b"end_header",
    ]  # fmt: skip
    rows = [b"0 0 0 1", b"1 0 0 2", b"0 1 0 3", b"0 0 1 4"]
    faces = [b"3 0 2 1", b"3 0 1 3", b"3 1 2 3", b"3 2 0 3"]
    return b"\n".join([*header, *rows, *faces, b""])


def obj_with(text):
    return b"\n".join([
        b"# " + text, b"mtllib " + text, b"v 0 0 0", b"v 1 0 0", b"v 0 1 0", b"v 0 0 1",
        b"o " + text, b"g " + text, b"usemtl " + text, b"f 1 3 2", b"f 1 2 4",
        b"usemtl other", b"f 2 3 4", b"f 3 1 4", b"",
    ])  # fmt: skip


def stl_with(text):
    rows = np.zeros(4, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="f4")
    rows["corners"] = corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]]
    return text[:80].ljust(80, b"\0") + (4).to_bytes(4, "little") + rows.tobytes()


def gltf_with(text):
    document = octahedron(*OCTAHEDRON)
    name = text.decode("utf-8", "surrogatepass") if isinstance(text, bytes) else text
    document.head["materials"] = [{"name": name, "extras": {name: name}}]
    document.head["meshes"][0]["primitives"][0]["material"] = 0
    document.head["nodes"][0]["name"] = name
    return document


MAKERS = {".ply": ply_with, ".obj": obj_with, ".stl": stl_with}


def converted_from(folder, source, text):
    """Read a file with *text* in it, and write it in every format; each can be read."""
    path = folder / f"given{source}"
    path.write_bytes(MAKERS[source](text))
    given_ = read_polydata(path)
    for suffix in FORMATS:
        write_mesh(folder / f"b{suffix}", given_)
        again = read_polydata(folder / f"b{suffix}")
        assert again.n_points == given_.n_points
        assert "\0" not in json.dumps(repr(contents(again)).replace("\\x00", "\0"))


@pytest.mark.parametrize("source", MAKERS)
@pytest.mark.parametrize("text", [b"made\0by hand", b"\x1b[31mr\xe9d", b"%00<&>"])
def test_a_file_with_such_texts_can_be_written_in_every_format(tmp_path, source, text):
    if source == ".obj" and b"\0" in text:
        with pytest.raises(sd.errors.MeshError, match="not text"):
            converted_from(tmp_path, source, text)
        return
    converted_from(tmp_path, source, text)


@pytest.mark.parametrize("text", ["a\0b", "\ud800", "\x1b[0m"])
def test_names_of_a_gltf_file_are_storable(tmp_path, text):
    path = gltf_with(text).save(tmp_path / "given.gltf")
    given_ = read_polydata(path)
    for suffix in (".glb", ".obj", ".vtp"):
        write_mesh(tmp_path / f"b{suffix}", given_)
        assert read_polydata(tmp_path / f"b{suffix}").n_points == 6


def test_texts_with_lone_surrogates_do_not_abort_the_process():
    surface = cube()
    set_names(surface, "notes", ["\ud800", "a\0b"])
    assert contents(surface)["Field", "notes"] == ["?", "a_b"]


def storable_once(text):
    """Return what is left of a text in every format: names that are equal then become one."""
    raw = text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass")
    return " ".join(storable(raw).split())


ANY = st.sampled_from(TEXTS) | st.text(max_size=12) | st.binary(max_size=12)


@pytest.mark.campaign
@pytest.mark.parametrize("suffix", FORMATS)
def test_any_texts_are_read_back_or_reported(tmp_path, suffix):
    @settings(
        deadline=None, derandomize=True, max_examples=300,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(
        place=st.sampled_from(PLACES),
        texts=st.lists(ANY, min_size=1, max_size=3, unique_by=storable_once),
    )
    def each(place, texts):
        surface = cube()
        place(surface, texts)
        assert changed(tmp_path, suffix, surface) == []

    each()
