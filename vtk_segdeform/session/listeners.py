"""Notification of changes.

Listeners are called after a change, in the order in which they were added.  If a listener makes
another change, the listeners are notified of it after all of them have been notified of the first.
"""

from __future__ import annotations

import enum
import itertools
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack


class Change(enum.Flag):
    """The parts of a session that changed; several are combined by ``|``."""

    REGIONS = enum.auto()
    """`Session.regions`."""
    NAMES = enum.auto()
    """`Painting.names`."""
    CAGES = enum.auto()
    """`Session.cages`, at rest."""
    CONSTRAINTS = enum.auto()
    """`Session.fixed`, or the names or vertices of `Session.handles`."""
    POSE = enum.auto()
    """`Session.vertices`, `Session.cage_vertices`, `Session.targets`."""
    OPTIONS = enum.auto()
    """`Session.options`."""
    HISTORY = enum.auto()
    """The steps to undo or redo."""
    PIVOTS = enum.auto()
    """`Handles.pivot` of a handle."""
    SAVED_POSES = enum.auto()
    """`Session.saved_poses`."""
    LANDMARKS = enum.auto()
    """`Session.landmarks`."""
    CARRIED = enum.auto()
    """`Session.carried`."""


Listener = Callable[[Change], None]


class Listeners:
    """Callables that are notified of changes.

    An exception in a listener is raised after all listeners were called; it does not revert the
    change.  If several listeners raise, the last exception is raised and the earlier ones are its
    ``__context__``.

    Examples
    --------
    >>> listeners = Listeners()
    >>> remove = listeners.add(lambda change: print("changed:", change.name))
    >>> listeners.notify(Change.POSE)
    changed: POSE
    >>> remove()
    >>> listeners.notify(Change.POSE)
    """

    def __init__(self) -> None:
        self._listeners: dict[int, Listener] = {}
        self._numbers = itertools.count()
        self._pending: deque[Change] = deque()
        self._notifying = False

    def add(self, listener: Listener) -> Callable[[], None]:
        """Add a listener; return a function that removes it, also during a notification."""
        number = next(self._numbers)
        self._listeners[number] = listener

        def remove() -> None:
            self._listeners.pop(number, None)

        return remove

    def notify(self, change: Change) -> None:
        """Notify all listeners of *change*, unless it is empty."""
        if not change:
            return
        self._pending.append(change)
        if self._notifying:
            return
        self._notifying = True
        try:
            self._notify_pending()
        finally:
            self._notifying = False

    def _notify_pending(self) -> None:
        while self._pending:
            change = self._pending.popleft()
            # ExitStack runs the callbacks in reverse order, and all of them even if some raise.
            with ExitStack() as calls:
                calls.callback(self._notify_pending)
                for number in reversed(self._listeners):
                    calls.callback(self._notify_one, number, change)

    def _notify_one(self, number: int, change: Change) -> None:
        listener = self._listeners.get(number)  # None if an earlier listener has removed it
        if listener is not None:
            listener(change)
