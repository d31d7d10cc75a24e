"""Compilation in the background: what serves meanwhile, and who compiles."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import pytest
from solids import icosphere

from vtk_segdeform import Mesh, Regions, files, fit_cages, sizes
from vtk_segdeform.deformer import Deformer
from vtk_segdeform.interpreter import python_environment
from vtk_segdeform.kernels import compilation, compiled_kernels, dispatch, wait_until_compiled
from vtk_segdeform.kernels.compilation import _stamp, begin, is_pending

pytest.importorskip("numba")
COMPILATION = compilation._CODE
KERNELS = Path(compilation._FOLDER)
# Compiles, in place of the real process, until there is a file "end" beside the stamp.
COMPILER = """
import time; from vtk_segdeform.kernels import compilation as c; from vtk_segdeform import files
stamp = c._stamp()
while (lock := files.hold(stamp.parent / c._LOCK)) is None: time.sleep(0.01)  # the test looks at it
while not (stamp.parent / "end").exists(): time.sleep(0.01)
stamp.touch()  # {}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return an empty folder for numba's cache, in a process that has not called any kernel."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compilation, "_CODE", COMPILER)
    monkeypatch.setattr(compilation, "_started", [])
    monkeypatch.setattr(dispatch, "_does_without", [None])
    _stamp.cache_clear()
    yield tmp_path
    (tmp_path / "end").touch()
    for process in compilation._started:
        process.result()
    _stamp.cache_clear()


def until(condition):
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_equivalents_serve_until_the_next_preparation_after_the_compilation(folder):
    points, faces = icosphere(1)
    mesh = Mesh(points, faces)
    regions = Regions.single(mesh)
    cages = fit_cages(mesh, regions, 20)
    assert compiled_kernels(10**6) is None
    assert dispatch.is_compiling()
    deformer = Deformer(mesh, regions, cages, handle=[0])
    assert compiled_kernels() is None
    assert dispatch.load_early()  # too early
    (folder / "end").touch()
    until(lambda: not is_pending())
    deformer.solve(points[:1] + 0.1)
    assert compiled_kernels() is None  # within a drag nothing changes
    Deformer(mesh, regions, cages)
    assert compiled_kernels() is dispatch._module()
    assert not dispatch.is_compiling()


def test_an_editor_uses_them_when_the_hand_has_rested(folder, monkeypatch):
    kernels = SimpleNamespace(number_trees=lambda _: None)
    monkeypatch.setattr(dispatch, "_module", functools.cache(lambda: kernels))
    monkeypatch.setattr(dispatch, "_is_late", [False])
    dispatch.load_late()
    assert dispatch.is_compiling()
    dispatch.load_for(10**6)
    assert dispatch._is_late[0]  # nothing is loaded yet
    assert compiled_kernels() is None
    (folder / "end").touch()
    until(lambda: not dispatch.load_early())
    until(lambda: not dispatch._is_late[0])
    assert compiled_kernels(sizes.COMPILED) is kernels


def test_whoever_waits_has_them(folder):
    assert compiled_kernels() is None
    (folder / "end").touch()
    wait_until_compiled()
    assert _stamp().exists()
    assert compiled_kernels() is dispatch._module()


def test_without_numba_nothing_is_compiled(folder, monkeypatch):
    monkeypatch.setenv("SEGDEFORM_NUMBA", "0")
    dispatch._is_enabled.cache_clear()
    with monkeypatch.context() as nowhere:
        nowhere.setattr(compilation, "wait", None)
        wait_until_compiled()
    assert compiled_kernels() is None
    assert not dispatch.is_compiling()
    monkeypatch.delenv("SEGDEFORM_NUMBA")
    dispatch._is_enabled.cache_clear()
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    begin()
    assert not is_pending()
    assert not compilation._started


def test_kernels_are_compiled_here_if_the_process_fails_or_cannot_start(folder, monkeypatch):
    monkeypatch.setattr(compilation, "_CODE", "import os; os.kill(os.getpid(), 9)  # {}")
    assert compiled_kernels() is None
    until(lambda: not is_pending())
    dispatch.load_for(1)
    assert compiled_kernels() is dispatch._module()
    compilation._started.clear()
    assert is_pending()
    monkeypatch.setattr(compilation.subprocess, "Popen", lambda *_, **__: os.stat("/nowhere"))
    begin()
    assert not is_pending()


def test_kernels_are_compiled_here_if_no_folder_can_be_written_to(folder, monkeypatch):
    _stamp.cache_clear()
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert compiled_kernels() is dispatch._module()
    assert not compilation._started


def test_the_stamp_is_where_numba_has_its_cache(folder, monkeypatch):
    assert _stamp().parent == folder
    (folder / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder / "file" / "below"))
    _stamp.cache_clear()
    assert _stamp().parent == KERNELS / "__pycache__"


@pytest.mark.parametrize("change", ["source", "time", "processor", "version"])
def test_what_numba_depends_on_is_compiled_again(folder, monkeypatch, change):
    sources = [folder / "a.py", folder / "b.py"]
    for source in sources:
        source.write_text("1")
    monkeypatch.setattr(compilation, "_sources", lambda: sources)
    before = _stamp()
    _stamp.cache_clear()
    assert _stamp() == before
    if change == "source":
        time = sources[1].stat().st_mtime_ns
        sources[1].write_text("12")
        os.utime(sources[1], ns=(time, time))
    elif change == "time":
        os.utime(sources[0], ns=(0, 0))
    elif change == "processor":
        monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    else:
        monkeypatch.setattr(sys, "version", "4")
    _stamp.cache_clear()
    assert _stamp() != before


