"""Preparing a session for pulls in the background, while the editor remains usable.

    lacking(session)    ->  the next stage of the preparation, or None: `Session.preparation`
    another thread      ->  its result, from a snapshot of the session
    `Session.accept`    ->  here, once no gesture runs; no undo step

A stage is cancelled if its inputs change: the mesh, the regions, the cages, the stiffness or the
options of the binding.  A stage that failed, or that the user has cancelled, is not repeated for
the same inputs unless requested.

A new mesh gets a `StandIn` first, which can be pulled long before the session is bound.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable
from typing import Any

from vtk_segdeform.errors import Cancelled, SegDeformError, SessionError
from vtk_segdeform.kernels import load_for
from vtk_segdeform.progress import Progress, part
from vtk_segdeform.session import Preparation, Session, StandIn, same_inputs

from .messages import error_text
from .queue import Kind, Queue, Task

_STAND_IN = 0.15  # of the progress of the first stage

_log = logging.getLogger(__name__)

Work = Callable[[Progress], Preparation]


def lacking(session: Session, made: Callable[[StandIn], object] | None = None) -> Work | None:
    """Return the next stage of the preparation of *session*; None if it needs none.

    It passes a stand-in to *made*, if one is useful, before it begins.  The work uses a copy of the
    session, which has no listeners, so another thread may run it.
    """
    if session.is_bound:
        return None
    own = copy.copy(session)

    def work(progress: Progress) -> Preparation:
        begun = 0.0
        if made is not None and not (own.cages or _is_posed(own)):
            stand_in = _stand_in(own, part(progress, 0.0, _STAND_IN))
            if stand_in is not None:
                made(stand_in)
                begun = _STAND_IN
        load_for(own.mesh.n_vertices)
        return own.preparation(part(progress, begun, 1.0))

    return work


def _stand_in(session: Session, progress: Progress | None) -> StandIn | None:
    """Return a stand-in for *session*; None if it is of no use, or fails."""
    try:
        return StandIn.of(session.mesh, session.options.lids, progress)
    except Cancelled:
        raise
    except (SegDeformError, ArithmeticError, ValueError, MemoryError) as fault:
        _log.info("no stand-in", exc_info=fault)  # a pull waits for the session
        return None


def _is_posed(session: Session) -> bool:
    """Return whether a pull would depend on more than the mesh."""
    state = session.state
    return state.pose is not None or bool(state.handles) or len(state.fixed) > 0


class Preparing:
    """The stage that is running, if any, and the inputs for which none is wanted.

    Parameters
    ----------
    queue : Queue
        Runs the stages.
    is_due : callable
        Returns whether a result may change the session now.
    accept : callable
        ``accept(session, preparation)``, called with each result.
    ended : callable
        Called after a stage has ended without an error: the session may lack another one.
    """

    def __init__(
        self,
        queue: Queue,
        is_due: Callable[[], bool],
        accept: Callable[[Session, Preparation], object],
        ended: Callable[[], object],
    ) -> None:
        self._queue, self._is_due, self._accept, self._ended = queue, is_due, accept, ended
        self._inputs: tuple[Any, ...] = ()  # of the running stage
        self._declined: tuple[Any, ...] = ()
        self._stand_ins: list[StandIn] = []  # which the worker may hold, unlike a widget

    @property
    def fraction(self) -> float | None:
        """Completed fraction of the running stage, 0..1, coarsely; None if none is running."""
        return self._queue.fraction(Kind.PREPARE)

    def stand_in(self, session: Session) -> StandIn | None:
        """Return what can be pulled instead of *session*; None if there is nothing yet."""
        made = self._stand_ins[-1] if self._stand_ins else None
        return made if made and made.mesh is session.mesh and not _is_posed(session) else None

    def update(self, session: Session, *, start: bool, again: bool = False) -> None:
        """Cancel the running stage if its inputs have changed; *start* one if *session* lacks it.

        *again* also starts a stage that has failed or was cancelled.
        """
        inputs = _key(session)
        if again:
            self._declined = ()
        if self._queue.task(Kind.PREPARE) is not None:
            if same_inputs(inputs, self._inputs):
                return
            self.interrupt()
        is_declined = same_inputs(inputs, self._declined)
        if start and not (is_declined or session.is_bound):
            self._inputs = inputs
            made = None if self.stand_in(session) is not None else self._stand_ins.append
            task = Task(
                kind=Kind.PREPARE,
                begin=lambda: lacking(session, made),
                done=lambda result: self._finish(session, result),
                failed=self._fail,
                may_end=self._is_due,
            )
            self._queue.add(task)

    def cancel(self) -> bool:
        """Cancel the running stage, and decline its inputs; False if none is running."""
        if self._queue.task(Kind.PREPARE) is None:
            return False
        self._declined = self._inputs
        self.interrupt()
        return True

    def interrupt(self) -> None:
        """Cancel the running stage; the next `update` may start it again."""
        self._queue.cancel(Kind.PREPARE)

    def stop(self) -> None:
        """Cancel the running stage and drop the stand-in."""
        self.interrupt()
        self._stand_ins = []

    def _finish(self, session: Session, result: Preparation) -> None:
        self._stand_ins = []
        if same_inputs(_key(session), self._inputs):
            self._accept(session, result)
        self._ended()

    def _fail(self, error: BaseException) -> None:
        self._declined, self._stand_ins = self._inputs, []
        if isinstance(error, SegDeformError):
            raise SessionError(
                f"Cannot prepare this mesh for pulling: {error_text(error)}. Press 1 to paint "
                "other regions, or drag again to retry"
            ) from error
        raise error


def _key(session: Session) -> tuple[Any, ...]:
    """Return the inputs of a preparation; two are equal exactly if its result is the same."""
    state, options = session.state, session.options
    of_cages = state.regions, state.cages, options.offset
    return (session.mesh, *of_cages, options.stretch, options.rotation_groups, options.symmetry,
            state.stiffness)  # fmt: skip
