"""Progress callbacks and cancellation."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import wait
from typing import TypeVar

from .checks import as_callable
from .importing import in_thread

T = TypeVar("T")

_PERIOD = 0.05  # seconds between two calls of a progress callback

Progress = Callable[[float, str], None]
"""Called with the fraction done, 0..1, and a text; may raise `Cancelled` to stop.

What it returns is ignored."""


def tell(progress: Progress | None, fraction: float, message: str) -> None:
    """Call *progress* unless it is None."""
    if progress is not None:
        as_callable(progress, "progress")(fraction, message)


def part(progress: Progress | None, start: float, end: float) -> Progress | None:
    """Return a callback for a part of the work that spans *start*..*end* of *progress*."""
    if progress is None:
        return None
    as_callable(progress, "progress")

    def report(fraction: float, message: str) -> None:
        progress(start + fraction * (end - start), message)

    return report


def cancellable(work: Callable[[], T], progress: Progress | None, message: str) -> T:
    """Return ``work()``, which reports no progress itself, such as a function of a library.

    With *progress* it runs in another thread, and *progress* is called meanwhile.  If that raises,
    the thread is abandoned: it ends with its work, or with the process.
    """
    if progress is None:
        return work()
    result = in_thread(work, daemon=True)
    while True:
        tell(progress, 0.0, message)
        if wait([result], timeout=_PERIOD).done:
            return result.result()
