"""The states a session went through, and the way back to them.

A *step* leads from one committed state to the next and has a label.  A *drag* is many moves that
become one step: it is begun by the first move, and ended by `Timeline.commit`, or taken back by
`Timeline.revert`.  A step, undo or redo during a drag commits it first.
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


@final
class History:
    """The states before this one and after it, each under the name of the step between.

    Parameters
    ----------
    limit : int
        Steps kept; the oldest go first.
    """

    def __init__(self, limit: int) -> None:
        if not is_whole(limit, 1, sys.maxsize):
            raise SessionError(f"history must be a number of steps, 1 or more; got {shown(limit)}")
        self._past: deque[tuple[str, State]] = deque(maxlen=int(limit))
        self._future: list[tuple[str, State]] = []

    def copy(self) -> History:
        """Return an independent copy of the history."""
        other = History(self._past.maxlen or 1)
        other._past.extend(self._past)
        other._future.extend(self._future)
        return other

    @property
    def undo_label(self) -> str | None:
        """The step that `undo` takes back, or None."""
        return self._past[-1][0] if self._past else None

    @property
    def redo_label(self) -> str | None:
        """The step that `redo` does again, or None."""
        return self._future[-1][0] if self._future else None

    def record(self, label: str, before: State, after: State) -> None:
        """Remember the step *label*, which led from *before* to *after*; redo forgets."""
        self._past.append((label, before))
        self._future.clear()
        _lighten(before, after)

    def undo(self, now: State) -> State:
        """Return the state before the last step."""
        label, state = self._past.pop()
        self._future.append((label, now))
        _lighten(now, state)
        return state

    def redo(self, now: State) -> State:
        """Return the state after the step that was undone last."""
        label, state = self._future.pop()
        self._past.append((label, now))
        _lighten(now, state)
        return state


def _lighten(stored: State, shown: State) -> None:
    """Drop the weights that *stored* regions keep; they are eight times as large as the masks."""
    if stored.regions is not None and stored.regions is not shown.regions:
        for name in ("weights", "border_distance"):  # cached properties, found again when asked for
            vars(stored.regions).pop(name, None)


class Timeline:
    """The present state, the way to it, and who is told when it changes.

    Parameters
    ----------
    state : State
        Where to begin.
    limit : int
        Steps that can be undone; older ones are forgotten.
    """

    def __init__(self, state: State, limit: int) -> None:
        self._state = state
        self._before: State | None = None  # the drag in hand; None if there is none
        self._dragged: dict[str, None] = {}  # what it moved, in order
        self._history = History(limit)
        self._listeners = Listeners()

    @property
    def state(self) -> State:
        """All there is besides the mesh, frozen; a drag in hand included."""
        return self._state

    @property
    def is_dragging(self) -> bool:
        """Whether there were moves since the last step, for `commit` or `revert`."""
        return self._before is not None

    @property
    def undo_label(self) -> str | None:
        """The step that `undo` would take back."""
        return self._drag_label() if self.is_dragging else self._history.undo_label

    @property
    def redo_label(self) -> str | None:
        """The step that `redo` would do again."""
        return None if self.is_dragging else self._history.redo_label

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return self.undo_label is not None

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to do again."""
        return self.redo_label is not None

    def undo(self) -> str | None:
        """Take back the last step; return its label, None if there is none."""
        self._end_drag(None)
        label = self._history.undo_label
        if label is not None:
            self._go(self._history.undo(self._state), Change.HISTORY)
        return label

    def redo(self) -> str | None:
        """Do the step again that was taken back last; return its label, None if there is none."""
        label = self.redo_label
        if label is not None:
            self._go(self._history.redo(self._state), Change.HISTORY)
        return label

    def commit(self, label: str | None = None) -> str | None:
        """End the drag in hand: it becomes one step, "drag handle 1" unless *label* is given.

        Returns
        -------
        label : str or None
            None if there was no drag, and nothing was done.
        """
        label = self._end_drag(None if label is None else require(label, str, "label"))
        if label is not None:
            self._listeners.tell(Change.HISTORY)
        return label

    def revert(self) -> None:
        """Give up the drag in hand: everything is again what it was before."""
        if self._before is not None:
            before, self._before = self._before, None
            self._dragged.clear()
            self._go(before, Change(0))

    def on_change(self, listener: Listener) -> Callable[[], None]:
        """Call *listener* with a `Change` after every change; return a callable that ends that.

        What a listener raises comes out of the method that made the change, which is done all the
        same, and the other listeners hear of it; see `Listeners`.
        """
        return self._listeners.add(as_callable(listener, "listener"))

    def _step(self, label: str, after: State) -> None:
        """Go to *after*, as a step, unless that is where we are."""
        if self._state.changes(after):
            self._end_drag(None)
            self._history.record(label, self._state, after)
            self._go(after, Change.HISTORY)

    def _move(self, after: State, *moved: str) -> None:
        """Go to *after*, as part of a drag of what is *moved*."""
        if self._before is None:
            self._before = self._state
        self._dragged.update(dict.fromkeys(moved))
        self._go(after, Change(0))

    def _go(self, state: State, change: Change) -> None:
        change |= self._state.changes(state)
        self._state = state
        self._listeners.tell(change)

    def _drag_label(self) -> str:
        return "drag " + ", ".join(self._dragged)

    def _end_drag(self, label: str | None) -> str | None:
        if self._before is None:
            return None
        label = label or self._drag_label()
        self._history.record(label, self._before, self._state)
        self._before = None
        self._dragged.clear()
        return label
