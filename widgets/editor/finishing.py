"""Finishing poses on the mesh in the background, once the hand has rested after a drag.

    end of a drag  ->  rest for a moment, until the pose has converged
    another thread ->  `Session.finishing`, from its own deformer
    the result     ->  `Session.accept_finish`, part of the same undo step
    on the screen  ->  `Glide`, since the pose may move by some per cent of the diagonal

The next press, every change of the session, and saving cancel it: a file contains what was shown,
and stays up to date.  Large meshes are finished on request only.
"""

from __future__ import annotations

from collections.abc import Callable

from vtk_segdeform.checks import as_flag
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Change, FinishedPose, Session

from ..scene import Glide, SurfaceDisplay, View
from .job import Job, view_timer
from .rest import Rest

MOST_VERTICES = 20_000  # of a mesh that is finished without a request: it takes about a second

_REST = 0.4  # seconds without a change before it begins
_STEP = 0.2  # the fraction that is shown is a multiple of this: each change draws the view
_KEPT = Change.NAMES | Change.PIVOTS  # changes that a finish does not depend on


class Finishing:
    """Finishes the pose of a session after a drag, unless that is not wanted.

    Parameters
    ----------
    view : View
        Provides the timer.
    session : callable
        Returns the session that is edited.
    surface : callable
        Returns the surface that shows it.
    is_free : callable
        Returns whether nothing is being dragged, refined or computed.
    changed : callable
        Called when `fraction` has changed.
    """

    def __init__(
        self,
        view: View,
        session: Callable[[], Session],
        surface: Callable[[], SurfaceDisplay],
        is_free: Callable[[], bool],
        changed: Callable[[], object],
    ) -> None:
        self._view, self._session, self._surface = view, session, surface
        self._is_free, self._changed = is_free, changed
        self._is_wanted = True
        self.glide = Glide(view)
        self._rest = Rest(view, _REST, is_free, self._start)
        self._job: Job[FinishedPose] | None = None
        self._is_accepting = False
        self._fraction: float | None = None

    @property
    def is_wanted(self) -> bool:
        """Whether poses are finished after each drag."""
        return self._is_wanted

    @is_wanted.setter
    def is_wanted(self, wanted: bool) -> None:
        self._is_wanted = as_flag(wanted, "wanted")
        self.interrupt()

    @property
    def fraction(self) -> float | None:
        """Completed fraction, 0..1, coarsely; None if no pose is being finished."""
        return self._fraction

    @property
    def work(self) -> str:
        """What `fraction` is about."""
        return "Finishing"

    @property
    def is_pending(self) -> bool:
        """Whether a pose is being finished, or will be in a moment."""
        return self._rest.is_pending or self._job is not None

    def rest(self) -> None:
        """Finish the pose in a moment: a drag has just ended."""
        self.interrupt()
        is_small = self._session().mesh.n_vertices <= MOST_VERTICES
        if self._is_wanted and is_small:
            self._rest.begin()

    def follow(self, change: Change) -> None:
        """Cancel the finish if it does not suit the session after *change*."""
        if self._is_accepting or not change & ~_KEPT:
            return
        if change is Change.POSE and self._rest.is_pending:
            self._rest.begin()  # still converging
        else:
            self.interrupt()

    def interrupt(self) -> bool:
        """Cancel, and end the glide; False if there was nothing to cancel."""
        is_running = self._job is not None
        self.glide.end()
        self._rest.stop()
        if self._job is not None:
            self._job.abandon()
            self._job = None
        self._show(None)
        return is_running

    def remove(self) -> None:
        """Stop permanently."""
        self.interrupt()

    def _start(self) -> bool:
        """Begin to finish the pose; True if it must converge first."""
        session = self._session()
        solution = session.solution  # None after undo
        if session.is_unsettled:
            return True  # it will be refined
        self.interrupt()
        if solution is None or not session.can_finish:
            return False
        self._job = Job(
            view_timer(self._view),
            measured(session.finishing()),
            done=self.accept,
            watch=self._watch,
            is_due=self._is_free,
        )
        self._show(0.0)
        return False

    def accept(self, result: FinishedPose) -> bool:
        """Use a finished pose, and glide to it; False if the pose has changed since."""
        session, self._is_accepting = self._session(), True
        try:
            with self._view.drawing_once():
                before = session.vertices
                is_accepted = session.accept_finish(result)
                if is_accepted:
                    self.glide.begin(self._surface(), before)
        finally:
            self._is_accepting = False
        return is_accepted

    def _watch(self, job: Job[FinishedPose]) -> None:
        if job is self._job and not job.is_running:
            self._job = None
        self._show(_STEP * int(job.fraction / _STEP) if job.is_running else None)

    def _show(self, fraction: float | None) -> None:
        if fraction != self._fraction:
            self._fraction = fraction
            self._changed()


def measured(finish: Callable[[Progress], FinishedPose]) -> Callable[[Progress], FinishedPose]:
    """Return *finish*, which also looks for crossings and folds of the pose, for the hint."""

    def run(progress: Progress) -> FinishedPose:
        result = finish(progress)
        result.solution.crossings()
        result.solution.folds()
        return result

    return run
