"""glTF and GLB: reader for the meshes of a scene in world coordinates, as one surface.

    attributes   NORMAL, TANGENT and TEXCOORD_0 (active), COLOR_0 as "RGB" or "RGBA", further
                 TEXCOORD_k and _NAMES become point arrays if all primitives have them
    materials    cell array "Material": index into the field array "MaterialNames"
    nodes        cell array "Object": index into the field array "ObjectNames", if there are several
    document     field array "glTF": the whole file as a .glb, with its textures, animations ...,
                 from which `moved` makes a file with other positions

Only buffers and images in the folder of the model are read from other files.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from ...errors import MeshError
from ..groups import MATERIAL, OBJECT, set_groups
from ..polygons import polydata_of
from .buffers import Document
from .contained import self_contained
from .scene import Block, Piece, attribute, products, scene_of

DOCUMENT = "glTF"
_log = logging.getLogger(__name__)
# Extensions that do not affect the surface, and a supported one.
_IGNORED = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp")
_SUPPORTED = "KHR_mesh_quantization"


@np.errstate(over="ignore", invalid="ignore")  # overflows are reported when the mesh is checked
def read_gltf(path: Path) -> pv.PolyData:
    """Read the triangles of the scene in a .gltf or .glb file.

    Raises
    ------
    MeshError
        If a number is out of range, the nodes do not form a forest, a required extension is not
        supported, or a buffer is outside the folder of the model.
    """
    document = Document(path.read_bytes(), path.parent)
    _require_supported_extensions(document.json)
    surface = surface_of(document, *scene_of(document))
    try:
        surface.field_data[DOCUMENT] = np.frombuffer(self_contained(document), dtype="u1")
    except MeshError as error:
        _log.warning("materials and textures cannot be written again: %s", error)
    return surface


def surface_of(document: Document, blocks: list[Block], pieces: list[Piece]) -> pv.PolyData:
    """Return the scene of a document as one surface."""
    if not pieces:
        raise MeshError("contains no triangles")
    starts = np.cumsum([0, *(len(block.local) for block in blocks)])
    faces = np.concatenate([piece.faces + starts[piece.block] for piece in pieces])
    points = np.concatenate([block.points for block in blocks])
    surface = polydata_of(points, np.full(len(faces), 3), faces.ravel())
    arrays = [arrays_of(document, block) for block in blocks]
    for name in arrays[0]:
        parts = [each[name] for each in arrays if name in each]
        if len(parts) == len(arrays) and len({part.shape[1:] for part in parts}) == 1:
            surface.point_data[name] = np.concatenate(parts)
    if "TEXCOORD_0" in surface.point_data:
        surface.point_data.active_texture_coordinates_name = "TEXCOORD_0"
    if "NORMAL" in surface.point_data:
        surface.point_data.active_normals_name = "NORMAL"
    _name_cells(document, blocks, pieces, surface)
    return surface


def _require_supported_extensions(head: dict[str, Any]) -> None:
    needed = head.get("extensionsRequired", [])
    if not isinstance(needed, list):
        raise MeshError("extensionsRequired must be a list")
    for name in map(str, needed):
        if name != _SUPPORTED and not name.startswith(_IGNORED):
            raise MeshError(f"needs the glTF extension {name[:80]}, which is not supported")


def arrays_of(document: Document, block: Block) -> dict[str, Any]:
    """Return the attributes of the vertices of a block in the world, by name of the array."""
    arrays, count = {}, len(block.local)
    linear = block.frames[..., :3, :3]
    determinant = np.linalg.det(linear)
    for key in block.attributes:
        if not key.startswith(("NORMAL", "TANGENT", "TEXCOORD_", "COLOR_", "_")):
            continue
        values = attribute(document, block.attributes, key, count)
        if key == "COLOR_0" and values.shape[1] in (3, 4):
            colour = np.nan_to_num(values.astype(float)).clip(0.0, 1.0)
            arrays["RGB" if values.shape[1] == 3 else "RGBA"] = np.rint(255 * colour).astype("u1")
        elif key == "NORMAL" and values.shape[1] == 3:
            if (determinant != 0).all():
                arrays[key] = unit(products(np.linalg.inv(linear).swapaxes(-1, -2), values))
        elif key == "TANGENT" and values.shape[1] == 4:
            along = unit(products(linear, values[:, :3]))
            arrays[key] = np.column_stack([along, values[:, 3] * np.sign(determinant)])
        elif not key.startswith(("NORMAL", "TANGENT")):
            arrays[key] = np.ascontiguousarray(values[:, 0] if values.shape[1] == 1 else values)
    return arrays


def unit(vectors: Any) -> Any:
    """Return vectors (n, 3) with length one; those of length zero remain."""
    x, y, z = vectors.T
    length = np.sqrt((x * x + y * y) + z * z)
    return vectors / np.where(length > 0, length, 1.0)[:, None]


def _name_cells(
    document: Document, blocks: list[Block], pieces: list[Piece], surface: pv.PolyData
) -> None:
    """Store the material and the node of each triangle."""
    lengths = [len(piece.faces) for piece in pieces]
    materials = [
        _named(each, f"material {k}") for k, each in enumerate(document.items("materials"))
    ]
    if any(piece.material is not None for piece in pieces):
        numbers = [len(materials) if p.material is None else p.material for p in pieces]
        plain = ["default"] if len(materials) in numbers else []
        set_groups(surface, MATERIAL, np.repeat(numbers, lengths), [*materials, *plain])
    shown = dict.fromkeys(block.node for block in blocks)
    if len(shown) > 1:
        nodes = document.items("nodes")
        places = {node: k for k, node in enumerate(shown)}
        numbers = [places[blocks[piece.block].node] for piece in pieces]
        named = [f"mesh {k}" if k is None else _named(nodes[k], f"node {k}") for k in shown]
        set_groups(surface, OBJECT, np.repeat(numbers, lengths), named)


def _named(item: dict[str, Any], default: str) -> str:
    name = item.get("name")
    clean = name.replace("\0", "") if isinstance(name, str) else ""
    return clean.encode("utf-8", "replace").decode() or default
