"""MeshLab projects, .mlp: a mesh and its cages as layers that MeshLab opens together.

    work.mlp              list of the layers and their matrices, in XML
    work.layers/*.ply     the layers, with selection, quality, colours and texture coordinates

A layer with quality and without colours is coloured by it, since MeshLab shows the quality only in
colours.  The cages of a session are hidden, and shown by a layer of their edges beside each, which
MeshLab draws as lines since that file has no faces; the local volume change is hidden as well.

PyMeshLab is not required.  MeshLab stores a selection in a PLY file as bit 32 of the property
``flags``; here it is the array "selection", as in `meshlab_layers`.

A project may come from an untrusted source, so only files in its own folder and below are read, at
most a thousand layers of four gigabytes in total, and entities are not expanded.  New layers are
written beside the old ones and the .mlp last, so that it always refers to a consistent set of
layers.  Only *path* and the folder of its layers are changed, and in that folder only files with
generated names.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pyvista as pv

from ..arrays import FloatArray
from ..checks import as_path
from ..errors import MeshError
from ..files import file_inside, open_regular, replacing, require_place
from .convert import read_polydata, with_vertices, write_mesh
from .meshlab_layers import HasLayers, Layer, as_layers, free_name
from .polygons import polygons_of

_SELECTED = 0x20  # of MeshLab's flags
_GENERATED = re.compile(r"\d+-[0-9a-f]{12}(-wires)?\.ply")
_CAGE = re.compile(r"cage \d+")  # the name of the layer of a cage
_WIRES = "-wires.ply"  # the end of the name of a file that only shows the edges of another layer
_HEAD = "<!DOCTYPE MeshLabDocument>\n"
_LARGEST = 10_000_000  # bytes of the .mlp
_MOST_LAYERS, _MOST_BYTES = 1000, 4 << 30  # in total, also if a file is listed several times
_IDENTITY = "\n1 0 0 0 \n0 1 0 0 \n0 0 1 0 \n0 0 0 1 \n"
# The colours of regions in pictures and in the editor.
_REGIONS = ["E69F00", "56B4E9", "009E73", "CC79A7", "F0E442", "0072B2", "D55E00"]
_LOSS, _NONE, _GAIN = [0, 114, 178], [255, 255, 255], [213, 94, 0]
_WIRE = (40, 40, 40, 255)
_COLOURS = {"RGB", "RGBA"}


def read_project(path: str | Path) -> dict[str, pv.PolyData]:
    """Read the layers of a MeshLab project, by name, transformed by their matrices.

    Wires that `write_project` added to show cages are left out.

    Parameters
    ----------
    path : str or Path
        An .mlp file; layers of equal names get a number.

    Raises
    ------
    MeshError
        If it is not a MeshLab project, refers to a layer outside its folder or one that cannot be
        read, or has more than 1000 layers or 4 GiB.
    MissingDependencyError
        If only PyMeshLab reads the format of a layer and it is not installed.
    """
    path = as_path(path)
    layers: dict[str, pv.PolyData] = {}
    elements = [
        element
        for element in _parsed(path).findall("MeshGroup/MLMesh")
        if not element.get("filename", "").endswith(_WIRES)
    ]
    if len(elements) > _MOST_LAYERS:
        raise MeshError(f"{path}: has {len(elements)} layers; the limit is {_MOST_LAYERS}")
    files = [_layer_file(path, element.get("filename", "")) for element in elements]
    total = sum(file.stat().st_size for file in files)
    if total > _MOST_BYTES:
        raise MeshError(
            f"{path}: its layers have {total:.3g} bytes; the limit is {_MOST_BYTES:.3g}"
        )
    for element, file in zip(elements, files, strict=True):
        surface = read_polydata(file)
        for attributes in (surface.point_data, surface.cell_data):
            if "flags" in attributes:
                chosen = np.asarray(attributes.pop("flags")).astype(np.int64) & _SELECTED != 0
                if chosen.any():
                    attributes["selection"] = chosen.astype(np.uint8)
        matrix = _matrix(path, element)
        if not np.array_equal(matrix, np.eye(4)):
            points = np.asarray(surface.points, dtype=np.float64)
            surface = with_vertices(surface, points @ matrix[:3, :3].T + matrix[:3, 3])
        layers[free_name(element.get("label") or file.stem, layers)] = surface
    if not layers:
        raise MeshError(f"{path}: the project has no layers")
    return layers


def write_project(path: str | Path, what: Layer | HasLayers | Mapping[str, Layer]) -> None:
    """Write layers as a MeshLab project.

    Parameters
    ----------
    path : str or Path
        For example ``work.mlp``; the layers are written to a folder ``work.layers`` beside it.
    what : Mesh, Surface, pyvista.PolyData, Session, or dict of str to one of the first three
        As in `meshlab.to_meshset`, but polygons are kept.  Layers of a session with the names
        "cage 1", "cage 2" ... are shown as wires.

    Raises
    ------
    MeshError
        If the suffix is not .mlp, the folder does not exist, or *what* is of another type.
    """
    path = as_path(path)
    if path.suffix.lower() != ".mlp":
        raise MeshError(f"{path}: the name of a MeshLab project must end in .mlp")
    folder = path.with_suffix(".layers")
    try:
        require_place(path)
    except OSError as fault:
        raise MeshError(f"{path}: {fault.strerror or fault}") from fault
    if os.path.islink(folder) or (os.path.exists(folder) and not os.path.isdir(folder)):
        raise MeshError(f"{path}: {folder.name} exists and is not a folder")
    layers = as_layers(what)
    project = ElementTree.Element("MeshLabProject")
    group = ElementTree.SubElement(project, "MeshGroup")
    try:
        folder.mkdir(exist_ok=True)
        names = set()
        for number, (label, surface) in enumerate(layers.items()):
            name = f"{number}-{_digest(surface)}.ply"
            write_mesh(folder / name, _with_flags(_coloured(surface)))
            shown = not isinstance(what, HasLayers) or label == "mesh"
            _add(group, label, f"{folder.name}/{name}", visible=shown)
            names.add(name)
            if not shown and _CAGE.fullmatch(label):
                name = name.removesuffix(".ply") + _WIRES
                with replacing(folder / name) as draft:
                    draft.write_bytes(_wires_of(surface))
                _add(group, f"{label}, wires", f"{folder.name}/{name}", visible=True)
                names.add(name)
        ElementTree.SubElement(project, "RasterGroup")
        ElementTree.indent(project, " ")
        text = _HEAD + ElementTree.tostring(project, encoding="unicode") + "\n"
        with replacing(path) as draft:
            draft.write_text(text, encoding="utf-8")
        for file in folder.iterdir():
            if _GENERATED.fullmatch(file.name) and file.name not in names and not file.is_symlink():
                file.unlink()
    except OSError as fault:
        reason = fault.strerror or str(fault)
        raise MeshError(
            f"{path}: cannot be written ({reason}); free disk space or choose another folder"
        ) from fault


def _add(group: ElementTree.Element, label: str, file: str, *, visible: bool) -> None:
    """Add a layer to a project."""
    entry = {"label": _printable(label), "visible": "1" if visible else "0", "filename": file}
    mesh = ElementTree.SubElement(group, "MLMesh", entry)
    ElementTree.SubElement(mesh, "MLMatrix44").text = _IDENTITY


def _digest(surface: pv.PolyData) -> str:
    """Return a digest of a surface, twelve hexadecimal digits."""
    texture = surface.GetPointData().GetTCoords()
    digest = hashlib.sha256(repr(texture and texture.GetName()).encode())
    arrays = {"points": surface.points, "corners": surface.faces, "strips": surface.strips}
    for kind, attributes in (("p", surface.point_data), ("c", surface.cell_data)):
        arrays |= {f"{kind} {name}": values for name, values in attributes.items()}
    for name, values in arrays.items():
        array = np.ascontiguousarray(values)
        digest.update(repr((name, array.shape, array.dtype.str)).encode())
        digest.update(array.tobytes())
    return digest.hexdigest()[:12]


def _with_flags(surface: pv.PolyData) -> pv.PolyData:
    copy = surface.copy(deep=False)
    for attributes in (copy.point_data, copy.cell_data):
        if "selection" in attributes:
            chosen = np.asarray(attributes.pop("selection")) != 0
            attributes["flags"] = (chosen * _SELECTED).astype(np.int32)
    return copy


def _printable(text: str) -> str:
    """Return *text* without control characters, which XML cannot store."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _parsed(path: Path) -> ElementTree.Element:
    try:
        with open_regular(path) as file:
            data = file.read(_LARGEST + 1)
    except OSError as fault:
        raise MeshError(f"{path}: {fault.strerror or fault}") from fault
    if len(data) > _LARGEST:
        raise MeshError(f"{path}: too large for a MeshLab project")
    if b"<!ENTITY" in data.upper() or b"\0" in data:
        raise MeshError(f"{path}: is not a MeshLab project: it declares entities or is not text")
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MeshError(f"{path}: is not a MeshLab project ({error})") from None
    if root.tag != "MeshLabProject":
        raise MeshError(f"{path}: is not a MeshLab project; its root is {root.tag[:40]!r}")
    return root


