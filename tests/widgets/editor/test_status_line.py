"""The status line: what it shows, how it wraps, and the progress bar."""

from __future__ import annotations

import numpy as np
import pytest
from hands import picture, plain_view

from vtk_segdeform.widgets.editor import messages
from vtk_segdeform.widgets.editor.status_line import StatusLine


@pytest.fixture
def line():
    view = plain_view((500, 300))
    line = StatusLine(view)
    view.render()
    yield line
    line.remove()
    view.remove_foreground()


def strip_height(view) -> int:
    """Return the height of the status line in pixels."""
    column = picture(view)[::-1, -2]
    return int(np.argmax((column == 255).all(axis=1)))


def test_the_line_shows_its_text_immediately(line):
    before = picture(line.view)
    line.say("fit cages to the regions", "REGIONS")
    after = picture(line.view)
    assert line.text == "fit cages to the regions"
    assert not line.is_warning
    changed = np.flatnonzero((before != after).any(axis=(1, 2)))
    assert changed.min() > 0.8 * len(after)  # only at the bottom


def test_a_warning_looks_different_until_the_next_text(line):
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
    assert not letters.any()  # no text is clipped
    assert line.text.endswith("for any line,")


def test_a_word_wider_than_the_window_is_broken(line):
    line.say("short")
    one = strip_height(line.view)
    path = "/a/folder/" + "x" * 90 + "/file"
    line.warn(f"{path}: cannot be written")
    high = strip_height(line.view)
    seen = picture(line.view)
    assert 1.5 * one < high < 3.0 * one
    assert not (seen[-high:, -5:] > 200).all(axis=2).any()
    # The upper line contains part of the path, not only the sign of the warning.
    assert (seen[-high : -high // 2, 300:-20] > 200).all(axis=2).any()
    line.warn(path)
    without = picture(line.view)
    assert (seen[-one:] != without[-one:]).any()  # the reason is visible


def test_the_line_follows_the_size_of_the_window(line):
    line.say("drag a handle", "DEFORM")
    small = strip_height(line.view)
    line.view.window.SetSize(1600, 1200)
    line.view.render()
    large = strip_height(line.view)
    assert 1.3 * small < large < 0.1 * 1200
    assert (picture(line.view)[-2, [2, 800, -2]] != 255).all()  # across the whole window


def test_the_bar_shows_the_completed_fraction(line):
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


def test_a_removed_line_leaves_nothing(line):
    blank = np.full_like(picture(line.view), 255)
    line.say("drag a handle")
    assert (picture(line.view) != blank).any()
    line.remove()
    assert (picture(line.view) == blank).all()


def test_a_line_whose_text_a_panel_shows_is_not_drawn(line):
    before = picture(line.view)
    line.say("drag a handle", "DEFORM")
    line.show(False)
    assert (picture(line.view) == before).all()
    assert (line.text, line.height) == ("drag a handle", 0.0)
    line.show(True)
    assert (picture(line.view) != before).any()


def test_a_result_yields_to_the_hint_after_some_seconds_a_question_does_not(monkeypatch):
    now, view = 100.0, plain_view((500, 300))
    monkeypatch.setattr(messages.time, "monotonic", lambda: now)
    shown = messages.Messages(view)
    for text, tell in (("Added pin 1", shown.note), ("Sure?", shown.confirms)):
        tell(text)
        shown.show("0 PULL", "Drag the surface")
        assert shown.text == f"{text} · Drag the surface"
        now += 3.0
        shown.show("0 PULL", "Drag the surface")
        assert shown.text == f"{text} · Drag the surface"
        now += 4.0
        shown.show("0 PULL", "Drag the surface")
        assert shown.text.endswith("Drag the surface")
        assert (text in shown.text) == (text == "Sure?")
    shown.remove()
    view.remove_foreground()
