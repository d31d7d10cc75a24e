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
    """The mesh and its W~; see `encoding`.

    counts (7,) uint32    vertices n, `twice`, faces, cage vertices, sets, `columns`, `weights`
    rest (n, 3) float32   the vertices at rest
    steps (n,) float32    s
    sets (n,) uint16      the set of each vertex; those of a set follow the same cage vertices
    lengths uint32        how many of `columns` each set has, a multiple of four
    columns uint16        the cage vertices of each set; padding has weight 0
    weights int16         q, row after row
    faces (f, 3) uint32   triangles of the vertices, and from n on of `twice`
    twice uint32          vertices that are drawn a second time, with the opposite normal
    """
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
