"""Polygons as two flat arrays, and their conversion from and to pyvista's PolyData.

counts[k] is the number of corners of polygon k; corners has the vertex indices of one polygon after
another.  Triangles are polygons with counts of 3.  Files also have polygons of one or two corners,
which are kept as they are given.
"""

from __future__ import annotations

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from ..arrays import FloatArray, IntArray
from ..errors import MeshError
from ..freezing import read_only
from ..mesh import cross_rows, first_equal_row, repeats_vertex, row_hashes
from ..mesh_repair import triangulate_long_loop

_PLANAR = 1e-6  # height over size
_DOWN = -1e-9  # cosine of the normal of a triangle that is upside down, times its share of the area


def polydata_of(points: FloatArray, counts: IntArray, corners: IntArray) -> pv.PolyData:
    """Return a surface with float64 *points* (n, 3) and the given polygons, in their order.

    NaN is allowed here; `find_faults` reports it.

    Raises
    ------
    MeshError
        If a vertex index is out of range.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    _require_points(len(points), corners)
    surface = pv.PolyData()
    surface.points = points
    # With offsets even for triangles alone: VTK's coordinates are wrong on cells of a fixed size.
    offsets = np.zeros(len(counts) + 1, dtype=np.int64)
    np.cumsum(counts, out=offsets[1:])
    surface.SetPolys(pv.CellArray.from_arrays(offsets, np.array(corners, dtype=np.int64)))
    return surface


def _require_points(n_points: int, corners: IntArray) -> None:
    if len(corners) and (corners.min() < 0 or corners.max() >= n_points):
        raise MeshError(
            f"faces use vertices {corners.min()} to {corners.max()}, but there are {n_points}; "
            "number vertices from 0, and pass all of them"
        )


def polygons_of(polydata: pv.PolyData) -> tuple[IntArray, IntArray]:
    """Return (counts, corners) of the polygons, in order, then of the triangles of strips.

    Raises
    ------
    MeshError
        If a vertex index is out of range.
    """
    result = _all_polygons(polydata)
    _require_points(polydata.n_points, result[1])
    return result


def _all_polygons(polydata: pv.PolyData) -> tuple[IntArray, IntArray]:
    cells = polydata.GetPolys()
    starts = pv.convert_array(cells.GetOffsetsArray()).astype(np.int64)
    counts, corners = [np.diff(starts)], [pv.convert_array(cells.GetConnectivityArray())]
    strips = polydata.strips
    while len(strips):
        strip, strips = strips[1 : strips[0] + 1], strips[strips[0] + 1 :]
        triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=-1)
        triangles[1::2] = triangles[1::2, [1, 0, 2]]  # every other triangle is reversed
        counts.append(np.full(len(triangles), 3))
        corners.append(triangles.ravel())
    return np.concatenate(counts).astype(np.int64), np.concatenate(corners).astype(np.int64)


def unstripped(lengths: IntArray, values: IntArray) -> IntArray:
    """Return the triangles of strips, (m, 3), oriented like the first of each strip.

    Degenerate triangles, which only connect parts of a strip, are omitted.
    """
    values = np.insert(values, np.cumsum(lengths), -1)  # after each strip
    number = np.arange(len(values))
    begun = np.maximum.accumulate(np.where(values == -1, number + 1, 0))  # start of its strip
    triangles = np.stack([values[:-2], values[1:-1], values[2:]], axis=-1)
    odd = (number - begun)[:-2] % 2 == 1
    triangles[odd] = triangles[odd][:, [1, 0, 2]]
    a, b, c = triangles.T
    whole: IntArray = triangles[(triangles != -1).all(axis=1) & (a != b) & (b != c) & (c != a)]
    return whole


def cells_of(polydata: pv.PolyData) -> IntArray:
    """Return the cell index of each polygon of `polygons_of`, its row in the cell data."""
    lengths = []
    strips = polydata.strips
    while len(strips):
        lengths.append(int(strips[0]) - 2)
        strips = strips[strips[0] + 1 :]
    times = np.concatenate([np.ones(polydata.GetNumberOfPolys()), lengths]).astype(np.int64)
    first = polydata.GetNumberOfVerts() + polydata.GetNumberOfLines()  # VTK's order of cells
    cells: IntArray = first + np.repeat(np.arange(len(times)), times)
    return cells


def drawn_cells(
    data: pv.PolyData | pv.UnstructuredGrid,
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return points (k, 3), triangles (m, 3) and the edges (e, 2) of lines; of a grid its surface.

    Raises
    ------
    MeshError
        If a vertex index is out of range.
    """
    if isinstance(data, pv.UnstructuredGrid):
        surface = vtkGeometryFilter()
        surface.SetInputData(data)
        surface.Update()
        data = pv.wrap(surface.GetOutput())
    lines = data.GetLines()
    corners = pv.convert_array(lines.GetConnectivityArray()).astype(np.int64)
    _require_points(data.n_points, corners)
    is_edge = np.ones(len(corners), dtype=bool)
    is_edge[pv.convert_array(lines.GetOffsetsArray())[1:] - 1] = False
    edges = np.stack([corners, np.roll(corners, -1)], axis=1)[is_edge]
    return np.asarray(data.points, dtype=np.float64), triangles_of(data), edges


