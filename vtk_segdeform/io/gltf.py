"""Read glTF and GLB: the meshes of a scene in world coordinates, as one surface.

    nodes        a forest; world matrix of a node = that of its parent @ its own
    mesh         primitives: triangles, strips or fans; lines and points are left out
    morphs       targets are added with the weights of the node or the mesh
    skins        a skinned vertex follows its joints and ignores the transform of its node
    attributes   NORMAL and TEXCOORD_0 (active), COLOR_0 as "RGB" or "RGBA", further TEXCOORD_k
                 and _NAMES become point arrays if all primitives have them

Animations, materials and images are not read.  The only other files that are read are buffers in
the model's folder.

Source
------
The Khronos Group, "glTF 2.0 Specification", ISO/IEC 12113:2022, sections 3.5 and 3.7.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from .gltf_buffers import Document, numbers, object_, objects, whole
from .polygons import polydata_of, unstripped

# Extensions that do not change the surface, and the one that is supported.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp")
_READ = "KHR_mesh_quantization"
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_PRIMITIVE = 1000  # cost of a primitive, in elements


class _Part(NamedTuple):
    points: FloatArray  # (n, 3)
    faces: IntArray  # (m, 3)
    arrays: dict[str, Any]  # (n, ...)


@np.errstate(over="ignore", invalid="ignore")  # the check of the mesh reports overflows
def read_gltf(path: Path) -> pv.PolyData:
    """Return the triangles of the scene in a .gltf or .glb file.

    Raises
    ------
    MeshError
        If a number is out of range, the nodes do not form a forest, a required extension is not
        supported, or a buffer is outside the model's folder.
    """
    document = Document(path)
    _require_known_extensions(document.json)
    parts = list(_parts(document))
    if not parts:
        raise MeshError("contains no triangles")
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    faces = np.concatenate([p.faces + start for p, start in zip(parts, starts, strict=False)])
    points = np.concatenate([part.points for part in parts])
    surface = polydata_of(points, np.full(len(faces), 3), faces.ravel())
    for name in parts[0].arrays:
        arrays = [part.arrays[name] for part in parts if name in part.arrays]
        if len(arrays) == len(parts) and len({each.shape[1:] for each in arrays}) == 1:
            surface.point_data[name] = np.concatenate(arrays)
    if "TEXCOORD_0" in surface.point_data:
        surface.point_data.active_texture_coordinates_name = "TEXCOORD_0"
    if "NORMAL" in surface.point_data:
        surface.point_data.active_normals_name = "NORMAL"
    return surface


def _require_known_extensions(head: dict[str, Any]) -> None:
    needed = head.get("extensionsRequired", [])
    if not isinstance(needed, list):
        raise MeshError("extensionsRequired must be a list")
    for name in map(str, needed):
        if name != _READ and not name.startswith(_HARMLESS):
            raise MeshError(f"needs the glTF extension {name[:80]}, which is not supported")


def _parts(document: Document) -> Iterator[_Part]:
    """Yield the primitives of every node in the scene, in world coordinates."""
    nodes = document.items("nodes")
    children = [_indices(node, "children", f"node {k}", len(nodes)) for k, node in enumerate(nodes)]
    worlds = _worlds(nodes, children)
    if not nodes:
        for k in range(len(document.items("meshes"))):
            yield from _primitives(document, {"mesh": k}, np.eye(4), [])
    for k in _in_scene(document, children):
        node = nodes[k]
        if "mesh" in node:
            matrices = _joints(document, node["skin"], worlds) if "skin" in node else []
            yield from _primitives(document, node, worlds[k], matrices)


def _indices(where: dict[str, Any], key: str, name: str, end: int) -> list[int]:
    listed = where.get(key, [])
    if not isinstance(listed, list):
        raise MeshError(f"{name}: {key} must be a list")
    return [whole({key: each}, key, name, most=end - 1) for each in listed]


def _worlds(nodes: list[dict[str, Any]], children: list[list[int]]) -> list[FloatArray]:
    """Return the (4, 4) world matrix of every node."""
    named = [child for each in children for child in each]
    if len(set(named)) < len(named):
        raise MeshError("a node of the scene has two parents")
    worlds: dict[int, FloatArray] = {}
    waiting = [(k, np.eye(4)) for k in set(range(len(nodes))) - set(named)]
    while waiting:
        k, above = waiting.pop()
        worlds[k] = above @ _local(nodes[k], f"node {k}")
        waiting += [(child, worlds[k]) for child in children[k]]
    if len(worlds) < len(nodes):
        raise MeshError("a node of the scene is its own descendant")
    return [worlds[k] for k in range(len(nodes))]


def _local(node: dict[str, Any], name: str) -> FloatArray:
    """Return the (4, 4) matrix of a node: stored by columns, or as rotation, scale, translation."""
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
    """Return the nodes of the default scene, or all nodes if there is none, in their order."""
    scenes = document.items("scenes")
    if not scenes:
        return range(len(children))
    index = whole(document.json, "scene", "the file", default=0, most=len(scenes) - 1)
    waiting = _indices(scenes[index], "nodes", f"scene {index}", len(children))
    seen = set()
    while waiting:
        k = waiting.pop()
        if k not in seen:
            seen.add(k)
            waiting += children[k]
    return sorted(seen)


def _joints(document: Document, index: object, worlds: list[FloatArray]) -> list[FloatArray]:
    """Return for each joint of a skin the (4, 4) matrix from the bind pose to the world."""
    skin = document.item("skins", index)
    joints = _indices(skin, "joints", f"skin {index}", len(worlds))
    if "inverseBindMatrices" not in skin:
        return [worlds[k] for k in joints]
    columns = document.array(skin["inverseBindMatrices"], "MAT4").astype(float).reshape(-1, 4, 4)
    if len(columns) < len(joints):
        raise MeshError(f"skin {index} has {len(columns)} matrices for {len(joints)} joints")
    return [worlds[k] @ bound.T for k, bound in zip(joints, columns, strict=False)]


def _primitives(
    document: Document, node: dict[str, Any], world: FloatArray, joints: list[FloatArray]
) -> Iterator[_Part]:
    mesh, name = document.item("meshes", node["mesh"]), f"mesh {node['mesh']}"
    for primitive in objects(mesh, "primitives", name):
        document.spend(_PRIMITIVE)
        mode = whole(primitive, "mode", name, default=_TRIANGLES, most=_FAN)
        attributes = object_(primitive, "attributes", name)
        if mode < _TRIANGLES or "POSITION" not in attributes:
            continue
        if any(key in object_(primitive, "extensions", name) for key in _COMPRESSED):
            position = document.item("accessors", attributes["POSITION"])
            if "bufferView" not in position:
                raise MeshError(f"{name} is compressed, which is not supported")
        points = document.array(attributes["POSITION"], "VEC3").astype(float)
        faces = _faces(document, primitive, mode, len(points), name)
        targets = objects(primitive, "targets", name)
        if targets:
            owner = node if "weights" in node else mesh
            weights = numbers(owner, "weights", name, [0.0] * len(targets))
            for weight, target in zip(weights, targets, strict=True):
                if weight and "POSITION" in target:
                    points = points + weight * _fitting(document, target, "POSITION", points)
        arrays = _arrays(document, attributes, points, world)
        if joints:
            points = _skinned(document, attributes, points, joints)
        else:
            points = points @ world[:3, :3].T + world[:3, 3]
            if np.linalg.det(world[:3, :3]) < 0:
                faces = faces[:, ::-1]  # mirrored
        yield _Part(points, faces, arrays)


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


def _fitting(document: Document, attributes: dict[str, Any], key: str, points: FloatArray) -> Any:
    """Return an attribute's numbers, as many as there are *points*."""
    array = document.array(attributes[key], "SCALAR", "VEC2", "VEC3", "VEC4")
    if len(array) != len(points):
        raise MeshError(f"{key} has {len(array)} elements for {len(points)} vertices")
    if key == "POSITION" and array.shape[1] != 3:
        raise MeshError("a morph target has positions that are not VEC3")
    return array


