"""Autosave of unsaved work: after each step, and every few seconds during a drag.

The state of a session is immutable, so a job in another thread writes it and neither the drag nor
its display waits for the disk.  Once the work has been saved or undone, its autosave is deleted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from qtpy import QtCore

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.session import Change, Session

from ..editor import About, Autosaves, Job, Slot
from ..scene import Stop
from .qt_timer import qt_timer

INTERVAL = 10.0  # seconds: the longest part of an ongoing drag that a crash may lose
_QUIET = 250  # milliseconds without a change, for example after refinement
_PERIOD = 15  # milliseconds between two polls of the job


class Autosaver(QtCore.QObject):
    """Save the unsaved work on one document at a time.

    Parameters
    ----------
    autosaves : Autosaves
        Where to save.
    parent : QObject
        The window.
    interval : float
        Longest time between a change and its autosave, in seconds.

    Attributes
    ----------
    about : About
        The document; written beside the work in the next new slot.
    """

    saved = QtCore.Signal()
    """The work was written."""
    failed = QtCore.Signal(str)
    """The work could not be written, with the reason; emitted once until it succeeds again."""

    def __init__(
        self, autosaves: Autosaves, parent: Any = None, *, interval: float = INTERVAL
    ) -> None:
        super().__init__(parent)
        self._autosaves = autosaves
        self._session: Session | None = None
        self._slot: Slot | None = None
        self.about = About()
        self._is_modified: Callable[[], bool] = bool
        self._view: Callable[[], Mapping[str, Any]] = dict
        self._saved_state: object = None  # the state in the slot
        self._job: Job[None] | None = None
        self._has_failed = self._is_due = False
        self._stops = stops_of(self)
        self._after_step = self._timer(0, self.save)
        self._after_pause = self._timer(_QUIET, self.save)
        self._at_latest = self._timer(round(1000.0 * interval), self.save)

    @property
    def is_idle(self) -> bool:
        """Whether no autosave is running or due."""
        timers = self._after_step, self._after_pause
        return self._job is None and not any(timer.isActive() for timer in timers)

    def watch(
        self,
        session: Session,
        about: About,
        is_modified: Callable[[], bool],
        *,
        view: Callable[[], Mapping[str, Any]] = dict,
        slot: Slot | None = None,
    ) -> None:
        """Save the changes of another session from now on.

        Parameters
        ----------
        session : Session
            The session.
        about : About
            Its document.
        is_modified : callable
            Returns whether the session has unsaved changes.
        view : callable
            Returns the view of its editor.
        slot : Slot, optional
            The slot that contains the session already.
        """
        self.discard()
        self._session, self.about, self._is_modified = session, about, is_modified
        self._view = view
        self._slot, self._saved_state = slot, session.state if slot is not None else None
        self._stops.append(session.on_change(self._changed))

    def discard(self) -> None:
        """Stop watching the session, and delete its autosave."""
        for timer in (self._after_step, self._after_pause, self._at_latest):
            timer.stop()
        while self._stops:
            self._stops.pop()()
        self._session = None
        job, self._job = self._job, None
        if job is not None:
            job.cancel()
            job.wait()
        self._remove_slot()

    def save(self) -> None:
        """Save the current work if it is unsaved and has changed since the last autosave."""
        session = self._session
        if session is None:
            return
        self._is_due = self._job is not None
        if self._is_due:
            return
        if not self._is_modified():
            self._remove_slot()
        elif session.state is not self._saved_state:
            view = self._view()
            self._saved_state = session.state  # a later one may be written, and then once more
            self._job = Job(
                qt_timer(self, _PERIOD),
                lambda _: self._write(session, view),
                done=lambda _: self._finish(None),
                failed=self._finish,
            )

    def _changed(self, change: Change) -> None:
        session = self._session
        if session is None:
            return
        if not session.is_dragging:
            timer = self._after_step if change & Change.HISTORY else self._after_pause
            timer.start()
        if not self._at_latest.isActive():
            self._at_latest.start()

    def _write(self, session: Session, view: Mapping[str, Any]) -> None:
        """Write the session, in the other thread; it reads only the mesh and the state, once."""
        slot = self._slot if self._slot is not None else self._autosaves.new(self.about)
        self._slot = slot
        slot.write(session, view)

    def _finish(self, error: BaseException | None) -> None:
        self._job = None
        if error is None:
            self._has_failed = False
            self.saved.emit()
        elif isinstance(error, SegDeformError | OSError):
            self._fail(error)
        else:
            raise error
        if self._is_due:
            self.save()

    def _fail(self, error: Exception) -> None:
        self._saved_state = None
        if self._slot is not None and not self._slot.path.parent.is_dir():
            self._slot = None  # the folder was deleted
        self._at_latest.start()  # try again
        if not self._has_failed:
            self._has_failed = True
            self.failed.emit(f"Could not autosave: {error}")

    def _remove_slot(self) -> None:
        slot, self._slot, self._saved_state = self._slot, None, None
        if slot is not None:
            slot.remove()

    def _timer(self, milliseconds: int, call: Callable[[], None]) -> Any:
        timer = QtCore.QTimer(self)
        timer.setSingleShot(True)
        timer.setInterval(milliseconds)
        timer.timeout.connect(call)
        return timer


def stops_of(listener: Any) -> list[Stop]:
    """Return a list for the subscriptions of a QObject, which end when Qt deletes it."""
    stops: list[Stop] = []

    def stop(*_: object) -> None:
        while stops:
            stops.pop()()

    listener.destroyed.connect(stop)
    return stops
