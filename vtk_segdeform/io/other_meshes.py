"""Surfaces given as other objects of VTK than a PolyData.

    vtkPolyData             wrapped
    UnstructuredGrid        its triangles, polygons, strips, lines and vertices, as those of a file
    MultiBlock              its blocks as one surface; their names become groups of cells

Anything else is refused with the line that converts it (`mesh.conversion_of`).
"""

from __future__ import annotations

import logging

import numpy as np
import pyvista as pv

from ..checks import shown
from ..errors import ArgumentError, MeshError
from ..mesh import conversion_of
from .array_names import set_names
from .grids import surface_of_grid
from .groups import GROUP, names_key

_log = logging.getLogger(__name__)


def as_polydata(mesh: object, name: str, expected: str = "a PolyData") -> pv.PolyData:
    """Return the surface that *mesh* is; a PolyData is returned itself.

    Parameters
    ----------
    mesh : object
        What a caller has passed.
    name, expected : str
        For the message of an error: the name of the argument, and what it must be.

    Raises
    ------
    ArgumentError
        If it is no surface; the message has the line that converts it, if there is one.
    MeshError
        If a grid has cells that are not of a surface.
    """
    if isinstance(mesh, pv.PolyData):
        return mesh
    line = conversion_of(mesh)
    data = pv.wrap(mesh) if line == "Surface(mesh)" else None
    if isinstance(data, pv.PolyData):
        return data
    if isinstance(data, pv.UnstructuredGrid):
        try:
            return surface_of_grid(data, only_as_grid=False)
        except MeshError:
            line = "Surface(mesh.extract_surface(algorithm=None))"
            raise MeshError(f"{name} has cells that are not of a surface: {line}") from None
    blocks = []
    if isinstance(data, pv.MultiBlock):
        items = data.recursive_iterator("items")
        blocks = [(key, block) for key, block in items if block is not None]
    if not blocks:
        how = f". Convert it: {line}" if data is None and line else ""
        raise ArgumentError(f"{name} must be {expected}; got {shown(mesh)}{how}")
    of_block = f"{expected}; of a MultiBlock all blocks must be surfaces"
    return _joined([(key, as_polydata(block, name, of_block)) for key, block in blocks])


def _joined(blocks: list[tuple[str | None, pv.PolyData]]) -> pv.PolyData:
    """Return blocks as one surface, in which each is a group, unless they have groups already."""
    surfaces = [surface.copy(deep=False) for _, surface in blocks]
    if len(surfaces) == 1:
        return surfaces[0]
    names = [key or f"block {k}" for k, (key, _) in enumerate(blocks)]
    is_named = not any(GROUP in surface.cell_data for surface in surfaces)
    if is_named:
        for k, surface in enumerate(surfaces):
            surface.cell_data[GROUP] = np.full(surface.n_cells, k)
    joined = surfaces[0].append_polydata(*surfaces[1:])
    for sort in ("point", "cell"):
        given = {key for each in surfaces for key in getattr(each, f"{sort}_data")}
        if lost := sorted(given - set(getattr(joined, f"{sort}_data"))):
            _log.warning("only some blocks have the %s arrays %s: left out", sort, ", ".join(lost))
    if is_named:
        set_names(joined, names_key(GROUP), names)
    return joined
