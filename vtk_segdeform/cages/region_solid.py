"""A region of the mesh as a solid, and the distance to it on a grid, from which its cage is cut.

A patch of skin alone is a thin shell with a rim; its offset makes a poor cage.  The region as a
*solid* makes a good one: all that lies inside the mesh and is nearest to a vertex of the region,

    S = skin of the region  u  {y inside the mesh : the vertex nearest to y is in the region}

On the nodes y of a regular grid, with its step as the unit of length:

    f(y) = distance to S, negative inside                            `SolidField.distance`
    g    = f blurred, so that slits too narrow for a cage close, and
           without cavities and islands                              `SolidField.smooth`

The surface g = offset is closed, whatever the region looks like.

The grid stands in the region's own principal axes, so that a cage turns with its mesh; where a
shape is symmetric the numbering of the vertices settles axes and signs (`principal_axes`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..kernels import in_parallel
from ..mesh import Mesh, inside_nodes, ragged_arange

_STEPS_PER_OFFSET = 1.5  # at least: every point of S then has a node within the offset surface
_MARGIN = 3.7183  # steps from the offset surface to the end; odd, so that no extreme is on a tie
_BLUR = 0.5  # standard deviation, as a share of the offset
_FIRST_OF_EQUALS = 1.0 - 1e-6 * np.arange(3)  # decides for equal sides, which rounding must not
_PIECE = 20_000  # faces to a thread
_SPACING = 0.7  # steps between samples of a face, so that it leaves no gap


@dataclass(frozen=True, eq=False)
class Skin:
    """The mesh about its centre; made once for all regions."""

    points: FloatArray
    faces: IntArray
    face_areas: FloatArray
    longest: FloatArray  # (m,): the longest side of each face
    centre: FloatArray

    @classmethod
    def of(cls, mesh: Mesh) -> Skin:
        """Return the skin of *mesh*."""
        centre = mesh.vertices.mean(axis=0)
        longest = np.empty(mesh.n_faces)

        def work(start: int, stop: int) -> None:
            x = mesh.vertices[mesh.faces[start:stop]]
            square = ((x - x[:, [1, 2, 0]]) ** 2).sum(axis=2).max(axis=1)
            longest[start:stop] = np.sqrt(square)

        in_parallel(work, mesh.n_faces, _PIECE)
        return cls(mesh.vertices - centre, mesh.faces, mesh.face_areas, longest, centre)

    @cached_property
    def tree(self) -> cKDTree:
        """The tree of the vertices."""
        return cKDTree(self.points, balanced_tree=False)


@dataclass(frozen=True, eq=False)
class Patch:
    """A region's part of the skin: its vertices, and the faces that touch any of them."""

    skin: Skin
    members: BoolArray
    weights: FloatArray  # (n,): area of the touching faces at their corners
    axes: FloatArray  # (3, 3) rows, longest first

    @classmethod
    def of(cls, skin: Skin, members: BoolArray) -> Patch:
        """Return the patch of the vertices in the mask *members* (n,)."""
        touching = members[skin.faces].any(axis=1)
        corners, thirds = skin.faces[touching].ravel(), skin.face_areas[touching] / 3.0
        weights = np.zeros(len(skin.points))
        weights += np.bincount(corners, np.repeat(thirds, 3), minlength=len(weights))
        around = np.flatnonzero(weights)
        return cls(skin, members, weights, principal_axes(skin.points[around], weights[around]))

    @property
    def area(self) -> float:
        """Area of the faces that touch the region."""
        return float(self.weights.sum())

    @property
    def spread(self) -> FloatArray:
        """(3,) standard deviation of the area along each axis."""
        x = self.skin.points @ self.axes.T
        mean = self.weights @ x / self.area
        return np.asarray(np.sqrt(self.weights @ (x - mean) ** 2 / self.area))

    @property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest coordinates along the axes, (3,) each, of the faces that touch it."""
        x = self.skin.points[self.weights > 0.0] @ self.axes.T
        return x.min(axis=0), x.max(axis=0)

    def ellipsoid(self, n: int) -> tuple[FloatArray, IntArray]:
        """Return a convex surface around the patch: *n* points spread over an ellipsoid."""
        k = np.arange(n) + 0.5
        height, turn = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
        ring = np.sqrt(1.0 - height**2)
        ball = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
        hull = ConvexHull(ball)
        a, b, c = ball[hull.simplices.T]
        inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
        faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
        free = -hull.equations[:, 3].max()  # radius of the ball that no face enters
        low, high = self.box
        half = np.maximum(high - low, 0.1 * (high - low).max()) / 2.0
        local = ball * (1.1 * np.sqrt(3.0) / free * half) + (low + high) / 2.0
        return local @ self.axes, faces.astype(np.int64)


@dataclass(frozen=True, eq=False)
class Grid:
    """A regular grid: the node with indices k is the point ``origin + step * k @ axes``."""

    origin: FloatArray
    axes: FloatArray
    step: float
    shape: tuple[int, int, int]

    def to_nodes(self, points: FloatArray) -> FloatArray:
        """Return (n, 3) points in steps from the first node."""
        return np.asarray((points - self.origin) @ self.axes.T / self.step)

    def to_points(self, nodes: FloatArray | IntArray) -> FloatArray:
        """Undo `to_nodes`."""
        return np.asarray(self.origin + self.step * (nodes @ self.axes))


@dataclass(frozen=True, eq=False)
class SolidField:
    """The distance to a region's solid on the nodes of a grid; all lengths are in steps."""

    grid: Grid
    distance: FloatArray
    smooth: FloatArray
    offset: float
    members: FloatArray  # the region's vertices
    n_shells: int  # separate parts of the surface smooth = offset


