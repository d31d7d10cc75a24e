"""Ctrl+C at any moment leaves a process in which the same call works.

A signal handler raises its exception between any two instructions of the main thread: in an import,
while numba compiles, and while other threads compute.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from scipy.spatial import cKDTree

from vtk_segdeform.importing import completed, imported
from vtk_segdeform.kernels import threads

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

# Interrupts itself after 50 ms, and so on, until a call is completed.  The pauses become longer: a
# slow machine would never complete a step that takes longer than they do.
FIRST_CALL = """
import os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)
import vtk_segdeform as sd

def interrupt():
    pause = 0.05
    while not is_over:
        time.sleep(pause)
        pause *= 1.03
        os.kill(os.getpid(), signal.SIGINT)

is_over, count = False, 0
sending = threading.Thread(target=interrupt)
sending.start()
while True:
    try:
        if not is_over:
            cage = sd.models.sphere(20)
            weights = sd.mean_value_coordinates([[0.1, 0.0, 0.0]] * 3000, cage.vertices, cage.faces)
            is_over = True
        sending.join()
        break
    except KeyboardInterrupt:
        count += 1
print(count, "numba" in sys.modules, abs(weights @ cage.vertices - [0.1, 0.0, 0.0]).max() < 1e-9)
"""
# Interrupts itself after each of the given seconds, and calls until a call is completed.
SCRIPT = """
import os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)
import vtk_segdeform as sd

def call():
    mesh = sd.models.sphere(int(sys.argv[1]))
    regions = sd.segment(mesh, 2)
    cages = sd.fit_cages(mesh, regions, 24)
    tip = mesh.vertices[:, 2] > 0.4
    deformer = sd.Deformer(mesh, regions, cages, fixed=mesh.vertices[:, 2] < -0.4, handle=tip)
    return deformer.solve(mesh.vertices[tip] + [0.1, 0.0, 0.0]).vertices

def interrupt():
    for seconds in map(float, sys.argv[2:]):
        time.sleep(seconds)
        os.kill(os.getpid(), signal.SIGINT)

sending = threading.Thread(target=interrupt)
sending.start()
count = 0
while True:
    try:
        while sending.is_alive():
            call()
        moved = call()
        break
    except KeyboardInterrupt:
        count += 1
