"""Session files with any value of the header, or any array, replaced: read, or refused by a fault.

A fault that is named by its check differs from an error of Python that was caught by luck: the
cause of a refusal is one of ours, or of reading the archive, never a TypeError.
"""

from __future__ import annotations

import io
import json
import zipfile
from itertools import cycle

import numpy as np
import pytest
import pyvista as pv
from given_surfaces import tube
from scenes import sausage
from solids import OCTAHEDRON
from vtkmodules.vtkCommonCore import vtkStringArray

import vtk_segdeform as sd
from vtk_segdeform.errors import SessionError
from vtk_segdeform.session.store import load_session, save_session, saved_view

VALUES = [
    None, True, False, 0, 1, 5, -1, 2**70, 1.5, -0.0, 1e308, float("nan"), float("inf"), "", "x",
    "a" * 300, "a\0b", "\ud800", [], [1], [[1]], [None], [["x", 1]], {}, {"a": 1}, {"x": [1]},
]  # fmt: skip
MISSING = object()


def posed() -> sd.Session:
    """Return a small session with everything that a header can have, but a surface."""
    scene = sausage(1)
    session = sd.Session(sd.Mesh(*OCTAHEDRON))
    session.set_regions(sd.Regions.single(session.mesh))
    session.set_cages([sd.Cage(scene.cages[0].vertices, scene.cages[0].faces)])
    session.painting.rename(0, "all")
    session.set_fixed([1])
    session.handles.add([0], "h")
    session.drag(session.targets["h"] + [0.2, 0.1, 0.0], max_steps=2)
    session.pull(2, session.vertices[2] + [0.1, 0.2, 0.0], locality=0.5, max_steps=2)
    session.commit()
    session.handles.set_pivot("h", session.mesh.vertices[0] + 0.1)
    session.finish()
    session.set_fixed([1, 3])
    return session


def given() -> sd.Session:
    """Return a session of a small surface with arrays of every kind."""
    surface = tube(8, 4)
    for name in list(surface.cell_data):
        del surface.cell_data[name]
    surface.lines = [2, 0, 1]
    surface.point_data["number"] = np.arange(float(surface.n_points))
    surface.cell_data["flag"] = np.arange(surface.n_cells) % 2 == 0
    surface.field_data["table"] = np.ones((3, 5))
    surface.field_data["complex"] = np.ones(3, dtype="c8")
    names = vtkStringArray()
    names.SetName("names")
    for text in ("one", "two"):
        names.InsertNextValue(text)
    surface.GetFieldData().AddArray(names)
    surface.GetPointData().AddArray(pv.convert_array(np.arange(surface.n_points)))  # no name
    return sd.Session(sd.Surface(surface))


MAKERS = {"posed": posed, "given": given}


@pytest.fixture(scope="module", params=MAKERS)
def members(request, tmp_path_factory):
    """Return the header of a session file, and its other members by name."""
    path = tmp_path_factory.mktemp("sound") / "a.segdeform"
    save_session(path, MAKERS[request.param](), view={"camera": [1, 2]})
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    return json.loads(content.pop("header.json")), content


def places(value, path=()):
    """Yield the path of every value in a value of JSON."""
    yield path
    keys = value if isinstance(value, dict) else range(len(value) if isinstance(value, list) else 0)
    for key in keys:
        yield from places(value[key], (*path, key))


def replaced(header, path, new):
    if not path:
        return new
    header = json.loads(json.dumps(header))
    inner = header
    for key in path[:-1]:
        inner = inner[key]
    if new is MISSING:
        del inner[path[-1]]
    else:
        inner[path[-1]] = new
    return header


