"""Layers of MeshLab as pyvista's PolyData, with all their attributes as arrays.

A `Mesh` has only positions and triangles, so the other attributes of a layer become arrays of a
PolyData, which files, views and the deformation (`convert.with_vertices`) preserve:

    selection            point and cell array "selection", uint8, 1 if selected
    quality              point and cell array "quality", float64
    colour               point and cell array "RGBA", uint8 (n, 4)
    texture coordinates  of vertices: the active ones, "TextureCoordinates" (n, 2);
                         of corners: cell array "TextureCorners" (m, 6)
    custom attributes    numbers or vectors of vertices or faces: all other numeric point and cell
                         arrays (n,) and (n, 3), by name

`ply` uses the same names.  MeshLab stores texture coordinates in single precision, all else in
double.  Every vertex has a colour and a quality in MeshLab; the defaults, white and 0, do not
become arrays.  The matrix of a layer is applied to its positions.  MeshLab cannot list custom
attributes, so their names must be given.

This module does not import PyMeshLab.
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterable, Mapping
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
import pyvista as pv

from ..errors import MeshError
from ..mesh import Mesh
from .polygons import polydata_of, texture_of


@runtime_checkable
class HasGiven(Protocol):
    """A `Surface`."""

    @property
    def given(self) -> pv.PolyData:
        """The surface as it was given."""


Layer: TypeAlias = Mesh | pv.PolyData | HasGiven
_CORNERS, _TEXTURE = "TextureCorners", "TextureCoordinates"


@runtime_checkable
class HasLayers(Protocol):
    """A session, or another object made of several surfaces."""

    def layers(self) -> dict[str, pv.PolyData]:
        """Return its surfaces by name."""


class LayerData(NamedTuple):
    """Arguments of ``pymeshlab.Mesh(**arrays)``, and the data that it does not accept."""

    arrays: dict[str, Any]
    selected_vertices: Any  # (n,) float, 1 if selected; None if none is
    selected_faces: Any  # (m,)
    of_vertices: dict[str, Any]  # custom attributes by name, (n,) or (n, 3) float
    of_faces: dict[str, Any]


def as_layers(what: Layer | HasLayers | Mapping[str, Layer]) -> dict[str, pv.PolyData]:
    """Return one surface, a session, or several surfaces by name, as layers."""
    if isinstance(what, HasLayers):
        return what.layers()
    layers = what if isinstance(what, Mapping) else {"mesh": what}
    return {str(name): as_polydata(surface) for name, surface in layers.items()}


def as_polydata(surface: Layer) -> pv.PolyData:
    """Return a mesh or a surface as PolyData, with its polygons and arrays."""
    if isinstance(surface, HasGiven):
        return surface.given
    if isinstance(surface, Mesh):
        return polydata_of(surface.vertices, np.full(surface.n_faces, 3), surface.faces.ravel())
    if not isinstance(surface, pv.PolyData):
        raise MeshError(
            "expected a Mesh, a Surface, a PolyData, a Session or a dict of surfaces; "
            f"got {type(surface).__name__}"
        )
    return surface


def free_name(name: str, taken: Container[str]) -> str:
    """Return *name*, or "name 2", "name 3" ... if it is taken."""
    names = itertools.chain([name], (f"{name} {k}" for k in itertools.count(2)))
    return next(each for each in names if each not in taken)


def layer_data(surface: pv.PolyData) -> LayerData:
    """Return the data for a ``pymeshlab.Mesh``."""
    if not surface.is_all_triangles:
        surface = surface.triangulate()
    points, cells = surface.point_data, surface.cell_data
    arrays: dict[str, Any] = {
        "vertex_matrix": np.asarray(surface.points, dtype=np.float64),
        "face_matrix": surface.regular_faces,
    }
    for sort, attributes in (("v", points), ("f", cells)):
        if "quality" in attributes:
            arrays[f"{sort}_scalar_array"] = np.asarray(attributes["quality"], dtype=np.float64)
        colour = _colour(attributes)
        if colour is not None:
            arrays[f"{sort}_color_matrix"] = colour / 255.0
    texture = texture_of(surface)
    if texture is not None:
        arrays["v_tex_coords_matrix"] = texture[1].astype(np.float64)
    if _CORNERS in cells:
        corners = np.asarray(cells[_CORNERS], dtype=np.float64)
        arrays["w_tex_coords_matrix"] = corners.reshape(-1, 2)
    others = (_others(points, surface.n_points), _others(cells, surface.n_cells))
    return LayerData(arrays, _selection(points), _selection(cells), *others)


def add_attributes(layer: Any, sort: str, attributes: Mapping[str, Any]) -> None:
    """Add custom *attributes* to the elements of a ``pymeshlab.Mesh``, "vertex" or "face"."""
    for name, values in attributes.items():
        kind = "scalar" if values.ndim == 1 else "point"
        getattr(layer, f"add_{sort}_custom_{kind}_attribute")(values, name)


def surface_of(layer: Any, names: Iterable[str] = (), absent: Any = ()) -> pv.PolyData:
    """Convert a ``pymeshlab.Mesh`` to PolyData with all its attributes.

    Parameters
    ----------
    layer : pymeshlab.Mesh
        Not changed.
    names : iterable of str
        Names of the custom attributes to convert; a MeshError if one does not exist.
    absent : type or tuple of types
        Exceptions of PyMeshLab for an attribute that does not exist.
    """
    faces = np.asarray(layer.face_matrix(), dtype=np.int64).reshape(-1, 3)
    points = np.asarray(layer.transformed_vertex_matrix(), dtype=np.float64)
    surface = polydata_of(points, np.full(len(faces), 3), faces.ravel())
    for sort, attributes in (("vertex", surface.point_data), ("face", surface.cell_data)):
        selected = getattr(layer, f"{sort}_selection_array")()
        if selected.any():
            attributes["selection"] = selected.astype(np.uint8)
        if getattr(layer, f"has_{sort}_scalar")():
            quality = np.asarray(getattr(layer, f"{sort}_scalar_array")())
            if quality.any():
                attributes["quality"] = quality
        if getattr(layer, f"has_{sort}_color")():
            colour = np.asarray(getattr(layer, f"{sort}_color_matrix")())
            if (colour != 1.0).any():
                attributes["RGBA"] = np.rint(colour * 255.0).astype(np.uint8, order="C")
    if layer.has_vertex_tex_coord():
        texture = np.ascontiguousarray(layer.vertex_tex_coord_matrix())
        surface.point_data[_TEXTURE] = texture
        surface.point_data.active_texture_coordinates_name = _TEXTURE
    if layer.has_wedge_tex_coord():
        corners = np.ascontiguousarray(layer.wedge_tex_coord_matrix())
        surface.cell_data[_CORNERS] = corners.reshape(len(faces), 6)
    for name in names:
        _add_attribute(layer, name, surface, absent)
    return surface


def _add_attribute(layer: Any, name: str, surface: pv.PolyData, absent: Any) -> None:
    found = False
    for sort, attributes in (("vertex", surface.point_data), ("face", surface.cell_data)):
        for kind in ("scalar_attribute_array", "point_attribute_matrix"):
            try:
                values = getattr(layer, f"{sort}_custom_{kind}")(name)
            except absent:
                continue
            attributes[name], found = np.ascontiguousarray(values), True
    if not found:
        raise MeshError(f"the layer has no attribute {name!r} of vertices or faces")


def _others(attributes: Any, count: int) -> dict[str, Any]:
    """Return the numeric arrays that become custom attributes, as float64."""
    known = {"selection", "quality", "RGB", "RGBA", "Normals", "selected_here", _CORNERS, _TEXTURE}
    known |= {attributes.active_normals_name, attributes.active_texture_coordinates_name}
    arrays = {name: np.asarray(v) for name, v in attributes.items() if name not in known}
    return {
        name: np.asarray(values, dtype=np.float64)
        for name, values in arrays.items()
        if values.dtype.kind in "biuf" and values.shape in ((count,), (count, 3))
    }


def _colour(attributes: Any) -> Any:
    """Return the colours, (n, 4), or None."""
    name = next((name for name in ("RGBA", "RGB") if name in attributes), None)
    if name is None:
        return None
    colour = np.asarray(attributes[name])
    opaque = np.full((len(colour), 1), 255)
    return np.hstack([colour, opaque])[:, :4].astype(np.float64)


def _selection(attributes: Any) -> Any:
    chosen = np.asarray(attributes["selection"]) != 0 if "selection" in attributes else None
    return chosen.astype(np.float64) if chosen is not None and chosen.any() else None
