"""Undo, redo, and jumps to any state of the history.

A *step* leads from one committed state to the next and has a label.  A *drag* consists of many
moves that become one step: the first move starts it, `Timeline.commit` ends it and
`Timeline.revert` cancels it.  A step, undo or jump during a drag commits the drag first, and
there is nothing to redo then.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable
from typing import final

from ..arrays import is_whole
from ..checks import as_callable, require, shown
from ..errors import SessionError
from .listeners import Change, Listener, Listeners
from .state import State

_OPENED = "opened"


@final
class History:
    """The states before and after the current one, each with the label of its step.

    Parameters
    ----------
    limit : int
        Maximum number of undo steps; the oldest are discarded.
    """

    def __init__(self, limit: int) -> None:
        if not is_whole(limit, 1, sys.maxsize):
            raise SessionError(f"history must be a number of steps, 1 or more; got {shown(limit)}")
        self._past: deque[tuple[str, State]] = deque(maxlen=int(limit))
        self._future: list[tuple[str, State]] = []
        self._oldest = _OPENED  # the label of the step that led to the oldest state

    def copy(self) -> History:
        """Return an independent copy of the history."""
        other = History(self._past.maxlen or 1)
        other._past.extend(self._past)
        other._future.extend(self._future)
        other._oldest = self._oldest
        return other

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of all states, the oldest first: of each, the step that led to it."""
        past = (label for label, _ in self._past)
        return self._oldest, *past, *(label for label, _ in reversed(self._future))

    @property
    def position(self) -> int:
        """The index of the current state among all states."""
        return len(self._past)

    def state(self, position: int, now: State) -> State:
        """Return the state at *position*; *now* is the current state."""
        ahead = position - len(self._past)
        if ahead == 0:
            return now
        return self._past[position][1] if ahead < 0 else self._future[-ahead][1]

    @property
    def undo_label(self) -> str | None:
        """The label of the step that `undo` reverts, or None."""
        return self._past[-1][0] if self._past else None

    @property
    def redo_label(self) -> str | None:
        """The label of the step that `redo` repeats, or None."""
        return self._future[-1][0] if self._future else None

    def amend(self, change: Callable[[State], State]) -> None:
        """Replace every state by its *change*, before and after the current one."""
        past = [(label, change(state)) for label, state in self._past]
        self._past.clear()
        self._past.extend(past)
        self._future = [(label, change(state)) for label, state in self._future]

    def record(self, label: str, before: State, after: State) -> None:
        """Add the step *label* from *before* to *after*, and clear the steps to redo."""
        if len(self._past) == self._past.maxlen:
            self._oldest = self._past[0][0]
        self._past.append((label, before))
        self._future.clear()
        _drop_weights(before, after)

    def undo(self, now: State) -> State:
        """Return the state before the last step; *now* is the current state."""
        label, state = self._past.pop()
        self._future.append((label, now))
        _drop_weights(now, state)
        return state

    def redo(self, now: State) -> State:
        """Return the state after the last step undone; *now* is the current state."""
        label, state = self._future.pop()
        self._past.append((label, now))
        _drop_weights(now, state)
        return state

    def jump(self, position: int, now: State) -> State:
        """Return the state at *position* after all steps between; *now* is the current state."""
        while len(self._past) > position:
            now = self.undo(now)
        while len(self._past) < position:
            now = self.redo(now)
        return now


def _drop_weights(stored: State, current: State) -> None:
    """Delete cached blend weights of *stored* regions: eight times the memory of the masks."""
    if stored.regions is not None and stored.regions is not current.regions:
        for name in ("weights", "border_distance"):  # cached properties, computed again on access
            vars(stored.regions).pop(name, None)


