"""Meshes with fixed vertices, handles and targets.

bent_cactus      the trunk is bent, as in `segdeform demo`
benchmark_pose   a pose of Botsch and Sorkine's benchmark, in the folder SEGDEFORM_DATA
Hand             the end of the longest limb of any body, so that it needs no choice for a body
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csgraph
from scipy.spatial.transform import Rotation

from ..arrays import FloatArray, IntArray
from ..cages import fit_cages
from ..deformer import Deformer
from ..io import read_mesh
from ..mesh import Mesh, SurfacePoint
from ..models import bar, cactus, sphere
from ..regions import Regions, segment

_HANDLE, _ROOT, _FIXED = 0.1, 0.45, 0.65  # distances from the tip, as shares of the largest
_RING = 0.03  # half the width of the ring around the root
_PULL = 0.25  # diagonals that a pull moves while a handle would turn by a radian


@dataclass(frozen=True, eq=False)
class Task:
    """A mesh with fixed vertices (f,), handle vertices (k,) and targets (k, 3)."""

    name: str
    mesh: Mesh
    fixed: IntArray
    handle: IntArray
    targets: FloatArray


def bent_cactus(n_vertices: int) -> Task:
    """Return the cactus with its trunk bent by 60 degrees."""
    mesh = cactus(n_vertices)
    x = mesh.vertices
    low, high = x.min(axis=0), x.max(axis=0)
    height = (x[:, 2] - low[2]) / (high[2] - low[2])
    fixed, handle = np.flatnonzero(height < 0.08), np.flatnonzero(height > 0.92)
    pivot = 0.5 * (low + high)
    pivot[2] = low[2] + 0.4 * (high[2] - low[2])
    turn = Rotation.from_euler("y", 60.0, degrees=True)
    return Task("cactus", mesh, fixed, handle, turn.apply(x[handle] - pivot) + pivot)


def benchmark_poses() -> list[Task]:
    """Return two poses of Botsch and Sorkine's benchmark; none if SEGDEFORM_DATA has it not."""
    folder = Path(os.environ.get("SEGDEFORM_DATA") or "/nowhere") / "botsch-sorkine"
    return [_pose(folder / name) for name in ("cactus", "cylinder")] if folder.is_dir() else []


def _pose(path: Path) -> Task:
    mesh = read_mesh(path.with_suffix(".off"))
    roles = np.loadtxt(path.with_suffix(".sel"))
    matrix = np.loadtxt(path.with_suffix(".def"))
    fixed, handle = np.flatnonzero(roles == 0), np.flatnonzero(roles == 2)
    targets = mesh.vertices[handle] @ matrix[:3, :3].T + matrix[:3, 3]
    return Task(f"Botsch-Sorkine {path.name}", mesh, fixed, handle, targets)


def make_regions(mesh: Mesh, n_regions: int) -> Regions:
    """Return *n_regions* regions."""
    return Regions.single(mesh) if n_regions == 1 else segment(mesh, n_regions)


def prepare(task: Task, n_regions: int, n_vertices: int, **options: Any) -> Deformer:
    """Return a deformer for *task* with given numbers of regions and cage vertices.

    *options* are those of `Deformer`.
    """
    regions = make_regions(task.mesh, n_regions)
    cages = fit_cages(task.mesh, regions, n_vertices)
    return Deformer(task.mesh, regions, cages, fixed=task.fixed, handle=task.handle, **options)


def warm_up() -> None:
    """Load the compiled kernels, or compile them, so that no measurement includes this."""
    task = bent_cactus(2500)
    prepare(task, 1, 40).solve(task.targets, max_steps=2)


