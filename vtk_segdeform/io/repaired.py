"""Repair of a surface with polygons and arrays, which are kept where there is no fault.

`repair` works on triangles; its maps lead from each new triangle to an old one, on to the polygon
it was cut from, and from each corner to a corner of that polygon:

    polygon     restored if all its triangles are kept and agree; otherwise left as triangles
    point data  kept; at new vertices interpolated from the border: floats and colours by
                distance, others from the nearest vertex
    cell data   kept; 0 or "" on new faces
    corners     "TextureCorners", two columns per corner, follow the corners; NaN on new faces
    normals     flipped where faces are flipped; computed for new faces

Each loss is reported in a sentence after the steps of the repair.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pyvista as pv

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import counted, normals
from ..mesh_repair import Repair, repair
from ..progress import Progress, part, tell
from .convert import as_polydata
from .polygons import cells_of, cut_into_triangles, polydata_of, polygons_of

_CORNERS = "TextureCorners"
_ATTRIBUTES = ("Scalars", "Vectors", "Normals", "TCoords", "Tensors")


def repair_surface(
    surface: pv.PolyData,
    *,
    weld_distance: float = 0.0,
    largest_hole: int = 100,
    progress: Progress | None = None,
) -> tuple[pv.PolyData, Repair]:
    """Repair *surface* with its polygons and arrays.

    Parameters
    ----------
    surface : pyvista.PolyData
        With any faults; not changed.
    weld_distance, largest_hole, progress
        As in `repair`.

    Returns
    -------
    repaired : pyvista.PolyData
        The original points and polygons in their order, then the new ones.  It is closed only if
        ``done.report.is_closed``.
    done : Repair
        The repair of the triangulated surface; its last steps list the losses.

    Raises
    ------
    MeshError
        As in `repair`.
    """
    surface = as_polydata(surface, "surface")
    counts, corners = polygons_of(surface)
    points = np.asarray(surface.points, dtype=np.float64)
    triangles, polygon = cut_into_triangles(points, counts, corners)
    done = repair(
        points,
        triangles,
        weld_distance=weld_distance,
        largest_hole=largest_hole,
        progress=part(progress, 0.0, 0.9),
    )
    if not done.steps:
        tell(progress, 1.0, "Nothing to repair")
        return surface.copy(deep=True), done
    tell(progress, 0.9, "Restoring polygons and arrays")
    trace = _traced(_Polygons(counts, corners, triangles, polygon), done)
    whole = polydata_of(done.vertices, trace.counts, trace.corners)
    cells = np.append(cells_of(surface), -1)[trace.polygon]  # -1 for lids
    losses = [
        *_lost(surface, trace),
        *_carry_points(surface, whole, done),
        *_carry_cells(surface, whole, trace, cells),
        *_merged_values(surface, trace, done),
    ]
    for name, values in surface.field_data.items():
        whole.field_data[name] = values
    for source, target in (
        (surface.GetPointData(), whole.GetPointData()),
        (surface.GetCellData(), whole.GetCellData()),
    ):
        for attribute in _ATTRIBUTES:
            active = getattr(source, f"Get{attribute}")()
            if active is not None and active.GetName():
                getattr(target, f"SetActive{attribute}")(active.GetName())
    tell(progress, 1.0, "Repaired")
    return whole, replace(done, steps=(*done.steps, *losses))


@dataclass(frozen=True)
class _Polygons:
    """Polygons, as of `polygons_of`, and the triangles they were cut into."""

    counts: IntArray
    corners: IntArray
    triangles: IntArray
    polygon: IntArray

    @cached_property
    def start(self) -> IntArray:
        """(c,) int: the position in `corners` at which each polygon begins."""
        return np.cumsum(self.counts) - self.counts

    @cached_property
    def places(self) -> IntArray:
        """(m, 3) int: the corner of the polygon at each corner of a triangle; -1 if unknown."""
        place = np.full(self.triangles.shape, -1)
        for c in range(int(self.counts.max(initial=0))):
            long = self.counts[self.polygon] > c
            at = np.where(long, self.start[self.polygon] + c, 0)
            here = long[:, None] & (self.corners[at][:, None] == self.triangles)
            place[here & (place < 0)] = c
        return place


@dataclass(frozen=True)
class _Trace:
    """Origin of the new polygons (c) and their corners (s).

    Attributes
    ----------
    counts : (c,) int
        Corners of each new polygon.
    corners, places : (s,) int
        The new vertex at each corner, polygon by polygon, and the index of the corner in its old
        polygon, -1 for new ones.
    polygon : (c,) int
        The old polygon of each new one, -1 if there is none.
    flipped : (c,) bool
        Whether the orientation was flipped.
    n_cut : int
        Number of old polygons with four or more corners that are triangles now.
    old, new : (q,) int
        Old and new vertex of each kept corner, with repetitions.
    """

    counts: IntArray
    corners: IntArray
    places: IntArray
    polygon: IntArray
    flipped: BoolArray
    n_cut: int
    old: IntArray
    new: IntArray


def _traced(given: _Polygons, done: Repair) -> _Trace:
    """Trace faces and corners back to their original polygons."""
    lids = done.faces[done.face_map < 0]
    kept = np.flatnonzero(done.face_map >= 0)
    was, flipped, new = done.face_map[kept], done.face_turned[kept], done.faces[kept]
    places = np.where(flipped[:, None], given.places[was][:, [0, 2, 1]], given.places[was])
    old = np.where(flipped[:, None], given.triangles[was][:, [0, 2, 1]], given.triangles[was])
    polygon = given.polygon[was]
    # The new vertex at each corner of an old polygon; -1 if triangles differ or are missing.
    slots = given.start[polygon][:, None] + places
    at_corner = np.full(len(given.corners), -1)
    at_corner[slots] = new
    at_corner[slots[at_corner[slots] != new]] = -1
    complete = np.minimum.reduceat(at_corner, given.start) >= 0
    n = len(given.counts)
    n_before = np.bincount(given.polygon, minlength=n)
    n_left = np.bincount(polygon, minlength=n)
    n_flipped = np.bincount(polygon, flipped, minlength=n)
    whole = complete & (given.counts > 3) & (n_before == given.counts - 2) & (n_left == n_before)
    whole &= ((n_flipped == 0) | (n_flipped == n_before)) & (given.places >= 0).all()
    first = np.zeros(len(kept), dtype=bool)
    first[np.unique(polygon, return_index=True)[1]] = True
    chosen = np.flatnonzero(first | ~whole[polygon])  # one triangle per polygon kept, else all
    as_polygon = whole[polygon[chosen]]
    counts = np.where(as_polygon, given.counts[polygon[chosen]], 3)
    owner = np.repeat(np.arange(len(chosen)), counts)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    face, in_face = chosen[owner], np.minimum(k, 2)
    forth = np.where(flipped[face], -k % counts[owner], k)
    place = np.where(as_polygon[owner], forth, places[face, in_face])
    slot = np.where(as_polygon[owner], given.start[polygon[face]] + forth, 0)
    corner = np.where(as_polygon[owner], at_corner[slot], new[face, in_face])
    some_left = n_left > 0
    return _Trace(
        np.append(counts, np.full(len(lids), 3)),
        np.append(corner, lids.ravel()),
        np.append(place, np.full(lids.size, -1)),
        np.append(polygon[chosen], np.full(len(lids), -1)),
        np.append(flipped[chosen], np.zeros(len(lids), dtype=bool)),
        int(np.count_nonzero((given.counts > 3) & some_left & ~whole)),
        old.ravel(),
        new.ravel(),
    )


def _lost(surface: pv.PolyData, trace: _Trace) -> Iterator[str]:
    """Yield sentences about cells that were converted or removed."""
    if trace.n_cut:
        polygons = counted(trace.n_cut, "polygon", "polygons")
        yield f"cut {polygons} into triangles where the repair changed a part"
    if surface.n_verts:
        yield f"remove {counted(surface.n_verts, 'vertex cell', 'vertex cells')}"
    if surface.n_lines:
        yield f"remove {counted(surface.n_lines, 'line', 'lines')}"
    if surface.n_strips:
        yield f"cut {counted(surface.n_strips, 'strip', 'strips')} into triangles"


def _carry_points(surface: pv.PolyData, whole: pv.PolyData, done: Repair) -> Iterator[str]:
    """Add the point arrays to *whole*, interpolated at new vertices."""
    new = np.flatnonzero(done.vertex_map < 0)
    weights = done.vertex_weights[new]
    nearest = np.zeros(len(new), dtype=np.int64)
    for row in range(len(new)):
        some = slice(weights.indptr[row], weights.indptr[row + 1])
        nearest[row] = weights.indices[some][weights.data[some].argmax()]
    flipped = _flipped_vertices(done)
    for name, values in surface.point_data.items():
        array = np.asarray(values)
        carried = array[done.vertex_map]
        carried[new] = array[nearest]
        if len(new) and (array.dtype.kind == "f" or array.dtype == np.uint8):
            used = np.unique(weights.indices)
            blend = weights[:, used] @ array[used].reshape(len(used), -1).astype(np.float64)
            blend = blend.reshape(len(new), *array.shape[1:])
            carried[new] = blend if array.dtype.kind == "f" else np.rint(blend)
        if name in _normal_arrays(surface.point_data):
            length = np.linalg.norm(carried[new], axis=1, keepdims=True)
            carried[new] /= np.where(length > 0.0, length, 1.0)
            carried[flipped] *= -1
        whole.point_data[name] = carried
    if len(new) and len(surface.point_data.keys()):
        names = ", ".join(surface.point_data.keys())
        vertices = counted(len(new), "new vertex", "new vertices")
        yield f"interpolate point data ({names}) at {vertices}"


def _flipped_vertices(done: Repair) -> BoolArray:
    """Return which vertices have only flipped faces, apart from new ones, (n,) bool."""
    kept = done.face_map >= 0
    count = np.bincount(done.faces[kept].ravel(), minlength=len(done.vertices))
    flipped = np.bincount(done.faces[kept & done.face_turned].ravel(), minlength=len(done.vertices))
    return np.asarray((flipped == count) & (count > 0))


def _carry_cells(
    surface: pv.PolyData, whole: pv.PolyData, trace: _Trace, cells: IntArray
) -> Iterator[str]:
    """Add the cell arrays to *whole*, zero on new faces."""
    new = cells < 0
    for name, values in surface.cell_data.items():
        array = np.asarray(values)
        carried = array[cells]
        if name == _CORNERS and array.ndim == 2:
            carried = _corner_array(array, trace, cells)
        elif name in _normal_arrays(surface.cell_data):
            carried[trace.flipped] *= -1
            carried[new] = _lid_normals(whole, trace, new)
        else:
            carried[new] = "" if array.dtype.kind in "US" else 0
        whole.cell_data[name] = carried
    names = [
        name
        for name, _ in surface.cell_data.items()
        if name not in _normal_arrays(surface.cell_data)
    ]
    if new.any() and names:
        faces = counted(int(new.sum()), "new face", "new faces")
        yield f"leave cell data ({', '.join(names)}) empty on {faces}"


def _corner_array(array: Any, trace: _Trace, cells: IntArray) -> Any:
    """Return per-corner values, two columns each, in the order of the new corners."""
    wide = array.reshape(len(array), -1, 2)
    carried = np.full((len(cells), *wide.shape[1:]), np.nan, dtype=array.dtype)
    owner = np.repeat(np.arange(len(cells)), trace.counts)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(trace.counts) - trace.counts, trace.counts)
    known = (trace.places >= 0) & (trace.places < wide.shape[1]) & (k < wide.shape[1])
    carried[owner[known], k[known]] = wide[cells[owner[known]], trace.places[known]]
    return carried.reshape(len(cells), -1)


def _lid_normals(whole: pv.PolyData, trace: _Trace, new: BoolArray) -> FloatArray:
    """Return the unit normals of the new faces; these are triangles and come last."""
    count = int(np.count_nonzero(new))
    faces = trace.corners[len(trace.corners) - 3 * count :].reshape(-1, 3)
    up = normals(np.asarray(whole.points)[faces])
    length = np.linalg.norm(up, axis=1, keepdims=True)
    return np.asarray(up / np.where(length > 0.0, length, 1.0))


def _normal_arrays(attributes: Any) -> set[str]:
    """Return the names of the arrays of normals."""
    return {"Normals", attributes.active_normals_name} & set(attributes.keys())


def _merged_values(surface: pv.PolyData, trace: _Trace, done: Repair) -> Iterator[str]:
    """Yield sentences about welded vertices with different values, of which one is kept."""
    for name, values in surface.point_data.items():
        array = np.asarray(values)
        array = array.reshape(len(array), -1)
        old, kept = array[trace.old], array[done.vertex_map[trace.new]]
        same = old == kept
        if array.dtype.kind == "f":
            same |= np.isnan(old) & np.isnan(kept)
        count = len(np.unique(trace.new[~same.all(axis=1)]))
        if count:
            vertices = counted(count, "welded vertex", "welded vertices")
            yield f"keep one of several values of {name} at {vertices}"
