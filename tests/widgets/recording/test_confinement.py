"""Untrusted recordings: the files a replay may write, and its limits."""

from __future__ import annotations

import itertools
import os
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from hands import plain_view
from solids import OCTAHEDRON

import vtk_segdeform as sd
from vtk_segdeform.cli.main import main
from vtk_segdeform.errors import ArgumentError, SessionError
from vtk_segdeform.widgets import DeformEditor, ReplayLimits, replay
from vtk_segdeform.widgets.recording import limits
from vtk_segdeform.widgets.recording.confinement import confined, confined_path
from vtk_segdeform.widgets.recording.reading import read_recording

pytestmark = pytest.mark.usefixtures("unprepared")
TITLE = "vtk_segdeform recording 1"
MESH = sd.Mesh(*OCTAHEDRON)
CODES = {"s": 19, "r": 18, "m": 13, "o": 15}
SAVES, RECORDS, FILMS, OPENS = (
    [f"0 {event} 5 5 control key={key} code={code}" for event in ("KeyPress", "Char", "KeyRelease")]
    for key, code in CODES.items()
)
KEYS = ["0 KeyPress 5 5 key=4 code=52", "0 KeyPress 5 5 key=h code=104"]
FILM = [*FILMS, *KEYS, *FILMS, "0 Timer 9"]
ALL = [TITLE, *SAVES, *RECORDS, *FILM, *OPENS, "0 Timer 20"]


class Bench:
    """An editor in its own folder, and the errors it reports."""

    def __init__(self) -> None:
        self.view = plain_view((200, 150))
        self.editor = DeformEditor(self.view, MESH)
        self.faults: list[Exception] = []
        self.editor.view.on_failure(self.faults.append)
        self.editor.On()

    def replay(self, lines, **options):
        """Replay *lines* and wait for the background jobs they start."""
        replay(self.view, lines, busy=lambda: self.editor.is_busy, **options)
        self.editor.wait()


