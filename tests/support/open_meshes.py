"""Open surfaces from code: cups, tubes, cut bodies and sheets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from solids import joined

from vtk_segdeform import models
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.mesh.soup import mesh_of


def sheet(f: Callable, n: int = 40, m: int = 40) -> Mesh:
    """Return the surface f(u, v) over the square from -1 to 1."""
    u, v = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, m), indexing="ij")
    return _joined(_points(f, u, v), np.arange(n * m).reshape(n, m))


def pipe(f: Callable, n: int = 40, m: int = 40) -> Mesh:
    """Return the surface f(u, v), closed in u from 0 to 2 pi, with v from 0 to 1."""
    around = np.linspace(0, 2 * np.pi, n, endpoint=False)
    u, v = np.meshgrid(around, np.linspace(0, 1, m), indexing="ij")
    ids = np.arange(n * m).reshape(n, m)
    return _joined(_points(f, u, v), np.vstack([ids, ids[:1]]))


def revolved(radii: list[float], heights: list[float], n: int = 40, m: int = 40) -> Mesh:
    """Return the surface of revolution of a profile, given by its corners from the bottom."""
    at = np.linspace(0, 1, len(radii))

    def point(u, v):
        r = np.interp(v, at, radii)
        return r * np.cos(u), r * np.sin(u), np.interp(v, at, heights)

    return pipe(point, n, m)


def part_of(mesh: Mesh, kept: np.ndarray) -> Mesh:
    """Return the *kept* (m,) faces of a mesh."""
    ids, faces = np.unique(mesh.faces[kept], return_inverse=True)
    return Mesh(mesh.vertices[ids], faces.reshape(-1, 3))


def cut(mesh: Mesh, axis: int, share: float) -> Mesh:
    """Return the faces below a *share* of the extent along an axis."""
    x = mesh.vertices[:, axis]
    return part_of(mesh, (x[mesh.faces] < x.min() + share * np.ptp(x)).all(axis=1))


def with_holes(mesh: Mesh, count: int, radius: float, seed: int = 1) -> Mesh:
    """Return the largest part of a mesh without the faces near *count* vertices."""
    picked = np.random.default_rng(seed).choice(mesh.n_vertices, count, replace=False)
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    apart = np.linalg.norm(middle[:, None] - mesh.vertices[picked], axis=2).min(axis=1)
    left = part_of(mesh, apart > radius * mesh.diagonal)
    component = left.components
    return part_of(left, component[left.faces[:, 0]] == np.bincount(component).argmax())


def with_walls(mesh: Mesh, *heights: float) -> Mesh:
    """Return a body about the z axis with plane walls inside, across it at *heights*."""
    vertices, faces = mesh.vertices, [mesh.faces]
    for z in heights:
        ring = np.flatnonzero(np.abs(mesh.vertices[:, 2] - z) < 1e-9)
        ring = ring[np.argsort(np.arctan2(*mesh.vertices[ring, :2].T))]
        middle = np.full(len(ring), len(vertices))
        faces.append(np.stack([ring, np.roll(ring, -1), middle], axis=1))
        vertices = np.append(vertices, [[0.0, 0.0, z]], axis=0)
    return Mesh(vertices, np.concatenate(faces))


def together(*meshes: Mesh) -> Mesh:
    """Return all meshes as one."""
    return Mesh(*joined(*((mesh.vertices, mesh.faces) for mesh in meshes)))


def combined(*meshes: Mesh) -> Mesh:
    """Return all meshes as one, with those in others turned inward, as cavities."""
    return mesh_of(*joined(*((mesh.vertices, mesh.faces) for mesh in meshes))).mesh


def open_box(n: int = 6) -> Mesh:
    """Return a box of 1 x 1 x 2 without its upper face."""
    box = models.bar((1, 1, 2), divisions=(n, n, 2 * n))
    z = box.vertices[:, 2]
    return part_of(box, ~(z[box.faces] > z.max() - 1e-9).all(axis=1))


def bottle(n: int = 40, m: int = 40) -> Mesh:
    """Return a bottle with an open neck."""
    return revolved([0.02, 1.0, 1.0, 0.3, 0.3], [0.0, 0.0, 2.5, 3.0, 4.0], n, m)


def tube(length: float = 6.0, n: int = 40, m: int = 40) -> Mesh:
    """Return a tube of radius 1 without ends."""
    return revolved([1.0, 1.0], [0.0, length], n, m)


def moebius_strip(n: int = 60, m: int = 7) -> Mesh:
    """Return a strip with one side."""
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.linspace(-0.4, 0.4, m), indexing="ij")
    r = 1 + v * np.cos(u / 2)
    points = np.stack([r * np.cos(u), r * np.sin(u), v * np.sin(u / 2)], axis=-1).reshape(-1, 3)
    ids = np.arange(n * m).reshape(n, m)
    return _joined(points, np.vstack([ids, ids[:1, ::-1]]))


def _points(f: Callable, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    axes = [np.broadcast_to(axis, u.shape) for axis in f(u, v)]
    return np.stack(axes, axis=-1).reshape(-1, 3)


def _joined(points: np.ndarray, ids: np.ndarray) -> Mesh:
    a, b, c, d = ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]
    faces = [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
    return Mesh(points, np.concatenate(faces).reshape(-1, 3))
