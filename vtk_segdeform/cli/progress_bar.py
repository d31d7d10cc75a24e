"""A progress bar for the terminal."""

from __future__ import annotations

import time
from typing import TextIO


class ProgressBar:
    """A progress callback that rewrites one line of a terminal, from the first second on.

    Nothing is written if *stream* is not a terminal.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._start = time.monotonic()
        self._shown = False

    def __call__(self, fraction: float, message: str) -> None:
        """Show the *fraction* of the work that is done, and the current step."""
        if self._stream.isatty() and time.monotonic() - self._start > 1.0:
            filled = "#" * round(30 * min(max(fraction, 0.0), 1.0))
            self._stream.write(f"\r[{filled:.<30}] {fraction:4.0%} {message:<40.40}")
            self._stream.flush()
            self._shown = True

    def clear(self) -> None:
        """Erase the bar, so that text can be printed."""
        if self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
            self._shown = False
