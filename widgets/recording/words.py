"""Words of a line that somebody may have damaged, as numbers; ValueError says what is wrong."""

from __future__ import annotations

import math


def so_many(words: list[str], n: int) -> list[str]:
    """Return *words* if they are *n*."""
    if len(words) != n:
        raise ValueError(f"expected {n} words, not {' '.join(words)[:60]!r}")
    return words


def whole(word: str, least: int, most: int) -> int:
    """Return the whole number that a *word* says, if it is from *least* to *most*."""
    number = int(word) if word.removeprefix("-").isdecimal() and len(word) < 9 else None
    if number is None or not least <= number <= most:
        raise ValueError(f"expected a whole number from {least} to {most}; got {word[:40]!r}")
    return number


def finite(word: str) -> float:
    """Return the number that a *word* says, if it is one."""
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"expected a number; got {word[:40]!r}")
    return number
