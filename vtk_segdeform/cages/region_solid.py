"""Distance field of a region as a solid, on a grid; its level set is the cage before simplifying.

The surface of a region alone is an open patch, and an offset of it makes a poor cage.  The region
as a *solid* also has the points inside the mesh whose nearest vertex is in the region:

    S = surface of the region  u  {y inside the mesh : the vertex nearest to y is in the region}

Inside means under lids over the borders, for the components of an open mesh that enclose a volume
(`geometry.Lids`).  A sheet has no inside: S is its surface, and the cage is offset on both sides.

On the nodes y of a regular grid, with its spacing as the unit of length:

    f(y) = distance to S, negative inside                            `SolidField.distance`
    g    = f smoothed, which closes slits too narrow for a cage,
           without cavities and islands                              `SolidField.smooth`

The surface g = offset is closed for any region.

The grid is aligned with the principal axes of the region, so that a cage rotates with its mesh; for
symmetric shapes the vertex indices determine axes and signs (`geometry.principal_axes`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..geometry import lids_of, principal_axes
from ..kernels import ROWS_AT_ONCE, in_parallel
from ..mesh import Mesh, inside_nodes, ragged_arange

STEPS_PER_OFFSET = 1.5  # at least, so that every point of S has a node inside the offset surface
_MARGIN = 3.7183  # steps around the offset surface; uneven, so that no extreme is on a node
_SAMPLE_SPACING = 0.7  # steps between samples of a face: less than 1, to leave no gaps


@dataclass(frozen=True, eq=False)
class Surface:
    """The mesh relative to its centre; computed once for all regions.

    Attributes
    ----------
    points, faces : (n, 3) float, (m, 3) int
        The mesh.
    walls : (n', 3) float, (m', 3) int
        The closed surface of its enclosed volumes: those of its faces and lids over its borders.
    face_areas, longest : (m,) float
        The area and the longest edge of each face.
    centre : (3,) float
        Mean of the vertices.
    """

    points: FloatArray
    faces: IntArray
    walls: tuple[FloatArray, IntArray]
    face_areas: FloatArray
    longest: FloatArray
    centre: FloatArray

    @classmethod
    def of(cls, mesh: Mesh) -> Surface:
        """Return the data of *mesh*."""
        centre = mesh.vertices.mean(axis=0)
        longest = np.empty(mesh.n_faces)

        def work(start: int, stop: int) -> None:
            x = mesh.vertices[mesh.faces[start:stop]]
            square = ((x - x[:, [1, 2, 0]]) ** 2).sum(axis=2).max(axis=1)
            longest[start:stop] = np.sqrt(square)

        in_parallel(work, mesh.n_faces, ROWS_AT_ONCE)
        points = mesh.vertices - centre
        walls = points, mesh.faces
        if not mesh.is_closed:
            lids = lids_of(mesh)
            walls = lids.extension @ points, lids.closed(mesh)
        return cls(points, mesh.faces, walls, mesh.face_areas, longest, centre)

    @cached_property
    def tree(self) -> cKDTree:
        """k-d tree of the vertices."""
        return cKDTree(self.points, balanced_tree=False)


@dataclass(frozen=True, eq=False)
class Patch:
    """The surface of a region: its vertices, and the faces that touch any of them."""

    surface: Surface
    members: BoolArray
    weights: FloatArray  # (n,): area of the touching faces at their corners, not all 0
    axes: FloatArray  # (3, 3): principal axes as rows, longest first

    @classmethod
    def of(cls, surface: Surface, members: BoolArray) -> Patch:
        """Return the patch of the vertices in the mask *members* (n,)."""
        touching = members[surface.faces].any(axis=1)
        corners, thirds = surface.faces[touching].ravel(), surface.face_areas[touching] / 3.0
        length = surface.longest[touching]
        least = 1e-2 * np.ptp(surface.points, axis=0).max()
        if thirds.sum() <= 1e-12 * (length @ length):  # count flat faces by their length instead
            thirds = np.maximum(length, least) ** 2 / 12.0
        weights = np.zeros(len(surface.points))
        weights += np.bincount(corners, np.repeat(thirds, 3), minlength=len(weights))
        if not touching.any():  # decimation may have left no face of a small component
            weights[members] = least**2
        around = np.flatnonzero(weights)
        return cls(
            surface, members, weights, principal_axes(surface.points[around], weights[around])
        )

    @property
    def area(self) -> float:
        """Area of the faces that touch the region."""
        return float(self.weights.sum())

    @property
    def spread(self) -> FloatArray:
        """(3,) float: standard deviation of the area along each axis."""
        x = self.surface.points @ self.axes.T
        mean = self.weights @ x / self.area
        return np.asarray(np.sqrt(self.weights @ (x - mean) ** 2 / self.area))

    @property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest coordinates of the touching faces along the axes, (3,) each."""
        x = self.surface.points[self.members | (self.weights > 0.0)] @ self.axes.T
        return x.min(axis=0), x.max(axis=0)

    def ellipsoid(self, n: int) -> tuple[FloatArray, IntArray]:
        """Return a convex surface around the patch, *n* points distributed over an ellipsoid."""
        k = np.arange(n) + 0.5
        height, angle = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
        ring = np.sqrt(1.0 - height**2)
        ball = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
        hull = ConvexHull(ball)
        a, b, c = ball[hull.simplices.T]
        inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
        faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
        inner = -hull.equations[:, 3].max()  # radius of the inscribed ball
        low, high = self.box
        size = (high - low).max() or np.sqrt(self.area)
        half = np.maximum(high - low, 0.1 * size) / 2.0
        local = ball * (1.1 * np.sqrt(3.0) / inner * half) + (low + high) / 2.0
        return local @ self.axes, faces.astype(np.int64)


