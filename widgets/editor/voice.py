"""What the editor says in its line: what was done and what to do next, or what went wrong.

What was done is said until the next thing is done; what went wrong as well, and alone.  Others,
a panel beside the view, hear whenever something is said.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vtk_segdeform.errors import SegDeformError

from ..scene import Stop, View
from .jobs import Job
from .status_line import StatusLine


def words_of(error: BaseException) -> str:
    """Return what went wrong in words.

    >>> words_of(ValueError("too far")), words_of(KeyError())
    ('too far', 'a fault: KeyError')
    """
    wordy = isinstance(error, SegDeformError | ValueError) and str(error)
    name = ", ".join(filter(None, (type(error).__name__, str(error))))
    return str(error) if wordy else f"a fault: {name}"


class Voice:
    """The words in the status line of a view.

    Parameters
    ----------
    view : View
        Where the line lies.
    """

    def __init__(self, view: View) -> None:
        self._line = StatusLine(view)
        self._note = self._fault = self._question = self._last_question = ""
        self._listeners: dict[int, Callable[[], object]] = {}

    @property
    def text(self) -> str:
        """What the line says."""
        return self._line.text

    @property
    def noted(self) -> str:
        """What was done last, or ""."""
        return self._note

    @property
    def fault(self) -> str:
        """What went wrong, or ""."""
        return self._fault

    @property
    def fraction(self) -> float | None:
        """How far the job is that is told of, 0..1; or None."""
        return self._line.fraction

    def on_word(self, listener: Callable[[], object]) -> Stop:
        """Call *listener* whenever something is said, until stopped; it may be the same again."""
        key = max(self._listeners, default=0) + 1
        self._listeners[key] = listener

        def stop() -> None:
            self._listeners.pop(key, None)

        return stop

    def note(self, text: str) -> None:
        """Tell what was done."""
        self._note, self._fault = text, ""

    def complain(self, error: Exception) -> None:
        """Tell what went wrong; our own errors are in words already."""
        self._fault = words_of(error)

    def forget(self) -> None:
        """Tell no more of what was done, went wrong or was asked before."""
        self._last_question, self._question = self._question, ""
        self._note = self._fault = ""

    def confirms(self, question: str) -> bool:
        """Tell whether *question* was asked just before; else ask it."""
        if self._last_question == question:
            return True
        self._question = question
        self.note(question)
        return False

    def speak(self, mode: str, hint: str) -> None:
        """Say all that, and *hint*, what to do next in *mode*."""
        if self._fault:
            self._line.warn(self._fault, mode)
        else:
            self._line.say(" · ".join(filter(None, (self._note, hint))), mode)
        self._tell()

    def tell_of(self, job: Job[Any], mode: str, doing: str) -> None:
        """Say how far a *job* is with *doing* something, and what can be done about it."""
        if job.is_cancelled:
            self.note("cancelled, nothing was changed")  # to be said when it is over
        then = "stopping ..." if job.is_cancelled else "Esc cancels"
        what = ": ".join(filter(None, (doing, job.text)))
        self._line.progress(job.fraction, f"{what} · {100.0 * job.fraction:.0f} % · {then}", mode)
        self._tell()

    def be_silent(self) -> None:
        """Say nothing."""
        self._line.say("")
        self._tell()

    def remove(self) -> None:
        """Take the line out of the view, for good."""
        self._line.remove()

    def _tell(self) -> None:
        for listener in list(self._listeners.values()):
            listener()
