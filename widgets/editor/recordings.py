"""Recordings of the editor's input, as text files, and videos of its deform mode.

A recording can be replayed on another machine: the session at its start is saved beside it, and
its first lines are the keys that select the mode and the tool at that moment.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from vtk_segdeform.errors import MissingDependencyError, SessionError
from vtk_segdeform.session import Session, save_session

from ..recording import Film, Input, Recorder, require_film
from ..scene import Stop, View

_MOST_FRAMES = 1200  # one minute of video; longer ones would fill the memory


class Recordings:
    """At most one recording of the input and one video of a view at a time.

    Parameters
    ----------
    view : View
        The view to record.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._recorder: Recorder | None = None
        self._path = Path()
        self._film: Film | None = None
        self._stop_film: Stop | None = None

    @property
    def is_recording(self) -> bool:
        """Whether the input is being recorded."""
        return self._recorder is not None

    @property
    def is_filming(self) -> bool:
        """Whether a video is being recorded."""
        return self._film is not None

    @property
    def labels(self) -> list[str]:
        """Labels of the current recordings, for the status line."""
        return ["recording input"] * self.is_recording + ["recording video"] * self.is_filming

    def start_recording(
        self,
        beside: Path,
        session: Session,
        *,
        keys: str,
        assigned: Mapping[str, Sequence[str]],
        skips: Callable[[Input], bool],
    ) -> Path:
        """Start recording the input; return the file.

        Parameters
        ----------
        beside : Path
            The file of the session.
        session : Session
            Saved beside the recording.
        keys : str
            Default keys that select the current mode and tool.
        assigned : mapping of str to sequence of str
            The keys of actions in the recorded input, as far as they differ from the default ones.
        skips : callable
            Whether to leave out an `Input`.

        Raises
        ------
        SessionError
            If the file or its session cannot be written, or during a drag.
        """
        path = free_place(beside, ".recording.txt")
        if session.is_dragging:
            raise SessionError("Finish the drag before recording the input")
        save_session(path.with_suffix(".segdeform"), session)
        session.poses.start_afresh()  # as the session that the replay loads
        self._recorder = Recorder(self._view, path, keys=keys, skips=skips)
        if assigned:
            self._recorder.assign(assigned)
        self._path = path
        return path

    def assign(self, keys: Mapping[str, Sequence[str]]) -> None:
        """Note in the current recording, if there is one, that actions have other *keys*."""
        if self._recorder is not None:
            self._recorder.assign(keys)

    def end_recording(self) -> Path:
        """Stop recording the input; return the file."""
        if self._recorder is not None:
            self._recorder.stop()
            self._recorder = None
        return self._path

    def start_film(self, when: Callable[[], bool]) -> None:
        """Start a video of every frame drawn while *when* returns True."""
        film = Film(self._view)
        self._stop_film = film.watch(lambda: len(film) < _MOST_FRAMES and when())
        self._film = film

    def end_film(self) -> Film:
        """Stop the video and return its frames."""
        if self._film is None or self._stop_film is None:
            raise SessionError("No video is being recorded")
        self._stop_film()
        film, self._film = self._film, None
        return film

    def remove(self) -> None:
        """Stop all recordings; a video that was not ended is discarded."""
        self.end_recording()
        if self.is_filming:
            self.end_film()


def film_place(beside: Path) -> Path:
    """Return the path of a new video: an MP4 file if possible, otherwise a GIF.

    Raises
    ------
    SessionError, MissingDependencyError
        If neither can be written there.
    """
    path = free_place(beside, ".film.mp4")
    try:
        require_film(path)
    except MissingDependencyError:
        path = free_place(beside, ".film.gif")
        require_film(path)
    return path


def free_place(beside: Path, ending: str) -> Path:
    """Return an unused path beside a session's file, with its name and *ending*."""
    first, suffix = ending.rsplit(".", 1)
    for number in itertools.count(1):
        count = f"-{number}" if number > 1 else ""
        path = beside.with_name(f"{beside.stem}{first}{count}.{suffix}")
        if not os.path.lexists(path):
            return path
    raise AssertionError  # unreachable: `count` never ends
