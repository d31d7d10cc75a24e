"""The log of an editor, shown as "History": an entry for each drag and each job.

The entry of a drag has the solver's steps and status, the handle error and the volume change.  It
is updated while the pose is refined.  A cancelled drag leaves no entry.  The oldest entries are
dropped first.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from vtk_segdeform.session import Change, Effort, Session
from vtk_segdeform.solver import Solution

from ..scene import enclosure_of
from ..volume_overlay import percent

LIMIT = 200


@dataclass(frozen=True)
class Entry:
    """A drag or a job."""

    number: int
    """1, 2, ...; unchanged when the entry is updated."""
    time: float
    """When it ended, as returned by `time.time`."""
    title: str
    """A short description."""
    seconds: float
    """Time spent in the solver, or duration of the job."""
    outcome: str
    """How it ended."""
    steps: int | None = None
    """Steps of the solver; None if it was not called."""
    handle_error: float | None = None
    """As `Solution.handle_error`."""
    volume_change: float | None = None
    """As `Session.volume_change`; None without a volume."""

    @property
    def text(self) -> str:
        """The entry in two or three lines."""
        took = f"{self.seconds:.1f} s" if self.seconds >= 1.0 else f"{1e3 * self.seconds:.0f} ms"
        if self.steps is not None:
            took = f"{self.steps} step{'s' * (self.steps != 1)}, {took}"
        lines = [f"{time.strftime('%H:%M:%S', time.localtime(self.time))}  {self.title}"]
        lines.append(f"{took}: {self.outcome}" if self.seconds else self.outcome)
        if self.volume_change is not None:
            lines.append(f"volume {percent(self.volume_change)}")
        if self.handle_error is not None:
            lines[-1] += f", handle error {_percent(self.handle_error)} of model size"
        return "\n".join(lines)


class Log:
    """The last drags and jobs of an editor; `follow` subscribes it to the drags of a session.

    Parameters
    ----------
    limit : int
        Largest number of entries.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self._entries: deque[Entry] = deque(maxlen=limit)
        self._count = 0
        self._session: Session | None = None
        self._stop: Callable[[], None] | None = None
        self._drag: tuple[str, Solution | None, float | None] | None = None  # the ongoing one
        self._before = Effort(0, 0.0)  # the ongoing drag, or the next one
        self._refinable = False  # whether the last entry is that of the current pose

    @property
    def entries(self) -> tuple[Entry, ...]:
        """All entries, the oldest first."""
        solution = None if self._session is None else self._session.solution
        if self._refinable and solution is not None:  # it may converge without a further step
            self._entries[-1] = replace(self._entries[-1], outcome=str(solution.status))
        return tuple(self._entries)

    def clear(self) -> None:
        """Remove all entries."""
        self._entries.clear()
        self._refinable = False

    def follow(self, session: Session) -> None:
        """Log the drags of *session*, and no longer those of another one."""
        self.unfollow()
        self._session, self._before = session, session.effort
        self._drag, self._refinable = None, False
        self._stop = session.on_change(lambda change: self._changed(session, change))

    def unfollow(self) -> None:
        """Stop logging drags."""
        self._refinable = False
        if self._stop is not None:
            self._stop()

    def add_job(self, title: str, seconds: float, outcome: str) -> None:
        """Add the entry of a job that has ended."""
        self._refinable = False
        self._append(Entry(0, time.time(), title, seconds, outcome))

    def _changed(self, session: Session, change: Change) -> None:
        if session.is_dragging:
            self._drag = session.undo_label or "", session.solution, _volume_change(session)
            return
        if self._drag is not None:
            if change & Change.HISTORY:  # otherwise the drag was cancelled
                self._append(self._entry(session.effort, *self._drag))
            self._refinable, self._drag = not change & Change.POSE, None
        elif self._refinable and change == Change.POSE and session.solution is not None:
            last = self._entries.pop()
            now = self._entry(session.effort, last.title, session.solution, _volume_change(session))
            more = Effort((last.steps or 0) + (now.steps or 0), last.seconds + now.seconds)
            now = replace(now, number=last.number, steps=more.steps, seconds=more.seconds)
            self._entries.append(now)
        elif change & (Change.POSE | Change.HISTORY):
            self._refinable = False
        self._before = session.effort

    def _entry(
        self, effort: Effort, title: str, solution: Solution | None, volume_change: float | None
    ) -> Entry:
        seconds, steps = effort.seconds - self._before.seconds, effort.steps - self._before.steps
        if solution is None:
            return Entry(0, time.time(), title, seconds, "Cage edited", None, None, volume_change)
        status, error = str(solution.status), solution.handle_error
        return Entry(0, time.time(), title, seconds, status, steps, error, volume_change)

    def _append(self, entry: Entry) -> None:
        self._count += 1
        self._entries.append(replace(entry, number=self._count))


def _volume_change(session: Session) -> float | None:
    return session.volume_change if enclosure_of(session).has_volume else None


def _percent(share: float) -> str:
    """Return a share in per cent, never in scientific notation.

    >>> _percent(1.3e-3), _percent(0.2), _percent(4e-9)
    ('0.13 %', '20 %', 'below 0.001 %')
    """
    percent = 100.0 * share
    if percent < 0.001:
        return "below 0.001 %" if share else "0 %"
    digits = min(3, max(0, 1 - math.floor(math.log10(percent))))  # two significant digits
    return f"{percent:.{digits}f} %"
