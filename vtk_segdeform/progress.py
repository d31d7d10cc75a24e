"""Progress callbacks and cancellation."""

from __future__ import annotations

from collections.abc import Callable

from .checks import as_callable

Progress = Callable[[float, str], None]
"""Called with the fraction done, 0..1, and a text; may raise `errors.Cancelled` to stop."""


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
