"""Solving during a drag: a few steps at each event, more from a timer between events.

Two or three steps from the last pose converge at almost every motion of a hand; where a body
buckles, some more follow it closer.  If a solve stops at its step limit, a timer refines the pose
until it has converged or makes no more progress.

While targets move, pictures are drafts; see `Draft`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from vtk_segdeform.session import Session
from vtk_segdeform.solver import Solution

from ..scene import Draft, Stop, View

STEPS = 8
"""Steps at an event or a tick, at most.

With 5, a pull has frames that are 1 % of the diagonal away from their poses, and takes as long."""
_PERIOD = 40  # milliseconds between two refinements
_LONGEST = 0.1  # seconds of the processor in one refinement, nearly: with contacts, of two steps


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
    is_refused : bool
        Whether the last targets of the gesture were refused.
    """

    def __init__(self, view: View, session: Session, failed: Callable[[], object]) -> None:
        self.is_refused = False
        self._view, self._session, self._failed = view, session, failed
        self._stop: Stop | None = None
        self._halted: Solution | None = None  # of the pose that is not to be refined
        self._draft = Draft.of(view)
        self._steps = STEPS  # of the next refinement, at most

    @property
    def is_refining(self) -> bool:
        """Whether the timer is running."""
        return self._stop is not None

    def solve(self, solve: Callable[..., Solution]) -> None:
        """Call ``solve(max_steps=...)``, and refine its result later.

        Targets that raise `ConstraintError` are reported to `View.on_failure` and leave the pose
        unchanged, so that the gesture can continue.
        """
        self._draft.begin()
        self.is_refused = True
        with self._view.guarded(only_refusals=True):
            solve(max_steps=STEPS)
            self.is_refused = False
        self._draft.begin()  # again, as a slow solve is no rest
        self.resume()

    def solve_through(self, moves: Sequence[Callable[..., Solution]]) -> None:
        """Call each of *moves* as `solve` does."""
        with self._view.guarded(only_refusals=True):
            for move in moves:
                move(max_steps=STEPS)

    def has_reached(self) -> bool:
        """Whether the pose is that of the last targets."""
        return not self.is_refused and self._session.solution is not None

    def resume(self) -> None:
        """Refine the current pose if it stopped at the step limit; otherwise stop refining.

        Also stop if changed options or cages need a new binding, which may take long.
        """
        session = self._session
        is_final = not session.is_unsettled or session.solution is self._halted
        if is_final or not session.is_bound:
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

    def _tick(self) -> None:
        self.resume()  # the pose may have changed since the last tick
        if self._stop is None:
            return
        is_done, began = False, time.thread_time()
        try:
            self._session.refine(max_steps=min(self._steps, STEPS))
            took = max(time.thread_time() - began, 1e-3)
            self._steps = min(max(int(self._steps * _LONGEST / took), 1), STEPS)
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