def test_one_process_compiles_at_a_time_and_another_after_one_that_was_killed(folder):
    other = files.hold(folder / compilation._LOCK)
    begin()
    assert is_pending()
    assert not compilation._started
    os.close(other)
    begin()
    assert len(compilation._started) == 1
    until(lambda: compilation._is_locked(_stamp()))
    begin()
    assert len(compilation._started) == 1


def test_a_process_that_found_another_at_work_is_followed_by_one_that_compiles(folder, monkeypatch):
    with monkeypatch.context() as before:
        before.setattr(compilation, "_CODE", "# {}")
        begin()
        assert compilation._started.pop().result() == 0
        begin()
        (first,) = compilation._started
        first.result()
    assert is_pending()
    begin()
    until(lambda: compilation._is_locked(_stamp()))
    assert compilation._started != [first]


@pytest.fixture
def compiled(folder, monkeypatch):
    """Return a list of the files that this process compiles as if it had been started for that."""
    found = []
    monkeypatch.setattr(compilation, "_compile", lambda sources: found.extend(sources))
    monkeypatch.setattr(compilation, "_let_others_go_first", lambda: None)
    monkeypatch.setattr(compilation, "_n_processes", lambda: 3)
    monkeypatch.setattr(compilation, "_start", None)
    return found


@pytest.mark.parametrize("end", ["normal", "killed"])
def test_processes_share_the_files_and_what_one_leaves_is_compiled(
    compiled, folder, monkeypatch, end
):
    shares = []

    def start(call, waiting):
        assert call == "compile_some(0)"
        shares.append(os.read(waiting, 1 + len(shares)))
        process = Future()
        process.set_result(0 if end == "normal" else -9)
        return process

    monkeypatch.setattr(compilation, "_start", start)
    compilation.compile_all()
    sources = compilation._sources()
    assert {file.stem for file in sources} >= {"products", "pairs"}
    assert compiled == [*sources[3:], *sources]
    assert shares == [b"\0", b"\1\2"]
    assert _stamp().exists()


def test_nothing_is_compiled_beside_another_process_or_after_it(compiled, folder):
    other = files.hold(folder / compilation._LOCK)
    compilation.compile_all()
    assert not _stamp().exists()
    os.close(other)
    _stamp().touch()
    compilation.compile_all()
    assert not compiled


def test_a_process_ends_before_the_compilation_and_says_nothing(folder):
    code = (
        "from vtk_segdeform.kernels import compilation as c\n"
        f"c._CODE = {COMPILER!r}\n"
        "c.begin(); print(len(c._started), c.is_pending())"
    )
    done = subprocess.run(
        [sys.executable, "-X", "dev", "-W", "error::ResourceWarning", "-c", code],
        env=python_environment(), capture_output=True, text=True, timeout=60.0,
    )  # fmt: skip
    assert (done.stdout, done.stderr, done.returncode) == ("1 True\n", "", 0)
    assert not _stamp().exists()
    (folder / "end").touch()
    until(_stamp().exists)  # the other process goes on


def test_kernels_call_only_those_of_their_file():
    """Others would be saved by two processes at a time, of which one would be lost."""
    for source in KERNELS.glob("*.py"):
        own = [line for line in source.read_text().splitlines() if line.startswith("from .")]
        assert source.stem in ("__init__", "kernels") or own == ["from .kernels import kernel"]


def test_types_are_written_as_numba_writes_them():
    from numba import types

    from vtk_segdeform.kernels.compiled.kernels import _types

    assert _types("const f8[:,:], i4[:], b1, i8") == (
        types.Array(types.float64, 2, "C", readonly=True),
        types.Array(types.int32, 1, "C"),
        types.boolean,
        types.int64,
    )


def every_kernel(folder):
    """Return how many kernels there are, and how many of them must be compiled."""
    code = (
        "from vtk_segdeform.kernels.compiled.kernels import KERNELS\n"
        "from vtk_segdeform.kernels import compiled\n"
        "for kernel, combinations in KERNELS:\n"
        "    for types in combinations: kernel.compile(types)\n"
        "print(len(KERNELS), sum(sum(k.stats.cache_misses.values()) for k, _ in KERNELS))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=python_environment(NUMBA_CACHE_DIR=str(folder)),
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return tuple(map(int, done.stdout.split()))


@pytest.mark.campaign
@pytest.mark.parametrize("end", ["normal", "killed"])
def test_afterwards_all_kernels_are_in_the_cache(folder, monkeypatch, end):
    monkeypatch.setattr(compilation, "_CODE", COMPILATION)
    start, processes = subprocess.Popen, []
    monkeypatch.setattr(
        compilation.subprocess,
        "Popen",
        lambda *a, **k: processes.append(start(*a, **k)) or processes[-1],
    )
    begin()
    if end == "killed":
        until(lambda: any(folder.rglob("*.nbc")))
        processes[0].kill()
        until(lambda: not is_pending())
        compilation._started.clear()  # as in the next process
        assert is_pending()
    wait_until_compiled()
    total, missing = every_kernel(folder)
    assert total > 50
    assert missing == 0
