"""JSON and buffers of a glTF file, validated before they are used.

    buffer      bytes: the second chunk of a .glb, a data: URI, or a file in the model's folder
    bufferView  a range of a buffer
    accessor    numbers in a bufferView: type, count and stride; some may be replaced (sparse)

A number in the JSON that does not fit the buffers raises a MeshError that names it.  No byte
outside a buffer is read, and memory is limited by the size of the file.

Source
------
The Khronos Group, "glTF 2.0 Specification", ISO/IEC 12113:2022, sections 3.6 and 4.
"""

from __future__ import annotations

import base64
import json
import math
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from ...errors import MeshError
from ...files import file_inside, read_regular

_TYPES = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_PER_BYTE, _LEAST = 64, 50_000_000  # limit of elements: per byte of the file, but at least this
_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"


class Document:
    """A glTF file: its JSON, and the arrays in its buffers.

    Parameters
    ----------
    data : bytes
        Content of a .gltf or .glb file.
    folder : Path, optional
        Folder of the model, for buffers and images in other files.

    Raises
    ------
    MeshError
        If it is not glTF 2.0.
    """

    def __init__(self, data: bytes, folder: Path | None = None) -> None:
        text, self._binary = _chunks(data) if data.startswith(_MAGIC) else (data, None)
        try:
            self.json = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise MeshError(f"its JSON cannot be read ({error})") from None
        asset = self.json.get("asset") if isinstance(self.json, dict) else None
        if not isinstance(asset, dict) or not str(asset.get("version")).startswith("2."):
            raise MeshError("is not glTF 2.0: its asset version is missing or different")
        self.size = len(data)  # total number of bytes read
        self.data, self._folder = data, folder  # as given
        self._buffers: dict[int, bytes] = {}
        self._arrays: dict[tuple[int, tuple[str, ...]], Any] = {}  # by accessor and allowed types
        self._lists: dict[str, list[dict[str, Any]]] = {}
        self._spent = 0

    @property
    def is_binary(self) -> bool:
        """Whether it is a .glb file with a buffer of its own."""
        return self._binary is not None and "uri" not in (self.items("buffers") or [{}])[0]

    def spend(self, elements: int) -> None:
        """Count generated elements; MeshError if they far exceed the size of the file.

        A few bytes may be instanced any number of times.
        """
        self._spent += elements
        if self._spent > max(_LEAST, _PER_BYTE * self.size):
            raise MeshError(f"its instances have more than {_LEAST} vertices and corners")

    def items(self, key: str) -> list[dict[str, Any]]:
        """Return the top-level list *key* of objects; empty if there is none."""
        if key not in self._lists:
            self._lists[key] = objects(self.json, key, key)
        return self._lists[key]

    def item(self, key: str, index: object) -> dict[str, Any]:
        """Return one object of such a list."""
        return self.items(key)[self.index(key, index)]

    def index(self, key: str, index: object) -> int:
        """Return an index into such a list as a number; MeshError if the list has no such item."""
        count = len(self.items(key))
        if not count:
            raise MeshError(f"refers to {key} {index!r:.40}, but has no {key}; export it again")
        return whole({"index": index}, "index", key, most=count - 1)

    def array(self, index: object, *types: str) -> Any:
        """Return the numbers of an accessor, (n, width), in the stored type; float64 if normalised.

        Parameters
        ----------
        index : int
            Index of the accessor.
        *types : str
            Allowed types: "SCALAR", "VEC3" ...
        """
        number = self.index("accessors", index)
        # Many nodes may show one mesh: its numbers are read and checked once.
        if (number, types) not in self._arrays:
            self._arrays[number, types] = self._read(number, types)
        array = self._arrays[number, types]
        self.spend(len(array))
        return array

    def _read(self, index: int, types: tuple[str, ...]) -> Any:
        accessor, name = self.item("accessors", index), f"accessor {index}"
        type_ = accessor.get("type")
        if type_ not in types:
            raise MeshError(f"{name} is of type {type_!r}; must be {' or '.join(types)}")
        kind, count = _component(accessor, name), whole(accessor, "count", name, least=1)
        shape = (count, _WIDTHS[type_])
        if "bufferView" in accessor:
            start = whole(accessor, "byteOffset", name, default=0)
            array = self._viewed(accessor["bufferView"], start, shape, kind)
        elif count > self.size:
            raise MeshError(f"{name} declares {count} elements, but has no buffer")
        else:
            array = np.zeros(shape, dtype=kind)
        if "sparse" in accessor:
            array = self._replaced(array, object_(accessor, "sparse", name), name)
        if accessor.get("normalized") is True and array.dtype.kind in "iu":
            return np.maximum(array / np.iinfo(array.dtype).max, -1.0)
        return array

    def _replaced(self, array: Any, sparse: dict[str, Any], name: str) -> Any:
        """Return a copy of *array* with some rows replaced."""
        name = f"the sparse part of {name}"
        count = whole(sparse, "count", name, least=1, most=len(array))
        where, what = object_(sparse, "indices", name), object_(sparse, "values", name)
        kind = _component(where, name)
        if kind[0] != "u":
            raise MeshError(f"{name} has indices that are not unsigned integers")
        start = whole(where, "byteOffset", name, default=0)
        rows = self._viewed(where.get("bufferView"), start, (count, 1), kind).ravel()
        if rows.max() >= len(array):
            raise MeshError(f"{name} replaces element {rows.max()} of {len(array)}")
        start, shape = whole(what, "byteOffset", name, default=0), (count, array.shape[1])
        array = array.copy()
        array[rows] = self._viewed(what.get("bufferView"), start, shape, array.dtype.str[1:])
        return array

    def _viewed(self, index: object, start: int, shape: tuple[int, int], kind: str) -> Any:
        view, name = self.item("bufferViews", index), f"bufferView {index}"
        buffer = self._buffer(view.get("buffer"))
        offset = whole(view, "byteOffset", name, default=0)
        length = whole(view, "byteLength", name)
        if offset + length > len(buffer):
            raise MeshError(f"{name} ends at byte {offset + length} of {len(buffer)} in its buffer")
        item = np.dtype(kind).itemsize
        row = shape[1] * item
        stride = whole(view, "byteStride", name, default=row, least=row, most=max(row, 252))
        end = start + (shape[0] - 1) * stride + row
        if end > length:
            raise MeshError(f"an accessor ends at byte {end} of {length} in {name}")
        place, steps = offset + start, (stride, item)
        return np.ndarray(shape, f"<{kind}", buffer=buffer, offset=place, strides=steps)

    def _buffer(self, index: object) -> bytes:
        buffer, number = self.item("buffers", index), int(str(index))
        if number not in self._buffers:
            name = f"buffer {index}"
            data, length = self._bytes(buffer, number), whole(buffer, "byteLength", name)
            if length > len(data):
                raise MeshError(f"{name} declares {length} bytes; there are {len(data)}")
            self._buffers[number] = data[:length]
            self.size += 0 if data is self._binary else len(data)
        return self._buffers[number]

    def _bytes(self, buffer: dict[str, Any], number: int) -> bytes:
        uri = buffer.get("uri")
        if uri is None and number == 0 and self._binary is not None:
            return self._binary
        if not isinstance(uri, str):
            raise MeshError(f"buffer {number} has neither a uri nor bytes in the file")
        if uri.startswith("data:"):
            kind, comma, payload = uri.partition(",")
            if not comma:
                raise MeshError(f"buffer {number} has a data: URI without data")
            if not kind.endswith(";base64"):
                return unquote_to_bytes(payload)
            try:
                return base64.b64decode(payload)
            except ValueError:
                raise MeshError(f"buffer {number} is not valid base64: it was cut off") from None
        file = self.file_of(uri)
        if file is None:
            raise MeshError(
                f"buffer {number} refers to {uri[:200]!r}, which is not a file in the "
                "model's folder; copy it there"
            )
        return read_regular(file)

    def file_of(self, uri: str) -> Path | None:
        """Return the file in the model's folder to which a URI refers; None if there is none."""
        return file_inside(self._folder, unquote(uri)) if self._folder is not None else None

    def buffer(self, index: int) -> bytes:
        """Return the bytes of a buffer."""
        return self._buffer(index)


