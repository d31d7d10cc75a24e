"""Archives: arrays and a header in one uncompressed zip file, which ``numpy.load`` can read.

Files may be damaged or malicious.  An array is read only if it has the shape and type that the
caller expects and its bytes are in the file; all arrays together have at most two gigabytes.
Texts are stored as UTF-8 and their ends.  Checksums are verified, and nothing is unpickled.

A value of the header is read by a check of what it must be, `field`(header, name, check): `whole`,
`number`, `flag`, `text`, or a `list_of`, `row_of` or `map_of` others.
"""

from __future__ import annotations

import copy
import json
import os
import tokenize
import zipfile
from collections.abc import Callable, Mapping
from io import BytesIO
from typing import IO, Any, TypeAlias, TypeVar

import numpy as np
from numpy.lib import format as npy

from ..checks import shown
from ..errors import SessionError
from ..files import LARGEST_FILE

_T = TypeVar("_T")
Check: TypeAlias = Callable[[Any, str], _T]
"""``check(value, name)`` returns a valid value of JSON, or raises a SessionError."""

_HEADER = "header.json"
_LONGEST_HEADER = 1 << 20  # bytes
_LONGEST_NPY_HEADER = 1 << 12  # bytes
_LONGEST_DIRECTORY = 1 << 20  # bytes
_ENTRY = 64  # bytes of the directory for each member, at most, without its name
_END = b"PK\5\6"  # start of the last 22 bytes of a zip file without a comment
_END_64 = b"PK\6\7"  # start of the 20 bytes before them in a zip64 file, which is too large
_MOST = 1e300  # a number
_EPOCH = (1980, 1, 1, 0, 0, 0)  # a constant date makes equal sessions equal files
_TYPES = {"f": np.dtype("<f8"), "i": np.dtype("<i8"), "b": np.dtype("|b1")}
_OTHERS = ("f4", "i4", "i2", "i1", "u8", "u4", "u2", "u1", "c8", "c16")
_TYPES |= {name: np.dtype(f"<{name}") for name in _OTHERS}
_NAMES = {dtype.newbyteorder("="): name for name, dtype in _TYPES.items()}


def field(header: Mapping[str, Any], name: str, check: Check[_T]) -> _T:
    """Return the value *name* of *header* if it passes *check*; SessionError if not.

    >>> field({"size": [2, 3]}, "size", row_of(whole, whole))
    (2, 3)
    >>> field({"size": [2, "3"]}, "size", row_of(whole, whole))
    Traceback (most recent call last):
    ...
    vtk_segdeform.errors.SessionError: size[1] must be a whole number in the header; got '3'
    """
    if name not in header:
        raise SessionError(f"{name} is missing in the header")
    return check(header[name], name)


def whole(value: Any, name: str) -> int:
    """Return *value* if it is an integer of at least 0."""
    _demand(type(value) is int and value >= 0, value, name, "a whole number")
    return int(value)


def number(value: Any, name: str) -> float:
    """Return *value* as a float if it is a number."""
    is_number = type(value) is float or (type(value) is int and abs(value) < _MOST)
    _demand(is_number, value, name, "a number")
    return float(value)


def flag(value: Any, name: str) -> bool:
    """Return *value* if it is a bool."""
    _demand(isinstance(value, bool), value, name, "true or false")
    return bool(value)


def text(value: Any, name: str) -> str:
    """Return *value* if it is text that can be encoded."""
    is_text = isinstance(value, str) and value == value.encode("utf-8", "replace").decode()
    _demand(is_text, value, name, "text")
    return str(value)


def optional(check: Check[_T]) -> Check[_T | None]:
    """Return the check of a value that may be null."""
    return lambda value, name: None if value is None else check(value, name)


def list_of(check: Check[_T]) -> Check[list[_T]]:
    """Return the check of a list of any length."""

    def checked(value: Any, name: str) -> list[_T]:
        _demand(isinstance(value, list), value, name, "a list")
        return [check(each, f"{name}[{k}]") for k, each in enumerate(value)]

    return checked


def row_of(*checks: Check[Any]) -> Check[tuple[Any, ...]]:
    """Return the check of a list with one value for each of *checks*."""

    def checked(value: Any, name: str) -> tuple[Any, ...]:
        is_row = isinstance(value, list) and len(value) == len(checks)
        _demand(is_row, value, name, f"a list of {len(checks)}")
        rows = enumerate(zip(value, checks, strict=True))
        return tuple(check(each, f"{name}[{k}]") for k, (each, check) in rows)

    return checked


def map_of(check: Check[_T]) -> Check[dict[str, _T]]:
    """Return the check of an object with any names."""

    def checked(value: Any, name: str) -> dict[str, _T]:
        _demand(isinstance(value, dict), value, name, "an object")
        return {
            text(key, f"a name in {name}"): check(v, f"{name}.{key}") for key, v in value.items()
        }

    return checked


def anything(value: Any, name: str) -> Any:
    """Return *value*, which the caller checks."""
    del name
    return value


def _demand(is_valid: bool, value: Any, name: str, what: str) -> None:
    if not is_valid:
        raise SessionError(f"{name} must be {what} in the header; got {shown(value)}")


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
        ("", sum(array.nbytes for array in arrays.values()) + _LONGEST_HEADER, LARGEST_FILE),
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
        self._archive, self._prefix = zipfile.ZipFile(file), ""
        self._unread = [size]  # bytes; overlapping members could otherwise exceed the file

    def within(self, prefix: str) -> Archive:
        """Return the same archive, for arrays whose names begin with *prefix*."""
        part = copy.copy(self)
        part._prefix = self._prefix + prefix
        return part

    def header(self) -> dict[str, Any]:
        """Return the content of ``header.json``, whose values are unchecked; see `field`."""
        with self._open(_HEADER, _LONGEST_HEADER) as content:
            return map_of(anything)(json.loads(content.read()), "the content")

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
        name = self._prefix + name
        with self._open(f"{name}.npy", size + _LONGEST_NPY_HEADER) as content:
            if npy.read_magic(content) != (1, 0):
                raise ValueError(f"{name} has an unsupported version of the npy format")
            try:
                found_shape, fortran, found_dtype = npy.read_array_header_1_0(
                    content, max_header_size=_LONGEST_NPY_HEADER
                )
            except (LookupError, TypeError, SyntaxError, tokenize.TokenError) as fault:
                raise ValueError(f"{name} has a damaged header") from fault
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
        if size > min(limit, self._unread[0]):
            raise ValueError(f"{name} is too large: {size} bytes")
        self._unread[0] -= size
        return self._archive.open(info)


def _require_short_directory(file: IO[bytes], size: int) -> None:
    """Raise ValueError if the directory, which zipfile reads at once, is too large."""
    file.seek(max(size - 42, 0))
    more, end = file.read(20), file.read(22)
    is_plain = end.startswith(_END) and end.endswith(b"\0\0") and not more.startswith(_END_64)
    if not is_plain or int.from_bytes(end[12:16], "little") > _LONGEST_DIRECTORY:
        raise ValueError("the directory of the archive is damaged; the file may be truncated")
