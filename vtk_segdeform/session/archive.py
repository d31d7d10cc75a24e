"""Arrays and a header in one file, an uncompressed zip that ``numpy.load`` reads as any .npz.

Nothing in a file is believed.  An array is read only once its shape and type are those that the
caller expects, and not before its bytes are known to be in the file, which for all arrays together
are two gigabytes at most; checksums are compared.  Nothing in a file is run either: no pickle.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from io import BytesIO
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

_HEADER = "header.json"
_LONGEST_HEADER = 1 << 20  # bytes
_LONGEST_NPY_HEADER = 1 << 12  # bytes, more than any array needs
_LONGEST_LIST = 1 << 16  # bytes of the directory
_LARGEST = 2 << 30  # bytes of a file; a million vertices take some eighty million
_END = b"PK\5\6"  # begins the last 22 bytes of a zip file without a comment, ...
_END_64 = b"PK\6\7"  # ... and this the 20 before them, of one too large for us
_EPOCH = (1980, 1, 1, 0, 0, 0)  # what is the same is the same file
_TYPES = {"f": np.dtype("<f8"), "i": np.dtype("<i8"), "b": np.dtype("|b1")}


def write_archive(file: IO[bytes], header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a *header*, plain enough for JSON, and *arrays* of float64, int64 or bool.

    Raises
    ------
    OSError
        If it cannot be written, or exceeds the size that can be read.
    """
    total = sum(array.nbytes for array in arrays.values())
    if total + _LONGEST_HEADER > _LARGEST:
        raise OSError(f"{total:.3g} bytes exceed the limit of {_LARGEST:.3g}")
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo(_HEADER, _EPOCH), json.dumps(header, indent=1))
        for name, array in arrays.items():
            content = BytesIO()
            npy.write_array(content, array.astype(_TYPES[array.dtype.kind]), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", _EPOCH), content.getbuffer())


class Archive:
    """The header and the arrays of an open file, each read only if it is what is expected.

    Parameters
    ----------
    file : binary file
        Open for reading.

    Raises
    ------
    ValueError, OSError, zipfile.BadZipFile
        If it is not an archive, or exceeds the largest size.
    """

    def __init__(self, file: IO[bytes]) -> None:
        size = os.fstat(
            file.fileno()
        ).st_size  # of the open file: its name may refer to another one by now
        _require_short_list(file, size)
        self._archive = zipfile.ZipFile(file)
        self._left = size  # bytes: members may not overlap to make more of the file than it is

    def header(self) -> Any:
        """Return what ``header.json`` says."""
        with self._open(_HEADER, _LONGEST_HEADER) as content:
            return json.loads(content.read())

    def array(self, name: str, kind: str, shape: tuple[int, ...]) -> Any:
        """Return the array *name*, of *kind* "f", "i" or "b", if it has the *shape*.

        Raises
        ------
        ValueError, OSError, zipfile.BadZipFile
            If there is no such array, it is another, or its bytes are not those written.
        """
        dtype = _TYPES[kind]
        size = dtype.itemsize
        for count in shape:  # plain integers, which do not overflow
            size *= count
        with self._open(f"{name}.npy", size + _LONGEST_NPY_HEADER) as content:
            if npy.read_magic(content) != (1, 0):
                raise ValueError(f"{name} has a layout that this program does not write")
            found, fortran, kept = npy.read_array_header_1_0(
                content, max_header_size=_LONGEST_NPY_HEADER
            )
            if (found, kept) != (shape, dtype):
                raise ValueError(
                    f"{name} must be {dtype} of shape {shape}; it is {kept} of {found}"
                )
            data = content.read()  # to the end, where the checksum is compared
        if len(data) != size:
            raise ValueError(f"{name} must hold {size} bytes; it holds {len(data)}")
        if kind == "b" and (np.frombuffer(data, np.uint8) > 1).any():
            raise ValueError(f"{name} holds bytes that are neither true nor false")
        array = np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")
        return array.astype(dtype.newbyteorder("="))

    def _open(self, name: str, limit: int) -> IO[bytes]:
        if name not in self._archive.namelist():
            raise ValueError(f"{name} is missing")
        info = self._archive.getinfo(name)
        if info.compress_type != zipfile.ZIP_STORED:
            raise ValueError(f"{name} is compressed, which this program never does")
        size = max(info.file_size, info.compress_size)
        if size > min(limit, self._left):
            raise ValueError(f"{name} is larger than it can be: {size} bytes")
        self._left -= size
        return self._archive.open(info)


def _require_short_list(file: IO[bytes], size: int) -> None:
    """Raise ValueError if the file, or the directory that zipfile reads at once, is too large."""
    if size > _LARGEST:
        raise ValueError(f"it has {size:.3g} bytes; the limit is {_LARGEST:.3g}")
    file.seek(max(size - 42, 0))
    more, end = file.read(20), file.read(22)
    is_plain = end.startswith(_END) and end.endswith(b"\0\0") and not more.startswith(_END_64)
    if not is_plain or int.from_bytes(end[12:16], "little") > _LONGEST_LIST:
        raise ValueError("the directory of the archive is damaged; the file may be truncated")
