"""What every experiment bends: a mesh, what is held and what is moved, and what binds it.

bent_cactus      the trunk's top turned over, the pose of `segdeform demo`
raised_neck      the dinosaur's head and neck, its feet held
benchmark_pose   a pose of Botsch and Sorkine's benchmark, from the folder SEGDEFORM_DATA
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
from ..regions import Regions, cage_distance_weights, segment
from .measuring import timed

# The paper's own formulation: one rotation a vertex, detail only, volume linearised, plain steps.
PAPER: dict[str, Any] = {
    "rotation_groups": None, "stretch": 0.0, "exact_volume": False,
    "acceleration": 0, "exact_hessian": False,
}  # fmt: skip
NEAR = 1e-4  # diagonals: converged is when the next step moves nothing by more


@dataclass(frozen=True, eq=False)
class Task:
    """A mesh to deform: (f,) fixed and (k,) handle vertices, and where the latter go (k, 3)."""

    name: str
    mesh: Mesh
    fixed: IntArray
    handle: IntArray
    targets: FloatArray

    def shifted(self, share: float) -> Task:
        """Return the task with its targets moved on by *share* of the diagonal, sideways."""
        way = share * self.mesh.diagonal * np.array([0.6, 0.8, 0.0])
        return replace(self, targets=self.targets + way)


@dataclass(frozen=True, eq=False)
class Bound:
    """A deformer that is ready, and the seconds it took to get there, part by part."""

    deformer: Deformer
    segment: float
    cages: float
    bind: float

    @property
    def seconds(self) -> float:
        """All of it."""
        return self.segment + self.cages + self.bind


def bound(task: Task, n_regions: int | None, n_vertices: int, **options: Any) -> Bound:
    """Return a deformer for *task* with so many regions and cage vertices; *options* are its own.

    ``as_printed=True`` also takes the paper's blend weights, eq. (4).
    """
    mesh, as_printed = task.mesh, options.pop("as_printed", False)
    regions, t_segment = timed(lambda: divided(mesh, n_regions))
    cages, t_cages = timed(lambda: fit_cages(mesh, regions, n_vertices))
    if as_printed:
        options["blend"] = cage_distance_weights(regions, cages)
    deformer, t_bind = timed(lambda: deformer_of(task, regions, cages, **options))
    return Bound(deformer, t_segment, t_cages, t_bind)


def divided(mesh: Mesh, n_regions: int | None) -> Regions:
    """Return so many regions; None leaves the number to `segment`."""
    return Regions.single(mesh) if n_regions == 1 else segment(mesh, n_regions)


def deformer_of(task: Task, regions: Regions, cages: Sequence[Cage], **options: Any) -> Deformer:
    """Return a deformer that holds what *task* holds."""
    return Deformer(task.mesh, regions, cages, fixed=task.fixed, handle=task.handle, **options)


def bent_cactus(n_vertices: int, degrees: float = 60.0) -> Task:
    """Return the cactus with its top turned over by *degrees*."""
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
    """Load the compiled kernels, and compile them at their first use ever: that counts nowhere."""
    task = bent_cactus(2500)
    bound(task, 1, 40).deformer.solve(task.targets, max_steps=2)


def benchmark_folder() -> Path | None:
    """Return the folder of the benchmark, if SEGDEFORM_DATA names one that has it."""
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
    name: str, mesh: Mesh, held: tuple[BoolArray, BoolArray], turn: tuple[FloatArray, float]
) -> Task:
    """Return the task that turns held[1] about the y direction, at a pivot by some degrees."""
    pivot, angle = turn[0], np.radians(turn[1])
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    fixed, handle = (np.flatnonzero(each) for each in held)
    targets = (mesh.vertices[handle] - pivot) @ matrix.T + pivot
    return Task(name, mesh, fixed, handle, targets)


def _shares(points: FloatArray) -> FloatArray:
    return np.asarray((points - points.min(axis=0)) / np.ptp(points, axis=0))


def _rows(path: Path) -> list[list[str]]:
    lines = path.read_text().splitlines()
    return [line.split() for line in lines if line.strip() and not line.startswith("#")]
