"""Solving in the time there is: a few steps at each event, and the rest while nothing happens.

How many steps an event has time for is learned from how long the last ones took.  A solve that
stopped for that is gone on with by a timer, until it has converged or can get no farther.
A replay gives each event as many as it was given before; see `pace`.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from statistics import median

from vtk_segdeform.session import Session
from vtk_segdeform.solver import Solution, Status

from ..scene import Pace, Stop, View

_BUDGET = 0.020  # seconds of an event: about half of what drawing takes without a graphics card
_AT_REST = 0.080  # seconds of a refinement, when no pointer waits to be followed
_MOST_STEPS = 8  # a drag is to follow the pointer rather than to arrive
_FEWEST_AT_REST = 3  # with one at a time acceleration learns nothing, and it takes for ever
_PERIOD = 40  # milliseconds between two refinements


class LiveSolve:
    """The solver of a session, as fast as events come.

    Parameters
    ----------
    view : View
        Whose timer refines.
    session : Session
        What is solved for.
    failed : callable
        Called when a refinement raises, before the exception goes on.

    Attributes
    ----------
    refines : bool
        Whether to refine at all.
    """

    def __init__(self, view: View, session: Session, failed: Callable[[], object]) -> None:
        self.refines = True
        self._view, self._session, self._failed = view, session, failed
        self._seconds: deque[float] = deque(maxlen=5)  # of one step; the median forgets hiccups
        self._stop: Stop | None = None
        self._pace = Pace(view.interactor)

    @property
    def steps(self) -> int:
        """How many steps the next event has time for: 1 to 8, and 1 before anything is known."""
        return self._steps_in(_BUDGET, 1)

    @property
    def is_refining(self) -> bool:
        """Whether the timer is running."""
        return self._stop is not None

    def solve(self, solve: Callable[..., Solution]) -> None:
        """Do ``solve(max_steps=...)``, and see to it that the rest is done later."""
        if not self._session.is_bound:
            self._session.bind()  # seconds that say nothing of how long a step takes
        self._spend(solve, self.steps)
        self.go_on()

    def go_on(self) -> None:
        """Refine the current pose if it was stopped early; otherwise stop refining.

        Also stop where changed options or cages would have to be bound first, which takes long.
        """
        solution = self._session.solution
        is_final = solution is None or solution.status is not Status.STEP_LIMIT
        if is_final or not self.refines or not self._session.is_bound:
            self.rest()
        elif self._stop is None:
            self._stop = self._view.every(_PERIOD, self._tick)

    def rest(self) -> None:
        """Stop the timer."""
        if self._stop is not None:
            self._stop()
            self._stop = None

    def remove(self) -> None:
        """Stop for good."""
        self.rest()
        self._pace.stop()

    def _tick(self) -> None:
        self.go_on()  # something else may have changed the pose
        if self._stop is None:
            return
        is_done = False
        try:
            self._spend(self._session.refine, self._steps_in(_AT_REST, _FEWEST_AT_REST))
            is_done = True
        finally:
            if not is_done:
                self.rest()
                self._failed()
        self.go_on()

    def _steps_in(self, seconds: float, fewest: int) -> int:
        if not self._seconds:
            return fewest
        return max(fewest, min(_MOST_STEPS, int(seconds / max(median(self._seconds), 1e-6))))

    def _spend(self, solve: Callable[..., Solution], steps: int) -> None:
        began = time.perf_counter()
        solution = solve(max_steps=self._pace.steps(steps))
        self._seconds.append((time.perf_counter() - began) / max(1, solution.steps))
