"""Numbers in text, for `number_lines`, `wavefront` and `stl`, and rows of lists, for `ply_tables`.

A number is m 10^p with an integer m.  If m is up to 2^53 and p from -22 to 22, both factors are
doubles, and their product or quotient is rounded once.  Otherwise m and 10^|p| are sums of two
doubles each, and so is the result, with 40 more bits than a double has: rounding it is correct
unless the sum is so close to the middle of two doubles that these bits do not decide.  Such a
number, one with an m above 2^62, or with |p| above 80, is left to the caller.

Sources: W. D. Clinger, How to read floating point numbers accurately, PLDI 1990, 92-101;
T. J. Dekker, A floating-point technique for extending the available precision, Numerische
Mathematik 18 (1971), 224-242.
"""

from __future__ import annotations

import numpy as np

from .kernels import kernel

_compile = kernel()
_POWERS = np.array([float(10**k) for k in range(81)])
_LOW_POWERS = np.array([float(10**k - int(float(10**k))) for k in range(81)])  # 10^k less these
_EXACT, _EXACT_POWER, _LARGEST = 2**53, 22, 2**62
_SPLIT = 2.0**27 + 1.0
_UNDECIDED = 2.0**-95  # relative error of a sum of two doubles, and a margin
_LINE_FEED, _SPACE, _TAB, _RETURN = b"\n \t\r"
_PLUS, _MINUS, _POINT, _SLASH, _ZERO, _NINE, _E = b"+-./09e"
_MOST_DIGITS = 17  # of an index
_LETTER_CASE = 0x20
_FLOAT, _INTEGER = b"fi"


@_compile()
def _product(a, b):
    """Return a b as the sum of two doubles, exactly."""
    x, y = _SPLIT * a, _SPLIT * b
    a_high, b_high = x - (x - a), y - (y - b)
    a_low, b_low = a - a_high, b - b_high
    high = a * b
    return high, a_low * b_low - (((high - a_high * b_high) - a_low * b_high) - a_high * b_low)


@_compile()
def _scaled(mantissa, power):
    """Return mantissa 10^power, correctly rounded; NaN if that is undecided."""
    high = np.float64(mantissa)
    k = abs(power)
    if mantissa <= _EXACT and k <= _EXACT_POWER:
        return high / _POWERS[k] if power < 0 else high * _POWERS[k]
    if k >= len(_POWERS):
        return np.nan
    low = np.float64(mantissa - np.int64(high))
    ten, ten_low = _POWERS[k], _LOW_POWERS[k]
    if power < 0:
        value = high / ten
        back, back_low = _product(value, ten)
        rest = (((high - back) - back_low) + (low - value * ten_low)) / ten
    else:
        value, rest = _product(high, ten)
        rest += high * ten_low + low * ten
    margin = value * _UNDECIDED
    return value + rest if value + (rest - margin) == value + (rest + margin) else np.nan


@_compile()
def _number(text, at, whole):
    """Return the number at text[at], and the index after it; -1 as the index if it is not plain.

    It must end before a blank or the end of *text*.  If *whole*, it has digits and a sign only.
    """
    n = len(text)
    negative = False
    if at < n and (text[at] == _MINUS or text[at] == _PLUS):
        negative = text[at] == _MINUS
        at += 1
    mantissa, power, n_digits = np.int64(0), np.int64(0), 0
    after_point = False
    while at < n:
        letter = text[at]
        if _ZERO <= letter <= _NINE:
            if mantissa > _LARGEST // 10 - 1:
                return 0.0, -1
            mantissa = 10 * mantissa + (np.int64(letter) - _ZERO)
            power -= after_point
            n_digits += 1
        elif letter == _POINT and not after_point and not whole:
            after_point = True
        else:
            break
        at += 1
    if n_digits == 0:
        return 0.0, -1
    if at < n and (text[at] | _LETTER_CASE) == _E and not whole:
        at += 1
        down = False
        if at < n and (text[at] == _MINUS or text[at] == _PLUS):
            down = text[at] == _MINUS
            at += 1
        exponent, first = np.int64(0), at
        while at < n and _ZERO <= text[at] <= _NINE and exponent < 1000:
            exponent = 10 * exponent + (np.int64(text[at]) - _ZERO)
            at += 1
        if at == first:
            return 0.0, -1
        power += -exponent if down else exponent
    if at < n and text[at] != _SPACE and not _TAB <= text[at] <= _RETURN:
        return 0.0, -1
    if whole and mantissa > _EXACT:
        return 0.0, -1
    value = _scaled(mantissa, power) if mantissa else 0.0
    if np.isnan(value):
        return 0.0, -1
    return -value if negative else value, at


