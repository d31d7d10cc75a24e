"""Session files give back the surface that was given, bit for bit, or refuse a damaged one."""

from __future__ import annotations

import copy
import io
import json
import pickle
import re
import zipfile

import numpy as np
import pytest
import pyvista as pv
from given_surfaces import GIVEN, require_only_moved, tube
from numpy.testing import assert_array_equal
from vtkmodules.vtkCommonCore import vtkStringArray

from vtk_segdeform.errors import SessionError
from vtk_segdeform.io.surface import Surface
from vtk_segdeform.models import sphere
from vtk_segdeform.session.session import Session
from vtk_segdeform.session.state import Options, State
from vtk_segdeform.session.store import load_session, save_session


def rich() -> pv.PolyData:
    """Return a surface with all kinds of cells and arrays."""
    surface = tube(8, 4)
    surface.lines = [2, 0, 1, 3, 4, 5, 6]
    surface.verts = [1, 3, 1, 2]
    surface.strips = [4, 0, 1, 9, 10]
    for name in surface.cell_data.keys():  # noqa: SIM118 - changed meanwhile
        del surface.cell_data[name]
    rng = np.random.default_rng(0)
    for dtype in ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "c8", "c16"):
        surface.point_data[f"of {dtype}"] = rng.integers(0, 99, surface.n_points).astype(dtype)
    surface.point_data["not a number"] = np.where(surface.points > 0.1, np.nan, -0.0)
    surface.cell_data["chosen"] = rng.random(surface.n_cells) > 0.5
    surface.cell_data["tensor"] = rng.random((surface.n_cells, 9))
    surface.GetCellData().SetActiveTensors("tensor")
    surface.set_active_scalars("of i2")
    surface.set_active_vectors("not a number")
    surface.field_data["table"] = rng.random((3, 5))
    surface.field_data["nothing"] = np.empty(0)
    names = vtkStringArray()
    names.SetName("名")
    for text in ("", "über", "a\0b", "\N{WOMAN}" * 300):
        names.InsertNextValue(text)
    surface.GetFieldData().AddArray(names)
    surface.GetPointData().AddArray(pv.convert_array(np.arange(surface.n_points)))  # no name
    return surface


def reopened(session, folder):
    save_session(folder / "a.segdeform", session)
    return load_session(folder / "a.segdeform")


@pytest.mark.parametrize("name", ["many arrays", "a long text"])
def test_a_surface_too_large_to_read_is_not_written(name, tmp_path, monkeypatch):
    surface = tube(8, 4)
    if name == "many arrays":
        monkeypatch.setattr("vtk_segdeform.session.archive._LONGEST_DIRECTORY", 2000)
        for k in range(20):
            surface.field_data[f"{k}"] = [k]
    else:
        surface.field_data["a" * (1 << 20)] = [0]
    with pytest.raises(SessionError, match=r"cannot be written \(.* bytes of .* exceed the limit"):
        save_session(tmp_path / "a.segdeform", Session(Surface(surface)))
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", [*GIVEN, "rich"])
def test_the_surface_in_a_session_file_is_the_one_that_was_given(name, tmp_path):
    given = rich() if name == "rich" else GIVEN[name]()
    session = Session(Surface(given))
    session.set_fixed(session.mesh.vertices[:, 2] < 0.1)
    loaded = reopened(session, tmp_path)
    content = (tmp_path / "a.segdeform").read_bytes()
    save_session(tmp_path / "b.segdeform", loaded)
    assert (tmp_path / "b.segdeform").read_bytes() == content
    require_only_moved(given, loaded.surface.given)
    for after in (loaded.surface.given, loaded.deformed):
        assert_array_equal(after.points, given.points)
    assert loaded.surface.given.points.dtype == given.points.dtype
    assert loaded.mesh is loaded.surface.mesh
    assert_array_equal(loaded.mesh.vertices, session.mesh.vertices)
    assert_array_equal(loaded.surface.vertex_of, session.surface.vertex_of)
    assert_array_equal(loaded.surface.loose, session.surface.loose)
    one, other = session.surface.workarounds, loaded.surface.workarounds
    assert [(each.kind, each.count, str(each)) for each in one] == [
        (each.kind, each.count, str(each)) for each in other
    ]
    for before, after in zip(one, other, strict=True):
        assert_array_equal(before.points, after.points)
    assert_array_equal(loaded.state.fixed, session.state.fixed)


def test_active_arrays_texts_and_unnamed_arrays_come_back(tmp_path):
    given = rich()
    found = reopened(Session(Surface(given)), tmp_path).surface.given
    assert found.GetPointData().GetScalars().GetName() == "of i2"
    assert found.GetPointData().GetVectors().GetName() == "not a number"
    assert found.GetCellData().GetTensors().GetName() == "tensor"
    assert found.cell_data["chosen"].dtype == bool
    texts = found.GetFieldData().GetAbstractArray("名")
    assert [texts.GetValue(k) for k in range(4)] == ["", "über", "a\0b", "\N{WOMAN}" * 300]
    last = found.GetPointData().GetNumberOfArrays() - 1
    assert found.GetPointData().GetAbstractArray(last).GetName() is None
    assert np.signbit(np.asarray(found.point_data["not a number"])[found.points <= 0.1]).all()


