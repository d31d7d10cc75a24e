"""Recordings and videos of the editor, by real keys, and their replay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hands import picture, plain_view
from PIL import Image
from test_editor import Bench, pull_handle, ready  # noqa: F401 - one of them is a fixture

from vtk_segdeform import Session, load_session, read_mesh
from vtk_segdeform.cli.main import main
from vtk_segdeform.widgets.editor.editor import Mode
from vtk_segdeform.widgets.recording.recording import replay
from vtk_segdeform.widgets.region_selector.region_selector import Tool

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")


@pytest.fixture
def bench(ready):  # noqa: F811
    """Yield an editor over a session that is ready, in a view with few pixels to film."""
    mesh, state = ready
    made = Bench(plain_view((200, 160)), Session(mesh, state=state))
    yield made
    assert made.hand.failures == []
    made.editor.remove()


@pytest.mark.campaign
def test_the_input_is_recorded_and_replayed_from_two_files(bench, tmp_path):
    bench.editor.path = tmp_path / "work.segdeform"
    bench.type("3", "t", "v", "4")
    pull_handle(bench, (10, 15))
    bench.hand.tick(3)
    bench.type("ctrl+r")
    assert "work.recording.txt" in bench.editor.status
    pull_handle(bench, (20, 30))
    bench.hand.tick(2)
    bench.type("2", "4")
    pull_handle(bench, (-15, 5))
    bench.type("3", "d", "ctrl+r")
    assert "Recording saved to" in bench.editor.status
    bench.type("2")  # not recorded any more

    text = tmp_path / "work.recording.txt"
    start = load_session(text.with_suffix(".segdeform"))
    again = Bench(plain_view((500, 400)), start)
    replay(again.view, text, busy=lambda: again.editor.is_busy)
    again.settle()
    assert again.hand.failures == []
    assert again.editor.mode is Mode.HANDLES
    selector = again.editor.widgets.selector
    assert (selector.tool, selector.through) == (Tool.RECTANGLE, True)
    assert np.array_equal(again.session.vertices, bench.session.vertices)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "work.recording.segdeform", "work.recording.txt",
    ]  # fmt: skip


def test_the_video_contains_the_drags_and_nothing_else(bench, tmp_path):
    bench.editor.path = tmp_path / "work.segdeform"
    del bench.editor.view.render  # draw at every event again
    bench.type("ctrl+m")
    assert "Recording video" in bench.editor.status
    bench.hand.key("h")
    bench.hand.key("h")
    bench.type("ctrl+m")
    assert "No video saved" in bench.editor.status
    bench.type("4", "ctrl+m")
    pull_handle(bench, (10, 15), moves=4)
    bench.type("ctrl+m")
    assert "saved to" in bench.editor.status
    with Image.open(tmp_path / "work.film.gif") as film:
        assert film.n_frames >= 4
        assert film.size == tuple(bench.editor.view.window.GetSize())


@pytest.mark.parametrize("key", ["ctrl+r", "ctrl+m"])
def test_an_unwritable_folder_is_reported_immediately(bench, tmp_path, key):
    bench.editor.path = tmp_path / "no" / "work.segdeform"
    bench.type(key)
    assert "no" in bench.editor.status
    assert len(bench.hand.failures) == 1
    assert "work." in str(bench.hand.failures.pop())
    bench.type("2")
    assert "recording" not in bench.editor.status


def test_the_status_line_shows_an_ongoing_recording(bench, tmp_path):
    bench.editor.path = tmp_path / "work.segdeform"
    seen = []
    for key in ("ctrl+r", "ctrl+m", "ctrl+r", "ctrl+m"):
        bench.type(key, "1", "2")  # the message of the key is gone
        seen.append(picture(bench.view)[-20:])
    bench.type("1", "2")
    last = picture(bench.view)[-20:]
    assert [np.array_equal(last, one) for one in seen] == [False, False, False, True]
    assert not np.array_equal(seen[0], seen[2])


def test_a_second_recording_does_not_overwrite_the_first(bench, tmp_path):
    bench.editor.path = tmp_path / "work.segdeform"
    bench.type(*["ctrl+r"] * 4)
    assert (tmp_path / "work.recording.txt").exists()
    assert (tmp_path / "work.recording-2.txt").exists()
    lines = (tmp_path / "work.recording-2.txt").read_text()
    assert "control key=r" not in lines


def test_two_files_are_replayed_from_the_command_line(bench, tmp_path, capsys):
    bench.editor.path = tmp_path / "work.segdeform"
    bench.type("4", "ctrl+r")
    pull_handle(bench, (10, 15), moves=4)
    bench.hand.tick(2)
    bench.type("ctrl+r")
    film, mesh = tmp_path / "bug.gif", tmp_path / "out.ply"
    text, start = (str(tmp_path / f"work.recording.{end}") for end in ("txt", "segdeform"))
    assert main(["replay", text, start, "--film", str(film), "-o", str(mesh)]) == 0
    told = capsys.readouterr().out
    assert "frames" in told
    assert "said" not in told
    assert np.allclose(read_mesh(mesh).vertices, bench.session.vertices, atol=1e-9)
    with Image.open(film) as pictures:
        assert pictures.n_frames > 4

    lines = Path(text).read_text().splitlines()
    lines[6] = "0.5 MouseMove ten 3"
    Path(text).write_text("\n".join(lines))
    assert main(["replay", text, start, "--film", str(film)]) == 1
    assert "line 7: expected a whole number" in capsys.readouterr().err
