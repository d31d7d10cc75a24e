"""Lines of numbers in text, parsed many at once.

Python takes a microsecond for each word, which for a file of a million vertices is many seconds.
Here numpy finds the lines and words, and numpy parses all numbers in one call, or a compiled kernel
does so in several threads.  What is not plain numbers is left to the caller: the functions return
None for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from ..kernels import compiled_checks, in_parallel, inputs
from .array_names import decoded

_LINE_FEED, _SPACE, _TAB, _SLASH = b"\n \t/"
_LONGEST = 2  # letters of a word that lines are grouped by
_MOST = 10**17  # an index
_LEAST_BYTE = 2  # of a colour, that is no fraction
_PIECE, _PIECE_LINES = 1 << 19, 1 << 14  # bytes, or lines, that a thread parses at a time


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
        wanted = np.repeat(self._sort == self._words.index(word), np.diff(self._starts))
        return bytes(self._letters[wanted])

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
        at = self.at(word)
        kernels = compiled_checks(len(at))
        if kernels is None or not len(at):
            return _table_of(self.of(word), word)
        values = np.empty((len(at), len(self._line(at[0]).split()) - 1))
        text, starts, rows = inputs(self._letters, self._starts, at)
        is_plain = np.zeros(len(at), dtype=bool)

        def parse(first: int, end: int) -> None:
            given = text, starts, rows[first:end], len(word)
            is_plain[first:end] = kernels.numbers_of_lines(*given, values[first:end])

        in_parallel(parse, len(at), _PIECE_LINES, blas=False)
        return values if is_plain.all() else None

    def corners(self, word: str) -> tuple[IntArray, IntArray] | None:
        """Return the corners of faces, the lines of *word*, as `_corners_of` does.

        Corners may be given in different ways.
        """
        at = self.at(word)
        kernels = compiled_checks(len(at))
        if kernels is None:
            return _corners_of(self.of(word))
        most = int((self._starts[at + 1] - self._starts[at]).sum()) // 2
        counts, corners = np.empty(len(at), dtype=np.int64), np.empty((most, 3), dtype=np.int64)
        text, starts, rows = inputs(self._letters, self._starts, at)
        found = kernels.corners_of_lines(text, starts, rows, len(word), counts, corners)
        return (counts, corners[:found]) if found >= 0 else None


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
        numbers = _plain_numbers(kernels, text, np.dtype(dtype).kind == "i")
        if numbers is not None and count in (None, len(numbers)):
            return numbers.astype(dtype, copy=False)
    if count is None:
        count = len(words_per_line(text)[0])
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


def _plain_numbers(kernels: Any, text: bytes, whole: bool) -> FloatArray | None:
    """Return the numbers (k,) of *text*; None if one is not plain, or not *whole* if it must be."""
    (characters,) = inputs(np.frombuffer(text, dtype=np.uint8))
    starts = [0]
    while starts[-1] < len(text):  # at ends of lines
        starts.append(text.find(b"\n", starts[-1] + _PIECE) + 1 or len(text))
    parts: list[FloatArray | None] = [None] * (len(starts) - 1)

    def parse(first: int, end: int) -> None:
        for k in range(first, end):
            piece = characters[starts[k] : starts[k + 1]]
            values = np.empty(len(piece) // 2 + 1)
            found = kernels.plain_numbers(piece, whole, values)
            parts[k] = values[:found].copy() if found >= 0 else None

    in_parallel(parse, len(parts), 1, blas=False)
    plain = [part for part in parts if part is not None]
    return np.concatenate([np.empty(0), *plain]) if len(plain) == len(parts) else None


def _table_of(lines: bytes, word: str) -> FloatArray | None:
    """Return the numbers (k, w) of lines that begin with *word*; None unless all have w numbers."""
    _, counts = words_per_line(lines)
    if not len(counts) or (counts != counts[0]).any():
        return None
    width = int(counts[0]) - 1
    values = numbers_of(lines.replace(word.encode(), b" "), np.float64, len(counts) * width)
    return None if values is None else values.reshape(-1, width)


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
