"""Lines of numbers in text, parsed many at once.

Python takes a microsecond for each word, which for a file of a million vertices is many seconds.
Here numpy finds the lines and words, and parses all numbers in one call.  What is not plain numbers
is left to the caller: the functions return None for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from .array_names import decoded

_LINE_FEED, _SPACE, _TAB, _SLASH = b"\n \t/"
_LONGEST = 2  # letters of a word that lines are grouped by
_MOST = 10**17  # an index
_LEAST_BYTE = 2  # of a colour, that is no fraction


class Lines:
    """The lines of a text, grouped by their first word if it is one of *words*.

    These have one or two letters.
    """

    def __init__(self, text: bytes, words: tuple[str, ...]) -> None:
        self._text = text + b"\n" * (not text.endswith(b"\n"))
        self._words = words
        data = self._letters = np.frombuffer(self._text, dtype=np.uint8)
        self._starts = np.append(0, np.flatnonzero(data == _LINE_FEED) + 1)
        first = self._starts[:-1]
        # Beyond the end, the last line feed.
        letters = [data[np.minimum(first + k, len(data) - 1)] for k in range(_LONGEST + 1)]
        self._sort = np.full(len(first), -1, dtype=np.int8)
        for number, word in enumerate(words):
            after = letters[len(word)]
            matches = (after == _SPACE) | (after == _TAB)
            for k, each in enumerate(word.encode()):
                matches &= letters[k] == each
            self._sort[matches] = number

    def of(self, word: str) -> bytes:
        """Return the lines that begin with *word*."""
        is_one = self._sort == self._words.index(word)
        turns = np.flatnonzero(np.diff(is_one, prepend=False, append=False))
        ends = self._starts[turns].tolist()  # of runs of such lines, in turns with their starts
        parts = zip(ends[::2], ends[1::2], strict=True)
        return b"".join([self._text[start:end] for start, end in parts])

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
            yield number, decoded(self._line(number))

    def _line(self, number: int) -> bytes:
        return self._text[self._starts[number] : self._starts[number + 1] - 1]

    def table(self, word: str) -> FloatArray | None:
        """Return the numbers (k, w) of the lines of *word*; None unless all have w numbers."""
        lines = self.of(word)
        _, counts = words_per_line(lines)
        if not len(counts) or (counts != counts[0]).any():
            return None
        width = int(counts[0]) - 1
        values = numbers_of(lines.replace(word.encode(), b" "), np.float64, len(counts) * width)
        return None if values is None else values.reshape(-1, width)

    def corners(self, word: str) -> tuple[IntArray, IntArray] | None:
        """Return the corners of faces, the lines of *word*, as `_corners_of` does."""
        return _corners_of(self.of(word))


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
    if count is None:
        is_word = np.frombuffer(text, dtype=np.uint8) > _SPACE
        count = int(is_word[:1].sum()) + int((is_word[1:] & ~is_word[:-1]).sum())
    try:
        numbers = np.fromstring(text, dtype=dtype, sep=" ")
    except (ValueError, DeprecationWarning):  # a warning before numpy 2.3
        return None
    return numbers if len(numbers) == count else None


def are_numbers(words: Sequence[str | bytes]) -> bool:
    """Return whether all *words* are numbers."""
    try:
        for word in words:
            float(word)
    except ValueError:
        return False
    return True


def colour_bytes(colours: FloatArray) -> NDArray[np.uint8]:
    """Return *colours* of text as bytes: they are fractions unless one of them is 2 or more.

    1 may be either, so that colours of 0 and 1 alone are fractions.  A fraction between 1 and 2
    has been rounded or computed; it is clipped.

    >>> colour_bytes(np.array([0.0, 1.0, 0.2])), colour_bytes(np.array([0.0, 1.0, 200.0]))
    (array([  0, 255,  51], dtype=uint8), array([  0,   1, 200], dtype=uint8))
    """
    numbers = np.nan_to_num(colours, posinf=0.0, neginf=0.0)
    scale = 1.0 if numbers.max(initial=0.0) >= _LEAST_BYTE else 255.0
    return np.asarray(np.rint((scale * numbers).clip(0.0, 255.0)), dtype=np.uint8)


def colour_numbers(colours: Any) -> Any:
    """Return the numbers that `colour_bytes` reads as *colours*, which are bytes."""
    values = np.asarray(colours)
    return values if values.max(initial=0) >= _LEAST_BYTE else values / 255.0


def _corners_of(lines: bytes) -> tuple[IntArray, IntArray] | None:
    """Return the number of corners of each line (m,) of faces, and the corners (c, 3).

    A corner is a, a/t, a//n or a/t/n, whole numbers other than 0, with 0 for those that are not
    given.  None if something else is there, or if some corners are given in another way.
    """
    begins, n_words = words_per_line(lines)
    counts = n_words - 1
    n_corners = int(counts.sum())
    data = np.frombuffer(lines, dtype=np.uint8)
    slashes = np.flatnonzero(data == _SLASH)
    per_word = np.diff(np.searchsorted(slashes, np.append(begins, len(data))))
    per_corner = np.delete(per_word, np.cumsum(n_words) - n_words)
    n_slashes = int(per_corner[0]) if n_corners else 0
    columns = ([0], [0, 1], [0, 1, 2])[min(n_slashes, 2)]
    if n_slashes > 2 or (per_corner != n_slashes).any():
        return None
    if n_slashes == 2 and (doubled := lines.count(b"//")):
        if doubled != n_corners:
            return None
        columns = [0, 2]
    text = lines.replace(b"f", b" ").replace(b"/", b" ")
    numbers = numbers_of(text, np.int64, n_corners * len(columns))
    if numbers is None or (numbers == 0).any() or (np.abs(numbers) >= _MOST).any():
        return None
    corners = np.zeros((n_corners, 3), dtype=np.int64)
    corners[:, columns] = numbers.reshape(n_corners, len(columns))
    return counts, corners
