"""Binary messages to the page that draws: a header, then arrays one after another.

    bytes   0 to 3     "SDFM"
    bytes   4 to 5     version
    bytes   6 to 7     kind
    bytes   8 to 11    length of the message in bytes
    bytes  12 to 15    serial number of the surface that the message belongs to
    bytes  16 ...      arrays, each padded with zeros to a multiple of four bytes

All numbers are little-endian.  ``surface.js`` reads the messages and must have the same version.
"""

from __future__ import annotations

import enum
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

VERSION = 3
_MAGIC = b"SDFM"
_HEADER = struct.Struct("<4sHHII")


class Kind(enum.IntEnum):
    """What a message contains; arrays in this order."""

    SURFACE = 1
    """Seven counts, and the arrays of `EncodedSurface`."""
    CAGES = 2
    """The number of the pose, and the moves of the cage vertices (m, 3) float32."""
    OFFSETS = 3
    """A step float32, and offsets of the vertices (n, 3) int16 in steps; or none."""
    COLOURS = 4
    """(n, 4) uint8; or none for the colour of the body."""
    LOOK = 5
    """Camera, light and material, float32; see `Look`."""
    MARKS = 6
    """For each mark the numbers of `Mark.head`, and its points unless the last message of marks
    had them, float32."""


def message(kind: Kind, serial: int, *arrays: NDArray[Any]) -> bytes:
    """Return the message of *kind* with *arrays*."""
    pieces = []
    for array in arrays:
        data = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).tobytes()
        pieces += [data, bytes(-len(data) % 4)]
    length = _HEADER.size + sum(map(len, pieces))
    return b"".join([_HEADER.pack(_MAGIC, VERSION, kind, length, serial), *pieces])
