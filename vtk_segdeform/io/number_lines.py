"""Lines of numbers in text, parsed many at once.

Python takes a microsecond for each word, which for a file of a million vertices is many seconds.
Here numpy finds the lines and words, and numpy or a compiled kernel parses all numbers in one call.
What is not plain numbers is left to the caller: the functions return None for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..kernels import compiled_checks, inputs

_LINE_FEED, _SPACE, _TAB = b"\n \t"


class Lines:
    """The lines of a text, grouped by their first word if it is one of *words*."""

    def __init__(self, text: str, words: tuple[str, ...]) -> None:
        self._text = text.encode() + b"\n" * (not text.endswith("\n"))
        self._words = words
        data = np.frombuffer(self._text, dtype=np.uint8)
        self._starts = np.append(0, np.flatnonzero(data == _LINE_FEED) + 1)
        first = self._starts[:-1]
        padded = np.append(data, np.zeros(max(map(len, words)) + 1, dtype=np.uint8))
        self._sort = np.full(len(first), -1, dtype=np.int8)
        for number, word in enumerate(words):
            after = padded[first + len(word)]
            matches = (after == _SPACE) | (after == _TAB)
            for k, letter in enumerate(word.encode()):
                matches &= padded[first + k] == letter
            self._sort[matches] = number

    def of(self, word: str) -> bytes:
        """Return the lines that begin with *word*."""
        wanted = np.repeat(self._sort == self._words.index(word), np.diff(self._starts))
        return bytes(np.frombuffer(self._text, dtype=np.uint8)[wanted])

    def above(self, word: str) -> IntArray:
        """Return the number of lines of *word* above each line (n,)."""
        is_one = self._sort == self._words.index(word)
        above: IntArray = np.cumsum(is_one) - is_one
        return above

    def at(self, word: str) -> IntArray:
        """Return the numbers (k,) of the lines of *word*."""
        return np.flatnonzero(self._sort == self._words.index(word))

    def others(self) -> Iterator[tuple[int, str]]:
        """Yield the other lines, with their numbers from 0."""
        for number in np.flatnonzero(self._sort < 0).tolist():
            yield number, self._text[self._starts[number] : self._starts[number + 1] - 1].decode()


def words_per_line(lines: bytes) -> tuple[IntArray, IntArray]:
    """Return where words begin (w,), and the number of words of each line."""
    data = np.frombuffer(lines, dtype=np.uint8)
    is_word = data > _SPACE
    is_word[1:] &= ~is_word[:-1]
    begins = np.flatnonzero(is_word)
    ends = np.flatnonzero(data == _LINE_FEED)
    return begins, np.diff(np.searchsorted(begins, ends), prepend=0)


def numbers_of(text: bytes, dtype: Any, count: int | None = None) -> Any:
    """Return the numbers (k,) of *text*; None if it has anything else, or k is not *count*."""
    most = len(text) // 2 + 1 if count is None else count
    kernels = compiled_checks(most)
    if kernels is not None:
        (characters,), values = inputs(np.frombuffer(text, dtype=np.uint8)), np.empty(most)
        found = kernels.plain_numbers(characters, np.dtype(dtype).kind == "i", values)
        if found in (range(most + 1) if count is None else (count,)):
            return values[:found].astype(dtype, copy=False)
    if count is None:
        count = len(words_per_line(text)[0])
    try:
        numbers = np.fromstring(text, dtype=dtype, sep=" ")
    except (ValueError, DeprecationWarning):  # a warning before numpy 2.3
        return None
    return numbers if len(numbers) == count else None


def table_of(lines: bytes, word: str) -> FloatArray | None:
    """Return the numbers (k, w) of lines that begin with *word*; None unless all have w numbers."""
    _, counts = words_per_line(lines)
    if not len(counts) or (counts != counts[0]).any():
        return None
    width = int(counts[0]) - 1
    values = numbers_of(lines.replace(word.encode(), b" "), np.float64, len(counts) * width)
    return None if values is None else values.reshape(-1, width)
