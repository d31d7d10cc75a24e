"""The steps of a session, and of the ones before and after it: a repaired copy is another session.

    opened, set fixed vertices, repair    steps of the original; the last one changes nothing there
                                opened, pull    steps of its repaired copy
    opened, set fixed vertices, repair, pull    the history of both

A step of the original in place of its last one replaces the copy.
"""

from __future__ import annotations

from collections.abc import Callable

from vtk_segdeform.session import Session

from .step_texts import step_texts

_REPAIR = "repair"


class SessionHistory:
    """The history of the current session, with those of the sessions before and after it.

    Parameters
    ----------
    session : Session
        The only one, at first.
    enter : callable
        ``enter(session)``, called to edit another one.
    """

    def __init__(self, session: Session, enter: Callable[[Session], object]) -> None:
        self._enter = enter
        self.begin(session)

    def begin(self, session: Session) -> None:
        """Start over with *session* as the current one."""
        self._sessions, self._current = [session], 0

    def repaired(self, session: Session) -> None:
        """Enter *session*, a repaired copy of the current one, by a step."""
        steps = self._sessions[self._current].history
        steps.move(steps.state)
        steps.commit(_REPAIR)
        self._current += 1
        self._sessions[self._current :] = [session]
        self._enter(session)

    @property
    def labels(self) -> tuple[str, ...]:
        """What led to each state, the oldest first; see `step_texts`."""
        first, *others = map(step_texts, self._linked)
        return first + tuple(label for labels in others for label in labels[1:])

    @property
    def position(self) -> int:
        """The index of the current state in `labels`."""
        before, now = self._sessions[: self._current], self._sessions[self._current]
        return sum(map(_n_steps, before)) + now.history.position

    @property
    def undo_label(self) -> str | None:
        """The label of the step to undo, or None."""
        return self.labels[self.position] if self.position else None

    @property
    def redo_label(self) -> str | None:
        """The label of the step to redo, or None."""
        return next(iter(self.labels[self.position + 1 :]), None)

    def own(self, position: int) -> int | None:
        """Return the *position* in the current session; None if that state is of another one."""
        k, own = self._find(position)
        return own if k == self._current else None

    def jump(self, position: int) -> None:
        """Undo or redo as many steps as lead to the state at *position*, of whichever session."""
        k, own = self._find(position)
        if k != self._current:
            self._current = k
            self._enter(self._sessions[k])
        self._sessions[k].history.jump(own)

    @property
    def _linked(self) -> list[Session]:
        """The sessions, without those whose originals have other last steps now."""
        end = self._current + 1
        while end < len(self._sessions) and self._sessions[end - 1].history.labels[-1] == _REPAIR:
            end += 1
        return self._sessions[:end]

    def _find(self, position: int) -> tuple[int, int]:
        """Return the index of the session with a state, and the position of the state in it."""
        *originals, _ = self._linked
        for k, session in enumerate(originals):
            if position < _n_steps(session):
                return k, position
            position -= _n_steps(session)
        return len(originals), position


def _n_steps(session: Session) -> int:
    return len(session.history.labels) - 1
