"""Finishing poses on the mesh in the background, once the hand has rested after a drag.

    end of a drag  ->  rest for a moment, until the pose has converged
    another thread ->  `finishing.finish` of the session, from its own deformer
    the result     ->  `Session.accept_finish`, part of the same undo step
    on the screen  ->  `Glide`, since the pose may move by some per cent of the diagonal

The next press, every change of the session, and saving cancel it: a file contains what was shown,
and stays up to date.  Large meshes are finished on request only.
"""

from __future__ import annotations

from collections.abc import Callable

from vtk_segdeform.checks import as_flag
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Change, FinishedPose, Session, finishing

from ..scene import Glide, SurfaceDisplay, View
from .queue import Kind, Queue, Task, Work

MOST_VERTICES = 20_000  # of a mesh that is finished without a request: it takes about a second

_REST = 0.4  # seconds without a change before it begins
_KEPT = Change.NAMES | Change.PIVOTS  # changes that a finish does not depend on


class Finishing:
    """Finishes the pose of a session after a drag, unless that is not wanted.

    Parameters
    ----------
    view : View
        Where the pose glides.
    queue : Queue
        Runs the finish.
    session : callable
        Returns the session that is edited.
    surface : callable
        Returns the surface that shows it.
    is_free : callable
        Returns whether nothing is being dragged, refined or computed.
    """

    def __init__(
        self,
        view: View,
        queue: Queue,
        session: Callable[[], Session],
        surface: Callable[[], SurfaceDisplay],
        is_free: Callable[[], bool],
    ) -> None:
        self._view, self._queue, self._session = view, queue, session
        self._surface, self._is_free = surface, is_free
        self._is_wanted, self._is_accepting = True, False
        self.glide = Glide(view)

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
        return self._queue.fraction(Kind.FINISH)

    @property
    def is_pending(self) -> bool:
        """Whether a pose is being finished, or will be in a moment."""
        return self._queue.task(Kind.FINISH) is not None

    def rest(self) -> None:
        """Finish the pose in a moment: a drag has just ended."""
        self.interrupt()
        is_small = self._session().mesh.n_vertices <= MOST_VERTICES
        if self._is_wanted and is_small:
            task = Task(
                kind=Kind.FINISH,
                begin=self._begin,
                done=self.accept,
                may_begin=lambda: self._is_free() and not self._session().is_unsettled,
                may_end=self._is_free,
                rest=_REST,
            )
            self._queue.add(task)

    def follow(self, change: Change) -> None:
        """Cancel the finish if it does not suit the session after *change*."""
        if self._is_accepting or not change & ~_KEPT:
            return
        if change is Change.POSE and self.is_pending and self.fraction is None:
            self._queue.delay(Kind.FINISH)  # still converging
        else:
            self.interrupt()

    def interrupt(self) -> bool:
        """Cancel, and end the glide; False if no pose was being finished."""
        self.glide.end()
        return self._queue.cancel(Kind.FINISH)

    def _begin(self) -> Work | None:
        session = self._session()
        if session.solution is None or not session.can_finish:  # None after undo
            return None
        return measured(finishing.finish(session.poses, session.state))

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


def measured(finish: Callable[[Progress], FinishedPose]) -> Callable[[Progress], FinishedPose]:
    """Return *finish*, which also looks for crossings and folds of the pose, for the hint."""

    def run(progress: Progress) -> FinishedPose:
        result = finish(progress)
        result.solution.crossings()
        result.solution.folds()
        return result

    return run
