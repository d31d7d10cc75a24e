"""What changed in a session, and who is told.

Listeners are told after the change, in the order they came, of one change after the other: a
change made by a listener waits until everybody has heard of the one before.
"""

from __future__ import annotations

import enum
import itertools
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack


class Change(enum.Flag):
    """What is not as it was; several at once are joined by ``|``."""

    REGIONS = enum.auto()
    """`Session.regions`."""
    NAMES = enum.auto()
    """`Session.region_names`; where regions are others as well, names may be as they were."""
    CAGES = enum.auto()
    """`Session.cages`, at rest."""
    CONSTRAINTS = enum.auto()
    """`Session.fixed`, or the names or vertices of `Session.handles`."""
    POSE = enum.auto()
    """`Session.vertices`, `Session.cage_vertices`, `Session.targets`."""
    OPTIONS = enum.auto()
    """`Session.options`."""
    HISTORY = enum.auto()
    """What `Session.undo` and `Session.redo` would do."""


Listener = Callable[[Change], None]


class Listeners:
    """Callables to tell of changes.

    One that raises neither keeps the others from hearing, nor undoes anything: once all were
    told, its exception reaches whoever made the change.  Of several the last comes out, the ones
    before are its ``__context__``.

    Examples
    --------
    >>> listeners = Listeners()
    >>> silence = listeners.add(lambda change: print("changed:", change.name))
    >>> listeners.tell(Change.POSE)
    changed: POSE
    >>> silence()
    >>> listeners.tell(Change.POSE)
    """

    def __init__(self) -> None:
        self._listeners: dict[int, Listener] = {}
        self._numbers = itertools.count()
        self._news: deque[Change] = deque()
        self._telling = False

    def add(self, listener: Listener) -> Callable[[], None]:
        """Tell *listener* from now on; return a callable that stops it, at once and for good."""
        number = next(self._numbers)
        self._listeners[number] = listener

        def stop() -> None:
            self._listeners.pop(number, None)

        return stop

    def tell(self, change: Change) -> None:
        """Tell everybody of *change*, unless it is nothing."""
        if not change:
            return
        self._news.append(change)
        if self._telling:
            return
        self._telling = True
        try:
            self._tell_news()
        finally:
            self._telling = False

    def _tell_news(self) -> None:
        while self._news:
            change = self._news.popleft()
            # The stack is unwound from its end, to its beginning even where some of it raises.
            with ExitStack() as calls:
                calls.callback(self._tell_news)
                for number in reversed(self._listeners):
                    calls.callback(self._tell_one, number, change)

    def _tell_one(self, number: int, change: Change) -> None:
        listener = self._listeners.get(number)  # it may have been stopped by one before it
        if listener is not None:
            listener(change)
