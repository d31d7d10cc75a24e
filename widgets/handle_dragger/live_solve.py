"""Solving during a drag: a few steps at each event, more from a timer between events.

Three steps from the last pose end near the converged one at almost every motion of a hand; where a
body buckles, more of them follow it closer.  Their number per event follows from the measured time
of the last steps.  If a solve stops at
its step limit, a timer refines the pose until it has converged or makes no more progress.

While targets move, pictures are drafts; see `Draft`.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from statistics import median

from vtk_segdeform.session import Session
from vtk_segdeform.solver import Solution

from ..scene import Draft, Stop, View

_EVENT_TIME = 0.030  # seconds per event, about half the time of software rendering
_REFINE_TIME = 0.080  # seconds per refinement, when no event is pending
_MOST_STEPS = 8  # per event: following the pointer matters more than converging
_LEAST_STEPS = 3  # per event
_LEAST_REFINE_STEPS = 3  # with fewer per call, Anderson acceleration has no effect
_PERIOD = 40  # milliseconds between two refinements


class Pace:
    """How many steps a call takes, by the measured time of the last ones."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=5)  # per step; their median is used

    @property
    def of_event(self) -> int:
        """The number of steps of the next event: 3 to 8, and 3 before the first measurement."""
        return self._steps_in(_EVENT_TIME, _LEAST_STEPS)

    @property
    def of_rest(self) -> int:
        """The number of steps of a refinement between two events."""
        return self._steps_in(_REFINE_TIME, _LEAST_REFINE_STEPS)

    def measure(self, seconds: float, steps: int) -> None:
        """Record that a call of so many *steps* took so many *seconds*."""
        self._seconds.append(seconds / max(1, steps))

    def _steps_in(self, seconds: float, fewest: int) -> int:
        if not self._seconds:
            return fewest
        return max(fewest, min(_MOST_STEPS, int(seconds / max(median(self._seconds), 1e-6))))


class LiveSolve:
    """Solves for a session within the time between events.

    Parameters
    ----------
    view : View
        Provides the timer.
    session : Session
        The session to solve for.
    failed : callable
        Called when a refinement raises, before the exception propagates.

    Attributes
    ----------
    is_enabled : bool
        Whether the timer refines.
    is_refused : bool
        Whether the last targets of the gesture were refused.
    """

    def __init__(self, view: View, session: Session, failed: Callable[[], object]) -> None:
        self.is_enabled, self.is_refused = True, False
        self._view, self._session, self._failed = view, session, failed
        self._pace = Pace()
        self._stop: Stop | None = None
        self._halted: Solution | None = None  # of the pose that is not to be refined
        self._draft = Draft.of(view)

    @property
    def steps(self) -> int:
        """The number of steps of the next event: 3 to 8, and 3 before the first measurement."""
        return self._pace.of_event

    @property
    def is_refining(self) -> bool:
        """Whether the timer is running."""
        return self._stop is not None

    def solve(self, solve: Callable[..., Solution]) -> None:
        """Call ``solve(max_steps=...)``, and refine its result later.

        Targets that raise `ConstraintError` are reported to `View.on_failure` and leave the pose
        unchanged, so that the gesture can continue.
        """
        if not self._session.is_bound:
            self._session.bind()  # beforehand, so that it is not measured as part of a step
        self._draft.begin()
        self.is_refused = True
        with self._view.guarded(only_refusals=True):
            self._measure(solve, self.steps)
            self.is_refused = False
        self._draft.begin()  # again, as a slow solve is no rest
        self.resume()

    def lead(self, moves: Sequence[Callable[..., Solution]]) -> None:
        """Call each of *moves* as `solve` does."""
        with self._view.guarded(only_refusals=True):
            for move in moves:
                move(max_steps=_MOST_STEPS)

    def has_reached(self) -> bool:
        """Whether the pose is that of the last targets."""
        return not self.is_refused and self._session.solution is not None

    def resume(self) -> None:
        """Refine the current pose if it stopped at the step limit; otherwise stop refining.

        Also stop if changed options or cages need a new binding, which may take long.
        """
        solution = self._session.solution
        is_final = not self._session.is_unsettled
        if (
            is_final
            or solution is self._halted
            or not self.is_enabled
            or not self._session.is_bound
        ):
            self._stop_refining()
        elif self._stop is None:
            self._stop = self._view.every(_PERIOD, self._tick)

    def begin(self) -> None:
        """Stop refining until `resume`; where pictures are slow, draw drafts from now on."""
        self._draft.begin(if_slow=True)
        self.is_refused = False
        self._stop_refining()

    def pause(self) -> None:
        """Stop refining until `resume`, and draw in full quality."""
        self._draft.end()
        self.is_refused = False
        self._stop_refining()

    def halt(self) -> None:
        """Stop refining the current pose and draw it in full quality."""
        self._halted = self._session.solution
        self.pause()

    def remove(self) -> None:
        """Stop permanently."""
        self.pause()

    def _tick(self) -> None:
        self.resume()  # the pose may have changed since the last tick
        if self._stop is None:
            return
        is_done = False
        try:
            self._measure(self._session.refine, self._pace.of_rest)
            is_done = True
        finally:
            if not is_done:
                self.pause()
                self._failed()
        self.resume()

    def _stop_refining(self) -> None:
        if self._stop is not None:
            self._stop()
            self._stop = None

    def _measure(self, solve: Callable[..., Solution], steps: int) -> None:
        """Solve and record the time per step."""
        began = time.perf_counter()
        solution = solve(max_steps=steps)
        self._pace.measure(time.perf_counter() - began, solution.steps)