@_compile("const u1[:], b1, f8[:]")
def plain_numbers(text, whole, result):
    """Put the numbers of *text* (b,) uint8, between blanks, into *result* (n,); return how many.

    Return -1 if they are over n, or if one of them is not plain.  If *whole*, all are integers.
    """
    at, count = np.int64(0), 0  # a literal would compile `_number` once more
    while at < len(text):
        if text[at] == _SPACE or _TAB <= text[at] <= _RETURN:
            at += 1
            continue
        if count == len(result):
            return -1
        result[count], at = _number(text, at, whole)
        if at < 0:
            return -1
        count += 1
    return count


@_compile("const u1[:], const i8[:], const i8[:], i8, f8[:,:]")
def numbers_of_lines(text, starts, lines, skip, values):
    """Put the numbers of *lines* (k,) of *text*, after *skip* letters, into *values* (k, w).

    Line i is text[starts[i] : starts[i + 1]].  Return whether all of them have w plain numbers.
    """
    for row in range(len(lines)):
        at, end = starts[lines[row]] + skip, starts[lines[row] + 1]
        for column in range(values.shape[1]):
            while at < end and text[at] <= _SPACE:
                at += 1
            if at == end:
                return False
            values[row, column], at = _number(text, at, np.bool_(False))
            if at < 0:
                return False
        while at < end and text[at] <= _SPACE:
            at += 1
        if at < end:
            return False
    return True


@_compile("const u1[:], const i8[:], const i8[:], i8, i8[:], i8[:,:]")
def corners_of_lines(text, starts, lines, skip, counts, corners):
    """Put the corners of faces, a, a/t, a//n or a/t/n, into *corners* (c, 3), with 0 for none.

    Put their number on each of *lines* (k,) into *counts*.  Return how many there are; -1 if
    something else is there, if an index is 0 or has over 17 digits, or if there are over c.
    """
    count = 0
    for row in range(len(lines)):
        at, end = starts[lines[row]] + skip, starts[lines[row] + 1]
        first = count
        while True:
            while at < end and text[at] <= _SPACE:
                at += 1
            if at == end:
                break
            if count == len(corners):
                return -1
            for part in range(3):
                negative = at < end and text[at] == _MINUS
                at += negative
                index, begin = np.int64(0), at
                while at < end and _ZERO <= text[at] <= _NINE:
                    index = 10 * index + (np.int64(text[at]) - _ZERO)
                    at += 1
                is_empty = part == 1 and at == begin and not negative
                if (index == 0 and not is_empty) or at - begin > _MOST_DIGITS:
                    return -1
                corners[count, part] = -index if negative else index
                if part == 2 or at == end or text[at] != _SLASH:
                    if is_empty:
                        return -1
                    corners[count, part + 1 :] = 0
                    break
                at += 1
            if at < end and text[at] > _SPACE:
                return -1
            count += 1
        counts[row] = count - first
    return count


@_compile(
    "i8[:,:], i8[:,:], i8, b1, const u1[:], const f8[:], const i8[:], const i8[:], const u1[:]"
)
def rows_of_lists(begins, lengths, at, swapped, letters, numbers, sizes, word_sizes, kinds):
    """Put where values begin, and how many they are, into *begins* and *lengths* (n, p).

    A row of a PLY element has for each property p one value of *sizes*, or, if *word_sizes* is not
    0, a length and so many values.  Lengths are of numpy's *kinds*: unsigned, integers, or floats,
    which are read from *numbers*, the same bytes as *letters*.  Return the end of the rows; -1 if
    a length is wrong, or if they exceed the bytes.
    """
    for row in range(len(begins)):
        for k in range(len(sizes)):
            n, size = np.int64(1), word_sizes[k]
            if at + size > len(letters):
                return -1
            if kinds[k] == _FLOAT:
                length = numbers[at // 8]
                if not 0.0 <= length < _EXACT:
                    return -1
                n = np.int64(length)
                if n != length:
                    return -1
            elif size:
                n = np.int64(0)
                for b in range(size):
                    n |= np.int64(letters[at + (size - 1 - b if swapped else b)]) << (8 * b)
                if kinds[k] == _INTEGER and n >> (8 * size - 1):
                    return -1
            at += size
            if n > (len(letters) - at) // sizes[k]:
                return -1
            begins[row, k], lengths[row, k] = at, n
            at += sizes[k] * n
    return at