def _layer_file(path: Path, name: str) -> Path:
    """Return the file of a layer, which must be in the folder of the project or below."""
    file = file_inside(path.parent, name)
    if file is None:
        raise MeshError(
            f"{path}: the layer {name[:200]!r} is not a file in the project's folder; "
            "copy it there and save the project again"
        )
    return file


def _matrix(path: Path, element: ElementTree.Element) -> FloatArray:
    words = (element.findtext("MLMatrix44") or _IDENTITY).split()
    try:
        matrix = np.array([float(word) for word in words]).reshape(4, 4)
    except ValueError:
        matrix = np.full((4, 4), np.nan)
    if not np.isfinite(matrix).all() or not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        label = element.get("label", "")[:80]
        raise MeshError(f"{path}: the matrix of layer {label!r} is not affine")
    return matrix


def _coloured(surface: pv.PolyData) -> pv.PolyData:
    """Return a surface with colours of its quality, unless it has colours or no quality.

    Whole numbers, such as regions, get distinct colours; other numbers blue below and red above 0.
    """
    points = surface.point_data
    if "quality" not in points or _COLOURS & {*points.keys(), *surface.cell_data.keys()}:
        return surface
    surface = surface.copy(deep=False)
    colours = _colours_of_quality(np.asarray(points["quality"], dtype=np.float64))
    surface.point_data["RGBA"] = colours
    return surface


