"""The messages in the status line: the last result and the next step, or an error.

A result stays until the next action, or for some seconds; an error, which replaces everything else,
until the next action.  Other views of the messages, such as a panel, subscribe with
`Messages.on_change`.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from vtk_segdeform.errors import SegDeformError

from ..scene import Stop, View
from .status_line import StatusLine

_NOTE_SECONDS = 6.0  # for which a result is shown; it disappears at the next change


def error_text(error: BaseException) -> str:
    """Return the message of an error, preceded by its type if it is an internal error.

    >>> error_text(ValueError("too far")), error_text(KeyError())
    ('too far', 'Internal error: KeyError')
    """
    if isinstance(error, SegDeformError | ValueError) and str(error):
        return str(error)
    return f"Internal error: {', '.join(filter(None, (type(error).__name__, str(error))))}"


class Messages:
    """The messages of an editor, shown in the status line of its view.

    Parameters
    ----------
    view : View
        Where the line is drawn.
    """

    def __init__(self, view: View) -> None:
        self._line = StatusLine(view)
        self._noted = 0.0
        self._note = self._error = self._question = self._last_question = ""
        self._preparing: float | None = None
        self._work = ""
        self._listeners: dict[int, Callable[[], object]] = {}

    @property
    def text(self) -> str:
        """Text of the status line."""
        return self._line.text

    @property
    def height(self) -> float:
        """Height of the status line in the last picture, in pixels."""
        return self._line.height

    @property
    def last_note(self) -> str:
        """Result of the last action, or ""."""
        return self._note

    @property
    def error(self) -> str:
        """The error that is shown, or ""."""
        return self._error

    @property
    def fraction(self) -> float | None:
        """Completed fraction of the job or preparation that is shown, 0..1; None if none is."""
        return self._line.fraction if self._preparing is None else self._preparing

    @property
    def work(self) -> str:
        """What `fraction` is about: the job with its current step, or the preparation; or ""."""
        return self._work

    def on_change(self, listener: Callable[[], object]) -> Stop:
        """Call *listener* whenever messages are shown, even if unchanged, until stopped."""
        key = max(self._listeners, default=0) + 1
        self._listeners[key] = listener

        def stop() -> None:
            self._listeners.pop(key, None)

        return stop

    def note(self, text: str) -> None:
        """Set the result of the last action; this clears an error."""
        self._note, self._error, self._noted = text, "", time.monotonic()

    def report_error(self, error: Exception) -> None:
        """Set the error."""
        self._error = error_text(error)

    def clear(self) -> None:
        """Clear the result, the error and any question asked before the last one."""
        self._last_question, self._question = self._question, ""
        self._note = self._error = ""

    def confirms(self, question: str) -> bool:
        """Return whether *question* was asked just before; otherwise ask it."""
        if self._last_question == question:
            return True
        self._question = question
        self.note(question)
        return False

    def show(
        self, mode: str, hint: str, preparing: float | None = None, *, work: str = "Preparing"
    ) -> None:
        """Show the error, or else the result and *hint*, the next step in *mode*.

        At the right, show which fraction of the background *work* is complete, if any is running.
        """
        self._preparing, self._work = preparing, "" if preparing is None else work
        if time.monotonic() > self._noted + _NOTE_SECONDS and not self._question:
            self._note = ""
        share = f" {100.0 * preparing:.0f} %" if preparing else ""
        aside = "" if preparing is None else f"{work} ...{share} (Esc)"
        if self._error:
            self._line.warn(self._error, mode, aside)
        else:
            note = "" if self._note in hint else self._note  # the hint may contain it
            self._line.say(" · ".join(filter(None, (note, hint))), mode, aside)
        self._notify()

    def show_progress(self, mode: str, text: str, fraction: float, *, is_cancelled: bool) -> None:
        """Show the progress of a job and how to cancel it."""
        self._preparing, self._work = None, text
        if is_cancelled:
            self.note("Cancelled. Nothing was changed")  # shown once the job has ended
        key = "Stopping ..." if is_cancelled else "Esc to cancel"
        self._line.progress(fraction, f"{text} · {100.0 * fraction:.0f} % · {key}", mode)
        self._notify()

    def hide(self) -> None:
        """Hide the line until something is shown again."""
        self._line.say("")
        self._notify()

    def show_line(self, shown: bool) -> None:
        """Draw the line in the view, or not because a panel shows its text."""
        self._line.show(shown)

    def remove(self) -> None:
        """Remove the line from the view, permanently."""
        self._line.remove()

    def _notify(self) -> None:
        for listener in list(self._listeners.values()):
            listener()
