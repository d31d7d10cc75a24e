"""Models, deformers and drawing functions that several pictures share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import vtk_segdeform as sd
from making.made import FIGURES
from vtk_segdeform.io import polydata_of
from vtk_segdeform.pictures import draw_mesh, of_region, view_of, write_panels

Drawing = Callable[[pv.Plotter], None]
PIVOT = np.array([0.0, 0.0, 0.4])


@cache
def cactus(n_vertices: int = 5430) -> dict[str, Any]:
    """Return the cactus with its regions, cages, fixed vertices and handle."""
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
    """Return a bar, and its poses bent by 120 degrees without and with volume preservation."""
    mesh = sd.models.bar(size=(0.2, 0.2, 1.0), divisions=(8, 8, 40))
    height = mesh.vertices[:, 2]
    parts = parts_of(mesh, np.flatnonzero(height < 0.05), np.flatnonzero(height > 0.95))
    targets = rotated(mesh, parts["handle"], 120)
    free = deformer_of(parts, preserve_volume=False).solve(targets)
    return parts, free, deformer_of(parts).solve(targets)


def deformer_of(parts: dict[str, Any], **options: Any) -> sd.Deformer:
    """Return a deformer of these parts."""
    ends = {name: parts[name] for name in ("fixed", "handle")}
    return sd.Deformer(parts["mesh"], parts["regions"], parts["cages"], **ends, **options)


def rotated(mesh: sd.Mesh, handle: Any, degrees: float, pivot: Any = PIVOT) -> Any:
    """Return the vertices of *handle*, rotated about y."""
    turn = Rotation.from_euler("y", degrees, degrees=True)
    return turn.apply(mesh.vertices[handle] - pivot) + pivot


def label_map() -> sd.Mesh:
    """Return the smoothed surfaces between the labels of a label map: seven organs in an egg."""
    shape = np.array([18, 18, 56])
    places = np.moveaxis(np.indices(shape), 0, -1) / (shape - 1) - 0.5
    points = np.random.default_rng(5).uniform(-0.33, 0.33, (7, 3))
    labels = np.linalg.norm(places[..., None, :] - points, axis=-1).argmin(axis=-1) + 1
    labels[np.linalg.norm(places, axis=-1) > 0.44] = 0
    grid = pv.ImageData(dimensions=shape)
    grid.point_data["labels"] = labels.ravel(order="F").astype(np.int32)
    surface = grid.contour_labels(
        boundary_style="all", scalars="labels", smoothing_iterations=20,
        output_mesh_type="triangles",
    )  # fmt: skip
    return sd.Surface(surface).mesh


def cut_open(parts: Sequence[tuple[Any, Any, Any]], normal: str) -> Drawing:
    """Return a function that draws the half of bodies behind a plane through their middle.

    Each has its faces, vertices and colour; the plane is perpendicular to the axis *normal*.
    """
    low, high = (
        end([end(x[faces.ravel()], axis=0) for faces, x, _ in parts], axis=0)
        for end in (np.min, np.max)
    )
    middle = (low + high) / 2.0

    def draw(plotter: pv.Plotter) -> None:
        for faces, x, colour in parts:
            surface = polydata_of(x, np.full(len(faces), 3), faces.ravel())
            cut = surface.clip_closed_surface(normal, origin=middle)
            look = {"smooth_shading": True, "split_sharp_edges": True, "ambient": 0.3}
            plotter.add_mesh(cut, color=tuple(colour / 255), **look)

    return draw


def region_colours(mesh: sd.Mesh, shares: Any) -> Any:
    """Return (m, 3) face colours: those of the regions, mixed by *shares* (r, n)."""
    palette = np.array([of_region(r) for r in range(len(shares))], dtype=float)
    return (np.asarray(shares).T @ palette)[mesh.faces].mean(axis=1)


def body(mesh: sd.Mesh, vertices: Any = None, colours: Any = None) -> Drawing:
    """Return a function that draws a mesh, optionally deformed and coloured."""

    def draw(plotter: pv.Plotter) -> None:
        draw_mesh(plotter, mesh, vertices=vertices, colours=colours)

    return draw


def add_wires(plotter: pv.Plotter, region: int, faces: Any, vertices: Any) -> None:
    """Add a cage as lines and spheres in the colour of its region."""
    surface = polydata_of(vertices, np.full(len(faces), 3), faces.ravel())
    colour = tuple(0.8 * of_region(region) / 255)
    plotter.add_mesh(surface.extract_all_edges(), color=colour, line_width=4.0, lighting=False)
    add_spheres(plotter, vertices, colour, 14.0)


def add_spheres(plotter: pv.Plotter, points: Any, colour: Any, size: float) -> None:
    """Add spheres of *size* pixels."""
    points = np.asarray(points)
    plotter.add_points(points, color=colour, point_size=size, render_points_as_spheres=True)


def write(name: str, drawings: Sequence[Drawing], points: Any) -> None:
    """Write *drawings* to NAME-1.png and so on, with one camera that sees all *points*."""
    for number, draw in enumerate(drawings, start=1):
        path = FIGURES / f"{name}-{number}.png"
        write_panels(path, [("", draw)], points, view_of(points, points))
