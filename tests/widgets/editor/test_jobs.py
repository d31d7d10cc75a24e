"""Work beside the window: jobs in a thread, the status line that tells of them, the help card."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from hands import Hand, picture, plain_view

from vtk_segdeform.errors import CageError, Cancelled
from vtk_segdeform.widgets.editor.help_card import HelpCard
from vtk_segdeform.widgets.editor.jobs import Job
from vtk_segdeform.widgets.editor.status_line import StatusLine

SECTIONS = [
    ("Everywhere", [("Ctrl+Z", "undo"), ("H", "this card"), ("Esc", "cancel")]),
    ("Painting", [("B", "brush"), ("L", "lasso"), ("[  ]", "smaller, larger brush")]),
]


def tick_until_ended(hand: Hand, job: Job) -> None:
    end = time.monotonic() + 5.0
    while job.is_running:
        assert time.monotonic() < end, "the job does not end"
        hand.tick()


def test_a_job_works_in_another_thread_and_delivers_in_this_one():
    hand = Hand(plain_view())
    delivered = []
    job = Job(
        hand.view,
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


def test_a_job_leaves_no_timer_behind():
    hand = Hand(plain_view())
    timers = []
    hand.view.interactor.AddObserver("CreateTimerEvent", lambda *_: timers.append(1))
    hand.view.interactor.AddObserver("DestroyTimerEvent", lambda *_: timers.pop())
    job = Job(hand.view, lambda progress: None, done=lambda _: None)
    assert timers == [1]
    tick_until_ended(hand, job)
    assert timers == []


def test_a_watcher_hears_how_far_it_is_and_last_of_its_end():
    hand = Hand(plain_view())
    heard = []
    go_on = threading.Event()

    def work(progress):
        progress(0.25, "a quarter")
        go_on.wait(5.0)
        progress(1.0, "all")

    job = Job(
        hand.view,
        work,
        done=lambda _: heard.append("done"),
        watch=lambda job: heard.append((job.fraction, job.text, job.is_running)),
    )
    end = time.monotonic() + 5.0
    while not heard:
        assert time.monotonic() < end
        hand.tick()
    hand.tick(3)  # nothing new: nobody is told again
    go_on.set()
    tick_until_ended(hand, job)
    assert heard == [(0.25, "a quarter", True), (1.0, "all", False), "done"]


def test_what_the_work_raises_reaches_the_listeners_of_failures():
    hand = Hand(plain_view())
    delivered = []

    def work(progress):
        raise CageError("no cage fits")

    job = Job(hand.view, work, done=delivered.append)
    tick_until_ended(hand, job)
    assert [str(failure) for failure in hand.failures] == ["no cage fits"]
    assert delivered == []


def test_what_the_delivery_raises_does_too_and_only_once():
    hand = Hand(plain_view())
    job = Job(hand.view, lambda progress: 0, done=lambda result: 1 // result)
    tick_until_ended(hand, job)
    hand.tick(3)
    assert [type(failure) for failure in hand.failures] == [ZeroDivisionError]


def test_the_result_is_delivered_even_if_a_watcher_raises():
    hand = Hand(plain_view())
    delivered = []

    def watch(job):
        raise RuntimeError("a watch without hands")

    job = Job(hand.view, lambda progress: "there", done=delivered.append, watch=watch)
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

    job = Job(hand.view, work, done=delivered.append)
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
    job = Job(hand.view, lambda progress: "late", done=delivered.append)
    job.cancel()
    tick_until_ended(hand, job)
    assert delivered == []


def test_without_an_event_loop_one_waits():
    view = plain_view()
    delivered = []
    job = Job(view, lambda progress: time.sleep(0.05) or "there", done=delivered.append)
    job.wait()
    assert delivered == ["there"]
    job.wait()
    assert delivered == ["there"]

    def fails(progress):
        raise CageError("no cage fits")

    with pytest.raises(CageError, match="no cage fits"):
        Job(view, fails, done=delivered.append).wait()


def test_a_thread_that_computes_gets_on_while_the_window_is_idle():
    # Each tick leaves the thread some time; without that 200 of them would be over in no time.
    hand = Hand(plain_view())

    def work(progress):
        for k in range(20_000):
            progress(k / 20_000, "counting")
            sum(range(200))
        return "counted"

    delivered = []
    job = Job(hand.view, work, done=delivered.append)
    ticks = 0
    while job.is_running and ticks < 200:
        hand.tick()
        ticks += 1
    assert delivered == ["counted"]


def test_a_job_gets_on_while_the_camera_is_dragged_and_is_delivered_after_it(line):
    view, told, done = line.view, [], []
    hand = Hand(view)
    go_on = threading.Event()

    def work(progress):
        progress(0.5, "half")
        assert go_on.wait(20.0)
        return "all"

    hand.press((100, 150))  # the camera style has every event to itself now
    hand.move((120, 150))
    Job(view, work, done=done.append, watch=lambda job: told.append((job.text, job.is_running)))
    for _ in range(20):
        hand.tick()
        time.sleep(0.01)
    assert told == [("half", True)]
    go_on.set()
    for _ in range(5):
        hand.tick()
    assert done == []
    hand.release((130, 150))
    for _ in range(5):
        hand.tick()
    assert done == ["all"]
    assert hand.failures == []


# The line at the bottom.


@pytest.fixture
def line():
    view = plain_view((500, 300))
    line = StatusLine(view)
    view.render()
    yield line
    line.remove()
    view.remove_foreground()


def strip_height(view) -> int:
    """Return how many rows from the bottom, at the window's left edge, are not background."""
    column = picture(view)[::-1, -2]
    return int(np.argmax((column == 255).all(axis=1)))


