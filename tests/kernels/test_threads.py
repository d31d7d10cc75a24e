"""BLAS is limited to one thread during computations, and its threads are restored afterwards."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from vtk_segdeform.kernels import quick_turns, threads

# Set-up and a drag, alone and then in two threads at a time; in a separate process, since BLAS
# has one thread in the tests.
CONCURRENT = """
import sys, threading
import numpy as np
from threadpoolctl import threadpool_info
import vtk_segdeform as sd

def blas():
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

mesh = sd.models.sphere(200)
height = mesh.vertices[:, 2]

def drag():
    tip = np.flatnonzero(height > 0.4)
    regions = sd.segment(mesh, 2)
    cages = sd.fit_cages(mesh, regions, 24)
    deformer = sd.Deformer(mesh, regions, cages, fixed=height < -0.4, handle=tip)
    poses = [deformer.solve(mesh.vertices[tip] + [0.1 * k, 0.0, 0.0]).vertices for k in (1, 2)]
    return [*poses, deformer.carry(mesh.vertices[::5])]

before, alone = blas(), drag()
for _ in range(int(sys.argv[1])):
    together = []
    workers = [threading.Thread(target=lambda: together.append(drag())) for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    moved = [np.abs(a - b).max() for poses in together for a, b in zip(alone, poses)]
    print(f"BLAS threads {before} before, {blas()} after; {len(moved)} poses, off by {max(moved)}")
"""


@pytest.mark.parametrize("times", [1, pytest.param(5, marks=pytest.mark.campaign)])
def test_concurrent_deformers_agree_with_sequential_ones_and_blas_threads_are_restored(times):
    pytest.importorskip("threadpoolctl")
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    environment = {**os.environ, **dict.fromkeys(names, "2"), "SEGDEFORM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", CONCURRENT, str(times)],
        env=environment, capture_output=True, text=True,
    )  # fmt: skip
    print(done.stdout)
    assert done.stderr == ""
    line = "BLAS threads {2} before, {2} after; 6 poses, off by 0.0"
    assert done.stdout.splitlines() == [line] * times


class Library:
    """A fake of threadpoolctl and BLAS: each limit stores the number to restore."""

    def __init__(self):
        self.threads = 8

    def select(self, **_):
        return Library()

    def limit(self, *, limits, **_):
        return Limiter(self, limits)


class Limiter:
    """A limit on a `Library`, until it is restored."""

    def __init__(self, library, limits):
        self.library, self.before = library, library.threads
        library.threads = limits

    def restore_original_limits(self):
        self.library.threads = self.before

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.restore_original_limits()


@pytest.fixture
def blas(monkeypatch):
    library = Library()
    limit = threads._BlasLimit(library)
    monkeypatch.setattr(threads, "_blas_limit", lambda: limit)
    return library


def test_blas_is_limited_until_the_last_thread_has_left(blas):
    inside, leave = threading.Event(), threading.Event()

    def other():
        with threads.one_blas_thread():
            inside.set()
            leave.wait(10)

    worker = threading.Thread(target=other)
    with threads.one_blas_thread():
        worker.start()
        assert inside.wait(10)
        assert blas.threads == 1
    assert blas.threads == 1  # the other one is still computing
    leave.set()
    worker.join()
    assert blas.threads == 8


def test_blas_threads_are_restored_after_an_error(blas):
    @threads.one_blas_thread()
    def fail():
        with threads.one_blas_thread():
            assert blas.threads == 1
            raise ZeroDivisionError

    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            fail()
        assert blas.threads == 8


def test_blas_threads_are_restored_though_that_is_interrupted(blas, monkeypatch):
    restore, once = Limiter.restore_original_limits, iter([True])

    def interrupted(limiter):
        if limiter.library is blas and next(once, False):
            raise KeyboardInterrupt
        restore(limiter)

    monkeypatch.setattr(Limiter, "restore_original_limits", interrupted)
    with pytest.raises(KeyboardInterrupt):
        threads.one_blas_thread()(lambda: None)()
    assert blas.threads == 8


def test_without_threadpoolctl_nothing_is_limited(monkeypatch):
    monkeypatch.setattr(threads, "_blas_limit", lambda: None)
    with threads.one_blas_thread():
        pass


def test_threads_take_quick_turns_until_the_last_one_has_ended():
    before = sys.getswitchinterval()
    inside, first, second = [], threading.Event(), threading.Event()

    def work(has_begun, may_end):
        with quick_turns():
            inside.append(sys.getswitchinterval())
            has_begun.set()
            may_end.wait(10.0)
            inside.append(sys.getswitchinterval())

    begun = [threading.Event(), threading.Event()]
    ends = first, second
    running = [threading.Thread(target=work, args=each) for each in zip(begun, ends, strict=True)]
    try:
        for thread, event in zip(running, begun, strict=True):
            thread.start()
            event.wait(10.0)
        first.set()
        running[0].join()
        assert sys.getswitchinterval() < 0.5 * before
    finally:
        first.set()
        second.set()
        for thread in running:
            thread.join()
    assert max(inside) < 0.5 * before
    assert sys.getswitchinterval() == pytest.approx(before)