print(count, "numba" in sys.modules, abs(moved - call()).max())
"""


def run(seconds, n_vertices=3000, **environment):
    """Run `SCRIPT`; return how often it was interrupted."""
    count, *others = output_of(SCRIPT, n_vertices, *seconds, **environment)
    assert others == ["True", "0.0"]
    return int(count)


def output_of(script, *arguments, **environment):
    """Return the words that a process prints, which must not fail."""
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-c", script, *map(str, arguments)],
        env={**os.environ, "SEGDEFORM_THREADS": "4", **environment},
        capture_output=True, text=True, timeout=300.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.campaign  # test_an_import_is_completed... and test_each_kernel... are parts of it
def test_a_first_call_works_after_interruptions_of_it():
    count, *others = output_of(FIRST_CALL)
    assert int(count) > 5
    assert others == ["True", "True"]


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(60))
def test_a_first_call_works_after_interruptions_at_random_moments(seed):
    draw = random.Random(seed)
    seconds = [draw.uniform(0.0, 2.0), *[draw.uniform(0.0, 0.01)] * draw.randrange(4)]
    run(seconds, SEGDEFORM_THREADS=draw.choice("1248"))


@pytest.mark.campaign
def test_many_interruptions_do_not_crash_threads():
    for shortest, longest, number in ((0.0, 0.006, 1000), (0.1, 0.9, 60)):
        draw = random.Random(number)
        assert run(draw.uniform(shortest, longest) for _ in range(number)) > 20


@pytest.mark.campaign
def test_interrupted_compilation_leaves_a_complete_cache(tmp_path):
    assert run([0.7] * 40, NUMBA_CACHE_DIR=str(tmp_path)) > 20
    files = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nbc")}
    assert len(files) > 10
    run([], NUMBA_CACHE_DIR=str(tmp_path))
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nbc")} == files


class Stop(Exception):
    """Raised by the handler of an application."""


def stop(*_):
    raise Stop


@contextmanager
def interrupted_after(*seconds):
    """Send this process SIGINT after each of so many *seconds*, to a handler that raises `Stop`."""

    def send():
        for each in seconds:
            time.sleep(each)
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, stop)
    sending = threading.Thread(target=send)
    sending.start()
    try:
        yield
        pytest.fail("not interrupted")
    except Stop:
        assert signal.getsignal(signal.SIGINT) is stop
    finally:
        while sending.is_alive():
            with suppress(Stop):
                sending.join()
        signal.signal(signal.SIGINT, before)


def test_an_import_is_completed_though_it_is_interrupted_at_once(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    name = "a_slow_module"
    (tmp_path / f"{name}.py").write_text("import time\ntime.sleep(0.2)\nhas_ended = time.time()")
    with interrupted_after(0.05):
        imported(name)
    assert not hasattr(sys.modules[name], "has_ended")
    assert imported(name).has_ended < time.time()
    del sys.modules[name]


def test_each_kernel_is_compiled_completely(monkeypatch):
    kernels = pytest.importorskip("vtk_segdeform.kernels.compiled.kernels")
    compiled = []

    def recorded(work):
        compiled.append(work)
        return completed(work)

    monkeypatch.setattr(kernels, "completed", recorded)
    add = kernels.kernel()()(lambda a, b: a + b)
    assert [add(1, 2), add(3, 4)] == [3, 7]
    assert len(compiled) == 1


def test_errors_are_those_of_the_work():
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        imported("no_such_module")
    with pytest.raises(ZeroDivisionError):
        completed(lambda: 1 // 0)


def test_other_threads_need_no_other_thread():
    found = []
    worker = threading.Thread(target=lambda: found.append(completed(threading.current_thread)))
    worker.start()
    worker.join()
    assert found == [worker]
    assert completed(threading.current_thread) is not threading.current_thread()


def test_a_module_that_is_being_imported_does_not_wait_for_its_own_lock(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    outer, inner = "an_outer_module", "an_inner_module"
    (tmp_path / f"{inner}.py").write_text(f"from {outer} import before\n")
    (tmp_path / f"{outer}.py").write_text(
        f"from vtk_segdeform.importing import imported\nbefore = 1\nimported({inner!r})\n"
    )
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 5.0)
    try:
        __import__(outer)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert sys.modules[inner].before == 1


def test_no_task_writes_after_its_caller_was_interrupted_twice(monkeypatch):
    monkeypatch.setattr(threads, "n_threads", lambda: 2)
    begun, ended = [], []

    def work(start, stop):
        begun.append(start)
        time.sleep(0.15)
        ended.append(start)

    with interrupted_after(0.04, 0.04):
        threads.in_parallel(work, 20, 1, blas=False)
    count = len(begun)
    assert 0 < count < 20
    assert sorted(ended) == sorted(begun)
    time.sleep(0.02)
    assert len(begun) == count


def test_nearest_points_are_those_of_scipy(monkeypatch):
    points = np.random.default_rng(0).random((5000, 3))
    tree = cKDTree(points[::7])
    for n in ("1", "3"):
        monkeypatch.setattr(threads, "n_threads", lambda n=n: int(n))
        for k, within in (((1,), 0.05), (range(1, 4), np.inf), ((2,), 0.1)):
            ours = threads.nearest(tree, points, k, within=within)
            theirs = tree.query(points, k=list(k), distance_upper_bound=within)
            for a, b in zip(ours, theirs, strict=True):
                np.testing.assert_array_equal(a, b)
    assert threads.nearest(tree, points[:0])[0].shape == (0, 1)
