"""Session files: bitwise identical after loading; damaged files raise a SessionError."""

from __future__ import annotations

import functools
import io
import json
import os
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scenes import sausage
from solids import OCTAHEDRON, TETRAHEDRON

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.errors import SegDeformError, SessionError
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session.session import Session
from vtk_segdeform.session.state import Options, State
from vtk_segdeform.session.store import load_session, save_session

SCENE = sausage(2, is_coarse=True)
pytestmark = pytest.mark.usefixtures("bound_once")


def posed() -> Session:
    """Return a session with regions, cages, fixed vertices, handles and a pose."""
    options = Options(n_cage_vertices=77, offset=0.25, stretch=2.5, rotation_groups=250)
    session = Session(SCENE.mesh, state=State(options=options))
    session.set_regions(Regions(SCENE.mesh, SCENE.regions.membership, smoothness=1.5))
    session.set_cages(SCENE.cages)
    session.painting.rename(1, "左腕 \N{WOMAN}\N{ZERO WIDTH JOINER}\N{MICROSCOPE}")
    session.set_fixed(SCENE.fixed[::-1])
    session.handles.add(SCENE.handle, "the tip · 1")
    session.handles.add(np.abs(SCENE.mesh.vertices[:, 0]) < 0.1)
    session.move_handle("the tip · 1", np.diag([1.0, 0.9, 1.1, 1.0]), max_steps=3)
    session.commit()
    return session


def tiny(pose: bool = True) -> Session:
    """Return a session of six vertices, small enough to damage its file at every byte."""
    session = Session(Mesh(*OCTAHEDRON))
    session.set_regions(Regions.single(session.mesh))
    session.set_cages([Cage(4.0 * TETRAHEDRON[0], TETRAHEDRON[1])])
    session.set_fixed([1])
    session.handles.add([0], "h")
    if pose:
        session.drag(session.targets["h"] + [0.2, 0.1, 0.0], max_steps=2)
    return session


def pulled() -> Session:
    """Return a tiny session in which a point was pulled."""
    session = tiny()
    session.pull(2, session.vertices[2] + [0.1, 0.2, 0.0], locality=0.0, max_steps=2)
    session.commit()
    session.pull(2, session.vertices[2] + [0.0, 0.1, 0.0], locality=1.0, max_steps=2)
    return session


@functools.cache
def shared(make: Callable[[], Session]) -> Session:
    """Return what *make* returns, the same session for all tests: not to be changed."""
    return make()


def same(a: Session, b: Session) -> bool:
    """Return whether two sessions are equal."""
    one, other = a.state, b.state
    arrays = [(a.mesh.vertices, b.mesh.vertices), (a.mesh.faces, b.mesh.faces)]
    arrays += [(a.vertices, b.vertices), (one.fixed, other.fixed)]
    arrays += [(one.regions.membership, other.regions.membership)]
    arrays += [(p.vertices, q.vertices) for p, q in zip(one.cages, other.cages, strict=True)]
    arrays += [(p.faces, q.faces) for p, q in zip(one.cages, other.cages, strict=True)]
    arrays += list(zip(a.cage_vertices, b.cage_vertices, strict=True))
    arrays += [(one.handles[name], other.handles.get(name)) for name in one.handles]
    arrays += [(a.targets[name], b.targets.get(name)) for name in one.handles]
    return (
        all(np.array_equal(p, q) for p, q in arrays)
        and list(one.handles) == list(other.handles)
        and (one.pose is None) == (other.pose is None)
        and one.options == other.options
        and a.painting.names == b.painting.names
        and one.regions.smoothness == other.regions.smoothness
        and one.pulls == other.pulls
        and locality(a) == locality(b)
    )


def locality(session: Session) -> list[object]:
    """Return the locality of a session in a form that can be compared."""
    last = session.state.locality
    if last is None:
        return []
    kept = np.concatenate(last.cage_vertices)
    return [last.point, last.reach, last.spread, last.follows, kept.tobytes()]


def saved(session: Session, folder: Path) -> bytes:
    save_session(folder / "saved.npz", session)
    return (folder / "saved.npz").read_bytes()


@pytest.mark.parametrize(
    "make",
    [posed, functools.partial(tiny, pose=False), tiny, pulled],
    ids=["all", "rest", "tiny", "pulled"],
)
def test_what_is_loaded_is_what_was_saved(make, tmp_path):
    session = shared(make)
    content = saved(session, tmp_path)
    loaded = load_session(tmp_path / "saved.npz")
    assert same(session, loaded)
    assert not loaded.history.can_undo
    save_session(str(tmp_path / "again"), loaded)
    assert (tmp_path / "again").read_bytes() == content
    assert sorted(os.listdir(tmp_path)) == ["again", "saved.npz"]