def require_read_or_refused(path, header, content):
    """Write a session file and read it; return whether it was refused."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("header.json", json.dumps(header))
        for name, data in content.items():
            archive.writestr(name, data)
    assert isinstance(saved_view(path), dict)
    refusal = refusal_of(path)
    if refusal is None:
        assert np.isfinite(load_session(path).vertices).all()
    return refusal is not None


def refusal_of(path):
    """Return the error by which a session file is refused, with a cause of ours; None if read."""
    try:
        load_session(path)
    except SessionError as error:
        refusal = error
    else:
        return None
    assert path.name in str(refusal)
    assert not isinstance(refusal.__cause__, TypeError | LookupError | AttributeError)
    return refusal


def every_change(header):
    for path in places(header):
        for new in [*VALUES, MISSING] if path else VALUES:
            yield path, new


def test_a_header_with_a_value_of_another_kind_is_read_or_refused(tmp_path, members):
    header, content = members
    values, refused = cycle([*VALUES, MISSING]), 0
    for path in [*places(header)][::2]:  # all of them in the campaign
        new = next(values)
        if path or new is not MISSING:
            damaged = replaced(header, path, new)
            refused += require_read_or_refused(tmp_path / "a.segdeform", damaged, content)
    assert refused > 10


@pytest.mark.parametrize(
    ("path", "new"),
    [
        (("surface", "active"), 5), (("surface", "active"), [1]), (("surface", "cells"), 5),
        (("surface", "active", "point_data"), "a" * 300),  # VTK would read outside its arrays
        (("surface", "active", "point_data"), ["number"] * 300),
        (("surface", "active", "point_data", 2), "number"),
        (("surface", "arrays", 0, 1), "\ud800"), (("surface", "arrays", 0, 3), []),
        (("surface", "workarounds"), [["a", 0, "HOLES", 0]]), (("surface",), 5),
    ],
)  # fmt: skip
@pytest.mark.parametrize("members", ["given"], indirect=True)
def test_a_surface_that_was_tampered_with_is_refused(tmp_path, members, path, new):
    header, content = members
    assert require_read_or_refused(tmp_path / "a.segdeform", replaced(header, path, new), content)


def other_arrays(data):
    """Yield the bytes of arrays of other shapes, types and values than the one in *data*."""
    array = np.load(io.BytesIO(data))
    for dtype in ("<f8", ">f8", "<f4", "<i8", "<i4", "u1", "?", "<c16", "U3", "M8[s]", "V8"):
        if np.dtype(dtype) != array.dtype:
            yield np.zeros(array.shape, dtype=dtype)
    yield array[..., None]
    yield array.reshape(-1)[:0]
    yield array.reshape(-1)
    yield np.concatenate([array, array])
    yield array[:-1]
    for value in (0, 1, -1, 2**62, np.nan, np.inf, 1e300):
        if array.dtype.kind == "f" or not isinstance(value, float):
            with np.errstate(all="ignore"):
                changed = array.copy()
                changed.reshape(-1)[-1:] = np.array(value).astype(array.dtype)
                yield changed
                yield np.full_like(array, np.array(value).astype(array.dtype))


def bytes_of(array):
    stored = io.BytesIO()
    np.save(stored, array)
    return stored.getvalue()


def test_an_array_of_another_shape_type_or_value_is_read_or_refused(tmp_path, members):
    header, content = members
    refused = 0
    for k, (name, data) in enumerate(content.items()):
        others = list(other_arrays(data))
        for other in others[k % 3 :: 16]:
            damaged = content | {name: bytes_of(other)}
            refused += require_read_or_refused(tmp_path / "a.segdeform", header, damaged)
    assert refused > 20


def test_a_description_of_an_array_that_is_cut_off_is_refused(tmp_path, members):
    header, content = members
    for letter in (b"\0", b"(", b"'"):
        data = content["fixed.npy"].replace(b"}", letter, 1)
        assert data != content["fixed.npy"]
        damaged = content | {"fixed.npy": data}
        assert require_read_or_refused(tmp_path / "a.segdeform", header, damaged)


@pytest.mark.campaign
def test_every_value_and_every_array_replaced_by_every_other(tmp_path, members):
    header, content = members
    path = tmp_path / "a.segdeform"
    for where, new in every_change(header):
        require_read_or_refused(path, replaced(header, where, new), content)
    for name, data in content.items():
        for other in other_arrays(data):
            require_read_or_refused(path, header, content | {name: bytes_of(other)})
        without = {key: value for key, value in content.items() if key != name}
        require_read_or_refused(path, header, without)
        for at in range(min(len(data), 128)):  # the header of the array
            for letter in b"\0(,{'9-":
                damaged = data[:at] + bytes([letter]) + data[at + 1 :]
                require_read_or_refused(path, header, content | {name: damaged})


@pytest.mark.campaign
def test_any_damage_of_the_archive_is_refused_or_harmless(tmp_path, members):
    header, content = members
    path, rng = tmp_path / "a.segdeform", np.random.default_rng(5)
    require_read_or_refused(path, header, content)
    sound = path.read_bytes()
    for _ in range(3000):
        broken = bytearray(sound)
        start = len(sound) - 4000 if rng.random() < 0.7 else 0  # the directory
        for place in rng.integers(start, len(sound), rng.integers(1, 4)):
            broken[place] = rng.integers(256)
        path.write_bytes(broken)
        refusal_of(path)


def test_a_compressed_member_is_refused_before_it_is_unpacked(tmp_path, members):
    header, content = members
    with zipfile.ZipFile(tmp_path / "a.segdeform", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.json", json.dumps(header) + " " * 50_000_000)
        for name, data in content.items():
            archive.writestr(name, data)
    with pytest.raises(SessionError, match=r"header\.json is compressed"):
        load_session(tmp_path / "a.segdeform")