class Timeline:
    """The current state with its history, its ongoing drag and its listeners.

    Parameters
    ----------
    state : State
        Initial state.
    limit : int
        Maximum number of undo steps; the oldest are discarded.
    """

    def __init__(self, state: State, limit: int) -> None:
        self._state = state
        self._drag_start: State | None = None  # state before the drag; None if there is no drag
        self._dragged: dict[str, None] = {}  # names of the moved handles and cages, in order
        self._history = History(limit)
        self._listeners = Listeners()

    @property
    def state(self) -> State:
        """The current state, including an ongoing drag; immutable."""
        return self._state

    @property
    def is_dragging(self) -> bool:
        """Whether there is an ongoing drag, to be ended by `commit` or `revert`."""
        return self._drag_start is not None

    @property
    def undo_label(self) -> str | None:
        """The label of the step that `undo` would revert, or None."""
        return self._drag_label() if self.is_dragging else self._history.undo_label

    @property
    def redo_label(self) -> str | None:
        """The label of the step that `redo` would repeat, or None."""
        return None if self.is_dragging else self._history.redo_label

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return self.undo_label is not None

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to redo."""
        return self.redo_label is not None

    @property
    def history(self) -> tuple[str, ...]:
        """The labels of all states, the oldest first: of each, the step that led to it.

        The first one is "opened", unless steps beyond the limit were discarded.  An ongoing drag is
        the last one.
        """
        labels = self._history.labels
        if self.is_dragging:
            return *labels[: self._history.position + 1], self._drag_label()
        return labels

    @property
    def position(self) -> int:
        """The index of the current state in `history`."""
        return self._history.position + self.is_dragging

    def jump(self, position: int) -> None:
        """Undo or redo as many steps as lead to the state at *position* of `history`.

        The states after it remain until the next step.

        Raises
        ------
        SessionError
            If there is no such state.
        """
        self._require_position(position)
        ended = self._end_drag(None)
        if ended or position != self.position:
            self._set_state(self._history.jump(int(position), self._state), Change.HISTORY)

    def undo(self) -> str | None:
        """Undo the last step; return its label, or None if there is none."""
        self._end_drag(None)
        label = self._history.undo_label
        if label is not None:
            self._set_state(self._history.undo(self._state), Change.HISTORY)
        return label

    def redo(self) -> str | None:
        """Redo the last step undone; return its label, or None if there is none."""
        label = self.redo_label
        if label is not None:
            self._set_state(self._history.redo(self._state), Change.HISTORY)
        return label

    def commit(self, label: str | None = None) -> str | None:
        """End the drag and record it as one step, by default labelled "drag handle 1".

        Returns
        -------
        label : str or None
            The label of the step; None if there was no drag.
        """
        label = self._end_drag(None if label is None else require(label, str, "label"))
        if label is not None:
            self._listeners.notify(Change.HISTORY)
        return label

    def revert(self) -> None:
        """Cancel the drag and restore the state before it."""
        if self._drag_start is not None:
            start, self._drag_start = self._drag_start, None
            self._dragged.clear()
            self._set_state(start, Change(0))

    def on_change(self, listener: Listener) -> Callable[[], None]:
        """Call *listener* with a `Change` after every change; return a function that removes it.

        An exception in a listener is raised by the method that made the change.  The change remains
        in effect, and the other listeners are called; see `Listeners`.
        """
        return self._listeners.add(as_callable(listener, "listener"))

    def _amend(self, change: Callable[[State], State]) -> None:
        """Apply *change* to the current state and to all steps, which adds no step."""
        self._history.amend(change)
        if self._drag_start is not None:
            self._drag_start = change(self._drag_start)
        self._set_state(change(self._state), Change(0))

    def _step(self, label: str, after: State) -> None:
        """Record a step to *after*, unless nothing changes."""
        if self._state.changes(after):
            self._end_drag(None)
            self._history.record(label, self._state, after)
            self._set_state(after, Change.HISTORY)

    def _move(self, after: State, *moved: str) -> None:
        """Change to *after* as part of a drag of the handles or cages *moved*."""
        if self._drag_start is None:
            self._drag_start = self._state
        self._dragged.update(dict.fromkeys(moved))
        self._set_state(after, Change(0))

    def _set_state(self, state: State, change: Change) -> None:
        change |= self._state.changes(state)
        self._state = state
        self._listeners.notify(change)

    def state_at(self, position: int) -> State:
        """Return the state at *position* of `history`.

        Raises
        ------
        SessionError
            If there is no such state.
        """
        self._require_position(position)
        if position == self.position:
            return self._state
        if self._drag_start is not None and position == self._history.position:
            return self._drag_start
        return self._history.state(int(position), self._state)

    def _require_position(self, position: int) -> None:
        last = len(self.history) - 1
        if not is_whole(position, 0, last):
            raise SessionError(f"position must be from 0 to {last}; got {shown(position)}")

    def _drag_label(self) -> str:
        return "drag " + ", ".join(self._dragged)

    def _end_drag(self, label: str | None) -> str | None:
        if self._drag_start is None:
            return None
        label = label or self._drag_label()
        self._history.record(label, self._drag_start, self._state)
        self._drag_start = None
        self._dragged.clear()
        return label