def with_loose_parts(body: Mesh, seed: int, count: int = 4) -> Mesh:
    """Return *body* with *count* small spheres close to its surface, as separate components."""
    rng, x = np.random.default_rng(seed), body.vertices
    a, b, c = x[body.faces.T]
    normals = np.cross(b - a, c - a)
    vertices, faces = [x], [body.faces]
    for face in rng.choice(len(body.faces), count, replace=False):
        normal, ball = normals[face] / np.linalg.norm(normals[face]), sphere(100)
        centre = x[body.faces[face]].mean(axis=0) + 0.025 * body.diagonal * normal
        faces.append(ball.faces + sum(map(len, vertices)))
        vertices.append(0.02 * body.diagonal * ball.vertices + centre)
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def divided_bar(n_vertices: int, count: int = 7) -> Mesh:
    """Return a bar of about *n_vertices* with inner walls, which divide it into *count* parts."""
    across = max(2, round((n_vertices / (16.0 * count)) ** 0.5))
    along = count * 4 * across
    body = bar((1.0, 1.0, float(count)), (across, across, along))
    vertices, faces = [body.vertices], [body.faces]
    for k in range(1, count):
        ring = np.flatnonzero(np.abs(body.vertices[:, 2] - k) < 1e-9)
        ring = ring[np.argsort(np.arctan2(*body.vertices[ring, :2].T))]
        middle = np.full(len(ring), sum(map(len, vertices)))
        faces.append(np.stack([ring, np.roll(ring, -1), middle], axis=1))
        vertices.append(np.array([[0.0, 0.0, float(k)]]))
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


@dataclass(frozen=True, eq=False)
class Hand:
    """A handle at the end of a limb, the vertices that are fixed, and how the handle turns.

    Parameters
    ----------
    mesh : Mesh
        The body.
    fixed, handle : (f,) int, (k,) int
        Vertices.
    tip : int
        The vertex at the end of the limb.
    root, axis : (3,) float
        The handle turns about the line through *root* along *axis*.
    """

    mesh: Mesh
    fixed: IntArray
    handle: IntArray
    tip: int
    root: FloatArray
    axis: FloatArray

    @classmethod
    def on(cls, mesh: Mesh) -> Hand:
        """Return the hand on the limb of *mesh* whose tip is farthest along the surface."""
        x = mesh.vertices
        largest = mesh.components == np.bincount(mesh.components).argmax()
        middle = np.where(largest, np.linalg.norm(x - x.mean(axis=0), axis=1), np.inf).argmin()

        def distances(start: int) -> FloatArray:
            found = csgraph.dijkstra(mesh.adjacency, indices=np.array(start))
            return np.asarray(np.where(np.isfinite(found), found, -1.0))

        tip = int(distances(int(middle)).argmax())
        away = distances(tip) / distances(tip).max()
        handle = np.flatnonzero((away >= 0.0) & (away < _HANDLE))
        root = x[np.abs(away - _ROOT) < _RING].mean(axis=0)
        along = x[handle].mean(axis=0) - root
        side = np.cross(along, np.eye(3)[np.abs(along).argmin()])
        return cls(
            mesh, np.flatnonzero(away > _FIXED), handle, tip, root, side / np.linalg.norm(side)
        )

    @property
    def point(self) -> SurfacePoint:
        """The point that is pulled: in a face at the tip, as a pointer hits it."""
        face = self.mesh.faces[np.flatnonzero((self.mesh.faces == self.tip).any(axis=1))[0]]
        return SurfacePoint.of(face, np.where(face == self.tip, 0.6, 0.2))

    def targets(self, radians: float, aside: FloatArray | float = 0.0) -> FloatArray:
        """Return the targets (k, 3) of the handle, turned and moved *aside* (3,), in diagonals."""
        turn = Rotation.from_rotvec(radians * self.axis)
        places = turn.apply(self.mesh.vertices[self.handle] - self.root) + self.root
        return np.asarray(places + self.mesh.diagonal * np.asarray(aside))

    def twisted(self, radians: float) -> FloatArray:
        """Return the targets (k, 3) of the handle, turned about the limb."""
        x = self.mesh.vertices[self.handle]
        along = x.mean(axis=0) - self.root
        turn = Rotation.from_rotvec(radians * along / np.linalg.norm(along))
        return np.asarray(turn.apply(x - self.root) + self.root)

    def pulled_to(
        self, radians: float, aside: FloatArray | float = 0.0, *, start: FloatArray | None = None
    ) -> FloatArray:
        """Return where `point` is pulled to from *start* (3,), about as far as the handle moves."""
        start = self.point.at(self.mesh.vertices) if start is None else start
        way = np.cross(self.axis, start - self.root)
        moved = _PULL * radians * way / np.linalg.norm(way) + np.asarray(aside)
        return np.asarray(start + self.mesh.diagonal * moved)
