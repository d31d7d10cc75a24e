"""What was done and what it took: an entry for each drag and each job, the oldest forgotten first.

A drag's entry tells how it ended: the steps of the solver and its status, how far the handle is
from where it was to be, and what became of the volume.  It goes on being written while the pose
is refined.  A drag that was taken back leaves none.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from vtk_segdeform.session import Change, Effort, Session
from vtk_segdeform.solver import Solution

from ..volume_overlay import percent

LIMIT = 200


@dataclass(frozen=True)
class Entry:
    """One thing that was done."""

    number: int
    """1, 2, ...; the same as long as it is the same entry."""
    time: float
    """When it was done, as `time.time` counts."""
    what: str
    """In a few words."""
    seconds: float
    """What it took of solving, or of a job's time."""
    outcome: str
    """How it ended."""
    steps: int | None = None
    """Of the solver; None where nothing was solved for."""
    handle_error: float | None = None
    """As `Solution.handle_error`."""
    volume_change: float | None = None
    """As `Session.volume_change`."""

    @property
    def text(self) -> str:
        """All that in two or three lines."""
        took = f"{self.seconds:.1f} s" if self.seconds >= 1.0 else f"{1e3 * self.seconds:.0f} ms"
        if self.steps is not None:
            took = f"{self.steps} step{'s' * (self.steps != 1)}, {took}"
        lines = [f"{time.strftime('%H:%M:%S', time.localtime(self.time))}  {self.what}"]
        lines.append(f"{took}: {self.outcome}")
        if self.volume_change is not None:
            lines.append(f"volume {percent(self.volume_change)}")
        if self.handle_error is not None:
            lines[-1] += f", handle off by {self.handle_error:.1e} of the diagonal"
        return "\n".join(lines)


class Log:
    """The last things that were done in an editor; `follow` tells it of a session's drags.

    Parameters
    ----------
    limit : int
        How many entries there are at most.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self._entries: deque[Entry] = deque(maxlen=limit)
        self._count = 0
        self._session: Session | None = None
        self._stop: Callable[[], None] | None = None
        self._drag: tuple[str, Solution | None, float] | None = None  # the one in hand
        self._before = Effort(0, 0.0)  # that one, or the next one
        self._refinable = False  # whether the last entry tells how the present pose came to be

    @property
    def entries(self) -> tuple[Entry, ...]:
        """From the oldest on."""
        solution = None if self._session is None else self._session.solution
        if self._refinable and solution is not None:  # it may have arrived without a step more
            self._entries[-1] = replace(self._entries[-1], outcome=str(solution.status))
        return tuple(self._entries)

    def clear(self) -> None:
        """Forget all of it."""
        self._entries.clear()
        self._refinable = False

    def follow(self, session: Session) -> None:
        """Write down the drags of *session*, and of no other one any more."""
        self.rest()
        self._session, self._before = session, session.effort
        self._drag, self._refinable = None, False
        self._stop = session.on_change(lambda change: self._changed(session, change))

    def rest(self) -> None:
        """Write down no more drags."""
        self._refinable = False
        if self._stop is not None:
            self._stop()

    def add_job(self, what: str, seconds: float, outcome: str) -> None:
        """Write down that a job has ended."""
        self._refinable = False
        self._add(Entry(0, time.time(), what, seconds, outcome))

    def _changed(self, session: Session, change: Change) -> None:
        if session.is_dragging:
            self._drag = session.undo_label or "", session.solution, session.volume_change
            return
        if self._drag is not None:
            if change & Change.HISTORY:  # else it was taken back
                self._add(self._pose(session.effort, *self._drag))
            self._refinable, self._drag = not change & Change.POSE, None
        elif self._refinable and change == Change.POSE and session.solution is not None:
            last = self._entries.pop()
            now = self._pose(session.effort, last.what, session.solution, session.volume_change)
            more = Effort((last.steps or 0) + (now.steps or 0), last.seconds + now.seconds)
            now = replace(now, number=last.number, steps=more.steps, seconds=more.seconds)
            self._entries.append(now)
        elif change & (Change.POSE | Change.HISTORY):
            self._refinable = False
        self._before = session.effort

    def _pose(
        self, effort: Effort, what: str, solution: Solution | None, volume_change: float
    ) -> Entry:
        seconds, steps = effort.seconds - self._before.seconds, effort.steps - self._before.steps
        if solution is None:
            return Entry(0, time.time(), what, seconds, "moved freely", None, None, volume_change)
        status, error = str(solution.status), solution.handle_error
        return Entry(0, time.time(), what, seconds, status, steps, error, volume_change)

    def _add(self, entry: Entry) -> None:
        self._count += 1
        self._entries.append(replace(entry, number=self._count))
