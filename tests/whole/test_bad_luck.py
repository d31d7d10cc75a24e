"""Kills, full disks, cancelling at any moment, listeners that raise: what is there stays whole.

A disk that is full at byte n is made by a limit on the size of files, which the system itself
enforces, also on native code that writes.
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

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"
posix = pytest.mark.skipif(sys.platform != "linux", reason="needs fork and limits")
SUFFIXES = [".ply", ".obj", ".off", ".stl", ".vtk", ".vtp"]
FOREIGN = [".dae", ".ctm", ".x3d", ".wrl", ".3ds"] if meshlab.available() else []


def killed(folder, count, seed):
    """Return what `killed_saver` counted."""
    done = subprocess.run(
        [sys.executable, SUPPORT / "killed_saver.py", folder, str(count), str(seed)],
        capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": f"{SUPPORT}:{ROOT}:{Path(__file__).parent}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return {what: int(number) for number, what in re.findall(r"(\d+) ([a-z ]+)", done.stdout)}


@posix
def test_a_save_that_is_killed_leaves_the_old_file_or_the_new(tmp_path):
    found = killed(tmp_path, 40, seed=1)
    assert found["old"] + found["new"] == 40
    assert found["killed while writing"] > 0  # or nothing was tested


@posix
@pytest.mark.campaign
def test_a_thousand_killed_saves_lose_no_file(tmp_path):
    found = killed(tmp_path, 1000, seed=2)
    print(f"\n1000 kills: {found}")
    assert found["old"] + found["new"] == 1000
    assert found["killed while writing"] > 200


@contextmanager
def room_for(size):
    """Let no file grow beyond *size* bytes."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def kept(folder):
    """Return all files by name, with what is in them."""
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def require_kept_on_a_full_disk(folder, suffix):
    """Assert that a mesh stays as it was, whatever room there is for the next one."""
    path = folder / f"a{suffix}"
    larger = sd.Mesh(*icosphere(2))
    write_mesh(path, larger)
    size = path.stat().st_size
    write_mesh(path, sd.Mesh(*OCTAHEDRON))
    before = kept(folder)
    nearly = [] if suffix in FOREIGN else [size - 1]  # which is as good as all, in some formats
    for room in (0, 100, size // 2, *nearly):
        with room_for(room), pytest.raises(MeshError, match=rf"a\{suffix}: cannot be written"):
            write_mesh(path, larger)
        assert kept(folder) == before, room
    write_mesh(path, larger)
    assert kept(folder) != before


@posix
@pytest.mark.parametrize("suffix", SUFFIXES + FOREIGN)
def test_on_a_full_disk_a_mesh_is_as_it_was_and_the_error_names_it(tmp_path, suffix, capfd):
    here = os.getcwd()
    require_kept_on_a_full_disk(tmp_path, suffix)
    assert os.getcwd() == here  # PyMeshLab goes elsewhere when it fails
    capfd.readouterr()


@posix
def test_on_a_full_disk_the_same_is_true_of_vtkhdf(tmp_path):
    call = "import pathlib, sys, test_bad_luck as t; "  # HDF5 complains again when a program ends
    call += "t.require_kept_on_a_full_disk(pathlib.Path(sys.argv[1]), '.vtkhdf')"
    done = subprocess.run(
        [sys.executable, "-c", call, tmp_path],
        capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": f"{SUPPORT}:{ROOT}:{Path(__file__).parent}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@posix
def test_on_a_full_disk_a_session_is_as_it_was_at_whatever_byte(tmp_path):
    path = tmp_path / "a.segdeform"
    session = sd.Session(sd.Mesh(*icosphere(2)))
    sd.save_session(path, session)
    size = path.stat().st_size
    sd.save_session(path, sd.Session(sd.Mesh(*OCTAHEDRON)))
    before = kept(tmp_path)
    for room in np.linspace(0, size - 1, 40).astype(int):
        with room_for(int(room)), pytest.raises(SessionError, match="cannot be written"):
            sd.save_session(path, session)
        assert kept(tmp_path) == before


@posix
def test_on_a_full_disk_a_project_is_as_it_was(tmp_path):
    path = tmp_path / "a.mlp"
    write_project(path, sd.Mesh(*OCTAHEDRON))
    before = kept(tmp_path)
    for room in (0, 100, 2000):
        with room_for(room), pytest.raises(MeshError, match="cannot be written"):
            write_project(path, sd.Mesh(*icosphere(2)))
        assert {name: data for name, data in kept(tmp_path).items() if name in before} == before
        assert len(read_project(path)) == 1


def refused(*_args, **_options):
    raise PermissionError(13, "Permission denied")


@pytest.mark.parametrize("call", ["os.open", "os.replace", "os.fsync"])
def test_without_permission_nothing_changes_and_the_error_says_so(tmp_path, monkeypatch, call):
    session, mesh = sd.Session(sd.Mesh(*OCTAHEDRON)), sd.Mesh(*icosphere(1))
    path, surface = tmp_path / "a.segdeform", tmp_path / "a.ply"
    sd.save_session(path, session)
    write_mesh(surface, session.mesh)
    before = kept(tmp_path)
    monkeypatch.setattr(call, refused)
    with pytest.raises(SessionError, match="Permission denied"):
        sd.save_session(path, sd.Session(mesh))
    with pytest.raises(MeshError, match="Permission denied"):
        write_mesh(surface, mesh)
    assert kept(tmp_path) == before


@lru_cache(maxsize=1)
def work():
    """Return a session that can do everything, at work, and what can be cancelled in it."""
    scene = sausage(2)
    session = sd.Session(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session.change_options(n_cage_vertices=60)
    session.set_fixed(scene.fixed)
    session.add_handle(scene.handle, "tip")
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
    """Cancel *job* at its report number *moment*; return whether it got there."""
    session, reports = work(), iter(range(10**6))
    before, label = session.state, session.undo_label

    def stop(_fraction, _text):
        if next(reports) == moment:
            raise Cancelled("enough")

    try:
        JOBS[job](session, stop)
    except Cancelled:
        assert session.state is before
        assert session.undo_label == label
        assert not session.is_dragging
        return True
    if session.state is not before:
        session.undo()
        assert session.state is before
    return False


@pytest.mark.parametrize("job", JOBS)
def test_cancelling_at_any_moment_leaves_the_session_as_it_was(job):
    moments = np.random.default_rng(0).permutation(12)[:3]
    assert cancelled_at(job, 0)
    for moment in moments:
        cancelled_at(job, int(moment))


@pytest.mark.campaign
@pytest.mark.parametrize("job", JOBS)
def test_cancelling_at_every_moment_leaves_the_session_as_it_was(job):
    moment = 0
    while cancelled_at(job, moment):
        moment += 1
    print(f"\n{job}: cancelled at {moment} moments")


def test_a_session_works_on_while_all_its_listeners_raise():
    session = sd.Session(work().mesh, state=work().state)
    stops = [session.on_change(raising) for _ in range(3)]
    pose = session.vertices.copy()
    steps = [
        lambda: session.drag(dict(session.targets), max_steps=1),
        session.commit,
        lambda: session.set_fixed([1, 2]),
        lambda: session.add_handle([7, 8]),
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
    while session.undo_label:
        session.undo()
    assert np.allclose(session.vertices, pose, atol=1e-6)


def raising(_change):
    raise ZeroDivisionError


def test_a_progress_that_raises_something_else_leaves_the_session_as_it_was_too():
    session = work()
    before = session.state
    for job in ("segment", "fit", "bind"):
        with pytest.raises(ZeroDivisionError):
            JOBS[job](session, lambda *_: 1 // 0)
        assert session.state is before
    with pytest.raises(SegDeformError):
        session.drag({"no such handle": np.zeros((1, 3))})
    assert session.state is before
