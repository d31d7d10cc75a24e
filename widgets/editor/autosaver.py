"""When to autosave unsaved work: soon after each step, and every few seconds during a drag.

The state of a session is immutable, so another thread writes it, and neither the drag nor its
display waits for the disk.  Once the work has been saved or undone, its autosave is deleted.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import State

from .autosave import About, Autosaves, Slot
from .controller import Controller
from .queue import Kind, Task, Work

INTERVAL = 10.0  # seconds: the longest part of an ongoing drag that a crash may lose
_REST = 0.25  # seconds without a change


class Autosaver:
    """Saves the unsaved work of one editor, from now on.

    Parameters
    ----------
    controller : Controller
        The controller of the editor; a failure is shown in its status line, once.
    autosaves : Autosaves
        Where to save.
    about : callable
        Returns the description of the document, which is written into each new slot.
    slot : Slot, optional
        The slot that contains the session already.
    interval : float
        Longest time between a change and its autosave, in seconds.
    """

    def __init__(
        self,
        controller: Controller,
        autosaves: Autosaves,
        about: Callable[[], About],
        *,
        slot: Slot | None = None,
        interval: float = INTERVAL,
    ) -> None:
        self._controller, self._queue = controller, controller.queue
        self._autosaves, self._about, self._slot = autosaves, about, slot
        self._interval = interval
        self._session = controller.session
        self._seen = controller.session.state
        self._tried: State | None = self._seen  # None after a failure
        self._has_failed = False
        self._stop = controller.messages.on_change(self._changed)

    @property
    def is_idle(self) -> bool:
        """Whether no autosave is running or due."""
        return self._queue.task(Kind.AUTOSAVE) is None

    def save(self) -> None:
        """Save now, if anything has changed, and wait until that is done."""
        self._changed()
        self._queue.wait(Kind.AUTOSAVE)

    def discard(self) -> None:
        """Stop, and delete what was saved."""
        self._stop()
        self._drop()

    def _changed(self) -> None:
        session = self._controller.session
        if session is not self._session:  # another one was opened in the editor
            self._session, self._seen, self._tried = session, session.state, None
            self._drop()
        is_new, self._seen = session.state is not self._seen, session.state
        task = self._queue.task(Kind.AUTOSAVE)
        if not self._controller.is_modified:
            if task is None or task.future is None:  # or else once it has been written
                self._tried = session.state
                self._drop()
        elif task is not None:
            if is_new and not session.is_dragging:
                self._queue.delay(Kind.AUTOSAVE)
        elif session.state is not self._tried:
            self._add(_REST)

    def _add(self, rest: float) -> None:
        session, latest = self._session, time.monotonic() + self._interval
        task = Task(
            kind=Kind.AUTOSAVE,
            begin=self._begin,
            done=lambda _: self._end(),
            failed=self._fail,
            may_begin=lambda: not session.is_dragging or time.monotonic() >= latest,
            rest=rest,
        )
        self._queue.add(task)

    def _begin(self) -> Work | None:
        session, self._tried = self._session, self._session.state
        try:
            slot = self._slot = self._slot or self._autosaves.new(self._about())
        except SegDeformError as error:
            self._fail(error)
            return None
        view = self._controller.camera.settings(self._controller.mode)

        def write(_: Progress) -> None:
            slot.write(session, view)  # reads only the mesh and the state, once

        return write

    def _end(self) -> None:
        self._has_failed = False
        self._changed()

    def _fail(self, error: BaseException) -> None:
        if not isinstance(error, SegDeformError | OSError):
            raise error
        if self._slot is not None and not self._slot.path.parent.is_dir():
            self._slot = None  # the folder was deleted
        self._tried = None
        self._add(self._interval)
        if not self._has_failed:
            self._has_failed = True
            self._controller.say(f"Could not autosave: {error}")

    def _drop(self) -> None:
        """Stop writing and delete the slot."""
        self._queue.cancel(Kind.AUTOSAVE)
        self._queue.wait(Kind.AUTOSAVE)
        slot, self._slot = self._slot, None
        if slot is not None:
            slot.remove()
