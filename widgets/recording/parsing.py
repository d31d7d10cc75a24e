"""Parsing the words of a line, which may be damaged; a ValueError describes the fault."""

from __future__ import annotations

import math


def require_count(words: list[str], n: int) -> list[str]:
    """Return *words* if there are *n* of them."""
    if len(words) != n:
        raise ValueError(f"expected {n} words, not {' '.join(words)[:60]!r}")
    return words


def parse_int(word: str, least: int, most: int) -> int:
    """Return the whole number in *word*, which must be from *least* to *most*."""
    number = int(word) if word.removeprefix("-").isdecimal() and len(word) < 9 else None
    if number is None or not least <= number <= most:
        raise ValueError(f"expected a whole number from {least} to {most}; got {word[:40]!r}")
    return number


def parse_float(word: str) -> float:
    """Return the finite number in *word*."""
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"expected a number; got {word[:40]!r}")
    return number