def copied(value: Any) -> Any:
    """Return a copy of JSON values; MeshError if they are nested too deeply."""
    try:
        return json.loads(json.dumps(value))
    except RecursionError:
        raise MeshError("its JSON is nested too deeply") from None


def glb_of(head: dict[str, Any], binary: bytes) -> bytes:
    """Return the bytes of a .glb file from its JSON and its only buffer."""
    text = json.dumps(head, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), _JSON) + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), _BINARY) + binary
    return struct.pack("<4sII", _MAGIC, 2, 12 + len(chunks)) + chunks


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk, if any, of a .glb file."""
    if len(data) < 20:
        raise MeshError("is truncated")
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2:
        raise MeshError(f"is glTF {version}; only version 2 is supported")
    if length > len(data):
        raise MeshError(f"declares {length} bytes, but has {len(data)}")
    chunks, at = dict[bytes, bytes](), 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > length:
            raise MeshError(f"has a chunk of {size} bytes, which extends past the end of the file")
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if _JSON not in chunks:
        raise MeshError("has no JSON chunk")
    return chunks[_JSON], chunks.get(_BINARY)


def whole(
    where: dict[str, Any], key: str, name: str, *, default: int | None = None,
    least: int = 0, most: float = math.inf,
) -> int:  # fmt: skip
    """Return the integer *key* of an object; messages call the object *name*."""
    value = where.get(key, default)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        end = f"of at least {least}" if most == math.inf else f"from {least} to {most}"
        got = "is missing" if value is None else f"is {value!r:.40}"
        raise MeshError(f"{name}: {key} {got}; must be a whole number {end}. Export the file again")
    return value


def numbers(where: dict[str, Any], key: str, name: str, default: list[float]) -> Any:
    """Return a list of finite numbers, as many as *default* has, as an array."""
    value = where.get(key, default)
    sound = isinstance(value, list) and len(value) == len(default)
    if not sound or not all(_is_number(each) for each in value):
        raise MeshError(f"{name}: {key} must be {len(default)} finite numbers")
    return np.array(value, dtype=float)


def object_(where: dict[str, Any], key: str, name: str) -> dict[str, Any]:
    """Return the object *key* of an object; empty if there is none."""
    value = where.get(key, {})
    if not isinstance(value, dict):
        raise MeshError(f"{name}: {key} must be an object")
    return value


def objects(where: dict[str, Any], key: str, name: str) -> list[dict[str, Any]]:
    """Return the list of objects *key* of an object; empty if there is none."""
    value = where.get(key, [])
    if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
        raise MeshError(f"{name}: {key} must be a list of objects")
    return value


def _is_number(value: object) -> bool:
    good = isinstance(value, int | float) and not isinstance(value, bool)
    return good and abs(value) < 1e300  # type: ignore[arg-type]


def _component(where: dict[str, Any], name: str) -> str:
    kind = _TYPES.get(whole(where, "componentType", name))
    if kind is None:
        raise MeshError(f"{name} has the unknown component type {where['componentType']}")
    return kind
