"""A new glTF document of any surface.

points      positions in single precision, relative to the middle of a surface that is farther from
            the origin than its size: the translation of its node; normals, texture coordinates,
            "RGB" or "RGBA", and arrays whose names begin with "_"
corners     "TextureCorners" and "NormalCorners": points are doubled where these differ
cells       triangles; those of one "Material" are one primitive
motion      morph targets, and an animation of their weights: one of them after the other
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv

from ...arrays import IntArray
from ...errors import MeshError
from ..array_names import warn_left_out, warn_of_rounding, warn_renamed
from ..groups import MATERIAL, groups_of, names_key
from ..moving import CORNER_NORMALS
from ..polygons import cells_of, corner_values, cut_into_triangles, polygons_of, texture_of
from .reading import DOCUMENT

_log = logging.getLogger(__name__)
_CORNER_TEXTURE = "TextureCorners"
_FLOAT, _BYTE, _INDEX = 5126, 5121, 5125
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_LARGEST = 3e38


def plain_document(
    surface: pv.PolyData, targets: Sequence[tuple[float, pv.PolyData]] = ()
) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the buffer of a document with one node that shows *surface*.

    *targets* are poses of it, which follow each other from 0 seconds on, with the time of each.
    """
    counts, corners = polygons_of(surface)
    points = np.asarray(surface.points, dtype=float)
    if not (np.abs(points) < _LARGEST).all():
        raise MeshError("has positions that glTF cannot store: NaN, infinite or over 3e38")
    kept: dict[str, list[str]] = {"point": [], "cell": [], "field": [DOCUMENT]}
    origin = _origin_of(points)
    attributes, of_corner, sources = _vertices(surface, counts, corners, points - origin, kept)
    slots, polygon = cut_into_triangles(points[corners], counts, np.arange(len(corners)))
    if len(polygon) > len(counts):
        _log.warning("glTF has no polygons: they are cut into triangles")
    material, names = _materials(surface, kept)
    warn_left_out("glTF", surface, kept)
    stored = (points - origin).astype("f4") + origin
    warn_of_rounding("glTF stores single precision", corners[slots], points, stored)
    numbers = material[cells_of(surface)][polygon] if names else np.zeros(len(slots), dtype=int)
    document = _Document()
    accessors = {name: document.vertices(name, values) for name, values in attributes.items()}
    shifts = [document.shift(surface, pose, attributes, sources) for _, pose in targets]
    primitives = []
    for number in np.unique(numbers):
        faces = of_corner[slots[numbers == number]]
        primitive = {"attributes": accessors, "indices": document.indices(faces)}
        primitive |= {"targets": shifts} if shifts else {}
        primitives.append(primitive | ({"material": int(number)} if names else {}))
    document.head["meshes"] = [{"primitives": primitives}]
    if shifts:
        document.animate([seconds for seconds, _ in targets])
    if origin.any():
        document.head["nodes"][0]["translation"] = origin.tolist()
    if names:
        document.head["materials"] = [{"name": name} for name in names]
    return document.head, bytes(document.binary)


def _origin_of(points: Any) -> Any:
    """Return the translation (3,) of the node, itself in single precision, which readers may use.

    Zero unless the points are farther from the origin than from each other.
    """
    if not len(points):
        return np.zeros(3)
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (0.5 * low + 0.5 * high).astype(np.float32).astype(float)
    return middle if np.abs(middle).max() > np.linalg.norm(high - low) else np.zeros(3)


def _vertices(
    surface: pv.PolyData, counts: IntArray, corners: IntArray, points: Any, kept: Any
) -> tuple[dict[str, Any], IntArray, IntArray]:
    """Return the attributes of the vertices by name, the vertex of each corner, and the points."""
    attributes = {"POSITION": points.astype("f4"), **_point_arrays(surface, kept["point"])}
    rows = cells_of(surface)
    each = {}
    for key, name, width in ((_CORNER_TEXTURE, "TEXCOORD_0", 2), (CORNER_NORMALS, "NORMAL", 3)):
        wide = surface.cell_data.get(key)
        values = None if wide is None else corner_values(np.asarray(wide)[rows], counts, width)
        if values is not None:
            each[name] = np.nan_to_num(values).astype("f4")
            kept["cell"].append(key)
    if not each:
        return attributes, corners, np.arange(len(points))
    if "TEXCOORD_0" in each:
        each["TEXCOORD_0"][:, 1] = 1.0 - each["TEXCOORD_0"][:, 1]
    table = np.column_stack([corners, *each.values()])
    _, first, of_corner = np.unique(table, axis=0, return_index=True, return_inverse=True)
    attributes = {name: values[corners[first]] for name, values in attributes.items()}
    attributes |= {name: values[first] for name, values in each.items()}
    return attributes, of_corner.ravel(), corners[first]


