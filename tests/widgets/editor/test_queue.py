"""The queue of an editor: what runs, in which order, and what is never called."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import pytest
from hands import Hand, plain_view

from vtk_segdeform.errors import CageError, Cancelled, SessionError
from vtk_segdeform.widgets.editor import queue as queue_module
from vtk_segdeform.widgets.editor.queue import Kind, Queue, Task


class Bench:
    """A queue over a view, and what was heard of its tasks."""

    def __init__(self) -> None:
        self.hand, self.heard = Hand(plain_view()), []
        self.gates: dict[str, threading.Event] = {}
        self.queue = Queue(self.hand.view, lambda: None)

    def add(self, kind, name, *, error=None, **how):
        """Add a task that reports, and waits at its gate in another thread."""
        gate = self.gates[name] = threading.Event()

        def work(progress):
            progress(0.5, "half")
            assert gate.wait(20.0)
            if error is not None:
                raise error
            return name

        def begin():
            self.heard.append(f"begin {name}")
            return work

        done = self.heard.append
        self.queue.add(Task(kind=kind, name=name, begin=begin, done=done, **how))

    def open(self, name, until=None):
        """Let a task end, and tick until *until* was heard, by default its result."""
        self.gates[name].set()
        self.until(lambda: (until or name) in self.heard)

    def until(self, seen):
        end = time.monotonic() + 20.0
        while not seen():
            assert time.monotonic() < end, "waited in vain"
            self.hand.tick()


@pytest.fixture
def bench():
    """Yield a queue; all its threads end with the test."""
    made = Bench()
    yield made
    for gate in made.gates.values():
        gate.set()
    made.queue.stop()


def test_the_worker_runs_one_task_at_a_time_in_the_order_of_kinds(bench):
    bench.add(Kind.CHECK, "check")
    bench.add(Kind.FINISH, "finish")
    bench.add(Kind.PREPARE, "prepare")
    assert bench.heard == ["begin check"]
    bench.open("check", "begin prepare")
    bench.hand.tick(3)
    assert "begin finish" not in bench.heard
    bench.open("prepare", "begin finish")
    bench.open("finish")
    assert [each for each in bench.heard if "begin" not in each] == ["check", "prepare", "finish"]


def test_a_cancelled_task_calls_nothing_and_the_next_one_waits_for_its_thread(bench):
    bench.add(Kind.FINISH, "first")
    assert bench.queue.fraction(Kind.FINISH) is not None
    assert bench.queue.cancel(Kind.FINISH)
    assert bench.queue.fraction(Kind.FINISH) is None
    bench.add(Kind.FINISH, "second")
    bench.hand.tick(3)
    assert bench.heard == ["begin first"]
    bench.open("first", "begin second")
    assert not bench.queue.cancel(Kind.PREPARE)
    bench.open("second")
    assert bench.heard == ["begin first", "begin second", "second"]


def test_a_job_begins_beside_the_worker_and_another_one_is_refused(bench):
    bench.add(Kind.PREPARE, "prepare")
    bench.add(Kind.JOB, "Counting")
    assert bench.heard == ["begin prepare", "begin Counting"]
    with pytest.raises(SessionError, match="Counting: wait"):
        bench.add(Kind.JOB, "Measuring")
    assert bench.queue.text.startswith("Counting")
    bench.queue.refuse()
    assert bench.queue.text.startswith("Busy. Counting")
    bench.gates["Counting"].set()
    bench.queue.wait(Kind.JOB)
    assert bench.heard[-1] == "Counting"
    assert bench.queue.job is None


def test_a_cancelled_job_remains_until_its_thread_has_ended(bench):
    bench.add(Kind.JOB, "Counting")
    assert bench.queue.cancel(Kind.JOB)
    bench.hand.tick(3)
    assert bench.queue.job.is_cancelled
    bench.gates["Counting"].set()
    bench.until(lambda: bench.queue.job is None)
    assert bench.heard == ["begin Counting"]


def test_an_error_is_shown_and_the_next_task_begins(bench):
    bench.add(Kind.PREPARE, "prepare", error=CageError("no cage fits"))
    bench.add(Kind.FINISH, "finish")
    bench.gates["prepare"].set()
    bench.open("finish")
    assert [str(each) for each in bench.hand.failures] == ["no cage fits"]


def test_no_result_is_delivered_while_the_hand_is_active_but_the_worker_is_free(bench):
    is_free = False
    bench.add(Kind.PREPARE, "prepare", may_end=lambda: is_free)
    bench.add(Kind.FINISH, "finish")
    bench.gates["prepare"].set()
    assert bench.hand.view.is_sparing
    bench.open("finish")
    bench.hand.tick()
    assert not bench.hand.view.is_sparing  # for nothing is computed
    assert "prepare" not in bench.heard
    is_free = True
    bench.until(lambda: "prepare" in bench.heard)


def test_a_task_begins_after_a_rest_and_hurries_if_told(bench, monkeypatch):
    now, is_free = [0.0], [True]
    monkeypatch.setattr(queue_module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    how = {"rest": 1.0, "may_begin": lambda: is_free[0]}
    bench.queue.add(Task(kind=Kind.LOAD, begin=lambda: bench.heard.append("loaded"), **how))
    for now[0], is_free[0] in [(0.9, True), (1.5, False), (2.4, True)]:
        bench.hand.tick()
        assert bench.heard == []
    now[0] = 2.6
    bench.hand.tick()
    assert bench.heard == ["loaded"]
    bench.queue.add(Task(kind=Kind.SAVE, begin=lambda: bench.heard.append("saved"), **how))
    bench.queue.hurry(Kind.SAVE)
    bench.hand.tick()
    assert bench.heard == ["loaded", "saved"]


def test_work_runs_in_another_thread_and_everything_else_in_this_one(bench):
    threads = []

    def here(*_):
        threads.append(threading.get_ident())

    def begin():
        here()
        return here

    bench.queue = Queue(bench.hand.view, here)
    bench.queue.add(Task(kind=Kind.JOB, begin=begin, done=here))
    bench.until(lambda: bench.queue.job is None)
    assert len(threads) == 5  # begin, changed, work, changed, done
    assert [each for each in threads if each != threads[0]] in ([threads[1]], [threads[2]])
    assert threads[0] == threads[-1] == threading.get_ident()


@pytest.mark.parametrize("kind", [Kind.JOB, Kind.DOCUMENT, Kind.AUTOSAVE])
def test_a_cancelled_task_stops_at_its_next_report(bench, kind):
    stopped = threading.Event()

    def work(progress):
        try:
            while True:
                progress(0.5, "on and on")
                time.sleep(0.001)
        except Cancelled:
            stopped.set()
            raise

    bench.queue.add(Task(kind=kind, begin=lambda: work, done=bench.heard.append))
    bench.hand.tick(2)
    assert bench.queue.cancel(kind)
    assert (bench.queue.task(kind) is None) == (kind is Kind.DOCUMENT)  # nobody waits for that
    bench.until(stopped.is_set)
    bench.until(lambda: bench.queue.task(kind) is None)
    assert bench.heard == bench.hand.failures == []


@pytest.mark.parametrize("error", [CageError("no cage fits"), None])
def test_an_error_after_the_cancellation_is_only_logged(bench, caplog, error):
    caplog.set_level("INFO", queue_module.__name__)
    bench.add(Kind.JOB, "told", error=error, failed=bench.heard.append)
    bench.until(lambda: bench.queue.job.fraction)  # the last report
    bench.queue.cancel(Kind.JOB)
    bench.gates["told"].set()
    bench.until(lambda: bench.queue.job is None)
    assert [record.exc_info[1] for record in caplog.records] == ([error] if error else [])
    assert "told" not in bench.heard
    assert bench.hand.failures == []


def test_an_error_reaches_failed_if_it_is_given_and_otherwise_whoever_waits(bench):
    error = CageError("no cage fits")
    bench.add(Kind.JOB, "told", error=error, failed=bench.heard.append)
    bench.gates["told"].set()
    bench.until(lambda: error in bench.heard)
    bench.add(Kind.JOB, "raised", error=error)
    bench.gates["raised"].set()
    with pytest.raises(CageError, match="no cage fits"):
        bench.queue.wait(Kind.JOB)
    bench.queue.wait(Kind.JOB)
    assert bench.hand.failures == []


def test_the_result_is_delivered_once_even_if_the_listener_raises(bench):
    def changed():
        if bench.queue.job is None:
            raise RuntimeError("a listener without hands")

    bench.queue = Queue(bench.hand.view, changed)
    bench.queue.add(Task(kind=Kind.JOB, begin=lambda: lambda _: 0, done=lambda n: 1 // n))
    bench.until(lambda: bench.hand.failures)
    bench.hand.tick(3)
    (failure,) = bench.hand.failures
    assert isinstance(failure, ZeroDivisionError)
    assert isinstance(failure.__context__, RuntimeError)


def test_a_computing_thread_makes_progress_while_the_window_is_idle(bench):
    # Each tick waits for the worker; otherwise 200 ticks would pass immediately.
    def work(progress):
        for k in range(20_000):
            progress(k / 20_000, "counting")
            sum(range(200))
        return "counted"

    bench.queue.add(Task(kind=Kind.JOB, begin=lambda: work, done=bench.heard.append))
    for _ in range(200):
        if bench.queue.job is not None:
            bench.hand.tick()
    assert bench.heard == ["counted"]


def test_the_timer_is_slow_while_no_thread_runs(bench, monkeypatch):
    """All timers of a view have the shortest period, also that of a pose that converges."""
    periods, view = [], bench.hand.view
    monkeypatch.setattr(view, "every", lambda period, _: periods.append(period) or periods.pop)
    bench.queue.add(Task(kind=Kind.SETTLE, begin=bench.heard.clear, may_begin=lambda: False))
    assert periods == [100]
    bench.add(Kind.CHECK, "check")
    assert periods == [20]
    bench.gates["check"].set()
    bench.queue.wait(Kind.CHECK)
    assert periods == [100]
    bench.queue.cancel(Kind.SETTLE)
    assert periods == []


def test_without_tasks_there_is_no_timer(bench):
    timers = []
    bench.hand.view.interactor.AddObserver("CreateTimerEvent", lambda *_: timers.append(1))
    bench.hand.view.interactor.AddObserver("DestroyTimerEvent", lambda *_: timers.pop())
    bench.add(Kind.PREPARE, "prepare")
    bench.add(Kind.FINISH, "finish")
    assert timers == [1]
    bench.gates["prepare"].set()
    bench.open("finish")
    assert timers == []
    bench.add(Kind.FINISH, "again", may_begin=lambda: False)
    bench.queue.stop()
    assert timers == []
