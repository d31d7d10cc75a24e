"""Writes glTF and GLB files with any content, for tests: JSON and bytes assembled by hand."""

from __future__ import annotations

import base64
import copy
import json
import struct

import numpy as np

CODES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Gltf:
    """A glTF document under construction; ``head`` is its JSON, ``blob`` its only buffer."""

    def __init__(self):
        self.blob = b""
        self.head = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 0}]}
        for key in ("nodes", "meshes", "accessors", "bufferViews"):
            self.head[key] = []

    def add(self, key, **item):
        """Append *item* to a list at the top; return its number."""
        self.head.setdefault(key, []).append(item)
        return len(self.head[key]) - 1

    def view(self, data, **more):
        """Append bytes; return the number of their bufferView."""
        self.blob += b"\0" * (-len(self.blob) % 4)
        start = len(self.blob)
        self.blob += data
        self.head["buffers"][0]["byteLength"] = len(self.blob)
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(data), **more)

    def array(self, values, kind="f4", **more):
        """Append numbers (n, k) of a type; return the number of their accessor."""
        values = np.asarray(values).astype(f"<{kind}")
        values = values.reshape(len(values), -1)
        more = {"componentType": CODES[kind], "type": WIDTHS[values.shape[1]], **more}
        if kind == "f4":
            more |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        view = self.view(values.tobytes())
        return self.add("accessors", bufferView=view, count=len(values), **more)

    def mesh(self, vertices, faces, *, kind="u2", **primitive):
        """Append a mesh of one primitive; return its number."""
        attributes = {"POSITION": self.array(vertices)} | primitive.pop("attributes", {})
        indices = self.array(np.asarray(faces).ravel(), kind)
        primitives = [{"attributes": attributes, "indices": indices, **primitive}]
        return self.add("meshes", primitives=primitives)

    def save(self, path, **head):
        """Write a .glb, or a .gltf with its buffer in a data: URI."""
        document = copy.deepcopy(self.head) | head
        if path.suffix == ".gltf":
            code = base64.b64encode(self.blob).decode()
            if "uri" not in document["buffers"][0]:
                document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{code}"
            path.write_text(json.dumps(document))
            return path
        path.write_bytes(glb(json.dumps(document).encode(), self.blob))
        return path


def glb(text, blob):
    """Return the bytes of a .glb of JSON and a buffer."""
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def octahedron(vertices, faces):
    """Return a document with one node that shows one mesh."""
    document = Gltf()
    document.add("nodes", mesh=document.mesh(vertices, faces))
    document.head |= {"scene": 0, "scenes": [{"nodes": [0]}]}
    return document
