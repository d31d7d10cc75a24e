"""A glTF document that was read, with its vertices at other positions.

    position    local' = inverse frame of the vertex @ world', so that a node, or a skin in the pose
                of the file, shows the new positions; morph targets are added to them as before
    normal      transposed frame @ world normal;   tangent  inverse frame @ world tangent
    instances   nodes that no longer show the same shape get a copy of the mesh each

Everything else remains as it was: nodes, materials, textures, animations, extras.  Primitives whose
vertices have not moved are not changed at all.
"""

from __future__ import annotations

import hashlib
import logging
from typing import Any, TypeAlias

import numpy as np
import pyvista as pv

from ...arrays import FloatArray
from ...errors import MeshError
from ...geometry import NormalTransport
from ..array_names import warn_of_rounding
from ..polygons import polygons_of
from .accessors import Accessors
from .buffers import Document, copied, glb_of, object_, objects
from .reading import arrays_of, surface_of, unit
from .scene import COMPRESSED, Block, products, scene_of

_log = logging.getLogger(__name__)
_WORST = 1e8  # condition of a frame that can still be inverted
_SAME = 1e-9  # of directions: rounding
_LARGEST = 3e38  # in single precision
# New attributes of one mesh as one node shows it, by the attributes of the primitive.
_Change: TypeAlias = dict[str, dict[str, FloatArray]]


@np.errstate(over="ignore", invalid="ignore")
def moved_document(data: bytes, surface: pv.PolyData) -> bytes | None:
    """Return a document with the positions of *surface*; None if it has other points or faces.

    Parameters
    ----------
    data : bytes
        A .glb file that contains everything, as `reading` stores it.
    surface : pyvista.PolyData
        What was read from it, at other positions.

    Raises
    ------
    MeshError
        If the document or the positions are invalid.
    """
    document = Document(data)
    blocks, pieces = scene_of(document)
    rest = surface_of(document, blocks, pieces)
    counts, corners = polygons_of(surface)
    if surface.n_points != rest.n_points or not (counts == 3).all():
        return None
    if not np.array_equal(corners, polygons_of(rest)[1]):
        return None
    points = np.asarray(surface.points, dtype=float)
    if not (np.abs(points) < _LARGEST).all():
        raise MeshError("has positions that glTF cannot store: NaN, infinite or over 3e38")
    given = [arrays_of(document, block) for block in blocks]
    normals, tangents = _directions(rest, surface, given, blocks)
    changes: dict[int, dict[int | None, _Change]] = {}
    end = 0
    for block, arrays in zip(blocks, given, strict=True):
        rows = slice(end, end := end + len(block.local))
        world = {"POSITION": (rest.points, points), "NORMAL": normals, "TANGENT": tangents}
        here = {
            key: (old[rows], new[rows])
            for key, (old, new) in world.items()
            if key in {"POSITION", *arrays}
        }
        still = np.array_equal(*here["POSITION"])
        if still and all(np.allclose(*both, rtol=0.0, atol=_SAME) for both in here.values()):
            continue
        _warn(block)
        change = _local(document, block, {key: new for key, (_, new) in here.items()})
        shown = changes.setdefault(block.mesh, {}).setdefault(block.node, {})
        shown[_key(block.attributes)] = change
    if not changes:
        return data
    written = _written(document, changes)
    stored = np.concatenate([block.points for block in scene_of(Document(written))[0]])
    faces = corners.reshape(-1, 3)
    warn_of_rounding("glTF stores single precision", faces, points, stored)
    return written


def _key(attributes: dict[str, Any]) -> str:
    return repr(sorted(attributes.items()))


def _directions(
    rest: pv.PolyData, surface: pv.PolyData, given: list[dict[str, Any]], blocks: list[Block]
) -> list[tuple[FloatArray, FloatArray]]:
    """Return normals, and tangents, (n, 3) at rest and now; zero where a block has none.

    They are those of *surface*, unless it has none, or its points have moved without them.
    """
    olds = []
    for key in ("NORMAL", "TANGENT"):
        parts = [
            arrays[key][:, :3] if key in arrays else np.zeros((len(block.local), 3))
            for arrays, block in zip(given, blocks, strict=True)
        ]
        olds.append(np.concatenate(parts).astype(float))
    found = [_own(surface, key, old) for key, old in zip(("NORMAL", "TANGENT"), olds, strict=True)]
    moved = not np.array_equal(rest.points, surface.points)
    if moved and any(new is None and old.any() for old, new in zip(olds, found, strict=True)):
        counts, corners = polygons_of(rest)
        carried = NormalTransport(
            np.asarray(rest.points), counts, corners, olds[0],
            of_corner=corners, place=np.arange(rest.n_points),
        )  # fmt: skip
        points = np.asarray(surface.points, dtype=float)
        fresh = [carried.normals(points), olds[1]]
        if olds[1].any() and found[1] is None:
            fresh[1] = carried.tangents(olds[1], points)
        found = [a if b is None else b for a, b in zip(fresh, found, strict=True)]
    return [(old, old if new is None else new) for old, new in zip(olds, found, strict=True)]


