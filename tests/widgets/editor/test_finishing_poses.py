"""Poses are finished on the mesh after a drag, and nothing waits for it."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hands import plain_view
from test_editor import Bench, bench, pull_handle, ready  # noqa: F401 - two of them are fixtures

from vtk_segdeform import load_session
from vtk_segdeform.widgets.editor import finishing, finishing_after_drags
from vtk_segdeform.widgets.recording.recording import replay

pytestmark = pytest.mark.usefixtures("unprepared")


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    monkeypatch.setattr(finishing, "_REST", 0.0)


def until(bench, seen):  # noqa: F811
    end = time.monotonic() + 20.0
    while not seen():
        assert time.monotonic() < end, "waited in vain"
        bench.hand.tick()


def is_finished(bench):  # noqa: F811
    pose = bench.session.state.pose
    return pose is not None and pose.finished is not None and not bench.session.can_finish


def test_a_pose_is_finished_after_a_drag_and_a_replay_ends_in_the_same(bench, tmp_path):  # noqa: F811
    bench.editor.path = tmp_path / "work.segdeform"
    bench.editor.do(finishing_after_drags(True))
    bench.type("4", "ctrl+r")
    pull_handle(bench, (15, 25))
    until(bench, lambda: is_finished(bench))
    assert len(bench.session.history) == 2
    assert bench.session.solution.handle_error < 1e-12
    first = bench.session.vertices
    pull_handle(bench, (-10, 12))
    until(bench, lambda: is_finished(bench))
    bench.type("ctrl+r")
    text = tmp_path / "work.recording.txt"
    assert text.read_text().count(" Finish\n") == 2
    start = load_session(text.with_suffix(".segdeform"))
    again = Bench(plain_view((400, 320)), start)
    replay(again.view, text, busy=lambda: again.editor.is_busy)
    assert again.hand.failures == []
    assert np.array_equal(again.session.vertices, bench.session.vertices)
    bench.type("z")
    assert np.array_equal(bench.session.vertices, first)
    again.editor.remove()


def test_the_next_press_and_escape_and_undo_cancel_it(bench, monkeypatch):  # noqa: F811
    bench.type("4")
    running = bench.editor.controller.finishing
    running.is_wanted = True

    def begin():
        pull_handle(bench, (5, 8))
        until(bench, lambda: running.fraction is not None)
        assert not bench.editor.is_busy

    def blocked(_, progress):
        while True:
            progress(0.5, "waiting")
            time.sleep(0.001)

    monkeypatch.setattr("vtk_segdeform.session.finishing.Finish.__call__", blocked)
    begin()
    assert "Finishing" in bench.editor.controller.messages._line.aside
    begin()  # a press
    bench.type("escape")
    assert running.fraction is None
    begin()
    bench.type("z")
    assert running.fraction is None
    pull_handle(bench, (5, 8))
    bench.editor.controller.finishing.is_wanted = False
    bench.hand.tick()
    assert running.fraction is None


def test_a_key_finishes_the_pose_on_request(bench):  # noqa: F811
    bench.type("4", "shift+f")
    assert "no pose to finish" in bench.editor.status.lower()
    bench.hand.failures.clear()
    pull_handle(bench)
    bench.hand.tick(5)
    assert bench.editor.controller.finishing.fraction is None
    assert bench.session.can_finish
    bench.type("shift+f")
    assert is_finished(bench)
    assert "Pose finished on the mesh" in bench.editor.status
