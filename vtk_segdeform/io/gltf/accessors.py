"""Accessors of a glTF document that get new numbers.

Numbers in single precision that nothing else uses are replaced where they are, so that the layout
of the file remains.  Others (shared, sparse, quantised) become new ones at the end of the buffer.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from ...arrays import FloatArray
from .buffers import object_, objects, whole

_FLOAT, _TYPES = 5126, {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_WITH_RANGES = ("buffers", "bufferViews", "accessors")
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
        self._ranges, self._others = _ranges(head), _other_ranges(head)

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
            start, stride, _ = self._ranges[number]
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
        """Return whether the bytes of an accessor are single precision that nothing else uses."""
        accessor = self._head["accessors"][number]
        if "sparse" in accessor or accessor.get("componentType") != _FLOAT:
            return False
        if self._ranges[number] is None:
            return False
        view = self._head["bufferViews"][accessor["bufferView"]]
        if view.get("extensions"):  # compressed as well
            return False
        others = [each for k, each in enumerate(self._ranges) if k != number and each is not None]
        return all(_are_apart(self._ranges[number], each) for each in [*others, *self._others])


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


def _ranges(head: dict[str, Any]) -> list[Any]:
    """Return (first byte, stride, (bytes of a row, bytes in all)) of each accessor, or None."""
    ranges: list[Any] = []
    views = objects(head, "bufferViews", "the file")
    for k, accessor in enumerate(objects(head, "accessors", "the file")):
        if "bufferView" not in accessor:
            ranges.append(None)
            continue
        name = f"accessor {k}"
        kind = whole(accessor, "componentType", name)
        row = _SIZES.get(kind, 4) * _WIDTHS.get(str(accessor.get("type")), 16)
        number = whole(accessor, "bufferView", name, most=len(views) - 1)
        view, count = views[number], whole(accessor, "count", name, least=1)
        start = whole(view, "byteOffset", name, default=0)
        start += whole(accessor, "byteOffset", name, default=0)
        stride = whole(view, "byteStride", name, default=row, least=1)
        ranges.append((start, stride, (row, (count - 1) * stride + row)))
    return ranges


def _other_ranges(head: dict[str, Any]) -> list[Any]:
    """Return the ranges of images, sparse accessors, compressed data ..., as `_ranges` does."""
    views = objects(head, "bufferViews", "the file")
    ranges: list[Any] = []
    pending: list[Any] = [value for key, value in head.items() if key not in _WITH_RANGES]
    for each in (*views, *objects(head, "accessors", "the file")):
        pending += each.values()  # but not their own ranges
    while pending:
        value = pending.pop()
        if isinstance(value, list):
            pending += value
        elif isinstance(value, dict):
            pending += value.values()
            number = value.get("bufferView", -1)
            known = isinstance(number, int) and 0 <= number < len(views)
            place = views[number] if known else value
            start, length = place.get("byteOffset", 0), place.get("byteLength")
            if isinstance(start, int | float) and isinstance(length, int | float):
                ranges.append((start, 1, (1, length)))
    return ranges


def _are_apart(first: Any, second: Any) -> bool:
    """Return whether two ranges share no byte, one after the other or interleaved."""
    (a, step, (row, length)), (b, other, (width, extent)) = first, second
    if a + length <= b or b + extent <= a:
        return True
    gap = (b - a) % step
    return bool(step == other and gap >= row and gap + width <= step)