def _colours_of_quality(quality: FloatArray) -> Any:
    """Return colours (n, 4) uint8 of a quality (n,).

    >>> _colours_of_quality(np.array([0.0, 1.0, 7.0]))[:, :3].tolist()
    [[230, 159, 0], [86, 180, 233], [230, 159, 0]]
    >>> _colours_of_quality(np.array([-0.5, 0.0, 0.25]))[:, :3].tolist()
    [[0, 114, 178], [255, 255, 255], [234, 174, 128]]
    """
    quality = np.nan_to_num(quality, nan=0.0, posinf=0.0, neginf=0.0)
    if (quality == np.rint(quality)).all():
        palette = np.array([list(bytes.fromhex(colour)) for colour in _REGIONS])
        colours = palette[quality.astype(np.int64) % len(palette)]
    else:
        share = (quality / np.abs(quality).max())[:, None]
        towards = np.where(share < 0.0, _LOSS, _GAIN)
        colours = _NONE + np.abs(share) * (towards - np.array(_NONE))
    opaque = np.full((len(quality), 1), 255)
    return np.rint(np.hstack([colours, opaque])).astype(np.uint8)


def _wires_of(surface: pv.PolyData) -> bytes:
    """Return a PLY file of the edges of a surface, without faces."""
    counts, corners = polygons_of(surface)
    counts = counts[counts > 0]
    ends = np.roll(corners, -1)
    last = np.cumsum(counts) - 1
    ends[last] = corners[last - counts + 1]
    edges = np.unique(np.sort(np.stack([corners, ends], axis=1), axis=1), axis=0)
    vertex = np.zeros(surface.n_points, [("x", "<f8", 3), ("colour", "u1", 4)])
    vertex["x"], vertex["colour"] = surface.points, _WIRE
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertex)}"]
    header += [f"property double {name}" for name in "xyz"]
    header += [f"property uchar {name}" for name in ("red", "green", "blue", "alpha")]
    header += [f"element edge {len(edges)}", "property int vertex1", "property int vertex2"]
    data = "\n".join([*header, "end_header", ""]).encode()
    return bytes(data + vertex.tobytes() + edges.astype("<i4").tobytes())