def _arrays(
    document: Document, attributes: dict[str, Any], points: FloatArray, world: FloatArray
) -> dict[str, Any]:
    arrays = {}
    for key in attributes:
        if not key.startswith(("NORMAL", "TEXCOORD_", "COLOR_", "_")):
            continue
        values = _fitting(document, attributes, key, points)
        if key == "COLOR_0" and values.shape[1] in (3, 4):
            colour = np.nan_to_num(values.astype(float)).clip(0.0, 1.0)
            arrays["RGB" if values.shape[1] == 3 else "RGBA"] = np.rint(255 * colour).astype("u1")
        elif key == "NORMAL" and values.shape[1] == 3:
            if abs(np.linalg.det(world[:3, :3])) > 0:
                turned = values @ np.linalg.inv(world[:3, :3])
                length = np.linalg.norm(turned, axis=1, keepdims=True)
                arrays[key] = turned / np.where(length > 0, length, 1.0)
        elif not key.startswith("NORMAL"):
            arrays[key] = np.ascontiguousarray(values[:, 0] if values.shape[1] == 1 else values)
    return arrays


def _skinned(
    document: Document, attributes: dict[str, Any], points: FloatArray, joints: list[FloatArray]
) -> FloatArray:
    """Return *points* moved by the weighted joints."""
    matrices, result, total = np.array(joints), np.zeros_like(points), np.zeros(len(points))
    for k in range(len(attributes)):
        keys = f"JOINTS_{k}", f"WEIGHTS_{k}"
        if not set(keys) <= set(attributes):
            break
        which, weights = (_fitting(document, attributes, key, points) for key in keys)
        if which.dtype.kind != "u" or which.shape != weights.shape or which.max() >= len(joints):
            raise MeshError("a skinned mesh refers to joints that do not exist")
        for joint, weight in zip(which.T, weights.astype(float).T, strict=True):
            moved = np.einsum("nij,nj->ni", matrices[joint, :3, :3], points)
            result += weight[:, None] * (moved + matrices[joint, :3, 3])
            total += weight
    if not total.all():
        raise MeshError("a skinned mesh has vertices without a joint")
    return result / total[:, None]
