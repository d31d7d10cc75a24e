"""What several pictures show: the cactus, the bar, how they are held, and how they are drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from making.made import FIGURES
from vtk_segdeform.io.polygons import polydata_of
from vtk_segdeform.pictures.canvas import view_of, write_panels
from vtk_segdeform.pictures.palette import of_region
from vtk_segdeform.pictures.pictures import draw_mesh

Drawing = Callable[[pv.Plotter], None]
PIVOT = np.array([0.0, 0.0, 0.4])


@cache
def cactus(n_vertices: int = 5430) -> dict[str, Any]:
    """Return the cactus with its regions, its cages and what is held."""
    mesh = sd.models.cactus(n_vertices)
    height = mesh.vertices[:, 2]
    return parts_of(mesh, np.flatnonzero(height < 0.08), np.flatnonzero(height > 0.92))


def parts_of(mesh: sd.Mesh, fixed: Any, handle: Any) -> dict[str, Any]:
    """Return a mesh with three regions and their cages."""
    regions = sd.segment(mesh, n_regions=3)
    cages = sd.fit_cages(mesh, regions, n_vertices=155)
    return {"mesh": mesh, "regions": regions, "cages": cages, "fixed": fixed, "handle": handle}


@cache
def bar() -> tuple[dict[str, Any], sd.Solution, sd.Solution]:
    """Return a bar, bent by 120 degrees with its volume free, and with it held."""
    mesh = sd.models.bar(size=(0.2, 0.2, 1.0), divisions=(8, 8, 40))
    height = mesh.vertices[:, 2]
    parts = parts_of(mesh, np.flatnonzero(height < 0.05), np.flatnonzero(height > 0.95))
    targets = turned(mesh, parts["handle"], 120)
    free = bound(parts, preserve_volume=False).solve(targets)
    return parts, free, bound(parts).solve(targets)


def bound(parts: dict[str, Any], **options: Any) -> sd.Deformer:
    """Return a deformer of these parts."""
    held = {name: parts[name] for name in ("fixed", "handle")}
    return sd.Deformer(parts["mesh"], parts["regions"], parts["cages"], **held, **options)


def turned(mesh: sd.Mesh, handle: Any, degrees: float, pivot: Any = PIVOT) -> Any:
    """Return where *handle* is after a turn about y."""
    turn = Rotation.from_euler("y", degrees, degrees=True)
    return turn.apply(mesh.vertices[handle] - pivot) + pivot


def region_colours(mesh: sd.Mesh, shares: Any) -> Any:
    """Return (m, 3): the colours of the regions, mixed by *shares* (r, n) at the vertices."""
    palette = np.array([of_region(r) for r in range(len(shares))], dtype=float)
    return (np.asarray(shares).T @ palette)[mesh.faces].mean(axis=1)


def body(mesh: sd.Mesh, vertices: Any = None, colours: Any = None) -> Drawing:
    """Return what draws a mesh, deformed and coloured if so wanted."""

    def draw(plotter: pv.Plotter) -> None:
        draw_mesh(plotter, mesh, vertices=vertices, colours=colours)

    return draw


def add_wires(plotter: pv.Plotter, region: int, faces: Any, vertices: Any) -> None:
    """Add a cage as lines and balls in the colour of its region."""
    surface = polydata_of(vertices, np.full(len(faces), 3), faces.ravel())
    colour = tuple(0.8 * of_region(region) / 255)
    plotter.add_mesh(surface.extract_all_edges(), color=colour, line_width=4.0, lighting=False)
    add_balls(plotter, vertices, colour, 14.0)


def add_balls(plotter: pv.Plotter, points: Any, colour: Any, size: float) -> None:
    """Add balls of so many pixels."""
    points = np.asarray(points)
    plotter.add_points(points, color=colour, point_size=size, render_points_as_spheres=True)


def write(name: str, drawings: Sequence[Drawing], seen: Any) -> None:
    """Write NAME-1.png and so on: *drawings*, all with room for the points *seen*."""
    for number, draw in enumerate(drawings, start=1):
        path = FIGURES / f"{name}-{number}.png"
        write_panels(path, [("", draw)], seen, view_of(seen, seen))