def test_the_line_says_what_it_is_told_and_is_drawn_at_once(line):
    before = picture(line.view)
    line.say("fit cages to the regions", "REGIONS")
    after = picture(line.view)
    assert line.text == "fit cages to the regions"
    assert not line.is_warning
    changed = np.flatnonzero((before != after).any(axis=(1, 2)))
    assert changed.min() > 0.8 * len(after)  # at the bottom and nowhere else


def test_a_warning_looks_different_until_something_else_is_said(line):
    line.say("a handle needs one vertex or more")
    calm = picture(line.view)[-2, -2].astype(int)
    line.warn("a handle needs one vertex or more")
    warning = picture(line.view)[-2, -2].astype(int)
    assert line.is_warning
    assert warning[0] > calm[0] + 40
    line.say("drag a handle")
    assert not line.is_warning
    assert (picture(line.view)[-2, -2] == calm).all()


@pytest.mark.parametrize(("tell", "most"), [("say", 2), ("warn", 4)])
def test_a_long_text_takes_two_lines_and_a_warning_four_and_never_more(line, tell, most):
    line.say("short")
    one = strip_height(line.view)
    getattr(line, tell)("a text that is too long for one line, " * 3)
    two = strip_height(line.view)
    getattr(line, tell)("a text that is too long for any line, " * 20)
    full = strip_height(line.view)
    assert one < two <= full
    assert 0.7 * most < full / one < 1.1 * most
    letters = (picture(line.view)[-full:, -5:] > 200).all(axis=2)
    assert not letters.any()  # nothing runs out of the window
    assert line.text.endswith("for any line,")


def test_a_word_wider_than_the_window_is_broken_so_that_what_follows_is_seen(line):
    line.say("short")
    one = strip_height(line.view)
    path = "/a/folder/" + "x" * 90 + "/file"
    line.warn(f"{path}: cannot be written")
    high = strip_height(line.view)
    seen = picture(line.view)
    assert 1.5 * one < high < 3.0 * one
    assert not (seen[-high:, -5:] > 200).all(axis=2).any()
    # The upper line is full of the path: it is not the sign of the warning alone.
    assert (seen[-high : -high // 2, 300:-20] > 200).all(axis=2).any()
    line.warn(path)
    without = picture(line.view)
    assert (seen[-one:] != without[-one:]).any()  # the reason is to be seen


def test_the_line_follows_the_size_of_the_window(line):
    line.say("drag a handle", "DEFORM")
    small = strip_height(line.view)
    line.view.window.SetSize(1600, 1200)
    line.view.render()
    large = strip_height(line.view)
    assert 1.3 * small < large < 0.1 * 1200
    assert (picture(line.view)[-2, [2, 800, -2]] != 255).all()  # across the whole window


def test_the_bar_is_as_long_as_the_share_that_is_done(line):
    for share in (0.2, 0.75):
        line.progress(share, "fitting cages")
        row = picture(line.view)[-2].astype(int)
        blue = (row[:, 2] > 180) & (row[:, 0] < 120)
        assert np.count_nonzero(blue) == pytest.approx(share * 500, abs=2)
        assert line.fraction == share
    line.say("done")
    row = picture(line.view)[-2].astype(int)
    assert not ((row[:, 2] > 180) & (row[:, 0] < 120)).any()
    assert line.fraction is None


def test_a_line_that_is_removed_leaves_nothing(line):
    blank = np.full_like(picture(line.view), 255)
    line.say("drag a handle")
    assert (picture(line.view) != blank).any()
    line.remove()
    assert (picture(line.view) == blank).all()


# The card.


@pytest.mark.parametrize("size", [(300, 220), (800, 600), (600, 1000)])
@pytest.mark.parametrize("background", [0.0, 1.0])
def test_the_card_lies_inside_the_window_and_is_read_on_any_background(size, background):
    view = plain_view(size)
    view.renderer.SetBackground(background, background, background)
    blank = picture(view)
    card = HelpCard(view, SECTIONS)
    assert (picture(view) == blank).all()
    card.show()
    seen = picture(view)
    rows = np.flatnonzero((seen != blank).any(axis=(1, 2)))
    columns = np.flatnonzero((seen != blank).any(axis=(0, 2)))
    assert 0 < rows[0] < rows[-1] < size[1] - 1
    assert 0 < columns[0] < columns[-1] < size[0] - 1
    inside = seen[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(int).sum(axis=2) / 3
    assert (inside > 240).mean() > 0.5  # paper
    assert (inside < 100).mean() > 0.01  # letters
    # Words keep clear of the rim: nothing is cut off.
    edge = inside[4:-4, 4:-4]
    assert (edge[:, [0, -1]] > 240).all()
    assert (edge[[0, -1]] > 240).all()
    card.hide()
    assert (picture(view) == blank).all()
    view.remove_foreground()


def test_the_card_is_laid_out_anew_when_the_window_grows():
    view = plain_view((300, 220))
    card = HelpCard(view, SECTIONS)
    card.toggle()
    assert card.is_shown
    view.render()
    view.window.SetSize(900, 700)
    view.render()
    seen = picture(view)
    wide = np.flatnonzero((seen != 255).any(axis=(0, 2)))
    assert abs((wide[0] + wide[-1]) / 2 - 450) < 3  # in the middle again
    assert wide[-1] - wide[0] > 300
    card.toggle()
    assert not card.is_shown
    card.remove()
    view.remove_foreground()
