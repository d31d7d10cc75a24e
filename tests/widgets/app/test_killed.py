"""The desktop program is killed, as by ``kill -9``, and its last autosave is recovered.

A program in another process drags or saves, and reports every pose and every autosave.  It is
killed at some moment; a new window then recovers one of those poses to the last bit, no older
than the last autosave.  `test_autosave` and `test_window` test the parts of this in short.
"""

from __future__ import annotations

import gc
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from app_hands import (
    AppHand,
    Boxes,
    Window,
    delete,
    digest,
    ready_session,
    settings_in,
    slots,
)
from qt_hands import application, until

from vtk_segdeform.session.store import load_session, save_session
from vtk_segdeform.widgets.editor import Autosaves

MANY = pytest.mark.campaign


class Program:
    """The program that works in a folder, and its reports until it is killed."""

    def __init__(self, folder: Path):
        self._path = folder / "told"
        self._number = int(self.wait_for("number")[0][1])

    @property
    def told(self) -> list[list[str]]:
        """All complete lines, split into words."""
        lines = self._path.read_text().split("\n")[:-1] if self._path.exists() else []
        return [line.split() for line in lines]

    def wait_for(self, word: str, times: int = 1) -> list[list[str]]:
        """Wait for *times* more reports of *word*, or for the first one if *times* is 1."""
        before = len(self.all(word)) if times > 1 else 0
        until(lambda: len(self.all(word)) >= before + times, word, 120.0)
        return self.all(word)

    def all(self, word: str) -> list[list[str]]:
        return [line for line in self.told if line[0] == word]

    @property
    def poses(self) -> list[str]:
        """Its poses, in order."""
        return [pose for _, pose in self.all("pose")]

    def kill(self) -> None:
        """Kill it with SIGKILL."""
        os.kill(self._number, signal.SIGKILL)
        until(lambda: not is_alive(self._number), "its end")


def is_alive(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture(scope="module")
def programs():
    """Return a function that starts the program in a folder."""
    application()  # or skip
    root = Path(__file__).resolve().parents[3]
    forks = subprocess.Popen(
        [sys.executable, root / "tests" / "support" / "app_hands.py"],
        stdin=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(root)}, start_new_session=True,
    )  # fmt: skip

    def start(what: str, folder: Path) -> Program:
        print(what, folder, file=forks.stdin, flush=True)
        return Program(folder)

    yield start
    os.killpg(forks.pid, signal.SIGKILL)  # with all its children
    forks.stdin.close()
    forks.wait()


@pytest.fixture
def folder(tmp_path) -> Path:
    save_session(tmp_path / "arm.segdeform", ready_session())
    return tmp_path


def recovered(folder: Path) -> str | None:
    """Start the program again and recover; return the pose, or None if nothing is offered."""
    boxes = Boxes()
    boxes.answers.append("Recover")
    hand = AppHand(Window(settings_in(folder), Autosaves(folder / "unsaved")))
    hand.window.begin()
    hand.settle()
    pose = digest(hand.window.session) if hand.window.has_mesh else None
    if pose is not None:
        assert boxes.seen[0].startswith("Recover unsaved work on arm.segdeform from ")
        assert hand.title == "arm.segdeform* - segdeform"
        boxes.answers[:] = ["Discard"]
    delete(hand.window)
    assert slots(folder) == []
    del hand
    gc.collect()
    return pose


def later(poses: list[str], pose: str) -> list[str]:
    """Return a pose and all later ones."""
    return poses[poses.index(pose) :]


@pytest.mark.parametrize("seed", [pytest.param(k, marks=MANY) for k in range(3, 54)])
def test_killed_in_a_drag_it_offers_the_last_saved_pose_or_a_later_one(programs, folder, seed):
    rests = seed % 4 == 0  # after a drag that was finished
    program = programs("rest" if rests else "drag", folder)
    ((_, finished),) = program.wait_for("finished")
    assert Autosaves(folder / "unsaved").abandoned() == []  # locked while the program runs
    if rests:
        time.sleep(random.Random(seed).uniform(0.0, 0.4))
        program.kill()
        assert recovered(folder) in later(program.poses, finished)  # which may be finished
        return
    program.wait_for("kept", times=2 + seed % 3)
    time.sleep(random.Random(seed).uniform(0.0, 0.4))
    program.kill()
    found = recovered(folder)
    assert found in later(program.poses, program.all("kept")[-1][1])
    assert found in later(program.poses, finished)


@pytest.mark.parametrize("seed", [pytest.param(k, marks=MANY) for k in range(1, 52)])
def test_killed_while_saving_every_file_is_complete_and_old_or_new(programs, folder, seed):
    program = programs("save", folder)
    program.wait_for("saving", times=2)  # so that one has been saved
    time.sleep(random.Random(seed).uniform(0.0, 0.06))
    program.kill()
    saved = program.all("saved")[-1][1]
    assert digest(load_session(folder / "arm.segdeform")) in later(program.poses, saved)
    assert recovered(folder) in [None, *later(program.poses, saved)]
