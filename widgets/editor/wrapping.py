"""Text that fits into a window: its size, and where its lines break."""

from __future__ import annotations

import numpy as np

from ..scene import Text


def letter_size(width: int, height: int) -> float:
    """Return the font size for a window, in pixels."""
    return float(np.clip(min(height / 36.0, width / 48.0), 11.0, 26.0))


def wrapped(probe: Text, text: str, size: float, *, room: float, most: int) -> list[str]:
    """Return *text* in at most *most* lines, each no wider than *room* pixels.

    Lines break between words if possible; text that does not fit is replaced by dots.  *probe* is
    used to measure, and left with another text.
    """
    lines = list[str]()
    while text and len(lines) < most:
        cut = _fitting(probe, text, size, room)
        lines.append(text[:cut].rstrip())
        text = text[cut:].lstrip()
    if text:
        cut = _fitting(probe, f"{lines[-1]}...", size, room)
        lines[-1] = lines[-1][: min(cut, len(lines[-1])) - 3].rstrip() + "..."
    return lines


def _fitting(probe: Text, text: str, size: float, room: float) -> int:
    """Return the index at which to break *text*, between two words if possible."""
    low, high = 1, len(text)  # the first `low` letters fit, or none
    while low < high:
        middle = (low + high + 1) // 2
        probe.set_text(text[:middle], size)
        low, high = (middle, high) if probe.width() <= room else (low, middle - 1)
    space = text.rfind(" ", 0, low + 1)
    # Prefer a break in a long word to a line with only the sign of a warning.
    return space if low < len(text) and space > low // 3 else low
