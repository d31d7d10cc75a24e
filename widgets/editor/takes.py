"""What hands do in the editor, kept as a text file; and what its deform mode shows, as a film.

A recording is to be replayed by somebody else.  So the session it begins with is written beside
it, and its first lines are the keys that lead to the mode and the tool of that moment.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vtk_segdeform.errors import MissingDependencyError, SessionError
from vtk_segdeform.session import Session, save_session

from ..recording import Film, Input, Recorder, require_film
from ..scene import Stop, View

_MOST_PICTURES = 1200  # a minute of film; larger ones fill the memory


class Takes:
    """At most one recording and one film of a view that are going on.

    Parameters
    ----------
    view : View
        What is recorded and filmed.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._recorder: Recorder | None = None
        self._path = Path()
        self._film: Film | None = None
        self._stop_film: Stop | None = None

    @property
    def is_recording(self) -> bool:
        """Whether a recording is going on."""
        return self._recorder is not None

    @property
    def is_filming(self) -> bool:
        """Whether a film is being taken."""
        return self._film is not None

    @property
    def words(self) -> list[str]:
        """What is going on, for people."""
        return ["recording"] * self.is_recording + ["filming"] * self.is_filming

    def record(self, beside: Path, session: Session, keys: str) -> Path:
        """Begin a recording; return the file.  *keys* lead to the mode and the tool of now.

        Raises
        ------
        SessionError
            If it, or the session it begins with, cannot be written; or in the midst of a drag.
        """
        path = free_place(beside, ".recording.txt")
        if session.is_dragging:
            raise SessionError("let go of what is dragged before a recording begins")
        save_session(path.with_suffix(".segdeform"), session)
        session.start_afresh()  # as the session does that the replay loads
        self._recorder = Recorder(self._view, path, keys=keys, skips=_is_ours)
        self._path = path
        return path

    def end_recording(self) -> Path:
        """Write no more; return the file."""
        if self._recorder is not None:
            self._recorder.stop()
            self._recorder = None
        return self._path

    def take(self, when: Callable[[], bool]) -> None:
        """Begin a film of whatever is drawn *when* that is True."""
        film = Film(self._view)
        self._stop_film = film.watch(lambda: len(film) < _MOST_PICTURES and when())
        self._film = film

    def end_film(self) -> Film:
        """Take no more pictures; return those there are."""
        if self._film is None or self._stop_film is None:
            raise SessionError("no film is being taken")
        self._stop_film()
        film, self._film = self._film, None
        return film

    def remove(self) -> None:
        """End all; a film that was not ended is given up."""
        self.end_recording()
        if self.is_filming:
            self.end_film()


def film_place(beside: Path) -> Path:
    """Return where to write a film: an MP4 where that can be written, or else a GIF.

    Raises
    ------
    SessionError, MissingDependencyError
        If none can be written there.
    """
    path = free_place(beside, ".film.mp4")
    try:
        require_film(path)
    except MissingDependencyError:
        path = free_place(beside, ".film.gif")
        require_film(path)
    return path


def free_place(beside: Path, ending: str) -> Path:
    """Return a path beside a session's file, of its name and *ending*, that is not taken."""
    first, suffix = ending.rsplit(".", 1)
    for number in itertools.count(1):
        count = f"-{number}" if number > 1 else ""
        path = beside.with_name(f"{beside.stem}{first}{count}.{suffix}")
        if not os.path.lexists(path):
            return path
    raise AssertionError  # there is always another number


def _is_ours(event: Any) -> bool:
    """Tell whether an event is of the keys that begin and end takes, which no replay is to type."""
    return isinstance(event, Input) and event.control and (event.key or "").lower() in ("r", "m")
