"""Tasks of the experiments: meshes with fixed vertices, handles and targets.

bent_cactus      the trunk is bent, as in `segdeform demo`
raised_neck      the dinosaur's head is turned back, its feet are fixed
benchmark_pose   a pose of Botsch and Sorkine's benchmark, in the folder SEGDEFORM_DATA
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..cages import Cage, fit_cages
from ..deformer import Deformer
from ..io import read_mesh
from ..mesh import Mesh
from ..models import cactus, dinosaur
from ..regions import Regions, segment
from .measuring import timed

CONVERGED = 1e-4  # mesh diagonals: largest movement of a step that counts as converged


@dataclass(frozen=True, eq=False)
class Task:
    """A mesh with fixed vertices (f,), handle vertices (k,) and targets (k, 3)."""

    name: str
    mesh: Mesh
    fixed: IntArray
    handle: IntArray
    targets: FloatArray

    def shifted(self, share: float) -> Task:
        """Return the task with targets moved sideways by *share* of the mesh diagonal."""
        shift = share * self.mesh.diagonal * np.array([0.6, 0.8, 0.0])
        return replace(self, targets=self.targets + shift)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A bound deformer, and the seconds of each part of the set-up."""

    deformer: Deformer
    segment: float
    cages: float
    bind: float

    @property
    def seconds(self) -> float:
        """Total of the set-up."""
        return self.segment + self.cages + self.bind


def prepare(task: Task, n_regions: int | None, n_vertices: int, **options: Any) -> Prepared:
    """Return a deformer for *task* with given numbers of regions and cage vertices.

    *options* are those of `Deformer`.
    """
    mesh = task.mesh
    regions, t_segment = timed(lambda: make_regions(mesh, n_regions))
    cages, t_cages = timed(lambda: fit_cages(mesh, regions, n_vertices))
    deformer, t_bind = timed(lambda: make_deformer(task, regions, cages, **options))
    return Prepared(deformer, t_segment, t_cages, t_bind)


def make_regions(mesh: Mesh, n_regions: int | None) -> Regions:
    """Return *n_regions* regions; if None, `segment` chooses the number."""
    return Regions.single(mesh) if n_regions == 1 else segment(mesh, n_regions)


def make_deformer(task: Task, regions: Regions, cages: Sequence[Cage], **options: Any) -> Deformer:
    """Return a deformer with the fixed vertices and the handle of *task*."""
    return Deformer(task.mesh, regions, cages, fixed=task.fixed, handle=task.handle, **options)


def bent_cactus(n_vertices: int, degrees: float = 60.0) -> Task:
    """Return the cactus with its trunk bent by *degrees*."""
    mesh = cactus(n_vertices)
    height = _shares(mesh.vertices)[:, 2]
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    middle[2] = mesh.vertices[:, 2].min() + 0.4 * np.ptp(mesh.vertices[:, 2])
    return _turned("cactus", mesh, (height < 0.08, height > 0.92), (middle, degrees))


def raised_neck(n_vertices: int, degrees: float = 50.0) -> Task:
    """Return the dinosaur with its head turned back by *degrees* about its shoulders."""
    mesh = dinosaur(n_vertices)
    share = _shares(mesh.vertices)
    head = (share[:, 0] > 0.88) & (share[:, 2] > 0.8)
    shoulders = np.array([0.35, 0.0, 0.45]) * mesh.vertices.max(axis=0)
    return _turned("dinosaur", mesh, (share[:, 2] < 0.06, head), (shoulders, -degrees))


def warm_up() -> None:
    """Load the compiled kernels, or compile them, so that no measurement includes this."""
    task = bent_cactus(2500)
    prepare(task, 1, 40).deformer.solve(task.targets, max_steps=2)


def benchmark_folder() -> Path | None:
    """Return the folder of the benchmark, or None if SEGDEFORM_DATA does not contain it."""
    folder = Path(os.environ.get("SEGDEFORM_DATA", "")) / "botsch-sorkine"
    return folder if "SEGDEFORM_DATA" in os.environ and folder.is_dir() else None


def benchmark_pose(folder: Path, name: str) -> Task:
    """Return the pose "cactus" or "cylinder" of Botsch and Sorkine's benchmark."""
    mesh = read_mesh(folder / f"{name}.off")
    roles = np.array(_rows(folder / f"{name}.sel"), dtype=float).ravel()
    matrix = np.array(_rows(folder / f"{name}.def"), dtype=float)
    fixed, handle = np.flatnonzero(roles == 0), np.flatnonzero(roles == 2)
    targets = mesh.vertices[handle] @ matrix[:3, :3].T + matrix[:3, 3]
    return Task(f"Botsch-Sorkine {name}", mesh, fixed, handle, targets)


def _turned(
    name: str, mesh: Mesh, masks: tuple[BoolArray, BoolArray], turn: tuple[FloatArray, float]
) -> Task:
    """Return the task with *masks* of fixed and handle vertices; *turn* is a pivot and degrees.

    The handle is rotated about the y direction.
    """
    pivot, angle = turn[0], np.radians(turn[1])
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    fixed, handle = (np.flatnonzero(mask) for mask in masks)
    targets = (mesh.vertices[handle] - pivot) @ matrix.T + pivot
    return Task(name, mesh, fixed, handle, targets)


def _shares(points: FloatArray) -> FloatArray:
    return np.asarray((points - points.min(axis=0)) / np.ptp(points, axis=0))


def _rows(path: Path) -> list[list[str]]:
    lines = path.read_text().splitlines()
    return [line.split() for line in lines if line.strip() and not line.startswith("#")]