@pytest.fixture
def bench(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    made = Bench()
    yield made
    made.editor.remove()


def tree_of(folder):
    """Return all files below a folder, with their content."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_without_a_folder_no_file_is_accessed_and_that_is_reported(bench, tmp_path):
    (tmp_path / "here" / "session.segdeform").write_text("mine")
    bench.editor.path = tmp_path / "here" / "session.segdeform"
    bench.replay([TITLE, *SAVES, *SAVES, *RECORDS, *FILM, *OPENS, *OPENS])
    assert tree_of(tmp_path) == {"here/session.segdeform": b"mine"}
    assert len(bench.faults) >= 5
    assert {type(fault) for fault in bench.faults} == {SessionError}
    assert all("only in the folder passed to it" in str(fault) for fault in bench.faults)


def test_with_a_folder_all_files_are_written_there_whatever_the_path_of_the_editor(bench, tmp_path):
    (tmp_path / "there").mkdir()
    mine = tmp_path / "here" / "work.segdeform"
    mine.write_text("mine")
    bench.editor.path = mine
    bench.replay(ALL, folder=tmp_path / "there")
    assert bench.faults == []
    written = tree_of(tmp_path)
    assert written.pop("here/work.segdeform") == b"mine"
    assert {name.partition("/")[0] for name in written} == {"there"}
    assert {"there/work.segdeform", "there/work.recording.txt"} <= set(written)


def test_afterwards_the_keys_write_where_they_did_before(bench, tmp_path):
    (tmp_path / "there").mkdir()
    bench.replay([TITLE, *SAVES], folder=tmp_path / "there")
    bench.editor.save()
    assert set(tree_of(tmp_path)) == {"there/session.segdeform", "here/session.segdeform"}
    with pytest.raises(SessionError, match="line 2"):
        bench.replay([TITLE, "0 Nonsense"], folder=tmp_path / "there")
    bench.editor.save(tmp_path / "here" / "again.segdeform")
    assert "here/again.segdeform" in tree_of(tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="links")
def test_a_link_does_not_lead_out_of_the_folder(bench, tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "precious").write_text("mine")
    for name in ("session.segdeform", "session.recording.txt"):
        (tmp_path / "there" / name).symlink_to(tmp_path / "precious")
    bench.replay([TITLE, *SAVES, *SAVES, *OPENS], folder=tmp_path / "there")
    assert (tmp_path / "precious").read_text() == "mine"
    assert all("leads out of the folder" in str(fault) for fault in bench.faults)
    assert len(bench.faults) == 3


def test_a_replay_inside_a_replay_restores_the_outer_folder(tmp_path):
    interactor, path = plain_view((50, 50)).interactor, Path("elsewhere/work.segdeform")
    outer, inner = tmp_path / "outer", tmp_path / "inner"
    with confined(interactor, outer):
        with confined(interactor, inner):
            assert confined_path(interactor, path) == inner / path.name
        assert confined_path(interactor, path) == outer / path.name
    assert confined_path(interactor, path) == path


def test_a_missing_folder_is_an_error_before_any_event(bench, tmp_path):
    with pytest.raises(SessionError, match="no such folder"):
        bench.replay(ALL, folder=tmp_path / "nowhere")
    assert tree_of(tmp_path) == {}


@pytest.mark.parametrize(
    ("lines", "says", "given"),
    [
        (itertools.repeat("0 MouseMove 2 1"), "2002: the limit of 2,000 events", {"events": 2000}),
        (itertools.repeat("# a word"), "2002: the limit of 2,000 events", {"events": 2000}),
        (["0 Timer 100000"] * 3, "4: the limit of 200,000 events", {}),
        (["0 Window 16384 16384"], "3: .*16384 x 16384 exceeds the limit of 16,000,000 pixels", {}),
    ],
)
def test_a_recording_beyond_the_limits_is_refused_before_any_event(lines, says, given):
    view = plain_view((50, 50))
    moved = []
    view.observe("MouseMoveEvent", lambda: moved.append("moved"))
    with pytest.raises(SessionError, match=f"^recording, line {says}"):
        replay(
            view,
            itertools.chain([TITLE, "0 MouseMove 1 1"], lines),
            limits=ReplayLimits(**given),
        )
    assert moved == []


def test_a_limit_may_be_raised_or_lowered_and_counts_ticks():
    lines = [TITLE, "0 Timer 100000", "0 Timer 100000", "0 Window 5000 4000"]
    assert len(read_recording(lines, ReplayLimits(events=200_001, pixels=20_000_000))) == 3
    with pytest.raises(SessionError, match="line 4: the limit of 200,000 events"):
        read_recording(lines, ReplayLimits(pixels=20_000_000))
    for wrong in ({"events": 0}, {"seconds": -1.0}, {"pixels": "9"}, {"seconds": float("nan")}):
        with pytest.raises(ArgumentError, match=rf"{next(iter(wrong))} must be a positive number"):
            ReplayLimits(**wrong)


def test_the_time_limit_applies_within_an_entry_of_many_ticks_and_during_endless_work():
    view = plain_view((50, 50))
    view.observe("TimerEvent", lambda: time.sleep(0.02))
    start = time.monotonic()
    with pytest.raises(SessionError, match=r"stopped at its limit of 0\.2 seconds"):
        replay(view, [TITLE, "0 Timer 100000"], limits=ReplayLimits(seconds=0.2))
    with pytest.raises(SessionError, match=r"stopped at its limit of 0\.2 seconds"):
        replay(
            view, [TITLE, "0 MouseMove 1 1"], limits=ReplayLimits(seconds=0.2), busy=lambda: True
        )
    assert time.monotonic() - start < 60.0


def test_pauses_that_are_longer_than_the_limit_are_refused_at_once():
    lines = [TITLE, *(f"{9 * k} MouseMove 1 1" for k in range(100))]
    with pytest.raises(
        SessionError, match=r"would take 198 seconds, more than its limit of 100 seconds"
    ):
        replay(plain_view((50, 50)), lines, pace=1.0, limits=ReplayLimits(seconds=100.0))
    replay(plain_view((50, 50)), lines, limits=ReplayLimits(seconds=100.0))  # without pauses


def test_a_huge_file_a_pipe_and_a_device_are_refused_at_once(tmp_path):
    view = plain_view((50, 50))
    with open(tmp_path / "huge.txt", "wb") as file:
        file.truncate(45_000_000_000)
    with pytest.raises(SessionError, match=r"huge\.txt: .*has 45 GB; the limit is"):
        replay(view, tmp_path / "huge.txt")
    if os.name == "posix":
        os.mkfifo(tmp_path / "pipe")
        for path in (tmp_path / "pipe", "/dev/zero"):
            with pytest.raises(SessionError, match="a device or a pipe"):
                replay(view, path)


@pytest.mark.campaign
def test_the_command_writes_only_to_the_given_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sd.write_mesh("ball.ply", MESH)
    (tmp_path / "evil.txt").write_text("\n".join([TITLE, "0 Window 200 150", *ALL[1:]]))
    before = set(tree_of(tmp_path))
    assert main(["replay", "evil.txt", "ball.ply", "--film", "a.gif"]) == 0
    assert "only in the folder passed to it" in capsys.readouterr().out
    assert set(tree_of(tmp_path)) - before == {"a.gif"}
    assert main(["replay", "evil.txt", "ball.ply", "--film", "b.gif", "--folder", "new"]) == 0
    assert "only in a folder" not in capsys.readouterr().out
    written = set(tree_of(tmp_path)) - before - {"a.gif", "b.gif"}
    assert "new/session.segdeform" in written
    assert all(name.startswith("new/") for name in written)


def test_the_limits_are_in_the_help_and_the_messages_of_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sd.write_mesh("ball.ply", MESH)
    (tmp_path / "long.txt").write_text("\n".join([TITLE, *["0 Timer 100000"] * 1000]))
    hours = itertools.count(step=3600)
    monkeypatch.setattr(limits, "time", SimpleNamespace(monotonic=lambda: next(hours)))
    assert main(["replay", "long.txt", "ball.ply", "--film", "a.gif"]) == 1
    assert "long.txt, line 4: the limit of 200,000 events" in capsys.readouterr().err
    more = ["--film", "a.gif", "--events", "1000000000", "--seconds", "7"]
    assert main(["replay", "long.txt", "ball.ply", *more]) == 1
    assert "stopped at its limit of 7 seconds" in capsys.readouterr().err
    assert set(tree_of(tmp_path)) == {"ball.ply", "long.txt"}
    assert main(["replay", "--help"]) == 0
    output = " ".join(capsys.readouterr().out.split())
    for limit in ("200000", "300", "16 million pixels", "--folder"):
        assert limit in output