@dataclass(frozen=True, eq=False)
class Grid:
    """A regular grid: the node with indices k is the point ``origin + step * k @ axes``."""

    origin: FloatArray
    axes: FloatArray
    step: float
    shape: tuple[int, int, int]

    def to_nodes(self, points: FloatArray) -> FloatArray:
        """Return *points* (n, 3) in units of the grid, relative to the first node."""
        return np.asarray((points - self.origin) @ self.axes.T / self.step)

    def to_points(self, nodes: FloatArray | IntArray) -> FloatArray:
        """Return the inverse of `to_nodes`."""
        return np.asarray(self.origin + self.step * (nodes @ self.axes))


@dataclass(frozen=True, eq=False)
class SolidField:
    """Distance to the solid of a region on the nodes of a grid; lengths are in steps."""

    grid: Grid
    distance: FloatArray
    smooth: FloatArray
    offset: float
    members: FloatArray  # the vertices of the region
    n_shells: int  # components of the surface smooth = offset


def solid_field(patch: Patch, offset: float, step: float, *, most_nodes: float) -> SolidField:
    """Return the distance to the solid of the region, on a grid that extends beyond *offset*.

    *step* is increased if the grid would have more than *most_nodes* nodes, and decreased if the
    offset would have too few steps; if both, the offset is increased.
    """
    surface, members = patch.surface, patch.members
    low, high = patch.box
    step = min(step, offset / STEPS_PER_OFFSET)
    while np.prod((high - low + 2 * offset) / step + 2 * _MARGIN + 2) > most_nodes:
        step *= 1.1
        offset = max(offset, step * STEPS_PER_OFFSET)
    pad = offset + _MARGIN * step
    nx, ny, nz = (int(k) for k in np.ceil((high - low + 2 * pad) / step) + 1)
    grid = Grid((low - pad) @ patch.axes, patch.axes, step, (nx, ny, nz))

    nodes = grid.to_nodes(surface.points)
    large = surface.faces[
        surface.longest > 0.99 * _SAMPLE_SPACING * step
    ]  # smaller faces need no samples
    samples = np.concatenate([nodes[members], _samples(nodes[large[members[large].all(axis=1)]])])
    corners, faces = surface.walls
    inside = np.argwhere(inside_nodes(grid.to_nodes(corners), faces, grid.shape))
    inside = inside[((inside >= pad / step) & (inside <= np.array(grid.shape) - pad / step)).all(1)]
    if not members.all():
        inside = inside[members[surface.tree.query(grid.to_points(inside))[1]]]
    distance = _distance(samples, inside, grid.shape)
    smooth = ndimage.gaussian_filter(distance, 0.5 * offset / step, mode="nearest")
    smooth, n_shells = _filled(smooth, offset / step, nodes[members])
    return SolidField(grid, distance, smooth, offset / step, nodes[members], n_shells)


