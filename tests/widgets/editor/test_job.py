"""Jobs: work in another thread, its progress, its result and its cancellation."""

from __future__ import annotations

import threading
import time

import pytest
from hands import Hand, plain_view

from vtk_segdeform.errors import CageError, Cancelled
from vtk_segdeform.widgets.editor.job import Job, view_timer


def tick_until_ended(hand: Hand, job: Job) -> None:
    end = time.monotonic() + 5.0
    while job.is_running:
        assert time.monotonic() < end, "the job does not end"
        hand.tick()


def test_a_job_works_in_another_thread_and_delivers_in_this_one():
    hand = Hand(plain_view())
    delivered = []
    job = Job(
        view_timer(hand.view),
        lambda progress: threading.get_ident(),
        done=lambda worker: delivered.append((worker, threading.get_ident())),
    )
    assert job.is_running
    assert delivered == []
    tick_until_ended(hand, job)
    [(worker, here)] = delivered
    assert here == threading.get_ident() != worker
    hand.tick(5)
    assert len(delivered) == 1
    assert not hand.failures


def test_a_job_removes_its_timer():
    hand = Hand(plain_view())
    timers = []
    hand.view.interactor.AddObserver("CreateTimerEvent", lambda *_: timers.append(1))
    hand.view.interactor.AddObserver("DestroyTimerEvent", lambda *_: timers.pop())
    job = Job(view_timer(hand.view), lambda progress: None, done=lambda _: None)
    assert timers == [1]
    tick_until_ended(hand, job)
    assert timers == []


def test_watch_receives_the_progress_and_finally_the_end():
    hand = Hand(plain_view())
    heard = []
    go_on = threading.Event()

    def work(progress):
        progress(0.25, "a quarter")
        go_on.wait(5.0)
        progress(1.0, "all")

    job = Job(
        view_timer(hand.view),
        work,
        done=lambda _: heard.append("done"),
        watch=lambda job: heard.append((job.fraction, job.text, job.is_running)),
    )
    end = time.monotonic() + 5.0
    while not heard:
        assert time.monotonic() < end
        hand.tick()
    hand.tick(3)  # nothing new: no further report
    go_on.set()
    tick_until_ended(hand, job)
    assert heard == [(0.25, "a quarter", True), (1.0, "all", False), "done"]


def test_an_error_of_the_work_reaches_the_listeners_of_failures():
    hand = Hand(plain_view())
    delivered = []

    def work(progress):
        raise CageError("no cage fits")

    job = Job(view_timer(hand.view), work, done=delivered.append)
    tick_until_ended(hand, job)
    assert [str(failure) for failure in hand.failures] == ["no cage fits"]
    assert delivered == []


def test_an_error_of_the_work_reaches_failed_instead_if_it_is_given():
    hand = Hand(plain_view())
    failed = []

    def work(progress):
        raise CageError("no cage fits")

    job = Job(view_timer(hand.view), work, done=failed.append, failed=failed.append)
    tick_until_ended(hand, job)
    assert failed == [job.error]
    assert isinstance(job.error, CageError)
    assert not hand.failures


def test_an_error_of_done_reaches_them_once():
    hand = Hand(plain_view())
    job = Job(view_timer(hand.view), lambda progress: 0, done=lambda result: 1 // result)
    tick_until_ended(hand, job)
    hand.tick(3)
    assert [type(failure) for failure in hand.failures] == [ZeroDivisionError]


def test_the_result_is_delivered_even_if_watch_raises():
    hand = Hand(plain_view())
    delivered = []

    def watch(job):
        raise RuntimeError("a watch without hands")

    job = Job(view_timer(hand.view), lambda progress: "there", done=delivered.append, watch=watch)
    tick_until_ended(hand, job)
    assert delivered == ["there"]
    assert [str(failure) for failure in hand.failures] == ["a watch without hands"]


def test_a_cancelled_job_stops_at_its_next_report_and_delivers_nothing():
    hand = Hand(plain_view())
    delivered, stopped = [], []

    def work(progress):
        try:
            while True:
                progress(0.5, "on and on")
                time.sleep(0.001)
        except Cancelled:
            stopped.append("stopped")
            raise

    job = Job(view_timer(hand.view), work, done=delivered.append)
    hand.tick(2)
    assert job.is_running
    job.cancel()
    tick_until_ended(hand, job)
    assert stopped == ["stopped"]
    assert job.is_cancelled
    assert delivered == hand.failures == []


def test_a_job_cancelled_after_its_last_report_delivers_nothing_either():
    hand = Hand(plain_view())
    delivered = []
    job = Job(view_timer(hand.view), lambda progress: "late", done=delivered.append)
    job.cancel()
    tick_until_ended(hand, job)
    assert delivered == []


def test_wait_delivers_without_an_event_loop():
    view = plain_view()
    delivered = []
    job = Job(view_timer(view), lambda progress: time.sleep(0.05) or "there", done=delivered.append)
    job.wait()
    assert delivered == ["there"]
    job.wait()
    assert delivered == ["there"]

    def fails(progress):
        raise CageError("no cage fits")

    with pytest.raises(CageError, match="no cage fits"):
        Job(view_timer(view), fails, done=delivered.append).wait()


def test_a_computing_thread_makes_progress_while_the_window_is_idle():
    # Each tick waits for the worker; otherwise 200 ticks would pass immediately.
    hand = Hand(plain_view())

    def work(progress):
        for k in range(20_000):
            progress(k / 20_000, "counting")
            sum(range(200))
        return "counted"

    delivered = []
    job = Job(view_timer(hand.view), work, done=delivered.append)
    ticks = 0
    while job.is_running and ticks < 200:
        hand.tick()
        ticks += 1
    assert delivered == ["counted"]
