"""Undo, redo, and jumps to any state of the history.

A *step* leads from one committed state to the next and has a label.  A *drag* consists of many
moves that become one step: the first move starts it, `Timeline.commit` ends it and
`Timeline.revert` cancels it.  A step, undo or jump during a drag commits the drag first, and
there is nothing to redo then.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, MutableSequence
from dataclasses import dataclass
from typing import Any, TypeAlias, final

from ..arrays import is_whole
from ..checks import as_callable, require, shown
from ..errors import SessionError
from .listeners import Change, Listener, Listeners
from .state import State

_NOTHING = Change(0)
_Steps: TypeAlias = MutableSequence[tuple[str, State]]  # the nearest to the current state last


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
        self._state = state
        self._drag: Drag | None = None
        self._past: deque[tuple[str, State]] = deque(maxlen=int(limit))  # labels of the steps after
        self._future: list[tuple[str, State]] = []  # labels of the steps before; the next one last
        self._oldest = "opened"  # the label of the step that led to the oldest state
        self._listeners = Listeners()

    def __getstate__(self) -> dict[str, Any]:
        own = vars(self) | {"_past": self._past.copy(), "_future": self._future.copy()}
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
        if self._drag is not None:
            return self._drag.label
        return self._past[-1][0] if self._past else None

    @property
    def redo_label(self) -> str | None:
        """The label of the step that `redo` would repeat, or None."""
        return self._future[-1][0] if self._future and self._drag is None else None

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
        past = self._oldest, *(label for label, _ in self._past)
        if self._drag is not None:
            return *past, self._drag.label
        return *past, *(label for label, _ in reversed(self._future))

    @property
    def position(self) -> int:
        """The index of the current state in `labels`."""
        return len(self._past) + (self._drag is not None)

    def state_at(self, position: int) -> State:
        """Return the state at *position* of `labels`.

        Raises
        ------
        SessionError
            If there is no such state.
        """
        self._require_position(position)
        if position == self.position:
            return self._state
        if self._drag is not None and position == len(self._past):
            return self._drag.start
        ahead = int(position) - len(self._past)
        return self._past[position][1] if ahead < 0 else self._future[-ahead][1]

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
        if ended or position != self.position:
            now = self._state
            while len(self._past) > position:
                now = _shifted(self._past, self._future, now)
            while len(self._past) < position:
                now = _shifted(self._future, self._past, now)
            self._set(now, Change.HISTORY)

    def undo(self) -> str | None:
        """Undo the last step; return its label, or None if there is none."""
        label = self.undo_label
        self._end_drag()
        if label is not None:
            self._set(_shifted(self._past, self._future, self._state), Change.HISTORY)
        return label

    def redo(self) -> str | None:
        """Redo the last step undone; return its label, or None if there is none."""
        label = self.redo_label
        if label is not None:
            self._set(_shifted(self._future, self._past, self._state), Change.HISTORY)
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
            self._record(label, self._state, after)
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
        for steps in (self._past, self._future):
            for k, (label, state) in enumerate(steps):
                steps[k] = label, change(state)
        if self._drag is not None:
            self._drag = Drag(change(self._drag.start), self._drag.moved, self._drag.grip)
        self._set(change(self._state))

    def _set(self, state: State, change: Change = _NOTHING) -> None:
        change |= self._state.changes(state)
        self._state = state
        self._listeners.notify(change)

    def _require_position(self, position: int) -> None:
        last = len(self.labels) - 1
        if not is_whole(position, 0, last):
            raise SessionError(f"position must be from 0 to {last}; got {shown(position)}")

    def _end_drag(self, label: str | None = None) -> str | None:
        if self._drag is None:
            return None
        label = label or self._drag.label
        self._record(label, self._drag.start, self._state)
        self._drag = None
        return label

    def _record(self, label: str, before: State, after: State) -> None:
        if len(self._past) == self._past.maxlen:
            self._oldest = self._past[0][0]
        self._past.append((label, before))
        self._future.clear()
        _drop_weights(before, after)


def _shifted(source: _Steps, sink: _Steps, now: State) -> State:
    """Move the last step from *source* to *sink*, and return its state; *now* is the current."""
    label, state = source.pop()
    sink.append((label, now))
    _drop_weights(now, state)
    return state


def _drop_weights(stored: State, current: State) -> None:
    """Delete cached blend weights of *stored* regions: eight times the memory of the masks."""
    if stored.regions is not None and stored.regions is not current.regions:
        for name in ("weights", "border_distance"):  # cached properties, computed again on access
            vars(stored.regions).pop(name, None)