def _distance(samples: FloatArray, inside: IntArray, shape: tuple[int, int, int]) -> FloatArray:
    """Return the distance of every node to the *samples* and the nodes *inside*.

    Samples with the same nearest node are replaced by their mean, so that the distance is more
    accurate than the grid.
    """
    solid = np.zeros(shape, dtype=bool)
    solid[tuple(inside.T)] = True
    of_sample = np.ravel_multi_index(tuple(np.rint(samples).astype(np.int64).T), shape)
    count = np.bincount(of_sample, minlength=solid.size)
    sampled = np.flatnonzero(count)
    solid.ravel()[sampled] = True
    nodes = np.indices(shape, dtype=np.float64).reshape(3, -1)
    where = nodes.copy()
    for axis in range(3):
        total = np.bincount(of_sample, samples[:, axis], minlength=solid.size)
        where[axis, sampled] = total[sampled] / count[sampled]
    nearest = ndimage.distance_transform_edt(~solid, return_distances=False, return_indices=True)
    at = where[:, np.ravel_multi_index(tuple(nearest.reshape(3, -1)), shape)]
    outside = np.sqrt(((at - nodes) ** 2).sum(axis=0)).reshape(shape)
    depth = ndimage.distance_transform_edt(solid) - 1.0
    return np.where(solid, -depth, outside)


def _filled(values: FloatArray, offset: float, members: FloatArray) -> tuple[FloatArray, int]:
    """Return *values* with cavities filled and islands without members removed; count the rest."""
    solid = values < offset
    whole = ndimage.binary_fill_holes(solid)
    islands, _ = ndimage.label(whole)
    kept = np.unique(islands[tuple(np.rint(members).astype(np.int64).T)])
    kept = kept[kept > 0]
    values = np.where(whole & ~solid, 0.0, values)
    return np.where(whole & ~np.isin(islands, kept), 2.0 * offset, values), len(kept)


def _samples(triangles: FloatArray) -> FloatArray:
    """Return points at most a step apart on the *triangles* (m, 3, 3) that are larger."""
    length = np.linalg.norm(triangles - triangles[:, [1, 2, 0]], axis=2)
    large = np.flatnonzero(length.max(axis=1) > _SAMPLE_SPACING)
    longest = (length[large] * [1.0, 1.0 - 1e-6, 1.0 - 2e-6]).argmax(axis=1)  # the first of equals
    order = (longest[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles[large], order[..., None], axis=1).transpose(1, 0, 2)
    base = length[large, longest]
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / base
    rows = np.ceil(height / _SAMPLE_SPACING).astype(np.int64) + 1
    columns = np.ceil(base / _SAMPLE_SPACING).astype(np.int64) + 1
    t, k = ragged_arange(rows * columns)
    up = (k // columns[t] / np.maximum(rows - 1, 1)[t])[:, None]
    along = (k % columns[t] / np.maximum(columns - 1, 1)[t])[:, None]
    return np.asarray((1 - up) * ((1 - along) * a[t] + along * b[t]) + up * c[t])
