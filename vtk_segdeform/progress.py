"""How long work tells its caller how far it is, and how the caller stops it."""

from __future__ import annotations

from collections.abc import Callable

from .checks import as_callable

Progress = Callable[[float, str], None]
"""Called with a fraction in 0..1 and what is being done; raise `errors.Cancelled` in it to stop."""


def tell(progress: Progress | None, fraction: float, message: str) -> None:
    """Call *progress*, if there is one."""
    if progress is not None:
        as_callable(progress, "progress")(fraction, message)


def part(progress: Progress | None, start: float, end: float) -> Progress | None:
    """Return a progress for a piece of work that spans *start*..*end* of the whole."""
    if progress is None:
        return None
    as_callable(progress, "progress")

    def report(fraction: float, message: str) -> None:
        progress(start + fraction * (end - start), message)

    return report
