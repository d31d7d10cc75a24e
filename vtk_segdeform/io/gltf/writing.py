"""glTF and GLB: writer of a surface, with everything of the file from which it was read."""

from __future__ import annotations

import base64
import json
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv

from ...errors import MeshError
from .buffers import Document, glb_of
from .moved import moved_document
from .plain import plain_document
from .reading import DOCUMENT

_log = logging.getLogger(__name__)


def write_gltf(path: Path, surface: pv.PolyData) -> None:
    """Write a .glb file, or a .gltf file with its buffer inside.

    A surface that was read from glTF is written into a copy of that document, unless it has other
    points or faces by now; then, and for any other surface, a new document is written.
    """
    data = None
    if DOCUMENT in surface.field_data:
        stored = np.asarray(surface.field_data[DOCUMENT])
        try:
            data = moved_document(stored.tobytes() if stored.dtype == np.uint8 else b"", surface)
        except MeshError as error:
            _log.warning("the glTF document of the surface is not used: it %s", error)
        else:
            if data is None:
                _log.warning(
                    "the surface has other points or faces than the glTF file from which it was "
                    "read: its materials, textures and nodes are left out"
                )
    _write(path, glb_of(*plain_document(surface)) if data is None else data)


def write_gltf_motion(
    path: Path, surface: pv.PolyData, targets: Sequence[tuple[float, pv.PolyData]]
) -> None:
    """Write a new document of *surface* with morph targets: poses of it, with their times."""
    _write(path, glb_of(*plain_document(surface, targets)))


def _write(path: Path, data: bytes) -> None:
    if path.suffix.lower() != ".gltf":
        path.write_bytes(data)
        return
    document = Document(data)
    head = document.json
    if document.items("buffers"):
        code = base64.b64encode(document.buffer(0)).decode()
        head["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{code}"
    path.write_text(json.dumps(head), encoding="utf-8")
