"""Keeps unsaved work while it is being done: after each step, and every few seconds of a drag.

What is written is the session's state, which is frozen; so another thread writes it, and neither
a drag nor its picture waits for the disk.  Once nothing would be lost any more, because the work
was saved or undone, what was kept of it is deleted.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent import futures
from typing import Any

from qtpy import QtCore

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.session import Change, Session

from ..scene import Stop
from .autosave import About, Autosaves, Slot

INTERVAL = 10.0  # seconds that a crash may cost, of a drag that is still going on
_QUIET = 250  # milliseconds without a change: refinement, for one, has come to an end
_PERIOD = 15  # milliseconds between two looks at the thread


class Keeper(QtCore.QObject):
    """Keeps the work on one document after the other.

    Parameters
    ----------
    autosaves : Autosaves
        Where.
    parent : QObject
        The window.
    interval : float
        Seconds after a change until it is kept, at the latest.

    Attributes
    ----------
    about : About
        What the work is on; told beside what is kept from the next slot on.
    """

    kept = QtCore.Signal()
    """The work as it was a moment ago is on disk."""
    failed = QtCore.Signal(str)
    """The work cannot be kept, and why; told once, until it can be again."""

    def __init__(
        self, autosaves: Autosaves, parent: Any = None, *, interval: float = INTERVAL
    ) -> None:
        super().__init__(parent)
        self._autosaves = autosaves
        self._session: Session | None = None
        self._slot: Slot | None = None
        self.about = About()
        self._is_behind: Callable[[], bool] = bool
        self._kept: object = None  # the state that the slot has
        self._writing: futures.Future[Slot] | None = None
        self._has_failed = self._again = False
        self._threads = futures.ThreadPoolExecutor(1, "segdeform keeper")
        self._stops = stops_of(self)
        self._at_once = self._timer(0, self.keep)
        self._when_quiet = self._timer(_QUIET, self.keep)
        self._at_last = self._timer(round(1000.0 * interval), self.keep)
        self._looks = self._timer(_PERIOD, self._look)
        self._looks.setSingleShot(False)

    @property
    def is_idle(self) -> bool:
        """Whether all that was to be kept by now is kept."""
        timers = self._at_once, self._when_quiet
        return self._writing is None and not any(timer.isActive() for timer in timers)

    def mind(
        self,
        session: Session,
        about: About,
        is_behind: Callable[[], bool],
        *,
        slot: Slot | None = None,
    ) -> None:
        """Keep this session from now on, and nothing of the one before.

        Parameters
        ----------
        session : Session
            What.
        about : About
            What it is on.
        is_behind : callable
            Tells whether something would be lost without us.
        slot : Slot, optional
            Where it is kept already, as it is now.
        """
        self.forget()
        self._session, self.about, self._is_behind = session, about, is_behind
        self._slot, self._kept = slot, session.state if slot is not None else None
        self._stops.append(session.on_change(self._changed))

    def forget(self) -> None:
        """Delete what is kept: it is saved, or was given up."""
        for timer in (self._at_once, self._when_quiet, self._at_last, self._looks):
            timer.stop()
        while self._stops:
            self._stops.pop()()
        self._session = None
        if self._writing is not None:
            futures.wait([self._writing])
            self._writing = None
        self._drop()

    def close(self) -> None:
        """Be done, for good."""
        self.forget()
        self._threads.shutdown()

    def keep(self) -> None:
        """Keep the work as it is now, if it is not kept already, and it is needed."""
        session = self._session
        if session is None:
            return
        self._again = self._writing is not None
        if self._again:
            return
        if not self._is_behind():
            self._drop()
        elif session.state is not self._kept:
            self._kept = session.state  # or a later one, which is then written once more
            self._writing = self._threads.submit(self._write, session)
            self._looks.start()

    def _changed(self, change: Change) -> None:
        session = self._session
        if session is None:
            return
        if not session.is_dragging:
            timer = self._at_once if change & Change.HISTORY else self._when_quiet
            timer.start()
        if not self._at_last.isActive():
            self._at_last.start()

    def _write(self, session: Session) -> Slot:
        """In the other thread; of the session only its mesh and its state are read, once each."""
        slot = self._slot if self._slot is not None else self._autosaves.new(self.about)
        self._slot = slot
        slot.write(session)
        return slot

    def _look(self) -> None:
        """See whether the writing is done, and what became of it."""
        if self._writing is None or not self._writing.done():
            return
        error, self._writing = self._writing.exception(), None
        self._looks.stop()
        if error is None:
            self._has_failed = False
            self.kept.emit()
        elif isinstance(error, SegDeformError | OSError):
            self._fail(error)
        else:
            raise error
        if self._again:
            self.keep()

    def _fail(self, error: Exception) -> None:
        self._kept = None
        if self._slot is not None and not self._slot.path.parent.is_dir():
            self._slot = None  # somebody took the folder away
        self._at_last.start()  # and then again
        if not self._has_failed:
            self._has_failed = True
            self.failed.emit(f"unsaved work cannot be kept: {error}")

    def _drop(self) -> None:
        slot, self._slot, self._kept = self._slot, None, None
        if slot is not None:
            slot.remove()

    def _timer(self, milliseconds: int, call: Callable[[], None]) -> Any:
        timer = QtCore.QTimer(self)
        timer.setSingleShot(True)
        timer.setInterval(milliseconds)
        timer.timeout.connect(call)
        return timer


def stops_of(hearer: Any) -> list[Stop]:
    """Return a list for what ends the hearing of a QObject; done when Qt deletes it."""
    stops: list[Stop] = []

    def stop(*_: object) -> None:
        while stops:
            stops.pop()()

    hearer.destroyed.connect(stop)
    return stops
