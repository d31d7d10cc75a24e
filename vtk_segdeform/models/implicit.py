"""Closed mesh with exactly n vertices of a surface f(x) = 0, and f for bodies with limbs.

f is approximately a signed distance: negative inside, with a slope near 1.  The steps:

    contour     level set 0 of f on a grid, whose spacing gives slightly fewer than n vertices
    split       split the longest edges until there are n vertices
    relax       flip edges, relax the vertices, project them to the surface; repeat
    refine      for large n: compute a mesh of n / 4, divide each triangle into four, project

A `Limb` is a tube about a curve c(s), with radius r(s) and k ribs of relative height a,

    f(x) = |x - c(s)| - r(s) (1 - a + a (1 + cos k phi))

where c(s) is the point of the curve nearest to x and phi the angle about the curve.  The smooth
minimum joins several limbs to one body, rounded where two distances are nearly equal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

from ..arrays import FloatArray, IntArray
from ..errors import ArgumentError
from ..mesh import Mesh, components
from .remeshing import Field, flip, refine, relax, split_to, vertex_normals

_FAR = 0.1  # upper limit of a limb's distance, which saves computing larger ones
_LARGEST_CONTOUR = 20_000  # vertices; for more, refining is faster and equally good
_ROUNDS = 12  # of relaxation; later ones do not improve the least angle


@dataclass(frozen=True)
class Limb:
    """A round, ribbed, tapering tube along a smooth curve; a function that returns the distance.

    Parameters
    ----------
    points : sequence of (x, y, z)
        Points on the curve.  Ribs start at the y axis around the curve.
    radii : sequence of float
        Radius of the tube at each point.
    ribs : int
        Number of ribs.
    height : float
        Height of the ribs, relative to the radius.
    """

    points: Sequence[tuple[float, float, float]]
    radii: Sequence[float]
    ribs: int = 0
    height: float = 0.0

    def __call__(self, x: FloatArray) -> FloatArray:
        """Return the approximate signed distance of the points *x* (n, 3), limited to 0.1, (n,)."""
        centre, tangent, radius, tree = self._curve
        reach = _FAR + 1.3 * max(self.radii)
        low, high = centre.min(axis=0) - reach, centre.max(axis=0) + reach
        near = np.flatnonzero(((x > low) & (x < high)).all(axis=1))
        distance, k = tree.query(x[near], distance_upper_bound=reach)
        near, k = near[np.isfinite(distance)], np.asarray(k)[np.isfinite(distance)]
        t, offset = tangent[k], x[near] - centre[k]
        along = np.einsum("ij,ij->i", offset, t)
        between = (k > 0) & (k < len(centre) - 1)  # otherwise in the round cap of an end
        offset -= np.where(between, along, 0.0)[:, None] * t
        d = np.linalg.norm(offset, axis=1)
        r = radius[k]
        if self.ribs:
            side = np.cross([0.0, 1.0, 0.0], t)
            phi = np.arctan2(offset[:, 1], np.einsum("ij,ij->i", offset, side))
            fade = np.where(between, 1.0, 1.0 - (along / np.maximum(d, 1e-12)) ** 2)
            r = r * (1.0 - self.height + self.height * fade * (1.0 + np.cos(self.ribs * phi)))
        value = np.full(len(x), _FAR)
        value[near] = np.minimum(d - r, _FAR)
        return value

    @cached_property
    def _curve(self) -> tuple[FloatArray, FloatArray, FloatArray, cKDTree]:
        """400 points of the curve with unit tangents, radii, and a search tree."""
        points = np.asarray(self.points, dtype=float)
        knots = np.insert(np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)), 0, 0.0)
        s = np.linspace(0.0, knots[-1], 400)
        spline = make_interp_spline(knots, points, k=min(3, len(points) - 1))
        tangent = spline(s, nu=1)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        centre = spline(s)
        return centre, tangent, PchipInterpolator(knots, self.radii)(s), cKDTree(centre)


def standing_body(limbs: Sequence[Limb], n_vertices: int, *, blend: float) -> Mesh:
    """Return the union of *limbs* as one body, cut at z = 0 and scaled to height 1.

    *blend* is the width of the transition between two limbs, in their unit.
    """

    def field(x: FloatArray) -> FloatArray:
        value = limbs[0](x)
        for limb in limbs[1:]:
            value = _smooth_minimum(value, limb(x), blend)
        return -_smooth_minimum(-value, x[:, 2], 0.02)

    points = np.concatenate([np.asarray(limb.points, dtype=float) for limb in limbs])
    reach = 1.2 * max(max(limb.radii) for limb in limbs)
    box = np.stack([points.min(axis=0) - reach, points.max(axis=0) + reach])
    box[0, 2] = 0.0
    mesh = implicit_surface(field, box, n_vertices)
    low, high = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    return mesh.with_vertices((mesh.vertices - [0.0, 0.0, low]) / (high - low))


def implicit_surface(field: Field, box: FloatArray, n_vertices: int) -> Mesh:
    """Return a mesh of *n_vertices* vertices on the surface where *field* is 0.

    Parameters
    ----------
    field : function of (n, 3) float points, returning (n,) float
        Approximately a signed distance, negative inside.  If the surface has several components,
        the largest is used.
    box : (2, 3) float
        Lower and upper corner of a box around the surface.
    n_vertices : int
        Number of vertices; enough for a few edges around the thinnest part.

    Returns
    -------
    mesh : Mesh

    Raises
    ------
    ValueError
        If *n_vertices* is too small for the shape.
    """
    if n_vertices > _LARGEST_CONTOUR:
        coarse = implicit_surface(field, box, n_vertices // 4)
        vertices, faces = split_to(*refine(coarse.vertices, coarse.faces), n_vertices)
        return Mesh(_projected(vertices, faces, field), faces)
    vertices, faces = split_to(*_contour_below(field, box, n_vertices), n_vertices)
    for _ in range(_ROUNDS):
        faces = flip(vertices, faces)
        vertices = _projected(relax(vertices, faces), faces, field)
    return Mesh(vertices, flip(vertices, faces, field))


def _contour_below(field: Field, box: FloatArray, n: int) -> tuple[FloatArray, IntArray]:
    """Return a contour with at most, and nearly, *n* vertices; n grows with 1 / spacing^2."""
    spacing = float(np.ptp(box, axis=0).max()) / 24
    best: tuple[FloatArray, IntArray] | None = None
    for _ in range(12):
        vertices, faces = _contour(field, box, spacing)
        if len(vertices) <= n and (best is None or len(vertices) > len(best[0])):
            best = vertices, faces
        if 0.97 * n <= len(vertices) <= n:
            break
        spacing *= float(np.sqrt(max(len(vertices), 8) / (0.985 * n)))
    if best is None or not len(best[0]):
        raise ArgumentError(f"n_vertices = {n} is too small for this shape; use more")
    return best


def _contour(field: Field, box: FloatArray, spacing: float) -> tuple[FloatArray, IntArray]:
    low, high = box[0] - 1.5 * spacing, box[1] + 1.5 * spacing
    x, y, z = (np.arange(low[k], high[k] + spacing, spacing) for k in range(3))
    grid = np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1)
    values = field(grid.reshape(-1, 3))
    # A surface close to a grid point gives needles there; keep it at some distance.
    values = np.copysign(np.maximum(np.abs(values), 0.15 * spacing), values)
    image = vtkImageData()
    image.SetDimensions(len(x), len(y), len(z))
    image.SetOrigin(*low)
    image.SetSpacing(spacing, spacing, spacing)
    # VTK orients triangles towards lower values, so the sign is reversed.
    image.GetPointData().SetScalars(numpy_to_vtk(-values, deep=True))
    contour = vtkFlyingEdges3D()
    contour.SetInputData(image)
    contour.SetValue(0, 0.0)
    contour.ComputeNormalsOff()
    contour.ComputeGradientsOff()
    contour.Update()
    output = contour.GetOutput()
    if not output.GetNumberOfPolys():
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    faces = vtk_to_numpy(output.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    vertices = vtk_to_numpy(output.GetPoints().GetData()).astype(float)
    return _largest_component(vertices, faces.astype(np.int64))


def _largest_component(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Remove small components, which a coarse grid leaves beside thin parts."""
    part = components(len(vertices), faces)
    kept = part == np.bincount(part).argmax()
    number = np.cumsum(kept) - 1
    return vertices[kept], number[faces[kept[faces[:, 0]]]]


def _projected(vertices: FloatArray, faces: IntArray, field: Field) -> FloatArray:
    """Project each vertex along its normal to the surface, by two secant steps.

    Steps are limited to the length of an edge, since they diverge where the field is flat, as in
    a sharp crease.
    """
    normals = vertex_normals(vertices, faces)
    edge = float(np.linalg.norm(vertices[faces] - vertices[faces[:, [1, 2, 0]]], axis=2).mean())
    before, value = np.zeros(len(vertices)), field(vertices)
    step = -value
    for _ in range(2):
        after = field(vertices + step[:, None] * normals)
        run = step - before
        slope = np.divide(after - value, run, out=np.ones_like(run), where=run != 0.0)
        before, value, step = step, after, step - after / np.clip(slope, 0.3, 3.0)
        step = np.clip(step, -edge, edge)
    moved: FloatArray = vertices + step[:, None] * normals
    return moved


def _smooth_minimum(a: FloatArray, b: FloatArray, width: float) -> FloatArray:
    """Return the minimum of a and b, rounded where they differ by less than *width*."""
    gap = np.maximum(1.0 - np.abs(a - b) / width, 0.0)
    lesser: FloatArray = np.minimum(a, b) - 0.25 * width * gap**2
    return lesser
