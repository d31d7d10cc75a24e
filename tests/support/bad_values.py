"""Values that no argument accepts, each created on demand: a generator can be used only once."""

from __future__ import annotations

import datetime
import pathlib
from collections.abc import Callable

import numpy as np
from scipy import sparse


class Broken:
    """Fails at any operation."""

    def _fails(self, *_args, **_keywords):
        raise RuntimeError("broken on purpose")

    __array__ = __len__ = __iter__ = __getitem__ = __contains__ = __repr__ = _fails
    __eq__ = __lt__ = __gt__ = __le__ = __ge__ = __float__ = __int__ = __index__ = _fails
    __bool__ = __hash__ = _fails


class BrokenArray:
    """Only its conversion to an array fails."""

    def __array__(self, *_args, **_keywords):
        raise RuntimeError("broken on purpose")


class Anything:
    """Can be constructed from any arguments."""

    def __init__(self, *_args, **_keywords):
        pass

    def __bool__(self):
        return False  # so that no caller waits for it


class Endless:
    """Claims to have a million million entries."""

    def __len__(self):
        return 10**12

    def __getitem__(self, key):
        return 0.0


def recursive(*begins):
    """Return a list that contains itself, twice, after *begins*."""
    itself = [*begins]
    itself.extend([itself, itself])
    return itself


def _own_mapping():
    mapping: dict = {}
    mapping["handle 1"] = mapping
    return mapping


BAD: dict[str, Callable[[], object]] = {
    "None": lambda: None,
    "True": lambda: True,
    "False": lambda: False,
    "numpy True": lambda: np.True_,
    "0": lambda: 0,
    "3": lambda: 3,
    "-1": lambda: -1,
    "2.5": lambda: 2.5,
    "10**18": lambda: 10**18,
    "-10**30": lambda: -(10**30),
    "10**5000": lambda: 10**5000,
    "1e300": lambda: 1e300,
    "1e-320": lambda: 1e-320,
    "nan": lambda: float("nan"),
    "inf": lambda: float("inf"),
    "numpy nan": lambda: np.float64("nan"),
    "complex": lambda: 1 + 2j,
    "text": lambda: "no such thing",
    "empty text": lambda: "",
    "long text": lambda: "x" * 1_000_000,
    "long name": lambda: "x" * 300,
    "null character": lambda: "a\0b",
    "surrogate": lambda: "a\ud800b",
    "bytes": lambda: b"name",
    "bytearray": lambda: bytearray(b"name"),
    "path": lambda: pathlib.Path("no-such-folder/file"),
    "object": object,
    "a class": lambda: Anything,
    "a function": lambda: lambda *_arguments, **_keywords: None,
    "module": lambda: np,
    "Ellipsis": lambda: Ellipsis,
    "empty list": list,
    "list": lambda: [1, 2, 3],
    "list of None": lambda: [None, None, None],
    "list of text": lambda: ["a", "b", "c"],
    "list of huge": lambda: [10**400, 10**400],
    "list of nan": lambda: [float("nan")] * 3,
    "ragged list": lambda: [[1, 2, 3], [4]],
    "list of lists": lambda: [[0, 1, 2], [2, 1, 0]],
    "deep list": lambda: [[[[[[[[1]]]]]]]],
    "recursive list": recursive,
    "recursive after numbers": lambda: recursive(1, 2),
    "recursive after rows": lambda: recursive([0, 0, 0]),
    "tuple": lambda: (1, 2),
    "set": lambda: {1, 2, 3},
    "dict": lambda: {"a": 1},
    "dict of handle": lambda: {"handle 1": None},
    "dict of numbers": lambda: {1: 2},
    "recursive dict": _own_mapping,
    "generator": lambda: (k for k in range(3)),
    "range": lambda: range(3),
    "huge range": lambda: range(10**12),
    "slice": lambda: slice(0, 3),
    "date": lambda: datetime.datetime(2026, 1, 1),
    "datetime64": lambda: np.datetime64("2026-01-01"),
    "dates": lambda: np.array(["2026-01-01"] * 3, dtype="datetime64[D]"),
    "empty array": lambda: np.empty(0),
    "no rows": lambda: np.empty((0, 3)),
    "no columns": lambda: np.empty((3, 0)),
    "zero-dimensional": lambda: np.array(1.0),
    "one of one": lambda: np.array([[[1.0]]]),
    "vector": lambda: np.arange(3.0),
    "points": lambda: np.zeros((4, 3)),
    "nan points": lambda: np.full((4, 3), np.nan),
    "huge points": lambda: np.full((4, 3), 1e300),
    "pairs": lambda: np.zeros((4, 2)),
    "four by four": lambda: np.eye(4),
    "nan matrix": lambda: np.full((4, 4), np.nan),
    "huge matrix": lambda: np.eye(4) * [1e300, 1e300, 1e300, 1],
    "cube": lambda: np.zeros((3, 3, 3)),
    "negative ids": lambda: np.array([-1, -2]),
    "large ids": lambda: np.array([10**9]),
    "unsigned ids": lambda: np.array([2**64 - 1], dtype=np.uint64),
    "same ids": lambda: np.array([0, 0, 0]),
    "short mask": lambda: np.array([True, False]),
    "mask of two": lambda: np.ones((2, 2), dtype=bool),
    "complex points": lambda: np.zeros((4, 3), dtype=complex),
    "object points": lambda: np.full((4, 3), None, dtype=object),
    "object of dicts": lambda: np.array([{}, {}], dtype=object),
    "text array": lambda: np.array([["a", "b", "c"]]),
    "bytes array": lambda: np.array([b"a", b"b"]),
    "records": lambda: np.zeros(3, dtype=[("x", float), ("y", int)]),
    "half": lambda: np.zeros((4, 3), dtype=np.float16),
    "masked points": lambda: np.ma.masked_all((4, 3)),
    "masked ids": lambda: np.ma.array([1, 2], mask=[0, 1]),
    "matrix": lambda: np.eye(3).view(np.matrix),
    "sparse": lambda: sparse.eye_array(4).tocsr(),
    "memoryview": lambda: memoryview(b"abc"),
    "stride 0": lambda: np.broadcast_to(np.float64(1.0), (4, 3)),
    "broken": Broken,
    "broken array": BrokenArray,
    "list of broken": lambda: [Broken()],
    "array of broken": lambda: np.array([BrokenArray, None, None], dtype=object)[:, None],
    "endless": Endless,
}
