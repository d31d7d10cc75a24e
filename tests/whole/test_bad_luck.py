"""Kills, full disks, cancellation and failing listeners leave files and sessions intact.

A limit on the size of files simulates a disk that is full at byte n; the system enforces it for
native code as well.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scenes import sausage
from solids import OCTAHEDRON, icosphere

import vtk_segdeform as sd
from vtk_segdeform.errors import Cancelled, MeshError, SegDeformError, SessionError
from vtk_segdeform.io import meshlab
from vtk_segdeform.io.convert import write_mesh
from vtk_segdeform.io.meshlab_project import read_project, write_project

pytestmark = pytest.mark.usefixtures("bound_once_in_memory")
ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"
posix = pytest.mark.skipif(sys.platform != "linux", reason="needs fork and limits")
SUFFIXES = [".ply", ".obj", ".off", ".stl", ".vtk", ".vtp"]
FOREIGN = [".dae", ".ctm", ".x3d", ".wrl", ".3ds"] if meshlab.available() else []


def killed(folder, count, seed):
    """Return the counts of `killed_saver`."""
    done = subprocess.run(
        [sys.executable, SUPPORT / "killed_saver.py", folder, str(count), str(seed)],
        capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": f"{SUPPORT}:{ROOT}:{Path(__file__).parent}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return {what: int(number) for number, what in re.findall(r"(\d+) ([a-z ]+)", done.stdout)}


@posix
def test_a_save_that_is_killed_leaves_the_old_file_or_the_new(tmp_path):
    found = killed(tmp_path, 12, seed=1)
    assert found["old"] + found["new"] == 12
    assert found["killed while writing"] > 0  # otherwise nothing was tested


@posix
@pytest.mark.campaign
def test_a_thousand_killed_saves_lose_no_file(tmp_path):
    found = killed(tmp_path, 1000, seed=2)
    print(f"\n1000 kills: {found}")
    assert found["old"] + found["new"] == 1000
    assert found["killed while writing"] > 200


@contextmanager
def limited_to(size):
    """Limit files to *size* bytes."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def contents(folder):
    """Return the contents of all files, by name."""
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def require_kept_on_a_full_disk(folder, suffix):
    """Check that a mesh file is unchanged if there is not enough space for its replacement."""
    path = folder / f"a{suffix}"
    larger = sd.Mesh(*icosphere(2))
    write_mesh(path, larger)
    size = path.stat().st_size
    write_mesh(path, sd.Mesh(*OCTAHEDRON))
    before = contents(folder)
    nearly = [] if suffix in FOREIGN else [size - 1]  # in other formats the last byte is optional
    for space in (0, 100, size // 2, *nearly):
        with limited_to(space), pytest.raises(MeshError, match=rf"a\{suffix}: cannot be written"):
            write_mesh(path, larger)
        assert contents(folder) == before, space
    write_mesh(path, larger)
    assert contents(folder) != before


@posix
@pytest.mark.parametrize(
    "suffix",
    [
        *SUFFIXES,
        *(pytest.param(each, marks=pytest.mark.campaign) for each in FOREIGN),
    ],
)
def test_on_a_full_disk_a_mesh_file_is_unchanged_and_the_error_names_it(tmp_path, suffix, capfd):
    here = os.getcwd()
    require_kept_on_a_full_disk(tmp_path, suffix)
    assert os.getcwd() == here  # PyMeshLab changes the folder when it fails
    capfd.readouterr()


@posix
@pytest.mark.campaign
def test_on_a_full_disk_a_vtkhdf_file_is_unchanged(tmp_path):
    call = "import pathlib, sys, test_bad_luck as t; "  # HDF5 prints again at exit
    call += "t.require_kept_on_a_full_disk(pathlib.Path(sys.argv[1]), '.vtkhdf')"
    done = subprocess.run(
        [sys.executable, "-c", call, tmp_path],
        capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": f"{SUPPORT}:{ROOT}:{Path(__file__).parent}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@posix
def test_on_a_disk_that_is_full_at_any_byte_a_session_file_is_unchanged(tmp_path):
    path = tmp_path / "a.segdeform"
    session = sd.Session(sd.Mesh(*icosphere(2)))
    sd.save_session(path, session)
    size = path.stat().st_size
    sd.save_session(path, sd.Session(sd.Mesh(*OCTAHEDRON)))
    before = contents(tmp_path)
    for space in np.linspace(0, size - 1, 40).astype(int):
        with limited_to(int(space)), pytest.raises(SessionError, match="cannot be written"):
            sd.save_session(path, session)
        assert contents(tmp_path) == before


@posix
def test_on_a_full_disk_a_project_is_unchanged(tmp_path):
    path = tmp_path / "a.mlp"
    write_project(path, sd.Mesh(*OCTAHEDRON))
    before = contents(tmp_path)
    for space in (0, 100, 2000):
        with limited_to(space), pytest.raises(MeshError, match="cannot be written"):
            write_project(path, sd.Mesh(*icosphere(2)))
        assert {name: data for name, data in contents(tmp_path).items() if name in before} == before
        assert len(read_project(path)) == 1


def deny(*_args, **_options):
    raise PermissionError(13, "Permission denied")


@pytest.mark.parametrize("call", ["os.open", "os.replace", "os.fsync"])
def test_without_permission_no_file_changes_and_the_error_says_so(tmp_path, monkeypatch, call):
    session, mesh = sd.Session(sd.Mesh(*OCTAHEDRON)), sd.Mesh(*icosphere(1))
    path, surface = tmp_path / "a.segdeform", tmp_path / "a.ply"
    sd.save_session(path, session)
    write_mesh(surface, session.mesh)
    before = contents(tmp_path)
    monkeypatch.setattr(call, deny)
    with pytest.raises(SessionError, match="Permission denied"):
        sd.save_session(path, sd.Session(mesh))
    with pytest.raises(MeshError, match="Permission denied"):
        write_mesh(surface, mesh)
    assert contents(tmp_path) == before


@lru_cache(maxsize=1)
def posed_session():
    """Return a session with regions, cages, a handle and a pose."""
    scene = sausage(2)
    session = sd.Session(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session.change_options(n_cage_vertices=60)
    session.set_fixed(scene.fixed)
    session.handles.add(scene.handle, "tip")
    session.drag({"tip": scene.turned(10)}, max_steps=3)
    session.commit()
    return session


JOBS = {
    "segment": lambda session, progress: session.segment(3, progress=progress),
    "fit": lambda session, progress: session.fit_cages(progress),
    "bind": lambda session, progress: sd.Session(
        session.mesh, state=session.state
    ).bind(progress),
    "deform": lambda session, progress: sd.deform(
        session.mesh, session.fixed, [5], session.mesh.vertices[[5]], progress=progress,
        n_cage_vertices=60,
    ),
}  # fmt: skip


def cancelled_at(job, moment):
    """Cancel *job* at its progress report number *moment*; return whether it made that report."""
    session, reports = posed_session(), iter(range(10**6))
    before, label = session.state, session.history.undo_label

    def stop(_fraction, _text):
        if next(reports) == moment:
            raise Cancelled("stop")

    try:
        JOBS[job](session, stop)
    except Cancelled:
        assert session.state is before
        assert session.history.undo_label == label
        assert not session.is_dragging
        return True
    if session.state is not before:
        session.undo()
        assert session.state is before
    return False


@pytest.mark.parametrize("job", JOBS)
def test_cancelling_at_some_moments_leaves_the_session_unchanged(job):
    moments = np.random.default_rng(0).permutation(12)[:3]
    assert cancelled_at(job, 0)
    for moment in moments:
        cancelled_at(job, int(moment))


@pytest.mark.campaign
@pytest.mark.parametrize("job", JOBS)
def test_cancelling_at_every_moment_leaves_the_session_unchanged(job):
    moment = 0
    while cancelled_at(job, moment):
        moment += 1
    print(f"\n{job}: cancelled at {moment} moments")


def test_a_session_works_although_all_its_listeners_raise():
    session = sd.Session(posed_session().mesh, state=posed_session().state)
    stops = [session.on_change(raising) for _ in range(3)]
    pose = session.vertices.copy()
    steps = [
        lambda: session.drag(dict(session.targets), max_steps=1),
        session.commit,
        lambda: session.set_fixed([1, 2]),
        lambda: session.handles.add([7, 8]),
        session.undo,
        session.undo,
        session.redo,
        session.reset_pose,
        session.undo,
    ]
    for step in steps:
        with pytest.raises(ZeroDivisionError):
            step()
    for stop in stops:
        stop()
    assert session.fixed.tolist() == [1, 2]
    assert abs(session.volume_change) < 1e-12
    while session.history.undo_label:
        session.undo()
    assert np.allclose(session.vertices, pose, atol=1e-6)


def raising(_change):
    raise ZeroDivisionError


def test_a_progress_callback_that_raises_leaves_the_session_unchanged():
    session = posed_session()
    before = session.state
    for job in ("segment", "fit", "bind"):
        with pytest.raises(ZeroDivisionError):
            JOBS[job](session, lambda *_: 1 // 0)
        assert session.state is before
    with pytest.raises(SegDeformError):
        session.drag({"no such handle": np.zeros((1, 3))})
    assert session.state is before
