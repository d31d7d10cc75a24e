"""Archives: arrays and a header in one uncompressed zip file, which ``numpy.load`` can read.

Files may be damaged or malicious.  An array is read only if it has the shape and type that the
caller expects and its bytes are in the file; all arrays together have at most two gigabytes.
Texts are stored as UTF-8 and their ends.  Checksums are verified, and nothing is unpickled.
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
_LONGEST_NPY_HEADER = 1 << 12  # bytes
_LONGEST_DIRECTORY = 1 << 20  # bytes
_ENTRY = 64  # bytes of the directory for each member, at most, without its name
_LARGEST = 2 << 30  # bytes of a file; a million vertices take about 80 million
_END = b"PK\5\6"  # start of the last 22 bytes of a zip file without a comment
_END_64 = b"PK\6\7"  # start of the 20 bytes before them in a zip64 file, which is too large
_EPOCH = (1980, 1, 1, 0, 0, 0)  # a constant date makes equal sessions equal files
_TYPES = {"f": np.dtype("<f8"), "i": np.dtype("<i8"), "b": np.dtype("|b1")}
_OTHERS = ("f4", "i4", "i2", "i1", "u8", "u4", "u2", "u1", "c8", "c16")
_TYPES |= {name: np.dtype(f"<{name}") for name in _OTHERS}
_NAMES = {dtype.newbyteorder("="): name for name, dtype in _TYPES.items()}


def type_of(array: Any) -> str:
    """Return the name under which an archive stores the type of *array*.

    Raises
    ------
    OSError
        If it cannot be stored.
    """
    if array.dtype not in _NAMES:
        raise OSError(f"arrays of {array.dtype} cannot be stored")
    return _NAMES[array.dtype]


def write_archive(file: IO[bytes], header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a *header* for JSON and *arrays* of numbers.

    Raises
    ------
    OSError
        If the file cannot be written, or would be too large to be read.
    """
    content = json.dumps(header, indent=1)
    for what, size, limit in (
        ("", sum(array.nbytes for array in arrays.values()) + _LONGEST_HEADER, _LARGEST),
        (" of names and texts", len(content.encode()), _LONGEST_HEADER),
        (" of a directory", sum(len(name) + _ENTRY for name in arrays), _LONGEST_DIRECTORY),
    ):
        if size > limit:
            raise OSError(f"{size:.3g} bytes{what} exceed the limit of {limit:.3g}")
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo(_HEADER, _EPOCH), content)
        for name, array in arrays.items():
            stored = BytesIO()
            npy.write_array(stored, array.astype(_TYPES[type_of(array)]), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", _EPOCH), stored.getbuffer())


class Archive:
    """An archive that is open for reading.

    Parameters
    ----------
    file : binary file
        Open for reading.

    Raises
    ------
    ValueError, OSError, zipfile.BadZipFile
        If the file is not an archive or is too large.
    """

    def __init__(self, file: IO[bytes]) -> None:
        size = os.fstat(file.fileno()).st_size  # not by name: another file may have replaced it
        _require_short_directory(file, size)
        self._archive = zipfile.ZipFile(file)
        self._unread = size  # bytes; overlapping members could otherwise exceed the file

    def header(self) -> Any:
        """Return the content of ``header.json``."""
        with self._open(_HEADER, _LONGEST_HEADER) as content:
            return json.loads(content.read())

    def array(self, name: str, kind: str, shape: tuple[int, ...]) -> Any:
        """Return the array *name* of the given *shape*, of a *kind* that `type_of` returns.

        Raises
        ------
        ValueError, OSError, zipfile.BadZipFile
            If there is no such array, its type or shape differs, or it is damaged.
        """
        if kind not in _TYPES:
            raise ValueError(f"{name} must have a type of {', '.join(_TYPES)}; got {kind!r}")
        dtype = _TYPES[kind]
        size = dtype.itemsize
        for count in shape:  # Python integers do not overflow
            size *= count
        with self._open(f"{name}.npy", size + _LONGEST_NPY_HEADER) as content:
            if npy.read_magic(content) != (1, 0):
                raise ValueError(f"{name} has an unsupported version of the npy format")
            found_shape, fortran, found_dtype = npy.read_array_header_1_0(
                content, max_header_size=_LONGEST_NPY_HEADER
            )
            if (found_shape, found_dtype) != (shape, dtype):
                raise ValueError(
                    f"{name} must be {dtype} of shape {shape}; got {found_dtype} of {found_shape}"
                )
            data = content.read()  # to the end, where zipfile verifies the checksum
        if len(data) != size:
            raise ValueError(f"{name} must have {size} bytes; got {len(data)}")
        if kind == "b" and (np.frombuffer(data, np.uint8) > 1).any():
            raise ValueError(f"{name} contains bytes that are neither true nor false")
        array = np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")
        return array.astype(dtype.newbyteorder("="))

    def _open(self, name: str, limit: int) -> IO[bytes]:
        info = self._archive.NameToInfo.get(name)
        if info is None:
            raise ValueError(f"{name} is missing")
        if info.compress_type != zipfile.ZIP_STORED:
            raise ValueError(f"{name} is compressed, which is not supported")
        size = max(info.file_size, info.compress_size)
        if size > min(limit, self._unread):
            raise ValueError(f"{name} is too large: {size} bytes")
        self._unread -= size
        return self._archive.open(info)


def _require_short_directory(file: IO[bytes], size: int) -> None:
    """Raise ValueError if the file, or the directory that zipfile reads at once, is too large."""
    if size > _LARGEST:
        raise ValueError(f"the file has {size:.3g} bytes; the limit is {_LARGEST:.3g}")
    file.seek(max(size - 42, 0))
    more, end = file.read(20), file.read(22)
    is_plain = end.startswith(_END) and end.endswith(b"\0\0") and not more.startswith(_END_64)
    if not is_plain or int.from_bytes(end[12:16], "little") > _LONGEST_DIRECTORY:
        raise ValueError("the directory of the archive is damaged; the file may be truncated")
