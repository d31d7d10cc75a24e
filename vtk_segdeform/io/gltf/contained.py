"""A glTF document as one .glb file, with the buffers and images of other files inside."""

from __future__ import annotations

import logging
from typing import Any

from ...errors import MeshError
from ...files import read_regular
from .buffers import Document, copied, glb_of, objects, whole

_log = logging.getLogger(__name__)
_KINDS = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp",
          b"\xabKTX": "image/ktx2", b"DDS ": "image/vnd-ms.dds"}  # fmt: skip


def self_contained(document: Document) -> bytes:
    """Return a document as the bytes of a .glb file; its own bytes if nothing is outside.

    A warning is logged for each image that is not in the folder of the model; its reference is
    kept.

    Raises
    ------
    MeshError
        If a buffer cannot be read, or a bufferView does not fit.
    """
    images = [image for image in document.items("images") if _is_outside(image)]
    if document.is_binary and len(document.items("buffers")) <= 1 and not images:
        return document.data
    head, binary, starts = copied(document.json), bytearray(), list[int]()
    places: dict[str, int] = {}  # of buffers, by URI: several may be the same file
    for k, buffer in enumerate(document.items("buffers")):
        uri = str(buffer.get("uri", f"#{k}"))
        if uri not in places:
            binary += b"\0" * (-len(binary) % 8)
            places[uri] = len(binary)
            binary += document.buffer(k)
        starts.append(places[uri])
    for k, view in enumerate(objects(head, "bufferViews", "the file")):
        _shift(view, f"bufferView {k}", starts)
        extensions = view.get("extensions")
        for each in extensions.values() if isinstance(extensions, dict) else ():
            if isinstance(each, dict) and "buffer" in each:
                _shift(each, f"an extension of bufferView {k}", starts)
    _embed_images(document, head, binary)
    head["buffers"] = [{"byteLength": len(binary)}] if binary else []
    if not binary:
        del head["buffers"]
    return glb_of(head, bytes(binary))


def _is_outside(image: dict[str, Any]) -> bool:
    uri = image.get("uri")
    return isinstance(uri, str) and not uri.startswith("data:")


def _shift(where: dict[str, Any], name: str, starts: list[int]) -> None:
    """Let a range of one of the buffers refer to the joined one."""
    if not starts:
        raise MeshError(f"{name} refers to a buffer, but the file has none")
    number = whole(where, "buffer", name, most=len(starts) - 1)
    where["byteOffset"] = whole(where, "byteOffset", name, default=0) + starts[number]
    where["buffer"] = 0


def _embed_images(document: Document, head: dict[str, Any], binary: bytearray) -> None:
    views: dict[str, int] = {}
    for image in objects(head, "images", "the file"):
        if not _is_outside(image):
            continue
        file = document.file_of(image["uri"])
        if file is None:
            _log.warning("image %r is not a file in the model's folder", image["uri"][:200])
            continue
        if str(file) not in views:
            try:
                data = read_regular(file)
            except OSError as fault:
                _log.warning("image %r: %s", image["uri"][:200], fault.strerror)
                continue
            binary += b"\0" * (-len(binary) % 8)
            view = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)}
            binary += data
            head.setdefault("bufferViews", []).append(view)
            views[str(file)] = len(head["bufferViews"]) - 1
        image["bufferView"] = views[str(file)]
        place = head["bufferViews"][image["bufferView"]]["byteOffset"]
        begin = bytes(binary[place : place + 4])
        kinds = [kind for start, kind in _KINDS.items() if begin.startswith(start)]
        image.setdefault("mimeType", kinds[0] if kinds else "image/png")
        image.setdefault("name", image["uri"].rpartition("/")[2].rpartition(".")[0])
        del image["uri"]