def principal_axes(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Return (3, 3) axes as rows, right-handed and longest first, that turn with (n, 3) *points*.

    The weight of each vertex is scaled by a random number that belongs to its place in the list.
    That parts axes of equal length and leaves no direction without a sign, and it turns along.
    """
    scale, sign = np.random.default_rng(0).uniform(0.0, 2.0, (2, len(points)))
    mass = weights * scale
    centred = points - mass @ points / mass.sum()
    axes = np.linalg.eigh((centred.T * mass) @ centred)[1].T[::-1]
    axes = axes * np.where(axes @ ((sign - 1.0) @ centred) < 0.0, -1.0, 1.0)[:, None]
    axes[2] = np.cross(axes[0], axes[1])
    return np.asarray(axes)


def solid_field(patch: Patch, offset: float, step: float, *, most_nodes: float) -> SolidField:
    """Return the distance to the region's solid, on a grid that reaches beyond *offset*.

    *step* becomes larger where the grid would have more than *most_nodes* nodes, or smaller
    where the offset would have too few steps; if both, the offset becomes larger.
    """
    skin, members = patch.skin, patch.members
    low, high = patch.box
    step = min(step, offset / _STEPS_PER_OFFSET)
    while np.prod((high - low + 2 * offset) / step + 2 * _MARGIN + 2) > most_nodes:
        step *= 1.1
        offset = max(offset, step * _STEPS_PER_OFFSET)
    pad = offset + _MARGIN * step
    nx, ny, nz = (int(k) for k in np.ceil((high - low + 2 * pad) / step) + 1)
    grid = Grid((low - pad) @ patch.axes, patch.axes, step, (nx, ny, nz))

    nodes = grid.to_nodes(skin.points)
    large = skin.faces[skin.longest > 0.99 * _SPACING * step]  # the others need no samples
    samples = np.concatenate([nodes[members], _samples(nodes[large[members[large].all(axis=1)]])])
    inside = np.argwhere(inside_nodes(nodes, skin.faces, grid.shape))
    inside = inside[((inside >= pad / step) & (inside <= np.array(grid.shape) - pad / step)).all(1)]
    if not members.all():
        inside = inside[members[skin.tree.query(grid.to_points(inside))[1]]]
    distance = _distance(samples, inside, grid.shape)
    smooth = ndimage.gaussian_filter(distance, _BLUR * offset / step, mode="nearest")
    smooth, n_shells = _filled(smooth, offset / step, nodes[members])
    return SolidField(grid, distance, smooth, offset / step, nodes[members], n_shells)


def _distance(samples: FloatArray, inside: IntArray, shape: tuple[int, int, int]) -> FloatArray:
    """Return the distance of every node to the *samples* and the nodes *inside*.

    To the mean of the samples nearest to the same node, that is: finer than the grid.
    """
    solid = np.zeros(shape, dtype=bool)
    solid[tuple(inside.T)] = True
    of_sample = np.ravel_multi_index(tuple(np.rint(samples).astype(np.int64).T), shape)
    count = np.bincount(of_sample, minlength=solid.size)
    met = np.flatnonzero(count)
    solid.ravel()[met] = True
    nodes = np.indices(shape, dtype=np.float64).reshape(3, -1)
    where = nodes.copy()
    for axis in range(3):
        total = np.bincount(of_sample, samples[:, axis], minlength=solid.size)
        where[axis, met] = total[met] / count[met]
    nearest = ndimage.distance_transform_edt(~solid, return_distances=False, return_indices=True)
    at = where[:, np.ravel_multi_index(tuple(nearest.reshape(3, -1)), shape)]
    outside = np.sqrt(((at - nodes) ** 2).sum(axis=0)).reshape(shape)
    depth = ndimage.distance_transform_edt(solid) - 1.0
    return np.where(solid, -depth, outside)


def _filled(values: FloatArray, offset: float, members: FloatArray) -> tuple[FloatArray, int]:
    """Return *values* < *offset* without cavities and islands without members; count the rest."""
    solid = values < offset
    whole = ndimage.binary_fill_holes(solid)
    islands, _ = ndimage.label(whole)
    held = np.unique(islands[tuple(np.rint(members).astype(np.int64).T)])
    held = held[held > 0]
    values = np.where(whole & ~solid, 0.0, values)
    return np.where(whole & ~np.isin(islands, held), 2.0 * offset, values), len(held)


def _samples(triangles: FloatArray) -> FloatArray:
    """Return points at most a step apart on those (m, 3, 3) *triangles* that are larger."""
    length = np.linalg.norm(triangles - triangles[:, [1, 2, 0]], axis=2)
    large = np.flatnonzero(length.max(axis=1) > _SPACING)
    longest = (length[large] * _FIRST_OF_EQUALS).argmax(axis=1)
    order = (longest[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles[large], order[..., None], axis=1).transpose(1, 0, 2)
    base = length[large, longest]
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / base
    rows = np.ceil(height / _SPACING).astype(np.int64) + 1
    columns = np.ceil(base / _SPACING).astype(np.int64) + 1
    t, k = ragged_arange(rows * columns)
    up = (k // columns[t] / np.maximum(rows - 1, 1)[t])[:, None]
    along = (k % columns[t] / np.maximum(columns - 1, 1)[t])[:, None]
    return np.asarray((1 - up) * ((1 - along) * a[t] + along * b[t]) + up * c[t])