def _own(surface: pv.PolyData, key: str, old: FloatArray) -> FloatArray | None:
    """Return the directions of a surface if it has other ones than at rest."""
    values = surface.point_data.get(key)
    if values is None or values.ndim != 2 or values.shape[1] < 3 or values.dtype.kind != "f":
        return None
    own = np.array(values[:, :3], dtype=float)
    if not np.isfinite(own).all() or np.allclose(own, old, rtol=0.0, atol=_SAME):
        return None
    return own


def _local(document: Document, block: Block, world: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return attributes in the world as the document stores them."""
    linear, shift = block.frames[..., :3, :3], block.frames[..., :3, 3]
    inverse = np.linalg.pinv(linear, rcond=1.0 / _WORST)
    stored = {key: document.array(block.attributes[key], "VEC3", "VEC4") for key in world}
    position = products(inverse, world["POSITION"] - shift)
    result = {"POSITION": stored["POSITION"].astype(float) + (position - block.local)}
    if "NORMAL" in world:
        normal = products(linear.swapaxes(-1, -2), world["NORMAL"])
        length = np.linalg.norm(stored["NORMAL"], axis=1, keepdims=True)
        result["NORMAL"] = length * unit(normal)
    if "TANGENT" in world:
        tangent = unit(products(inverse, world["TANGENT"]))
        result["TANGENT"] = np.column_stack([tangent, stored["TANGENT"][:, 3]])
    return result


def _warn(block: Block) -> None:
    name = f"mesh {block.mesh}"
    if (np.linalg.cond(block.frames[..., :3, :3]) > _WORST).any():
        _log.warning("glTF: %s is flattened by its node or skin: it moves only within it", name)
    if block.frames.ndim > 2:
        _log.warning("glTF: %s has a skin: its pose in the file is as deformed", name)
    if block.morphed:
        _log.warning("glTF: %s has morph targets: they are added to the deformed shape", name)


def _written(document: Document, changes: dict[int, dict[int | None, _Change]]) -> bytes:
    """Return the document with the changes of each mesh, by the nodes that show it."""
    head = copied(document.json)
    binary = document.buffer(0) if document.items("buffers") else b""
    accessors = Accessors(head, binary)
    for number, by_node in changes.items():
        nodes = document.items("nodes")
        everyone = {k for k, node in enumerate(nodes) if node.get("mesh") == number}
        groups: dict[bytes, tuple[_Change, list[int | None]]] = {}
        for node, change in by_node.items():
            groups.setdefault(_digest(change), (change, []))[1].append(node)
        unmoved = bool(everyone - by_node.keys())
        original = copied(head["meshes"][number])
        for k, (change, alike) in enumerate(groups.values()):
            place = number
            if k or unmoved:
                place = len(head["meshes"])
                head["meshes"].append(copied(original))
                for node in alike:
                    head["nodes"][node]["mesh"] = place
            shared = unmoved or len(groups) > 1
            _change(head["meshes"][place], change, accessors, None if shared else number)
    binary = accessors.finished()
    return glb_of(head, binary)


def _digest(change: _Change) -> bytes:
    digest = hashlib.sha256()
    for key, arrays in change.items():
        for name, values in arrays.items():
            digest.update(f"{key} {name}".encode())
            digest.update(values.astype("<f4").tobytes())
    return digest.digest()


def _change(mesh: dict[str, Any], change: _Change, accessors: Accessors, owner: int | None) -> None:
    """Give the primitives of a mesh new attributes; *owner* is its number unless it is a copy."""
    done: dict[tuple[str, str], int] = {}
    for primitive in objects(mesh, "primitives", "a mesh"):
        key = _key(object_(primitive, "attributes", "a mesh"))
        if key not in change or primitive.get("mode", 4) < 4:
            continue
        attributes = primitive["attributes"]
        for name, values in change[key].items():
            if (key, name) not in done:
                number = int(attributes[name])
                done[key, name] = accessors.replace(number, values, (owner, key, name))
            attributes[name] = done[key, name]
        for extension in COMPRESSED:  # with the old positions
            if extension in object_(primitive, "extensions", "a mesh"):
                del primitive["extensions"][extension]
