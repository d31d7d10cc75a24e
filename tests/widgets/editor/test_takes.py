"""Recording and filming from the editor, by real keys; and the replay that somebody else makes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hands import picture, plain_view
from PIL import Image
from test_editor import Desk, desk, pull_handle, ready  # noqa: F401 - two of them are fixtures

from vtk_segdeform import load_session, read_mesh
from vtk_segdeform.cli.main import main
from vtk_segdeform.widgets.editor.editor import Mode
from vtk_segdeform.widgets.recording.recording import replay
from vtk_segdeform.widgets.region_selector.region_selector import Tool


def test_what_hands_do_is_recorded_and_replayed_from_two_files_alone(desk, tmp_path):  # noqa: F811
    desk.editor.path = tmp_path / "work.segdeform"
    desk.type("3", "t", "v", "4")
    pull_handle(desk, (10, 15))
    desk.hand.tick(3)
    desk.type("ctrl+r")
    assert "work.recording.txt" in desk.editor.status
    pull_handle(desk, (20, 30))
    desk.hand.tick(2)
    desk.type("2", "4")
    pull_handle(desk, (-15, 5))
    desk.type("3", "d", "ctrl+r")
    assert "recording written to" in desk.editor.status
    desk.type("2")  # no part of it any more

    text = tmp_path / "work.recording.txt"
    start = load_session(text.with_suffix(".segdeform"))
    again = Desk(plain_view((500, 400)), start)
    replay(again.view, text, busy=lambda: again.editor.is_busy)
    again.settle()
    assert again.hand.failures == []
    assert again.editor.mode is Mode.HANDLES
    selector = again.editor.stage.selector
    assert (selector.tool, selector.through) == (Tool.RECTANGLE, True)
    assert np.array_equal(again.session.vertices, desk.session.vertices)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "work.recording.segdeform", "work.recording.txt",
    ]  # fmt: skip


def test_the_drags_are_filmed_and_nothing_else(desk, tmp_path):  # noqa: F811
    desk.editor.path = tmp_path / "work.segdeform"
    desk.type("ctrl+m")
    assert "filming" in desk.editor.status
    desk.hand.key("h")
    desk.hand.key("h")
    desk.type("ctrl+m")
    assert "nothing filmed" in desk.editor.status
    desk.type("4", "ctrl+m")
    pull_handle(desk, moves=4)
    desk.type("ctrl+m")
    assert "written to" in desk.editor.status
    with Image.open(tmp_path / "work.film.gif") as film:
        assert film.n_frames >= 4
        assert film.size == (500, 400)


@pytest.mark.parametrize("key", ["ctrl+r", "ctrl+m"])
def test_where_nothing_can_be_written_it_is_said_at_once(desk, tmp_path, key):  # noqa: F811
    desk.editor.path = tmp_path / "no" / "work.segdeform"
    desk.type(key)
    assert "no" in desk.editor.status
    assert len(desk.hand.failures) == 1
    assert "work." in str(desk.hand.failures.pop())
    desk.type("2")
    assert "recording" not in desk.editor.status


def test_the_line_at_the_bottom_shows_that_a_recording_goes_on(desk, tmp_path):  # noqa: F811
    desk.editor.path = tmp_path / "work.segdeform"
    seen = []
    for key in ("ctrl+r", "ctrl+m", "ctrl+r", "ctrl+m"):
        desk.type(key, "1", "2")  # what was said of the key is gone
        seen.append(picture(desk.view)[-20:])
    desk.type("1", "2")
    last = picture(desk.view)[-20:]
    assert [np.array_equal(last, one) for one in seen] == [False, False, False, True]
    assert not np.array_equal(seen[0], seen[2])


def test_a_second_recording_leaves_the_first(desk, tmp_path):  # noqa: F811
    desk.editor.path = tmp_path / "work.segdeform"
    desk.type(*["ctrl+r"] * 4)
    assert (tmp_path / "work.recording.txt").exists()
    assert (tmp_path / "work.recording-2.txt").exists()
    lines = (tmp_path / "work.recording-2.txt").read_text()
    assert "control key=r" not in lines


def test_two_files_are_replayed_from_the_command_line(desk, tmp_path, capsys):  # noqa: F811
    desk.editor.path = tmp_path / "work.segdeform"
    desk.type("4", "ctrl+r")
    pull_handle(desk)
    desk.hand.tick(2)
    desk.type("ctrl+r")
    film, mesh = tmp_path / "bug.gif", tmp_path / "out.ply"
    text, start = (str(tmp_path / f"work.recording.{end}") for end in ("txt", "segdeform"))
    assert main(["replay", text, start, "--film", str(film), "-o", str(mesh)]) == 0
    told = capsys.readouterr().out
    assert "pictures" in told
    assert "said" not in told
    assert np.allclose(read_mesh(mesh).vertices, desk.session.vertices, atol=1e-9)
    with Image.open(film) as pictures:
        assert pictures.n_frames > 4

    lines = Path(text).read_text().splitlines()
    lines[6] = "0.5 MouseMove ten 3"
    Path(text).write_text("\n".join(lines))
    assert main(["replay", text, start, "--film", str(film)]) == 1
    assert "line 7: expected a whole number" in capsys.readouterr().err
