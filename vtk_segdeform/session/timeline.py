"""Undo, redo, and jumps to any state of the history.

A *step* leads from one committed state to the next and has a label.  A *drag* consists of many
moves that become one step: the first move starts it, `Timeline.commit` ends it and
`Timeline.revert` cancels it.  A step, undo or jump during a drag commits the drag first, and
there is nothing to redo then.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

from ..arrays import is_whole
from ..checks import as_callable, require, shown
from ..errors import SessionError
from .listeners import Change, Listener, Listeners
from .state import State

_NOTHING = Change(0)


@dataclass(frozen=True, eq=False)
class Drag:
    """A drag that has not been committed yet."""

    start: State
    """The state before it."""
    moved: tuple[str, ...]
    """The names of the moved handles and cages, in order."""
    grip: object
    """What the next move continues from, besides the state."""

    @property
    def label(self) -> str:
        """The label of its step."""
        return "drag " + ", ".join(self.moved)


@final
class Timeline:
    """The current state, with the states before and after it, and its listeners.

    Parameters
    ----------
    state : State
        Initial state.
    limit : int
        Maximum number of undo steps; the oldest are discarded.

    Raises
    ------
    SessionError
        If *limit* is not a whole number of 1 or more.
    """

    def __init__(self, state: State, limit: int) -> None:
        if not is_whole(limit, 1, sys.maxsize):
            raise SessionError(f"history must be a number of steps, 1 or more; got {shown(limit)}")
        self._limit = int(limit)
        self._state = state
        self._drag: Drag | None = None
        # All states but that of an ongoing drag, and the label of the step that led to each.
        self._states, self._labels, self._position = [state], ["opened"], 0
        self._listeners = Listeners()

    def __getstate__(self) -> dict[str, Any]:
        own = vars(self) | {"_states": self._states.copy(), "_labels": self._labels.copy()}
        del own["_listeners"]
        return own

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _listeners=Listeners())

    @property
    def state(self) -> State:
        """The current state, including an ongoing drag; immutable."""
        return self._state

    @property
    def drag(self) -> Drag | None:
        """The ongoing drag, to be ended by `commit` or `revert`."""
        return self._drag

    @property
    def undo_label(self) -> str | None:
        """The label of the step that `undo` would revert, or None."""
        return self.labels[self.position] if self.position else None

    @property
    def redo_label(self) -> str | None:
        """The label of the step that `redo` would repeat, or None."""
        labels = self.labels
        return labels[self.position + 1] if self.position + 1 < len(labels) else None

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return self.undo_label is not None

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to redo."""
        return self.redo_label is not None

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of all states, the oldest first: of each, the step that led to it.

        The first one is "opened", unless steps beyond the limit were discarded.  An ongoing drag is
        the last one.
        """
        if self._drag is None:
            return tuple(self._labels)
        return *self._labels[: self._position + 1], self._drag.label

    @property
    def position(self) -> int:
        """The index of the current state in `labels`."""
        return self._position + (self._drag is not None)

    def state_at(self, position: int) -> State:
        """Return the state at *position* of `labels`.

        Raises
        ------
        SessionError
            If there is no such state.
        """
        self._require_position(position)
        return self._state if position == self.position else self._states[int(position)]

    def jump(self, position: int) -> None:
        """Undo or redo as many steps as lead to the state at *position* of `labels`.

        The states after it remain until the next step.

        Raises
        ------
        SessionError
            If there is no such state.
        """
        self._require_position(position)
        ended = self._end_drag()
        if ended or position != self._position:
            self._go(int(position))

    def undo(self) -> str | None:
        """Undo the last step; return its label, or None if there is none."""
        label = self.undo_label
        self._end_drag()
        if label is not None:
            self._go(self._position - 1)
        return label

    def redo(self) -> str | None:
        """Redo the last step undone; return its label, or None if there is none."""
        label = self.redo_label
        if label is not None:
            self._go(self._position + 1)
        return label

    def commit(self, label: str | None = None, *, join: bool = False) -> str | None:
        """End the drag and record it as one step, by default labelled "drag handle 1".

        If they are to *join*, it becomes part of the step before it with the same label.

        Returns
        -------
        label : str or None
            The label of the step; None if there was no drag.
        """
        joined = join and self._drag is not None and self._labels[self._position] == label
        if joined:
            self._position -= 1
        label = self._end_drag(None if label is None else require(label, str, "label"))
        if label is not None:
            self._listeners.notify(Change.HISTORY)
        return label

    def revert(self) -> None:
        """Cancel the drag and restore the state before it."""
        if self._drag is not None:
            start, self._drag = self._drag.start, None
            self._set(start)

    def on_change(self, listener: Listener) -> Callable[[], None]:
        """Call *listener* with a `Change` after every change; return a function that removes it.

        An exception in a listener is raised by the method that made the change.  The change remains
        in effect, and the other listeners are called; see `Listeners`.
        """
        return self._listeners.add(as_callable(listener, "listener"))

    # For edits, which check the states.

    def step(self, label: str, after: State) -> None:
        """Record a step to *after*, unless nothing changes."""
        if self._state.changes(after):
            self._end_drag()
            self._record(label, after)
            self._set(after, Change.HISTORY)

    def move(self, after: State, *moved: str, grip: object = None) -> None:
        """Change to *after* as part of a drag of the handles or cages *moved*.

        None keeps the *grip* of the last move.
        """
        drag = self._drag or Drag(self._state, (), None)
        names = tuple(dict.fromkeys((*drag.moved, *moved)))
        self._drag = Drag(drag.start, names, drag.grip if grip is None else grip)
        self._set(after)

    def update(self, after: State) -> None:
        """Change to *after* as part of the ongoing drag, or else of the last step."""
        self._set(after)

    def amend(self, change: Callable[[State], State]) -> None:
        """Apply *change* to the current state and to all others, which adds no step."""
        self._states = [change(state) for state in self._states]
        if self._drag is not None:
            self._drag = replace(self._drag, start=self._states[self._position])
        self._set(change(self._state))

    def _go(self, position: int) -> None:
        """Change to the state at another position, or the same one after a drag."""
        state = self._states[position]
        _drop_weights(self._state, state)
        self._position = position
        self._set(state, Change.HISTORY)

    def _set(self, state: State, change: Change = _NOTHING) -> None:
        change |= self._state.changes(state)
        self._state = state
        if self._drag is None:
            self._states[self._position] = state
        self._listeners.notify(change)

    def _require_position(self, position: int) -> None:
        last = len(self.labels) - 1
        if not is_whole(position, 0, last):
            raise SessionError(f"position must be from 0 to {last}; got {shown(position)}")

    def _end_drag(self, label: str | None = None) -> str | None:
        if self._drag is None:
            return None
        label = label or self._drag.label
        self._drag = None
        self._record(label, self._state)
        return label

    def _record(self, label: str, after: State) -> None:
        """Append a step that ends in *after*; steps that were undone are discarded."""
        _drop_weights(self._states[self._position], after)
        end = self._position + 1
        self._states[end:], self._labels[end:] = [after], [label]
        self._position = min(end, self._limit)
        discarded = slice(0, end - self._position)
        del self._states[discarded], self._labels[discarded]


def _drop_weights(stored: State, current: State) -> None:
    """Delete cached blend weights of *stored* regions: eight times the memory of the masks."""
    if stored.regions is not None and stored.regions is not current.regions:
        for name in ("weights", "border_distance"):  # cached properties, computed again on access
            vars(stored.regions).pop(name, None)
