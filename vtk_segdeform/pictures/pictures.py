"""Pictures of a deformation, rendered off-screen and written as PNG files.

    regions and cages   each region in its colour, and its cage as wires of that colour
    before and after    the mesh at rest and deformed; fixed vertices grey, handle red
    volume change       the deformed mesh coloured by a signed percentage, white at zero
    distortion          the deformed mesh coloured by a magnitude, dark at zero
    landmarks           the mesh at rest and fitted, with landmarks, targets and residuals

The colours are those of `palette`.  `canvas` chooses the camera and writes the files.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_faces, as_ids, as_numbers, as_points
from ..checks import as_path, require_sequence, shown
from ..errors import ArgumentError
from ..io import polydata_of
from ..mesh import Mesh, require_mesh
from ..regions import CageSurface, Regions
from .canvas import add_surface, view_of, write_panels
from .palette import BODY, FIXED, HANDLE, INK, of_region

_LANDMARK = 0.008  # radius, in diagonals
_BAR = 0.17  # fraction of the height for the colour bar


def picture_regions_and_cages(
    path: str | Path,
    mesh: Mesh,
    membership: ArrayLike,
    cages: Sequence[CageSurface] = (),
) -> None:
    """Draw the regions in colours, mixed in overlaps, and beside them their cages as wires.

    Parameters
    ----------
    path : str or Path
        A PNG file to write.
    mesh : Mesh
        n vertices.
    membership : (r, n) bool
        The vertices of each region.
    cages : sequence with .vertices (m, 3) and .faces (k, 3)
        One per region, in the same order; if empty, only the regions are drawn.
    """
    path = as_path(path)
    member_of = Regions(mesh, as_numbers(membership, "membership").astype(bool)).membership
    require_sequence(cages, "cages")
    if len(cages) not in (0, len(member_of)):
        raise ArgumentError(
            f"cages must be one for each of the {len(member_of)} regions; got {len(cages)}"
        )
    for cage in cages:
        if not (hasattr(cage, "vertices") and hasattr(cage, "faces")):
            raise ArgumentError(f"cages must have vertices and faces; got {shown(cage)}")
        points = as_points(cage.vertices, "vertices of cages")
        as_faces(cage.faces, len(points), "faces of cages")
    palette = np.array([of_region(r) for r in range(len(member_of))])
    mixing = member_of / member_of.sum(axis=0)
    colours = (mixing.T @ palette)[mesh.faces].mean(axis=1)
    everything = np.concatenate([mesh.vertices, *(cage.vertices for cage in cages)])

    def draw_regions(plotter: pv.Plotter) -> None:
        draw_mesh(plotter, mesh, colours=colours)

    def draw_cages(plotter: pv.Plotter) -> None:
        draw_mesh(plotter, mesh, colours=0.45 * colours + 0.55 * 255)
        for cage, colour in zip(cages, palette, strict=True):
            wires = _surface(cage.faces, cage.vertices).extract_all_edges()
            plotter.add_mesh(wires, color=tuple(0.8 * colour / 255), line_width=4.0, lighting=False)

    panels = [("regions" if len(member_of) > 1 else "one region", draw_regions)]
    if len(cages):
        number = sum(len(cage.vertices) for cage in cages)
        panels.append((f"cages, {number} vertices", draw_cages))
    write_panels(path, panels, everything, view_of(mesh.vertices, mesh.vertices))


def picture_before_after(
    path: str | Path,
    mesh: Mesh,
    vertices: ArrayLike,
    *,
    fixed: ArrayLike,
    handle: ArrayLike,
) -> None:
    """Draw *mesh* at rest and with other *vertices*, from the same camera.

    Parameters
    ----------
    path : str or Path
        A PNG file to write.
    mesh : Mesh
        At rest, n vertices.
    vertices : (n, 3) float
        Deformed.
    fixed, handle : (k,) int or (n,) bool
        Drawn grey and red.
    """
    path = as_path(path)
    require_mesh(mesh)
    deformed = as_points(vertices, "vertices", mesh.n_vertices)
    colours = np.tile(pv.Color(BODY).int_rgb, (mesh.n_faces, 1)).astype(float)
    for ids, name, colour in ((fixed, "fixed", FIXED), (handle, "handle", HANDLE)):
        chosen = np.zeros(mesh.n_vertices, dtype=bool)
        chosen[as_ids(ids, mesh.n_vertices, name)] = True
        colours[chosen[mesh.faces].all(axis=1)] = pv.Color(colour).int_rgb

    def draw_rest(plotter: pv.Plotter) -> None:
        draw_mesh(plotter, mesh, colours=colours)

    def draw_deformed(plotter: pv.Plotter) -> None:
        draw_mesh(plotter, mesh, vertices=deformed, colours=colours)

    everything = np.concatenate([mesh.vertices, deformed])
    panels = [("at rest (grey: fixed, red: handle)", draw_rest), ("deformed", draw_deformed)]
    write_panels(path, panels, everything, view_of(mesh.vertices, deformed))


def picture_volume_change(
    path: str | Path, mesh: Mesh, vertices: ArrayLike, change: ArrayLike
) -> None:
    """Draw the deformed mesh coloured by *change*: red for expansion, blue for compression.

    Parameters
    ----------
    path : str or Path
        A PNG file to write.
    mesh : Mesh
        At rest, n vertices; the camera is that of `picture_before_after`.
    vertices : (n, 3) float
        Deformed.
    change : (n,) or (m,) float
        Per vertex or per face, relative: 0.1 is shown as 10 %.
    """
    percent = 100.0 * _values(mesh, change, "change")
    most = _largest(np.abs(percent))
    _picture_values(
        path, mesh, vertices, percent, "local volume change [%]", ("RdBu_r", -most, most)
    )


def picture_distortion(
    path: str | Path, mesh: Mesh, vertices: ArrayLike, distortion: ArrayLike
) -> None:
    """Draw the deformed mesh coloured by *distortion*, 0 or more, per vertex or per face.

    The arguments are those of `picture_volume_change`.
    """
    values = _values(mesh, distortion, "distortion")
    limits = ("cividis", 0.0, _largest(values))
    _picture_values(path, mesh, vertices, values, "distortion", limits)


def picture_landmarks(
    path: str | Path,
    mesh: Mesh,
    vertices: ArrayLike,
    *,
    source: ArrayLike,
    target: ArrayLike,
    residuals: ArrayLike,
) -> None:
    """Draw *mesh* with its landmarks, and fitted, with their targets; lines are residuals.

    Parameters
    ----------
    path : str or Path
        A PNG file to write.
    mesh : Mesh
        At rest, n vertices; drawn with the middle of the fitted one.
    vertices : (n, 3) float
        Fitted.
    source, target : (k, 3) float
        Landmarks at rest and their targets.
    residuals : (k, 3) float
        From where the landmarks are to their targets; `LandmarkFit.residuals`.
    """
    path = as_path(path)
    require_mesh(mesh)
    fitted = as_points(vertices, "vertices", mesh.n_vertices)
    to = as_points(target, "target")
    shift = fitted.mean(axis=0) - mesh.vertices.mean(axis=0)
    rest, own = mesh.vertices + shift, as_points(source, "source", len(to)) + shift
    off = as_points(residuals, "residuals", len(to))
    everything = np.concatenate([rest, fitted, own, to])
    radius = _LANDMARK * float(np.linalg.norm(np.ptp(everything, axis=0)))

    def draw(plotter: pv.Plotter, x: FloatArray, points: FloatArray) -> None:
        draw_mesh(plotter, mesh, vertices=x)
        balls = pv.PolyData(points).glyph(geom=pv.Sphere(radius=radius), orient=False, scale=False)
        plotter.add_mesh(balls, color=HANDLE)

    def draw_rest(plotter: pv.Plotter) -> None:
        draw(plotter, rest, own)

    def draw_fitted(plotter: pv.Plotter) -> None:
        draw(plotter, fitted, to)
        lines = pv.line_segments_from_points(np.stack([to - off, to], axis=1).reshape(-1, 3))
        plotter.add_mesh(lines.tube(radius=0.4 * radius), color=INK)

    panels = [("landmarks", draw_rest), ("fitted; targets and residuals", draw_fitted)]
    write_panels(path, panels, everything, view_of(rest, fitted))


def draw_mesh(
    plotter: pv.Plotter,
    mesh: Mesh,
    *,
    vertices: FloatArray | None = None,
    colours: FloatArray | None = None,
) -> Any:
    """Add *mesh* to a plotter, smoothly shaded, with its silhouette; returns its actor.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Its camera must be set, since the silhouette depends on it.
    mesh : Mesh
        m faces.
    vertices : (n, 3) float, optional
        Drawn instead of the vertices of the mesh.
    colours : (m, 3) float, optional
        Red, green and blue of each face, 0 to 255.
    """
    surface = _surface(mesh.faces, mesh.vertices if vertices is None else vertices)
    if colours is not None:
        surface.cell_data["colours"] = np.round(colours).astype(np.uint8)
        return add_surface(plotter, surface, scalars="colours", rgb=True)
    return add_surface(plotter, surface, color=BODY)


def _picture_values(
    path: str | Path,
    mesh: Mesh,
    vertices: ArrayLike,
    values: FloatArray,
    title: str,
    scale: tuple[str, float, float],
) -> None:
    path = as_path(path)
    deformed = as_points(vertices, "vertices", mesh.n_vertices)
    surface = _surface(mesh.faces, deformed)
    attributes = surface.point_data if len(values) == mesh.n_vertices else surface.cell_data
    attributes["values"] = values

    def draw(plotter: pv.Plotter) -> None:
        colour_map, low, high = scale
        add_surface(plotter, surface, scalars="values", cmap=colour_map, clim=(low, high))
        plotter.add_scalar_bar(
            " ",  # the panel has the title
            n_labels=5,
            fmt="%.3g",
            color=INK,
            label_font_size=36,
            width=0.7,
            height=0.1,
            position_x=0.15,
            position_y=0.02,
        )

    write_panels(path, [(title, draw)], deformed, view_of(mesh.vertices, deformed), foot=_BAR)


def _values(mesh: Mesh, values: ArrayLike, name: str) -> FloatArray:
    """Return *values* (n,) or (m,), one per vertex or face of *mesh*."""
    require_mesh(mesh)
    array = as_numbers(values, name)
    if array.shape not in ((mesh.n_vertices,), (mesh.n_faces,)) or not np.isfinite(array).all():
        raise ArgumentError(
            f"{name} must be finite, one for each of {mesh.n_vertices} vertices or "
            f"{mesh.n_faces} faces; got shape {array.shape}"
        )
    return array


def _surface(faces: IntArray, vertices: FloatArray) -> pv.PolyData:
    """Return the triangles unchecked, since a picture may show a folded pose."""
    return polydata_of(vertices, np.full(len(faces), 3), faces.ravel())


def _largest(values: FloatArray) -> float:
    """Return the 99th percentile of *values*, rounded up; never 0."""
    size = float(np.percentile(values, 99.0)) if len(values) else 0.0
    if size <= 0.0:
        return 1.0
    unit = 10.0 ** np.floor(np.log10(size))
    return float(unit * np.ceil(10.0 * size / unit) / 10.0)