def test_copies_pickles_and_undo_keep_the_surface():
    session = Session(Surface(tube()))
    for other in (copy.deepcopy(session), copy.copy(session), pickle.loads(pickle.dumps(session))):
        require_only_moved(session.surface.given, other.deformed)
        assert other.mesh is other.surface.mesh
    session.set_fixed([0, 1])
    given = session.surface
    session.undo()
    assert session.surface is given


def test_only_sessions_that_earlier_programs_can_read_have_version_1(tmp_path):
    lids = State(options=Options(lids=True))
    for session, version in (
        (Session(sphere(300)), 1),
        (Session(sphere(300), state=lids), 2),
        (Session(Surface(tube()).mesh), 2),
        (Session(Surface(tube())), 2),
    ):
        again = reopened(session, tmp_path)
        with zipfile.ZipFile(tmp_path / "a.segdeform") as archive:
            header = json.loads(archive.read("header.json"))
        assert header["version"] == version
        assert "lids" in header["options"] or version == 1 or session.options.lids is None
        assert again.options == session.options


SMALL = Session(Surface(tube(8, 4)))
P, N = SMALL.surface.given.n_points, SMALL.mesh.n_vertices
HUGE = 1 << 61
WRONG = [
    ({"points": ["f", HUGE]}, "surface_points must be"),
    ({"points": ["f", -1]}, "must be a whole number"),
    ({"points": ["O", P]}, "must have a type"),
    ({"points": ["f4", P]}, "surface_points must be"),
    ({"points": 7}, "points must be a list of 2"),
    ({"cells": {"Polys": [HUGE, HUGE]}}, "must be int64"),
    ({"cells": {"Boxes": [1, 1]}}, "not a kind of cells"),
    ({"arrays": [["secrets", "a", "f8", [1], 1]]}, "not a place of arrays"),
    ({"arrays": [["point_data", 7, "f4", [P, 3], 3]]}, "must be text"),
    ({"arrays": [["point_data", "a", "f4", ["x"], 3]]}, "must be a whole number"),
    ({"arrays": [["point_data", "a", "text", [HUGE, 8], 1]]}, "must be int64|missing"),
    ({"active": {"point_data": [7]}}, "must be text"),
    ({"active": {"field_data": ["a"]}}, "no active arrays"),
    ({"workarounds": [["SEAM?", 1, "text", 0]]}, "SEAM|workarounds"),
    ({"workarounds": [["HOLE", 1, "text", HUGE]]}, "must be int64"),
]


def rewritten(content: bytes, header: dict, arrays: dict) -> bytes:
    written = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(written, "w") as new:
        for name in old.namelist():
            data, stem = old.read(name), name.partition(".")[0]
            if stem == "header":
                whole = json.loads(data)
                whole["surface"] |= header
                data = json.dumps(whole).encode()
            elif stem in arrays:
                buffer = io.BytesIO()
                np.save(buffer, arrays[stem])
                data = buffer.getvalue()
            new.writestr(name, data)
    return written.getvalue()


def refused(folder, header=None, arrays=None) -> str:
    save_session(folder / "good.segdeform", SMALL)
    content = rewritten((folder / "good.segdeform").read_bytes(), header or {}, arrays or {})
    (folder / "bad.segdeform").write_bytes(content)
    with pytest.raises(SessionError) as caught:
        load_session(folder / "bad.segdeform")
    return str(caught.value)


@pytest.mark.parametrize(("change", "says"), WRONG)
def test_a_header_that_was_tampered_with_is_refused(change, says, tmp_path):
    assert re.search(says, refused(tmp_path, header=change))


def test_indices_out_of_range_are_refused_before_vtk_sees_them(tmp_path):
    corners = np.arange(4 * 32)
    ends = np.arange(4, 4 * 33, 4)
    assert "corner of Polys" in refused(tmp_path, arrays={"surface_polys": corners})
    assert "corner of Polys" in refused(tmp_path, arrays={"surface_polys": -corners})
    assert "not in order" in refused(tmp_path, arrays={"surface_polys_ends": ends[::-1].copy()})
    assert "not in order" in refused(tmp_path, arrays={"surface_polys_ends": ends + 4})
    assert "follows no vertex" in refused(tmp_path, arrays={"surface_vertex_of": np.full(P, N)})
    assert "not a point" in refused(
        tmp_path, arrays={"surface_vertex_of": np.zeros(P, dtype=np.int64)}
    )