def texture_of(surface: pv.PolyData) -> tuple[str, FloatArray] | None:
    """Return the name of the active texture coordinates and these (n, 2), or None.

    v begins at the bottom, as in all formats but glTF, of which arrays keep their names.
    """
    values = surface.active_texture_coordinates
    if values is None or values.ndim != 2 or values.shape[1] < 2:
        return None
    name = str(surface.point_data.active_texture_coordinates_name)
    pairs = np.array(values[:, :2], dtype="f4" if values.dtype == np.float32 else "f8")
    if name.startswith("TEXCOORD_"):
        pairs[:, 1] = 1.0 - pairs[:, 1]
    return name, pairs


def padded_corners(counts: IntArray, values: FloatArray) -> FloatArray:
    """Return *values* (k, w) per corner as rows (m, w * most corners), padded with NaN."""
    most, width = int(counts.max(initial=0)), values.shape[1]
    wide = np.full((len(counts), most, width), np.nan)
    wide[np.arange(most) < counts[:, None]] = values
    return wide.reshape(len(counts), width * most)


def corner_values(wide: FloatArray | None, counts: IntArray, width: int = 2) -> FloatArray | None:
    """Return the inverse of `padded_corners`, (k, *width*); None if it does not fit *counts*."""
    if wide is None or wide.ndim != 2 or wide.dtype.kind != "f" or wide.shape[1] % width:
        return None
    most = wide.shape[1] // width
    if len(wide) != len(counts) or most < counts.max(initial=0):
        return None
    each: FloatArray = wide.reshape(len(counts), most, width)[np.arange(most) < counts[:, None]]
    return each


def triangles_of(polydata: pv.PolyData) -> IntArray:
    """Return triangles (m, 3) over the same points, polygon by polygon; see `cut_into_triangles`.

    Raises
    ------
    MeshError
        If a vertex index is out of range.
    """
    cells = polydata.GetPolys()
    if cells.IsHomogeneous() == 3 and not polydata.GetNumberOfStrips():  # the most common case
        corners = np.asarray(pv.convert_array(cells.GetConnectivityArray()), dtype=np.int64)
        _require_points(polydata.n_points, corners)
        return read_only(corners.reshape(-1, 3))
    counts, corners = _all_polygons(polydata)
    _require_points(polydata.n_points, corners)
    return cut_into_triangles(np.asarray(polydata.points, float), counts, corners)[0]