def test_a_file_without_names_as_older_programs_wrote_it_is_read_as_before(tmp_path):
    content = saved(shared(posed), tmp_path)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        header = json.loads(archive.read("header.json"))
    assert header.pop("region_names") == ["", shared(posed).painting.names[1]]
    assert header["version"] == 1  # older programs read files with names, too
    nameless = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(nameless, "w") as new:
        for name in old.namelist():
            new.writestr(name, json.dumps(header) if name == "header.json" else old.read(name))
    (tmp_path / "old.npz").write_bytes(nameless.getvalue())
    loaded = load_session(tmp_path / "old.npz")
    assert loaded.painting.names == ("region 1", "region 2")
    loaded.painting.rename(1, shared(posed).painting.names[1])
    assert same(loaded, shared(posed))


def refuse(content: bytes, folder: Path) -> str:
    """Return the message of the error for a file with *content*."""
    (folder / "broken.npz").write_bytes(content)
    with pytest.raises(SegDeformError, match=r"broken\.npz: is not a readable session") as caught:
        load_session(folder / "broken.npz")
    return str(caught.value)


def test_a_truncated_file_is_refused_at_every_length(tmp_path):
    for content in (saved(shared(tiny), tmp_path), saved(shared(posed), tmp_path)):
        for length in np.linspace(0, len(content) - 1, 60).astype(int):
            refuse(content[:length], tmp_path)


def test_a_flipped_bit_is_an_error_or_makes_no_difference(tmp_path):
    content = saved(shared(tiny), tmp_path)
    rng = np.random.default_rng(1)
    refused = 0
    for place in rng.choice(len(content), 100, replace=False):
        broken = bytearray(content)
        broken[place] ^= 1 << rng.integers(8)
        (tmp_path / "broken.npz").write_bytes(broken)
        try:
            loaded = load_session(tmp_path / "broken.npz")
        except SessionError:
            refused += 1
        else:
            assert same(loaded, shared(tiny))
    assert refused > 60


def test_other_archives_missing_files_and_folders_are_refused(tmp_path):
    np.savez(tmp_path / "arrays.npz", a=np.arange(3))
    with pytest.raises(SessionError, match=r"arrays\.npz: .*header\.json is missing"):
        load_session(tmp_path / "arrays.npz")
    with pytest.raises(SessionError, match="there is no such file"):
        load_session(tmp_path / "none.npz")
    with pytest.raises(SessionError, match="is a folder, not a file"):
        load_session(tmp_path)


def rewritten(content: bytes, *, compress: bool = False, **changes) -> bytes:
    """Return the archive with the members in *changes* replaced; header entries are a dict."""
    written = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(written, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            stem = name.partition(".")[0]
            if stem == "header":
                data = json.dumps({**json.loads(data), **changes.get("header", {})}).encode()
            elif stem in changes:
                buffer = io.BytesIO()
                np.save(buffer, changes[stem], allow_pickle=True)
                data = buffer.getvalue()
            kind = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
            new.writestr(name, data, kind)
    return written.getvalue()


HUGE = 1 << 61
WRONG = [
    ({"header": {"version": 6}}, "version 6 is newer than 5; update vtk_segdeform"),
    ({"header": {"version": 0}}, "version must be at least 1; got 0"),
    ({"header": {"format": "something else"}}, "does not contain the format"),
    ({"header": {"n_vertices": 10**30}}, "mesh_vertices must be float64 of shape"),
    ({"header": {"n_regions": 10**12}}, "membership must be bool of shape"),
    ({"header": {"cages": [[HUGE, HUGE]]}}, "cage_vertices must be"),
    ({"header": {"cages": [4, 4]}}, r"cages\[0\] must be a list of 2"),
    ({"header": {"handles": [["h", 1], ["h", 0]]}}, "two handles have the same name"),
    ({"header": {"handles": [["h", 1], ["i", 0]]}}, "each handle must have at least one vertex"),
    ({"header": {"smoothness": -1}}, "smoothness must be a number above 0"),
    ({"header": {"options": {"stretch": -1.0}}}, "stretch must be a number of at least 0"),
    ({"header": {"options": {"colour": 1}}}, "colour"),
    ({"mesh_vertices": np.full((6, 3), np.nan)}, "NaN|non-finite|not finite"),
    ({"mesh_vertices": OCTAHEDRON[0].astype(np.float32)}, "must be float64 of shape"),
    ({"mesh_faces": OCTAHEDRON[1][:, ::-1]}, "inside-out"),
    ({"membership": np.zeros((1, 6), bool)}, "no vertices"),
    ({"membership": np.full((1, 6), 7, np.uint8).view(bool)}, "neither true nor false"),
    ({"cage_vertices": 0.1 * TETRAHEDRON[0]}, "outside the cage"),
    ({"fixed": np.array([0])}, "both fixed and handle"),
    ({"pose": np.full((4, 3), 1e300)}, "the pose is damaged: it is .* away"),
    ({"header": {"region_names": ["arm", "leg"]}}, "2 names for 1 regions"),
    ({"header": {"region_names": ["a\0b"]}}, "name must be printable text"),
    ({"header": {"posed": "yes"}}, "posed must be true or false"),
    ({"header": {"pulls": [[]]}}, r"pulls\[0\] must be text"),
    ({"header": {"fixed_in_pose": True}}, "fixed_at.npy is missing"),
    ({"header": {"pivots": {"h": [0.0, 0.0, 1e9]}}}, "pivot of h is .* away"),
    ({"header": {"locality": [99, None, 0.1, 0.5]}}, "0 to 5; got 99"),
    ({"header": {"pulled_point": [[0, 1], [0.5, 0.6]]}}, "must have positive shares"),
    ({"header": {"locality": [2, -1.0, 0.1, 0.5]}}, "radius of a pull must be positive"),
    ({"header": {"locality": [2, None, 0.1, 1.5]}}, "follows must be from 0 to 1"),
]


@pytest.mark.parametrize(("change", "says"), WRONG)
def test_a_file_that_was_tampered_with_is_refused_and_the_fault_named(change, says, tmp_path):
    of_pulls = {"locality", "pulls", "pulled_point"} & {*change, *change.get("header", {})}
    content = rewritten(saved(shared(pulled) if of_pulls else shared(tiny), tmp_path), **change)
    assert re.search(says, refuse(content, tmp_path))


def test_arrays_in_another_order_of_bytes_are_refused_and_of_axes_understood(tmp_path):
    content = saved(shared(tiny), tmp_path)
    columns = np.asfortranarray(OCTAHEDRON[0])
    (tmp_path / "a.npz").write_bytes(rewritten(content, mesh_vertices=columns))
    assert same(load_session(tmp_path / "a.npz"), shared(tiny))
    swapped = OCTAHEDRON[0].astype(">f8")
    assert "must be float64" in refuse(rewritten(content, mesh_vertices=swapped), tmp_path)


def test_a_pickle_in_a_file_is_never_run(tmp_path):
    class Trap:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "trapped"),)

    trap = np.array([[Trap()] * 3] * 6, dtype=object)
    refuse(rewritten(saved(shared(tiny), tmp_path), mesh_vertices=trap), tmp_path)
    assert not (tmp_path / "trapped").exists()


