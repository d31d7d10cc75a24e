"""Bodies with others around, inside of and against them, made at run time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import solids
from scipy.sparse import csgraph
from scipy.spatial.transform import Rotation

from vtk_segdeform.arrays import BoolArray, FloatArray, IntArray
from vtk_segdeform.mesh import Mesh, normals

Solid = tuple[FloatArray, IntArray]


class Scene(NamedTuple):
    """Bodies, of which the first is bent."""

    mesh: Mesh
    fixed: IntArray
    handle: IntArray
    pivot: FloatArray
    follows: dict[int, int]
    """The carrier of each follower."""

    def targets(self, angle: float) -> FloatArray:
        """Return where a rotation by *angle* degrees about y takes the handle, (k, 3)."""
        turn = Rotation.from_euler("y", angle, degrees=True)
        return turn.apply(self.mesh.vertices[self.handle] - self.pivot) + self.pivot


def revolved(profile: Sequence[tuple[float, float]], n: int, step: float) -> Solid:
    """Return the solid that corners (radius, z) sweep about z, with *n* vertices around.

    It is closed if the *profile* ends on the axis or where it begins.  Edges along it are at most
    *step* long.
    """
    corners, ring = np.array(profile, dtype=float), 2.0 * np.pi * np.arange(n) / n
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    counts = [1 + max(1, round(length / step)) for length in lengths]
    ends = zip(itertools.pairwise(at), counts, strict=True)
    pieces = [np.linspace(*both, count)[:-1] for both, count in ends]
    along = np.concatenate([*pieces, at[-1:]])
    r, z = (np.interp(along, at, each) for each in corners.T)
    is_ring = bool((corners[0] == corners[-1]).all())
    vertices, rows = [], []
    for radius, height in zip(r[:-1] if is_ring else r, z, strict=False):
        around = ring if radius > 0.0 else ring[:1]
        rows.append(np.resize(sum(map(len, vertices)) + np.arange(len(around)), n))
        x, y = radius * np.cos(around), radius * np.sin(around)
        vertices.append(np.stack([x, y, np.full(len(around), height)], axis=1))
    rows += rows[:1] if is_ring else []
    faces = []
    for a, b in itertools.pairwise(rows):
        c, d = np.roll(a, -1), np.roll(b, -1)
        faces += [np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]
    found = np.concatenate(faces)
    distinct = (found != np.roll(found, 1, axis=1)).all(axis=1)
    return np.concatenate(vertices), found[distinct]


def rod(radius: float, low: float, high: float, *, n: int = 24, step: float = 0.1) -> Solid:
    """Return a cylinder along z."""
    return revolved([(0, low), (radius, low), (radius, high), (0, high)], n, step)


def tube(inner: float, outer: float, low: float, high: float, *, n=24, step=0.1) -> Solid:
    """Return the wall of a tube along z."""
    corners = [(outer, low), (outer, high), (inner, high), (inner, low), (outer, low)]
    return revolved(corners, n, step)


def joined(*parts: Solid) -> Mesh:
    """Return one mesh of all; their components have their numbers."""
    return Mesh(*solids.joined(*parts))


def bent(carrier: Solid, *others: Solid, follows: dict[int, int] | None = None) -> Scene:
    """Return the scene of bodies along z, of which the first is fixed and bent at its ends."""
    mesh = joined(carrier, *others)
    z, own = mesh.vertices[:, 2], mesh.components == 0
    low, high = z[own].min(), z[own].max()
    end = 0.1 * (high - low)
    fixed, handle = np.flatnonzero(own & (z < low + end)), np.flatnonzero(own & (z > high - end))
    pivot = np.array([0.0, 0.0, 0.5 * (low + high)])
    return Scene(mesh, fixed, handle, pivot, {1: 0} if follows is None else follows)


def with_cast(body: Mesh, gap: float, thickness: float) -> Scene:
    """Return the scene of a body with a cast around the middle of its farthest limb.

    *gap* and *thickness* are in diagonals of the body.
    """
    x, graph = body.vertices, body.adjacency
    middle = int(np.linalg.norm(x - x.mean(axis=0), axis=1).argmin())
    tip = int(csgraph.dijkstra(graph, indices=middle).argmax())
    away = csgraph.dijkstra(graph, indices=tip)
    length = away[middle]
    mask = (away > 0.3 * length) & (away < 0.5 * length)
    part = csgraph.connected_components(graph[mask][:, mask], directed=False)[1]
    mask[np.flatnonzero(mask)[part != np.bincount(part).argmax()]] = False
    shell = _shell(body, mask, gap * body.diagonal, thickness * body.diagonal)
    mesh = joined((x, body.faces), shell)
    fixed, handle = np.flatnonzero(away > 0.9 * away.max()), np.flatnonzero(away < 0.15 * length)
    return Scene(mesh, fixed, handle, x[mask].mean(axis=0), {1: 0})


def _shell(body: Mesh, mask: BoolArray, gap: float, thickness: float) -> Solid:
    """Return a closed shell over the vertices *mask* (n,) of a body."""
    faces = body.faces[mask[body.faces].all(axis=1)]
    up, turned = np.zeros_like(body.vertices), normals(body.vertices[body.faces])
    for corner in body.faces.T:
        np.add.at(up, corner, turned)
    near = body.adjacency.astype(bool)
    for _ in range(4):
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        up = up + near @ up
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    ids, flat = np.unique(faces, return_inverse=True)
    faces, m = flat.reshape(-1, 3), len(ids)
    x, up = body.vertices[ids], up[ids]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    both = {(b, a) for a, b in edges.tolist()}
    a, b = np.array([edge for edge in edges.tolist() if tuple(edge) not in both]).T
    rim = [np.stack([a, a + m, b + m], axis=1), np.stack([a, b + m, b], axis=1)]
    every = np.concatenate([faces, faces[:, ::-1] + m, *rim])
    return np.concatenate([x + (gap + thickness) * up, x + gap * up]), every


def ball(radius: float, centre: Sequence[float], subdivisions: int = 2) -> Solid:
    """Return a sphere."""
    vertices, faces = solids.icosphere(subdivisions, radius)
    return vertices + centre, faces


def off_carrier(scene: Scene, x: FloatArray, one: int, other: int) -> tuple[FloatArray, FloatArray]:
    """Return how far the vertices of *one* are from where the surface of the *other* takes them.

    In the pose *x* (n, 3); and their gaps at rest.  Each vertex keeps its place in the frame of the
    triangle of the *other* whose middle is nearest.
    """
    mesh, component = scene.mesh, scene.mesh.components
    ids = np.flatnonzero(component == one)
    faces = mesh.faces[component[mesh.faces[:, 0]] == other]
    middles = mesh.vertices[faces].mean(axis=1)
    away = np.linalg.norm(mesh.vertices[ids, None] - middles, axis=2)
    near = away.argmin(axis=1)

    def frames(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        a, b, c = np.moveaxis(points[faces[near]], 1, 0)
        first, up = b - a, np.cross(b - a, c - a)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        return (a + b + c) / 3.0, np.stack([first, np.cross(up, first), up], axis=2)

    (start, before), (end, after) = frames(mesh.vertices), frames(x)
    arm = np.einsum("kij,ki->kj", before, mesh.vertices[ids] - start)
    should = end + np.einsum("kij,kj->ki", after, arm)
    return np.linalg.norm(x[ids] - should, axis=1), away.min(axis=1)
