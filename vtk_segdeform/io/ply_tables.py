"""Elements of a PLY file as tables: its header, and text or binary rows.

    element face 12
    property list uchar int vertex_indices
    property uchar red

A property is a number, or a list preceded by its length in every row.  A text file is converted to
binary doubles, so that one reader suffices.  A name is any text without white space.  Counts in the
header are checked against the number of bytes after it.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..arrays import IntArray
from ..errors import MeshError
from .array_names import decoded
from .number_lines import are_numbers, numbers_of

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_FIRST = re.compile(rb"ply[ \t]*(\r\n|\n|\r)", re.IGNORECASE)
_END = re.compile(rb"(?:^|[\r\n])[ \t]*end_header[ \t]*(?=[\r\n]|\Z)")
_LINE = re.compile(rb"\r\n|\n|\r")


class Lists(NamedTuple):
    """A column of lists, concatenated."""

    lengths: Any  # (n,) int
    values: Any  # (sum of the lengths,)


Table: TypeAlias = dict[str, Any]  # by property: (n,) array of numbers, or Lists


@dataclass
class _Property:
    name: str
    kind: str  # numpy's type without byte order
    length: str = ""  # type of the length, if this is a list


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def smallest(self) -> int:
        """Smallest number of bytes of a row."""
        return sum(np.dtype(each.length or each.kind).itemsize for each in self.properties)


def tables_of(data: bytes) -> dict[str, Table]:
    """Return the tables in the bytes of a PLY file, by the names of its elements.

    Raises
    ------
    MeshError
        If it is not a PLY file, or has fewer rows than its header declares.
    """
    kind, elements, start = _header(data)
    order = _ORDERS[kind]
    stored = elements
    if kind == "ascii":
        data, start = _doubles(data[start:]).astype("<f8").tobytes(), 0
        stored = [_as_doubles(element) for element in elements]
    tables: dict[str, Table] = {}
    for element, rows in zip(elements, stored, strict=True):
        tables[element.name], start = _table(data, start, rows, order)
        if kind == "ascii":
            _restore_integers(tables[element.name], element)
    return tables


def comments_of(data: bytes, word: str = "comment") -> list[str]:
    """Return the lines in the header of a PLY file that begin with *word*, without it."""
    end = _END.search(data)
    lines = _LINE.split(data[: end.start()]) if end else []
    found = [decoded(line).strip() for line in lines]
    own = (each for each in found if each.startswith((f"{word} ", f"{word}\t")))
    return [each.removeprefix(word).strip() for each in own]


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    first, end = _FIRST.match(data), _END.search(data)
    if first is None or end is None:
        raise MeshError("the file does not begin with a PLY header")
    kind, elements = "", list[_Element]()
    for line in _LINE.split(data[first.end() : end.start()]):
        match [decoded(word) for word in line.split()]:
            case ["format", kind, *_]:
                pass
            case ["element", name, count, *_] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", length, type_, name, *_] if elements:
                sized = _type(length, line)
                elements[-1].properties.append(_Property(name, _type(type_, line), sized))
            case ["property", type_, name, *_] if elements:
                elements[-1].properties.append(_Property(name, _type(type_, line)))
            case ["element" | "property", *_]:
                raise MeshError(f"the PLY header has an invalid line: {decoded(line)[:80]!r}")
    if kind not in _ORDERS:
        raise MeshError(
            f"the format of the PLY file is {kind[:40]!r}; must be {', '.join(_ORDERS)}"
        )
    for names in ([e.name for e in elements], *([p.name for p in e.properties] for e in elements)):
        if len(set(names)) < len(names):
            raise MeshError("the PLY header has two elements or properties of the same name")
    newline = first[1] if data.startswith(first[1], end.end()) else data[end.end() : end.end() + 1]
    return kind, elements, end.end() + len(newline)


def _type(name: str, line: bytes) -> str:
    if name not in TYPES:
        raise MeshError(f"the PLY header has an unknown type: {decoded(line)[:80]!r}")
    return TYPES[name]


def _doubles(text: bytes) -> Any:
    """Return the numbers in *text*; MeshError if anything else is in it."""
    numbers = numbers_of(text, np.float64)
    if numbers is not None:
        return numbers
    words = text.split()
    try:
        return np.array(words, dtype=np.float64)
    except ValueError:
        wrong = next(word for word in words if not are_numbers([word]))
        raise MeshError(
            f"the PLY file has {decoded(wrong)[:40]!r} where a number is expected; export it again"
        ) from None


def _as_doubles(element: _Element) -> _Element:
    doubles = [_Property(each.name, "f8", each.length and "f8") for each in element.properties]
    return _Element(element.name, element.count, doubles)


def _restore_integers(table: Table, element: _Element) -> None:
    """Convert columns of integers to their type, unless a number in the text does not fit it."""
    for each in element.properties:
        values = table[each.name]
        if not each.length and each.kind[0] in "iu":
            bounds = np.iinfo(each.kind)
            whole = (values >= bounds.min) & (values <= bounds.max) & (values == np.rint(values))
            table[each.name] = values.astype(each.kind) if whole.all() else values


def _table(data: bytes, start: int, element: _Element, order: str) -> tuple[Table, int]:
    """Return the columns of an element, and the position after it."""
    if not element.count or not element.properties:
        nothing = np.empty(0)
        lists = Lists(np.empty(0, dtype=np.int64), nothing)
        return {each.name: lists if each.length else nothing for each in element.properties}, start
    if element.count * element.smallest > len(data) - start:
        raise MeshError(
            f"declares {element.count} rows of {element.name!r}, which the rest of the file cannot "
            "hold; it is truncated or damaged, copy or export it again"
        )
    (first,) = _walk(data, start, element, order, 1)[1].tolist()
    parts: list[Any] = []  # the layout of a row, if all rows are as long as the first
    for k, each in enumerate(element.properties):
        if each.length:
            parts.append((f"length {k}", order + each.length))
        parts.append((f"value {k}", order + each.kind, (first[k],)))
    layout = np.dtype(parts)
    if start + element.count * layout.itemsize <= len(data):
        table = np.frombuffer(data, layout, element.count, start)
        listed = [k for k, each in enumerate(element.properties) if each.length]
        if all((table[f"length {k}"] == first[k]).all() for k in listed):
            columns: Table = {}
            for k, each in enumerate(element.properties):
                values = table[f"value {k}"].ravel()
                lengths = np.full(element.count, first[k])
                columns[each.name] = Lists(lengths, values) if each.length else values
            return columns, start + element.count * layout.itemsize
    return _table_of_lists(data, start, element, order)


def _table_of_lists(data: bytes, start: int, element: _Element, order: str) -> tuple[Table, int]:
    """Return the columns of an element with lists of several lengths, and the position after it."""
    begins, lengths, end = _walk(data, start, element, order, element.count)
    columns: Table = {}
    letters = np.frombuffer(data, np.uint8)[start:end]
    for k, each in enumerate(element.properties):
        kind = np.dtype(order + each.kind)
        change = np.zeros(len(letters) + 1, dtype=np.int8)  # where its values begin and end
        change[begins[:, k] - start] += 1
        change[begins[:, k] - start + kind.itemsize * lengths[:, k]] -= 1
        values = letters[np.cumsum(change[:-1], dtype=np.int8).view(np.bool_)].view(kind)
        columns[each.name] = Lists(lengths[:, k].copy(), values) if each.length else values
    return columns, end


def _walk(
    data: bytes, start: int, element: _Element, order: str, count: int
) -> tuple[IntArray, IntArray, int]:
    """Return where the values of each property begin, and how many they are, (count, p) each.

    Also the position after these rows.

    Raises
    ------
    MeshError
        If a row is wrong or exceeds the data.
    """
    sizes = [np.dtype(each.kind).itemsize for each in element.properties]
    words = [
        struct.Struct(order + np.dtype(each.length).char) if each.length else None
        for each in element.properties
    ]
    at, places, counts = start, list[int](), list[int]()
    for _ in range(count):
        for size, word in zip(sizes, words, strict=True):
            n = 1
            if word is not None:
                if at + word.size > len(data):
                    raise MeshError(_cut_off(element))
                (length,) = word.unpack_from(data, at)
                n = _whole(length)
                at += word.size
                if n < 0:
                    raise MeshError(
                        f"a list of {element.name!r} has the length {length:g}; export the file "
                        "again"
                    )
            if at + size * n > len(data):
                raise MeshError(_cut_off(element))
            places.append(at)
            counts.append(n)
            at += size * n
    shape = count, len(sizes)
    return np.reshape(places, shape), np.reshape(counts, shape), at


def _cut_off(element: _Element) -> str:
    return (
        f"ends in the middle of a row of {element.name!r}; the file is truncated or damaged, copy "
        "or export it again"
    )


def _whole(length: Any) -> int:
    """Return *length* as an int; -1 if it is not whole, as a damaged text may have it."""
    return int(length) if math.isfinite(length) and length == int(length) else -1
