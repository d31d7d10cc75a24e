"""The sessions before and after one in the history: a repaired copy, and what it was made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from vtk_segdeform.session import Session, State


@dataclass(frozen=True)
class Neighbour:
    """Another session in the history."""

    step: str
    """The label of the step between the two sessions."""
    names: tuple[str, ...]
    """Its states that are in the history, by name."""
    enter: Callable[[int, str], None]
    """Open it in the state at a position of the whole history, and say so by this message."""


class Neighbours:
    """The neighbours of a session, if there are any.

    Attributes
    ----------
    before : Neighbour or None
        The one from which the session came, by a step before its first one.
    """

    def __init__(self) -> None:
        self.before: Neighbour | None = None
        self._after: Neighbour | None = None
        self._place: tuple[int, State, State | None] | None = None  # the state before it, and next

    @property
    def count_before(self) -> int:
        """The number of states before those of the session."""
        return 0 if self.before is None else len(self.before.names)

    def follow(self, session: Session, position: int, after: Neighbour) -> None:
        """Let *after* follow *session* at a *position*, until another step is recorded there."""
        self._after, self._place = after, _place(session, position)

    def after(self, session: Session) -> tuple[int, Neighbour] | None:
        """Return the position of *session* that is followed by another one, and that one."""
        if self._after is None or self._place is None:
            return None
        position, state, following = self._place
        if not session.history.position <= position < len(session.history.labels):
            return None
        _, now, next_now = _place(session, position)
        is_kept = now is state and next_now is following
        return (position, self._after) if is_kept else None

    def prepared(self, session: Session, after: tuple[int, Neighbour] | None) -> None:
        """Continue after *session* was prepared for pulls, when *after* followed it."""
        if after is not None:
            self.follow(session, *after)


def _place(session: Session, position: int) -> tuple[int, State, State | None]:
    is_last = position + 1 >= len(session.history.labels)
    following = None if is_last else session.history.state_at(position + 1)
    return position, session.history.state_at(position), following
