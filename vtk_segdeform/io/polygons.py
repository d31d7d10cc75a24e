"""Polygons as two flat arrays, and their conversion from and to pyvista's PolyData.

counts[k] is the number of corners of polygon k; corners has the vertex indices of one polygon after
another.  Triangles are polygons with counts of 3.  Files also have polygons of one or two corners,
which are kept as they are given.

Long because the compiled passes that cut polygons have their equivalents in numpy beside them.
"""

from __future__ import annotations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter

from ..arrays import BoolArray, FloatArray, IntArray
from ..errors import MeshError
from ..freezing import read_only
from ..kernels import compiled_checks, inputs
from ..mesh import cross_rows, first_equal_row, normals, repeats_vertex, row_hashes
from ..mesh_repair import triangulate_long_loop

_PLANAR = 1e-6  # height over size
_DOWN = -1e-9  # cosine of the normal of a triangle that is upside down, times its share of the area
_NO_COUNTS: IntArray = np.empty(0, dtype=np.int64)
# Of quads: VTK's filter takes a corner so near the diagonal beside it for one on it, at 1e-6.
_LEAST_HEIGHT = 1e-5  # in the unit of the points
_LEAST_SINE = 1e-3  # of the corners of a convex polygon
_MOST_CORNERS = 24
_NOT_CUT, _OF_EQUAL_LENGTH = -1, 2
_CORNERS_OF_CUTS = np.array([[0, 1, 2, 0, 2, 3], *[[0, 1, 3, 1, 2, 3]] * 2])


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

    Convex polygons are cut along their shortest diagonals, others by ear clipping, planar ones
    without overlaps.  Where that fails, as for one that touches or crosses itself, the
    triangulation has the least area.  A polygon that is given again, in either direction, is cut
    like the first one.  Polygons of one or two corners have no triangles.
    """
    if len(counts) and counts.min() < 3:
        enough = counts >= 3
        kept = counts[enough], corners[np.repeat(enough, counts)]
        faces, polygon = cut_into_triangles(points, *kept)
        return faces, np.flatnonzero(enough)[polygon]
    number = np.arange(len(counts))
    if (counts == 3).all():
        return corners.reshape(-1, 3), number
    n_triangles, starts = counts - 2, np.cumsum(counts) - counts
    faces, first = np.empty((int(n_triangles.sum()), 3), np.int64), np.cumsum(n_triangles)
    first -= n_triangles
    is_cut = counts == 3
    faces[first[is_cut]] = _rows(corners, starts[is_cut], 3)
    quads = np.flatnonzero(counts == 4)
    of_quads = _rows(corners, starts[quads], 4)
    cut = _quad_cuts(points, of_quads)
    _put_halves(faces, first[quads], of_quads, cut)
    is_cut[quads] = cut != _NOT_CUT
    is_cut |= _convex_cuts(faces, points, counts, corners)
    polygon, others = np.repeat(number, n_triangles), np.flatnonzero(~is_cut)
    if len(others):
        clipped, owner = _clipped(points, counts[others], corners[np.repeat(~is_cut, counts)])
        n_clipped = np.bincount(owner, minlength=len(others))
        if (n_clipped != n_triangles[others]).any():
            kept = faces[is_cut[polygon]]
            n_triangles[others] = n_clipped
            polygon = np.repeat(number, n_triangles)
            faces = np.empty((len(polygon), 3), dtype=np.int64)
            faces[is_cut[polygon]] = kept
        faces[np.flatnonzero(np.repeat(~is_cut, n_triangles))] = clipped
    is_other = counts > 3
    is_other[quads] = (cut == _NOT_CUT) | (cut == _OF_EQUAL_LENGTH)
    some = np.flatnonzero(is_other & (n_triangles == counts - 2))
    if len(some):  # other quads have the same shorter diagonal in any case
        sums = np.add.reduceat(row_hashes(points)[corners], starts)[some]
        ordered = np.sort(sums)
        some = some[np.isin(sums, ordered[1:][ordered[1:] == ordered[:-1]])]  # few, if any
    if len(some):
        place = first_equal_row(points)
        for size in np.unique(counts[some]):
            alike = some[counts[some] == size]
            _cut_alike(faces, polygon, alike, _rows(corners, starts[alike], size), place)
    return faces, polygon


def _rows(corners: IntArray, starts: IntArray, size: int) -> IntArray:
    """Return the *corners* of polygons of *size* corners, (k, size)."""
    if len(starts) * size == len(corners):
        return corners.reshape(-1, size)
    rows: IntArray = corners[starts[:, None] + np.arange(size)]
    return rows


def _quad_cuts(points: FloatArray, quads: IntArray) -> NDArray[np.int8]:
    """Return along which diagonal to cut each of *quads* (q, 4): 0 or 1, from that corner.

    2, _OF_EQUAL_LENGTH, is 1 as well.  -1, _NOT_CUT, if a quad is not convex, which is so if the
    normals at two corners are not on the same side, or a corner is near the diagonal beside it.
    This is what VTK's filter does, and the same from any first corner and in both directions.
    """
    cut = np.empty(len(quads), dtype=np.int8)
    if kernels := compiled_checks(len(quads)):
        kernels.quad_cuts(cut, _LEAST_HEIGHT**2, *inputs(points, quads))
        return cut
    with np.errstate(invalid="ignore", over="ignore"):
        p = [points[corner] for corner in quads.T]
        up = [cross_rows(p[(k + 1) % 4] - p[k], p[k - 1] - p[k]) for k in range(4)]
        first, second = (_dot(p[k] - p[k + 2], p[k] - p[k + 2]) for k in range(2))
        least = _LEAST_HEIGHT**2 * np.maximum(first, second)
        convex = np.ones(len(quads), dtype=bool)
        for k in range(4):
            convex &= _dot(up[k], up[k]) >= least
            for j in range(k):
                convex &= _dot(up[j], up[k]) > 0.0
        cut[:] = np.where(first < second, 0, np.where(first == second, _OF_EQUAL_LENGTH, 1))
    cut[~convex] = _NOT_CUT
    return cut


def _put_halves(faces: IntArray, first: IntArray, quads: IntArray, cut: NDArray[np.int8]) -> None:
    """Put the two triangles of each of *quads* (q, 4) that is *cut* (q,) into *faces*."""
    if kernels := compiled_checks(len(quads)):
        kernels.quad_halves(faces, *inputs(first, quads, cut))
        return
    is_cut = cut != _NOT_CUT
    two = np.take_along_axis(quads[is_cut], _CORNERS_OF_CUTS[cut[is_cut]], axis=1)
    for k in range(2):
        faces[first[is_cut] + k] = two[:, 3 * k : 3 * k + 3]


def _dot(u: FloatArray, v: FloatArray) -> FloatArray:
    """Return the dot products of the rows of *u* and *v*, (k,) float."""
    x, y, z = (u * v).T
    return np.asarray((x + y) + z)


def _convex_cuts(
    faces: IntArray, points: FloatArray, counts: IntArray, corners: IntArray
) -> BoolArray:
    """Return which polygons are convex, and put their triangles into *faces*.

    Polygon q has ``counts[q] - 2`` rows there.  The ear with the shortest diagonal is cut first.
    Quads are none, see `_quad_cuts`, and neither are polygons of many corners.
    """
    is_cut = np.zeros(len(counts), dtype=bool)
    some = np.flatnonzero((counts > 4) & (counts <= _MOST_CORNERS))
    starts, first = np.cumsum(counts) - counts, np.cumsum(counts - 2) - (counts - 2)
    if len(some) and (kernels := compiled_checks(len(corners))):
        found = np.zeros(len(some), dtype=bool)
        given = inputs(points, first[some], starts[some], counts[some], corners)
        kernels.convex_cuts(faces, found, _LEAST_SINE**2, *given)
        is_cut[some] = found
        return is_cut
    for size in np.unique(counts[some]):
        alike = np.flatnonzero(counts == size)
        polygons = corners[starts[alike, None] + np.arange(size)]
        with np.errstate(invalid="ignore", over="ignore"):
            spokes = np.ascontiguousarray((points[polygons] - points[polygons[:, :1]]).T)
            is_convex = _are_convex(spokes)
        alike = alike[is_convex]
        cut = _ears_of_convex(spokes[:, :, is_convex])
        at = first[alike][:, None] + np.arange(size - 2)
        faces[at] = np.take_along_axis(polygons[is_convex], cut, axis=1).reshape(-1, size - 2, 3)
        is_cut[alike] = True
    return is_cut


def _are_convex(spokes: FloatArray) -> BoolArray:
    """Return which polygons are convex, with no corner nearly flat.

    *spokes* (3, s, q) are their corners relative to the first ones.
    """
    size = spokes.shape[1]
    corner = [spokes[:, k] for k in range(size)]
    fan = [_cross(corner[k], corner[k + 1]) for k in range(1, size - 1)]
    up = sum(fan[1:], fan[0])
    convex = np.ones(spokes.shape[2], dtype=bool)
    for each in fan:
        convex &= _inner(each, up) > 0.0
    square = _inner(up, up)
    for k in range(size):
        after, before = corner[(k + 1) % size] - corner[k], corner[k - 1] - corner[k]
        height = _inner(_cross(after, before), up)
        lengths = _inner(after, after) * _inner(before, before)
        convex &= (height > 0.0) & (height * height >= _LEAST_SINE**2 * (square * lengths))
    return convex


def _ears_of_convex(spokes: FloatArray) -> IntArray:
    """Return the corners (q, 3 (s - 2)) of the triangles of convex polygons, 0 to s - 1."""
    places = list(spokes.transpose(1, 0, 2))
    ring = list(np.indices(spokes.shape[1:])[0])
    cut = []
    while (left := len(ring)) > 3:
        ends = [places[(k + 1) % left] - places[k - 1] for k in range(left)]
        ear = np.argmin([_inner(step, step) for step in ends], axis=0)
        cut += [np.choose((ear + k) % left, ring) for k in (-1, 0, 1)]
        for kept in range(left - 1):
            is_after = ear <= kept
            ring[kept] = np.where(is_after, ring[kept + 1], ring[kept])
            places[kept] = np.where(is_after, places[kept + 1], places[kept])
        del ring[-1], places[-1]
    return np.column_stack([*cut, *ring])


def _cross(u: FloatArray, v: FloatArray) -> FloatArray:
    return np.stack([u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)])


def _inner(u: FloatArray, v: FloatArray) -> FloatArray:
    x, y, z = u * v
    return np.asarray((x + y) + z)


def _clipped(points: FloatArray, counts: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Return the triangles of polygons by ear clipping, or the least area where that fails."""
    if not len(counts):
        return np.empty((0, 3), dtype=np.int64), _NO_COUNTS
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
    starts = np.cumsum(counts) - counts
    if kernels := compiled_checks(len(corners)):
        found = np.zeros(len(counts), dtype=bool)
        given = inputs(points, starts, counts, corners, faces, polygon)
        kernels.wrongly_cut(found, _DOWN, _PLANAR, *given)
        return np.flatnonzero(found)
    following = np.arange(1, len(corners) + 1)
    following[starts + counts - 1] = starts
    repeated = np.add.reduceat(corners == corners[following], starts)
    failed = np.bincount(polygon, minlength=len(counts)) < counts - repeated - 2
    with np.errstate(invalid="ignore", over="ignore"):
        spoke = points[corners] - np.repeat(points[corners[starts]], counts, axis=0)
        up = np.add.reduceat(np.cross(spoke, spoke[following]), starts)
        cosine = np.einsum("fx,fx->f", normals(points[faces]), up[polygon])
        square = np.einsum("cx,cx->c", up, up)
        down = np.unique(polygon[cosine < _DOWN * square[polygon]])
        for each in down:
            spokes = spoke[starts[each] :][: counts[each]]
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