def test_the_size_is_that_of_the_open_file(tmp_path, monkeypatch):
    path, other = tmp_path / "saved.npz", tmp_path / "other.npz"
    save_session(path, shared(posed))
    save_session(other, shared(tiny))
    real = zipfile.ZipFile

    def exchanged(file, *options):
        if other.exists():
            os.replace(other, path)  # another process saves at this moment
        return real(file, *options)

    monkeypatch.setattr(zipfile, "ZipFile", exchanged)
    assert same(load_session(path), shared(posed))


def sparse(path, size, n):
    """Write a session of *n* vertices to a sparse file of *size* bytes without array data."""
    save_session(path, shared(tiny))
    with zipfile.ZipFile(path) as archive:
        header = json.loads(archive.read("header.json"))
    header |= {"n_vertices": n}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("header.json", json.dumps(header))
    head = path.read_bytes()
    with open(path, "wb") as file:
        file.truncate(size)
        file.seek(size - len(head))
        file.write(head)


@pytest.mark.parametrize("size", [45_000_000_000, 2_200_000_000])
def test_a_sparse_file_of_gigabytes_is_refused_before_it_is_read(tmp_path, monkeypatch, size):
    sparse(tmp_path / "saved.npz", size, size // 48)
    monkeypatch.setattr(zipfile, "ZipFile", None)
    with pytest.raises(SessionError, match=r"saved\.npz: .*has .* GB; the limit is"):
        load_session(tmp_path / "saved.npz")


def test_an_archive_of_very_many_members_is_refused_before_they_are_listed(tmp_path, monkeypatch):
    path = tmp_path / "saved.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for number in range(1500):
            archive.writestr(f"{number:0700d}", b"")
    monkeypatch.setattr(zipfile, "ZipFile", None)
    with pytest.raises(SessionError, match=r"saved\.npz: .*the directory of the archive"):
        load_session(path)


def test_a_session_too_large_to_read_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr("vtk_segdeform.session.archive.LARGEST_FILE", (1 << 20) + 1000)
    with pytest.raises(SessionError, match=r"saved\.npz: cannot be written \(.* bytes exceed"):
        save_session(tmp_path / "saved.npz", shared(posed))
    assert os.listdir(tmp_path) == []


def test_a_view_that_is_no_json_is_refused_by_name(tmp_path):
    view = {"camera": []}
    view["camera"].append(view)
    with pytest.raises(SessionError, match="view must be plain JSON"):
        save_session(tmp_path / "a.segdeform", Session(SCENE.mesh), view=view)
    assert not list(tmp_path.iterdir())