def cut_into_triangles(
    points: FloatArray, counts: IntArray, corners: IntArray
) -> tuple[IntArray, IntArray]:
    """Return triangles (m, 3), and the polygon of each, (m,) int, in the order of polygons.

    VTK cuts quads along their shorter diagonals and clips the ears of other polygons, planar ones
    without overlaps.  Where that fails, as for one that touches or crosses itself, the
    triangulation has the least area.  A polygon that is given again, in either direction, is cut
    like the first one.  Polygons of one or two corners have no triangles.
    """
    if len(counts) and counts.min() < 3:
        enough = counts >= 3
        kept = counts[enough], corners[np.repeat(enough, counts)]
        faces, polygon = cut_into_triangles(points, *kept)
        return faces, np.flatnonzero(enough)[polygon]
    if (counts == 3).all():
        return corners.reshape(-1, 3), np.arange(len(counts))
    faces, polygon = _clipped(points, counts, corners)
    starts = np.cumsum(counts) - counts
    n_triangles = np.bincount(polygon, minlength=len(counts))
    some = np.flatnonzero((counts > 3) & (n_triangles == counts - 2))
    if len(some):
        hashes = row_hashes(points)
        hashes *= hashes >> np.uint64(32) | np.uint64(1)  # else sums are equal where signs differ
        sums = np.add.reduceat(hashes[corners], starts)[some]
        ordered = np.sort(sums)
        repeated = ordered[1:][ordered[1:] == ordered[:-1]]
        some = some[np.isin(sums, repeated)] if len(repeated) else some[:0]
    if len(some):
        place = first_equal_row(points)
        for size in np.unique(counts[some]):
            alike = some[counts[some] == size]
            rows = corners[starts[alike, None] + np.arange(size)]
            _cut_alike(faces, polygon, alike, rows, place)
    return faces, polygon


