"""The triangles that the scene of a glTF document shows, and how its numbers lead to them.

    nodes        a forest; the world matrix of a node is that of its parent @ its own
    mesh         primitives: triangles, strips or fans; lines and points are ignored
    morphs       targets are added with the weights of the node or mesh
    skins        a skinned vertex follows its joints and not the transform of its node

A block is the vertices of one or more primitives of a node, a piece the triangles of a primitive.
The frame of a vertex is the matrix from its local position, morphs included, to the world.

Source
------
The Khronos Group, "glTF 2.0 Specification", ISO/IEC 12113:2022, sections 3.5 and 3.7.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ...arrays import FloatArray, IntArray
from ...errors import MeshError
from ..polygons import unstripped
from .buffers import Document, numbers, object_, objects, whole

COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_PRIMITIVE = 1000  # cost of a primitive, as a number of elements


class Block(NamedTuple):
    """Vertices of a mesh, as a node of the scene shows them."""

    node: int | None  # None: a document without nodes
    mesh: int
    attributes: dict[str, Any]  # accessors by name
    local: FloatArray  # (n, 3) positions, morphs included
    frames: FloatArray  # (4, 4), or (n, 4, 4) if there is a skin
    morphed: bool

    @property
    def points(self) -> FloatArray:
        """Return the positions (n, 3) in the world."""
        return products(self.frames[..., :3, :3], self.local) + self.frames[..., :3, 3]


class Piece(NamedTuple):
    """Triangles of a primitive."""

    block: int
    faces: IntArray  # (m, 3) of the vertices of its block
    material: int | None


class _Shown(NamedTuple):
    """A mesh shown by a node."""

    number: int | None
    node: dict[str, Any]
    world: FloatArray
    joints: list[FloatArray]


def products(matrices: Any, vectors: Any) -> FloatArray:
    """Return the products of *matrices*, (3, 3) or (n, 3, 3), and *vectors* (n, 3), (n, 3) float.

    >>> products(np.diag([2.0, 1.0, 1.0]), np.array([[1.0, 2.0, 3.0]]))
    array([[2., 2., 3.]])
    """
    x = np.asarray(vectors, dtype=np.float64)
    return np.asarray(np.einsum("...ij,...j->...i", matrices, x))


def scene_of(document: Document) -> tuple[list[Block], list[Piece]]:
    """Return what the scene of a document shows, in the order of its nodes.

    Raises
    ------
    MeshError
        If a number is out of range, or the nodes do not form a forest.
    """
    blocks: list[Block] = []
    pieces: list[Piece] = []
    nodes = document.items("nodes")
    children = [_indices(node, "children", f"node {k}", len(nodes)) for k, node in enumerate(nodes)]
    worlds = _worlds(nodes, children)
    if not nodes:
        for k in range(len(document.items("meshes"))):
            _add(document, _Shown(None, {"mesh": k}, np.eye(4), []), blocks, pieces)
    for k in _in_scene(document, children):
        node = nodes[k]
        if "mesh" in node:
            matrices = _joints(document, node["skin"], worlds) if "skin" in node else []
            _add(document, _Shown(k, node, worlds[k], matrices), blocks, pieces)
    return blocks, pieces


def _indices(where: dict[str, Any], key: str, name: str, end: int) -> list[int]:
    listed = where.get(key, [])
    if not isinstance(listed, list):
        raise MeshError(f"{name}: {key} must be a list")
    return [whole({key: each}, key, name, most=end - 1) for each in listed]


def _worlds(nodes: list[dict[str, Any]], children: list[list[int]]) -> list[FloatArray]:
    """Return the world matrix of every node, (4, 4) each."""
    named = [child for each in children for child in each]
    if len(set(named)) < len(named):
        raise MeshError("a node of the scene has two parents")
    worlds: dict[int, FloatArray] = {}
    pending = [(k, np.eye(4)) for k in set(range(len(nodes))) - set(named)]
    while pending:
        k, above = pending.pop()
        worlds[k] = above @ _local(nodes[k], f"node {k}")
        pending += [(child, worlds[k]) for child in children[k]]
    if len(worlds) < len(nodes):
        raise MeshError("a node of the scene is its own descendant")
    return [worlds[k] for k in range(len(nodes))]


def _local(node: dict[str, Any], name: str) -> FloatArray:
    """Return the matrix (4, 4) of a node, from its columns or from rotation, scale, translation."""
    if "matrix" in node:
        columns: FloatArray = numbers(node, "matrix", name, [0.0] * 16).reshape(4, 4)
        return columns.T
    matrix = np.eye(4)
    if "rotation" in node:
        x, y, z, w = numbers(node, "rotation", name, [0.0, 0.0, 0.0, 1.0])
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    if "scale" in node:
        matrix[:3, :3] *= numbers(node, "scale", name, [1.0, 1.0, 1.0])
    if "translation" in node:
        matrix[:3, 3] = numbers(node, "translation", name, [0.0, 0.0, 0.0])
    return matrix


def _in_scene(document: Document, children: list[list[int]]) -> Iterable[int]:
    """Return the nodes of the default scene, sorted; all nodes if there are no scenes."""
    scenes = document.items("scenes")
    if not scenes:
        return range(len(children))
    index = whole(document.json, "scene", "the file", default=0, most=len(scenes) - 1)
    pending = _indices(scenes[index], "nodes", f"scene {index}", len(children))
    seen = set()
    while pending:
        k = pending.pop()
        if k not in seen:
            seen.add(k)
            pending += children[k]
    return sorted(seen)


def _joints(document: Document, index: object, worlds: list[FloatArray]) -> list[FloatArray]:
    """Return the matrix (4, 4) of each joint of a skin, from the bind pose to the world."""
    skin = document.item("skins", index)
    joints = _indices(skin, "joints", f"skin {index}", len(worlds))
    if "inverseBindMatrices" not in skin:
        return [worlds[k] for k in joints]
    columns = document.array(skin["inverseBindMatrices"], "MAT4").astype(float).reshape(-1, 4, 4)
    if len(columns) < len(joints):
        raise MeshError(f"skin {index} has {len(columns)} matrices for {len(joints)} joints")
    return [worlds[k] @ inverse.T for k, inverse in zip(joints, columns, strict=False)]


def _add(document: Document, shown: _Shown, blocks: list[Block], pieces: list[Piece]) -> None:
    """Append the blocks and pieces of a mesh; primitives with the same vertices share a block."""
    node, index = shown.node, document.index("meshes", shown.node["mesh"])
    mesh, name = document.item("meshes", index), f"mesh {index}"
    known: dict[str, int] = {}
    for primitive in objects(mesh, "primitives", name):
        document.spend(_PRIMITIVE)
        mode = whole(primitive, "mode", name, default=_TRIANGLES, most=_FAN)
        attributes = object_(primitive, "attributes", name)
        if mode < _TRIANGLES or "POSITION" not in attributes:
            continue
        if any(key in object_(primitive, "extensions", name) for key in COMPRESSED):
            position = document.item("accessors", attributes["POSITION"])
            if "bufferView" not in position:
                raise MeshError(f"{name} is compressed, which is not supported")
        targets = objects(primitive, "targets", name)
        key = repr((sorted(attributes.items()), targets))
        if key not in known:
            known[key] = len(blocks)
            local = document.array(attributes["POSITION"], "VEC3").astype(float)
            owner = node if "weights" in node else mesh
            weights = numbers(owner, "weights", name, [0.0] * len(targets)) if targets else []
            for weight, target in zip(weights, targets, strict=True):
                if weight and "POSITION" in target:
                    local = local + weight * attribute(document, target, "POSITION", len(local))
            frames = shown.world
            if shown.joints:
                frames = _skinned(document, attributes, len(local), shown.joints)
            blocks.append(Block(shown.number, index, attributes, local, frames, bool(targets)))
        else:
            document.spend(len(blocks[known[key]].local))
        number = known[key]
        faces = _faces(document, primitive, mode, len(blocks[number].local), name)
        if not shown.joints and np.linalg.det(shown.world[:3, :3]) < 0:
            faces = faces[:, ::-1]  # mirrored
        material = None
        if "material" in primitive and document.items("materials"):
            most = len(document.items("materials")) - 1
            material = whole(primitive, "material", name, most=most)
        pieces.append(Piece(number, faces, material))


def _faces(
    document: Document, primitive: dict[str, Any], mode: int, n_points: int, name: str
) -> IntArray:
    corners = np.arange(n_points)
    if "indices" in primitive:
        listed = document.array(primitive["indices"], "SCALAR").ravel()
        if listed.dtype.kind != "u":
            raise MeshError(f"{name} has indices that are not unsigned integers")
        corners = listed.astype(np.int64)
        if corners.max() >= n_points:
            raise MeshError(f"{name} refers to vertex {corners.max()} of {n_points}")
    if mode == _STRIP:
        return unstripped(np.array([len(corners)]), corners)
    if mode == _FAN:
        hub = np.full(max(len(corners) - 2, 0), corners[0])
        return np.stack([hub, corners[1:-1], corners[2:]], axis=-1)
    if len(corners) % 3:
        raise MeshError(f"{name} has {len(corners)} triangle corners, not a multiple of 3")
    return corners.reshape(-1, 3)


def attribute(document: Document, attributes: dict[str, Any], key: str, count: int) -> Any:
    """Return the array of an attribute, one row for each of *count* vertices."""
    array = document.array(attributes[key], "SCALAR", "VEC2", "VEC3", "VEC4")
    if len(array) != count:
        raise MeshError(f"{key} has {len(array)} elements for {count} vertices")
    if key == "POSITION" and array.shape[1] != 3:
        raise MeshError("a morph target has positions that are not VEC3")
    return array


def _skinned(
    document: Document, attributes: dict[str, Any], count: int, joints: list[FloatArray]
) -> FloatArray:
    """Return the frames (n, 4, 4) of vertices that follow weighted joints."""
    matrices, result, total = np.array(joints), np.zeros((count, 4, 4)), np.zeros(count)
    for k in range(len(attributes)):
        keys = f"JOINTS_{k}", f"WEIGHTS_{k}"
        if not set(keys) <= set(attributes):
            break
        which, weights = (attribute(document, attributes, key, count) for key in keys)
        if which.dtype.kind != "u" or which.shape != weights.shape or which.max() >= len(joints):
            raise MeshError("a skinned mesh refers to joints that do not exist")
        for joint, weight in zip(which.T, weights.astype(float).T, strict=True):
            result += weight[:, None, None] * matrices[joint]
            total += weight
    if not total.all():
        raise MeshError("a skinned mesh has vertices without a joint")
    return result / total[:, None, None]
