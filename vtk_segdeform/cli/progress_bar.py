"""How far the work is, for who waits at a terminal."""

from __future__ import annotations

import time
from typing import TextIO


class ProgressBar:
    """One line, rewritten in place, when a person is watching and has waited for a second."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._start = time.monotonic()
        self._shown = False

    def __call__(self, fraction: float, message: str) -> None:
        """Show that *fraction* of the work is done, and what is going on."""
        if self._stream.isatty() and time.monotonic() - self._start > 1.0:
            filled = "#" * round(30 * min(max(fraction, 0.0), 1.0))
            self._stream.write(f"\r[{filled:.<30}] {fraction:4.0%} {message:<40.40}")
            self._stream.flush()
            self._shown = True

    def clear(self) -> None:
        """Wipe the line, so that text can be written there."""
        if self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
            self._shown = False
