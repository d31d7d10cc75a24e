"""Small complete scenes: a mesh, its regions and cages, fixed vertices and a handle."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np
from solids import icosphere, rotation

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session import Options, Session, State


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a `Deformer` needs."""

    mesh: Mesh
    regions: Regions
    cages: tuple[Cage, ...]
    fixed: np.ndarray
    handle: np.ndarray

    def deformer(self, **options) -> Deformer:
        """Return a deformer over the scene."""
        return Deformer(
            self.mesh, self.regions, self.cages, fixed=self.fixed, handle=self.handle, **options
        )

    def held(self, **volumes) -> Deformer:
        """Return a deformer with options of `Deformer.hold` only; the cages are bound only once."""
        bound = _bound(self.mesh, self.regions, self.cages)
        return bound.hold(fixed=self.fixed, handle=self.handle, **volumes)

    def caged(self, **options) -> Session:
        """Return a session of the scene with regions and cages."""
        session = Session(self.mesh, state=State(options=Options(**options)))
        session.set_regions(self.regions)
        session.set_cages(self.cages)
        return session

    def session(self, name: str | None = None, **options) -> Session:
        """Return a session of the scene, complete except for a pose."""
        session = self.caged(**options)
        session.set_fixed(self.fixed)
        session.handles.add(self.handle, name)
        return session

    def turned(self, degrees: float, axis=(0.0, 1.0, 0.0), about=(0.0, 0.0, 0.0)) -> np.ndarray:
        """Return targets: the handle rotated about a line."""
        x = self.mesh.vertices[self.handle] - about
        return x @ rotation(axis, np.radians(degrees)).T + about

    def transformed(self, turn=None, scale: float = 1.0, shift=(0.0, 0.0, 0.0)) -> Scene:
        """Return the scene with its cages rotated, scaled and shifted."""
        turn = np.eye(3) if turn is None else turn

        def move(x):
            return scale * x @ turn.T + shift

        mesh = Mesh(move(self.mesh.vertices), self.mesh.faces)
        cages = tuple(Cage(move(c.vertices), c.faces) for c in self.cages)
        regions = Regions(mesh, self.regions.membership)
        return Scene(mesh, regions, cages, self.fixed, self.handle)


@functools.lru_cache(maxsize=8)
def _bound(mesh: Mesh, regions: Regions, cages: tuple[Cage, ...]) -> Deformer:
    return Deformer(mesh, regions, cages)


@functools.cache
def sausage(n_regions: int = 2, *, is_coarse: bool = False) -> Scene:
    """Return an ellipsoid along x with bumps, in *n_regions* overlapping cages of 66 vertices.

    A coarse one, for gestures, has a quarter of the vertices: 18 of each cage.
    All tests of a process share it, so they must not change it.
    """
    sphere, faces = icosphere(3 if is_coarse else 4)
    bumps = 1.0 + 0.03 * np.sin(9 * sphere[:, :1]) * np.cos(5 * sphere[:, 1:2])
    mesh = Mesh(sphere * bumps * [3.0, 0.8, 0.8], faces)
    x = mesh.vertices[:, 0]
    edges = np.linspace(x.min(), x.max(), n_regions + 1)
    ball, ball_faces = icosphere(1 if is_coarse else 2)
    masks, cages = [], []
    for low, high in itertools.pairwise(edges):
        mask = (x >= low - 0.5) & (x <= high + 0.5)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        radii = np.array([1.75 * (half + 0.5), 1.45, 1.45])
        cages.append(Cage(ball * radii + [middle, 0.0, 0.0], ball_faces))
        masks.append(mask)
    regions = Regions.from_masks(mesh, np.array(masks))
    fixed, handle = np.flatnonzero(x < -2.4), np.flatnonzero(x > 2.4)
    for ids in (fixed, handle):
        ids.setflags(write=False)
    return Scene(mesh, regions, tuple(cages), fixed, handle)


def joined(*parts: tuple[Mesh, float, float, int]) -> Mesh:
    """Return one mesh of parts, each (mesh, shift along x, scale, orientation)."""
    vertices, faces, count = [], [], 0
    for mesh, shift, scale, side in parts:
        vertices.append(mesh.vertices * scale + [shift, 0.0, 0.0])
        faces.append((mesh.faces if side > 0 else mesh.faces[:, ::-1]) + count)
        count += mesh.n_vertices
    return Mesh(np.concatenate(vertices), np.concatenate(faces))
