"""Texts of any kind, wherever a file has some: what is written can be read, in every format.

Names of arrays and components, texts in arrays, titles, comments, groups, materials and objects are
read back as they were, or a warning says what became of them.  Null characters and invalid bytes
are replaced before any format sees them (`array_names.storable`).
"""

from __future__ import annotations

import logging

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from solids import CUBE
from vtkmodules.vtkCommonCore import vtkStringArray

import vtk_segdeform as sd
from vtk_segdeform.io.array_names import set_names, storable
from vtk_segdeform.io.convert import read_polydata, to_polydata, write_mesh

FORMATS = [".ply", ".obj", ".off", ".stl", ".glb", ".gltf", ".vtp", ".vtu", ".vtk"]
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