def _clipped(points: FloatArray, counts: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Return the triangles of polygons by ear clipping, or the least area where that fails."""
    faces, polygon = _clipped_ears(points, counts, corners)
    failed = _failed(points, counts, corners, faces, polygon)
    if not len(failed):
        return faces, polygon
    starts = np.cumsum(counts) - counts
    kept = ~np.isin(polygon, failed)
    parts, owners = [faces[kept]], [polygon[kept]]
    for each in failed:
        parts.append(_cut_alone(points, corners[starts[each] :][: counts[each]]))
        owners.append(np.full(len(parts[-1]), each))
    faces, polygon = np.concatenate(parts), np.concatenate(owners)
    order = np.argsort(polygon, kind="stable")
    return faces[order], polygon[order]


def _cut_alike(
    faces: IntArray, polygon: IntArray, some: IntArray, corners: IntArray, place: IntArray
) -> None:
    """Replace the triangles of polygons that repeat an earlier one of *some* (q,), cut like it.

    *corners* (q, s) are their corners; points (n,) of equal *place* are at the same position.
    """
    at = place[corners]
    ordered = np.sort(at, axis=1)
    first = first_equal_row(ordered)
    again = np.flatnonzero(
        (first != np.arange(len(some))) & (np.diff(ordered, axis=1) > 0).all(axis=1)
    )
    first = first[again]
    size = at.shape[1]
    one = (at[again] == at[first, :1]).argmax(axis=1)[:, None]  # where the earlier one begins
    forth, back = (
        (np.take_along_axis(at[again], (one + step) % size, axis=1) == at[first]).all(axis=1)
        for step in (np.arange(size), -np.arange(size))
    )
    known = forth | back
    again, first, forth = again[known], first[known], forth[known]
    rows = np.searchsorted(polygon, some)[:, None] + np.arange(size - 2)
    like = place[faces[rows[first]]]  # (r, s - 2, 3)
    corner = (like[..., None] == at[again][:, None, None]).argmax(axis=-1)
    cut = corners[again][np.arange(len(again))[:, None, None], corner]
    faces[rows[again]] = np.where(forth[:, None, None], cut, cut[:, :, ::-1])


def _clipped_ears(
    points: FloatArray, counts: IntArray, corners: IntArray
) -> tuple[IntArray, IntArray]:
    """Return what VTK finds; it leaves out some polygons and parts of others."""
    _require_points(len(points), corners)
    places, cells = vtkPoints(), vtkCellArray()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points)))
    offsets = np.append(0, np.cumsum(counts))
    cells.SetData(numpy_to_vtkIdTypeArray(offsets), numpy_to_vtkIdTypeArray(corners))
    surface = vtkPolyData()
    surface.SetPoints(places)
    surface.SetPolys(cells)
    polygon = numpy_to_vtk(np.arange(len(counts)))
    polygon.SetName("polygon")
    surface.GetCellData().AddArray(polygon)
    tool = vtkTriangleFilter()  # for small surfaces twice as fast as pyvista's filter
    tool.SetInputData(surface)
    tool.Update()
    cut = tool.GetOutput()
    faces = vtk_to_numpy(cut.GetPolys().GetConnectivityArray()).astype(np.int64).reshape(-1, 3)
    return faces, vtk_to_numpy(cut.GetCellData().GetArray("polygon")).astype(np.int64)


def _failed(
    points: FloatArray, counts: IntArray, corners: IntArray, faces: IntArray, polygon: IntArray
) -> IntArray:
    """Return the polygons with too few triangles, or planar with one of them upside down, (k,)."""
    n_triangles = np.bincount(polygon, minlength=len(counts))
    failed = np.zeros(len(counts), dtype=bool)
    starts = np.cumsum(counts) - counts
    for each in np.flatnonzero(n_triangles < counts - 2):
        ring = corners[starts[each] :][: counts[each]]
        n_repeated = np.count_nonzero(ring == np.roll(ring, 1))
        failed[each] = n_triangles[each] < counts[each] - n_repeated - 2
    with np.errstate(invalid="ignore", over="ignore"):
        a, b, c = (points.take(corner, axis=0) for corner in faces.T.copy())
        normal = cross_rows(b - a, c - a)
        up = np.stack([np.bincount(polygon, x, len(counts)) for x in normal.T], axis=1)
        cosine = np.einsum("fx,fx->f", normal, up[polygon])
        square = np.einsum("cx,cx->c", up, up)
        for each in np.unique(polygon[cosine < _DOWN * square[polygon]]):
            around = points[corners[starts[each] :][: counts[each]]]
            spokes = around - around[0]
            height = np.abs(spokes @ up[each]).max()
            failed[each] |= height <= _PLANAR * np.sqrt(square[each]) * np.abs(spokes).max()
    return np.flatnonzero(failed)


def _cut_alone(points: FloatArray, polygon: IntArray) -> IntArray:
    """Return the triangles of a *polygon*, at the size that VTK's tolerances are made for."""
    corners = points[polygon]
    one, number = np.array([len(polygon)]), np.arange(len(polygon))
    if np.isfinite(corners).all():
        corners = corners - corners[0]
        corners /= np.abs(corners).max() or 1.0
        faces, owner = _clipped_ears(corners, one, number)
        if not len(_failed(corners, one, number, faces, owner)):
            return polygon[faces]
    return _least_area(points, polygon)


def _least_area(points: FloatArray, polygon: IntArray) -> IntArray:
    """Triangulate a *polygon*; its repeated corners are skipped."""
    corners = polygon[polygon != np.roll(polygon, -1)]
    if len(corners) < 3:
        return np.empty((0, 3), dtype=np.int64)
    triangles: IntArray = corners[triangulate_long_loop(points[corners])]
    return triangles[~repeats_vertex(triangles)]


def rows(counts: IntArray, corners: IntArray) -> list[list[int]]:
    """Return the polygons as lists, for a writer."""
    if not len(counts):
        return []
    if (counts == counts[0]).all():
        equal: list[list[int]] = corners.reshape(len(counts), -1).tolist()
        return equal
    return [part.tolist() for part in np.split(corners, np.cumsum(counts)[:-1])]