def _point_arrays(surface: pv.PolyData, kept: list[str]) -> dict[str, Any]:
    data, found = surface.point_data, dict[str, Any]()
    for name in dict.fromkeys((data.active_normals_name, "Normals", "NORMAL")):
        values = data.get(name) if name else None
        if "NORMAL" not in found and values is not None and values.shape[1:] == (3,):
            lengths = np.linalg.norm(np.asarray(values, dtype=float), axis=1)
            if np.isfinite(lengths).all() and (lengths > 0).all():  # as glTF requires
                found["NORMAL"] = (np.asarray(values) / lengths[:, None]).astype("f4")
                kept.append(str(name))
    texture = texture_of(surface)
    if texture is not None:
        name, pairs = texture
        pairs[:, 1] = 1.0 - pairs[:, 1]  # v begins at the top
        found["TEXCOORD_0"] = np.nan_to_num(pairs).astype("f4")
        kept.append(name)
    for name, width in (("RGBA", 4), ("RGB", 3)):
        values = data.get(name)
        if values is None or values.dtype != np.uint8 or values.shape[1:] != (width,):
            continue
        if "COLOR_0" not in found:
            found["COLOR_0"] = np.asarray(values)
            kept.append(name)
    for name in list(data.keys()):
        values = np.asarray(data[name])
        if not name.startswith("_") or name in kept or values.dtype.kind not in "biuf":
            continue
        numbers = values.reshape(len(values), -1).astype("f4")
        if numbers.shape[1] in _TYPES and np.array_equal(numbers, values.reshape(numbers.shape)):
            found[name] = numbers
            kept.append(name)
    return found


def _materials(surface: pv.PolyData, kept: dict[str, list[str]]) -> tuple[Any, list[str]]:
    """Return the material of each cell, and the names; none if there are no materials."""
    if (found := groups_of(surface, MATERIAL)) is None:
        return None, []
    kept["cell"].append(MATERIAL)
    kept["field"].append(names_key(MATERIAL))
    values, names = found
    named = [name or f"material {k}" for k, name in enumerate(names)]  # as it would be read
    warn_renamed("material", dict(zip(names, named, strict=True)))
    return values, named


class _Document:
    """A document in the making."""

    def __init__(self) -> None:
        self.binary = bytearray()
        self.head: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "vtk_segdeform"},
            "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "buffers": [{}], "bufferViews": [], "accessors": [],
        }  # fmt: skip

    def vertices(self, name: str, values: Any) -> int:
        """Append an attribute; return its accessor."""
        accessor: dict[str, Any] = {"componentType": _FLOAT}
        view, stored = {"target": 34962}, values
        if values.dtype == np.uint8:
            accessor = {"componentType": _BYTE, "normalized": True}
            stored = np.zeros((len(values), 4), dtype="u1")  # rows of four bytes
            stored[:, : values.shape[1]] = values
            view["byteStride"] = 4
        if name == "POSITION":
            accessor |= {"min": values.min(axis=0).astype(float).tolist()}
            accessor |= {"max": values.max(axis=0).astype(float).tolist()}
        accessor |= {"type": _TYPES[values.shape[1]], "count": len(values)}
        return self._add(accessor, view, stored)

    def indices(self, faces: IntArray) -> int:
        """Append triangles; return their accessor."""
        corners = faces.ravel().astype("<u4")
        accessor = {"componentType": _INDEX, "type": "SCALAR", "count": len(corners)}
        return self._add(accessor, {"target": 34963}, corners)

    def shift(
        self, rest: pv.PolyData, pose: pv.PolyData, attributes: dict[str, Any], sources: IntArray
    ) -> dict[str, int]:
        """Append what *attributes* change by in a *pose*; return the accessors, a morph target.

        *sources* are the points of the vertices.
        """
        moved = np.asarray(pose.points, dtype=float) - np.asarray(rest.points, dtype=float)
        found = {"POSITION": moved[sources].astype("f4")}
        normals = _point_arrays(pose, []).get("NORMAL")
        if normals is not None and "NORMAL" in attributes and CORNER_NORMALS not in rest.cell_data:
            found["NORMAL"] = normals[sources] - attributes["NORMAL"]
        return {
            name: self.vertices("POSITION" if name == "POSITION" else "", values)
            for name, values in found.items()
        }

    def animate(self, seconds: Sequence[float]) -> None:
        """Let the morph targets follow each other, each alone at its time, from none at 0."""
        count = len(seconds)
        names = [f"{each:g} s" for each in seconds]
        self.head["meshes"][0] |= {"weights": [0.0] * count, "extras": {"targetNames": names}}
        times = np.array([0.0, *seconds], dtype="<f4")
        weights = np.concatenate([np.zeros((1, count)), np.eye(count)]).astype("<f4").ravel()
        accessor = {"componentType": _FLOAT, "type": "SCALAR"}
        ends = {"min": [0.0], "max": [float(times[-1])]}
        sampler = {
            "input": self._add(accessor | ends | {"count": len(times)}, {}, times),
            "output": self._add(accessor | {"count": len(weights)}, {}, weights),
            "interpolation": "LINEAR",
        }
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        self.head["animations"] = [{"samplers": [sampler], "channels": [channel]}]

    def _add(self, accessor: dict[str, Any], view: dict[str, Any], values: Any) -> int:
        view |= {"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes}
        self.binary += values.tobytes()
        self.head["buffers"][0]["byteLength"] = len(self.binary)
        self.head["bufferViews"].append(view)
        accessor["bufferView"] = len(self.head["bufferViews"]) - 1
        self.head["accessors"].append(accessor)
        return len(self.head["accessors"]) - 1
