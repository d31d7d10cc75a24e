"""Accessors of a glTF document that get new numbers.

Numbers in single precision in a bufferView of their own are replaced where they are, so that a file
does not grow each time it is saved.  Others (interleaved, shared, sparse, quantised) become new
ones at the end of the buffer.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from typing import Any

import numpy as np

from ...arrays import FloatArray
from .buffers import object_, objects

_FLOAT, _TYPES = 5126, {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_Owner = tuple[int | None, str, str]


class Accessors:
    """The accessors of a document.

    Parameters
    ----------
    head : dict
        JSON of a valid document with at most one buffer; changed in place.
    binary : bytes
        The buffer.
    """

    def __init__(self, head: dict[str, Any], binary: bytes) -> None:
        self._head, self._binary = head, bytearray(binary)
        self._owners = _owners(head)
        self._uses, self._ranges = _used(head)

    def replace(self, number: int, values: FloatArray, owner: _Owner) -> int:
        """Give accessor *number* new values (n, k); return its number, which may be a new one.

        Parameters
        ----------
        number : int
            The accessor with the old values.
        values : (n, k) float
            As many as before.
        owner : tuple
            Number of the mesh, None for a copy, the key of its attributes, and which one it is.
        """
        numbers = np.ascontiguousarray(values, dtype="<f4")
        accessor = self._head["accessors"][number]
        if self._owners[number] != {owner}:
            accessor = {key: value for key, value in accessor.items() if key in ("name", "extras")}
            self._head["accessors"].append(accessor)
            number = len(self._head["accessors"]) - 1
        elif self._is_alone(number):
            view = self._head["bufferViews"][accessor["bufferView"]]
            start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            stride = view.get("byteStride", 4 * numbers.shape[1])
            rows = np.ndarray(
                numbers.shape, "<f4", buffer=self._binary, offset=start, strides=(stride, 4)
            )
            rows[:] = numbers
            self._bound(accessor, numbers)
            return number
        view = {"buffer": 0, "byteOffset": self._append(numbers), "byteLength": numbers.nbytes}
        view["target"] = 34962  # vertices
        self._head.setdefault("bufferViews", []).append(view)
        for key in ("sparse", "normalized", "byteOffset"):
            accessor.pop(key, None)
        accessor["bufferView"] = len(self._head["bufferViews"]) - 1
        accessor |= {"componentType": _FLOAT, "count": len(numbers)}
        accessor["type"] = _TYPES[numbers.shape[1]]
        self._bound(accessor, numbers, always=True)
        return number

    def finished(self) -> bytes:
        """Return the buffer with all new numbers, and store its length in the document."""
        if not self._head.get("buffers"):
            self._head["buffers"] = [{}]
        self._head["buffers"][0]["byteLength"] = len(self._binary)
        return bytes(self._binary)

    def _append(self, numbers: Any) -> int:
        self._binary += b"\0" * (-len(self._binary) % 4)
        start = len(self._binary)
        self._binary += numbers.tobytes()
        return start

    @staticmethod
    def _bound(accessor: dict[str, Any], numbers: Any, *, always: bool = False) -> None:
        if always or "min" in accessor or "max" in accessor:
            accessor["min"] = numbers.min(axis=0).astype(float).tolist()
            accessor["max"] = numbers.max(axis=0).astype(float).tolist()

    def _is_alone(self, number: int) -> bool:
        """Return whether an accessor is all of its bufferView, in single precision."""
        accessor = self._head["accessors"][number]
        index = accessor.get("bufferView")
        if "sparse" in accessor or accessor.get("componentType") != _FLOAT or index is None:
            return False
        view = self._head["bufferViews"][index]
        start, end = _range_of(view)
        overlapping = [each for each in self._ranges if each[0] < end and start < each[1]]
        return not view.get("extensions") and self._uses[index] == 1 and len(overlapping) == 1


def _owners(head: dict[str, Any]) -> dict[int, set[Any]]:
    """Return who uses each accessor: meshes with the key of the attributes, or anything else."""
    owners: dict[int, set[Any]] = defaultdict(set)
    for number, mesh in enumerate(objects(head, "meshes", "the file")):
        for primitive in objects(mesh, "primitives", f"mesh {number}"):
            attributes = object_(primitive, "attributes", f"mesh {number}")
            for name, index in attributes.items():
                key = repr(sorted(attributes.items()))
                _use(owners, index, (number, key, name))
            _use(owners, primitive.get("indices"), "other")
            for target in objects(primitive, "targets", f"mesh {number}"):
                for index in target.values():
                    _use(owners, index, "other")
    pending: list[Any] = [value for key, value in head.items() if key != "meshes"]
    while pending:  # animations, skins and extensions: any whole number there may be one
        value = pending.pop()
        if isinstance(value, dict):
            for key in ("input", "output", "inverseBindMatrices"):
                _use(owners, value.get(key), "other")
            listed = value.get("attributes")
            for index in listed.values() if isinstance(listed, dict) else ():
                _use(owners, index, "other")
            pending += value.values()
        elif isinstance(value, list):
            pending += value
    return owners


def _use(owners: dict[int, set[Any]], index: object, owner: Any) -> None:
    if isinstance(index, int) or (isinstance(index, float) and index.is_integer()):
        owners[int(index)].add(owner)


def _range_of(place: dict[str, Any]) -> tuple[float, float]:
    """Return the first byte of a range of the buffer, and the byte after it."""
    start, length = place.get("byteOffset", 0), place.get("byteLength", 0)
    known = isinstance(start, int | float) and isinstance(length, int | float)
    return (start, start + length) if known else (0.0, math.inf)


def _used(head: dict[str, Any]) -> tuple[Counter[int], list[tuple[float, float]]]:
    """Return how often each bufferView is used, and all ranges of bytes in a document.

    Ranges are those of bufferViews, and of compressed data in their extensions.
    """
    uses, ranges = Counter[int](), list[tuple[float, float]]()
    pending: list[Any] = [value for key, value in head.items() if key != "buffers"]
    while pending:
        value = pending.pop()
        if isinstance(value, list):
            pending += value
        elif isinstance(value, dict):
            pending += value.values()
            if isinstance(number := value.get("bufferView"), int):
                uses[number] += 1
            if "byteLength" in value:
                ranges.append(_range_of(value))
    return uses, ranges
