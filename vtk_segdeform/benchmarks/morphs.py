"""Motions as morph targets: how few keep every pose, and what a blend does to the volume."""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial.transform import Rotation

from ..cages import fit_cages
from ..deformer import Deformer
from ..models import cactus
from ..motions import write_motion
from ..progress import Progress, tell
from ..regions import segment
from .measuring import in_own_process
from .results import Cell, Scale, Section, Table

_POSES, _DEGREES = 36, 70.0  # of the bend, as in examples/write_a_motion.py
_TOLERANCES = (0.01, 0.002, 0.0005)  # of `write_motion`, in diagonals
_COLUMNS = (
    "tolerance, % of the diagonal",
    "morph targets",
    "off by, % of the diagonal",
    "volume of a blend, %",
    "MB",
    "writing, s",
)
_TEXT = f"""\
A cactus that bends by {_DEGREES:.0f} degrees in {_POSES} poses, written to a .glb file. Viewers \
blend linearly between morph targets, so a blend is off the poses between them, and its volume \
differs although that of every pose is exact."""


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table with a row for each tolerance."""
    tell(progress, 0.0, "motions as morph targets")
    rows = in_own_process(measured, scale.paper_size)
    title = f"{_POSES} poses of {scale.paper_size} vertices"
    return Section("Motions", _TEXT, [Table(_COLUMNS, rows, title)])


def measured(size: int) -> list[tuple[Cell, ...]]:
    """Return the rows for a cactus of *size* vertices, measured in this process."""
    mesh = cactus(size)
    height, regions = mesh.vertices[:, 2], segment(mesh, 3)
    fixed, handle = height < 0.1, height > 0.9
    deformer = Deformer(mesh, regions, fit_cages(mesh, regions), fixed=fixed, handle=handle)
    tip, pivot = mesh.vertices[deformer.handle], np.array([0.0, 0.0, 0.4])
    turns = Rotation.from_rotvec(
        np.linspace(0.0, np.radians(_DEGREES), _POSES + 1)[1:, None] * [0.0, 1.0, 0.0]
    )
    poses = [deformer.solve(turn.apply(tip - pivot) + pivot).vertices for turn in turns]
    rows: list[tuple[Cell, ...]] = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bend.glb"
        for tolerance in _TOLERANCES:
            began = time.perf_counter()
            found = write_motion(path, mesh, poses, tolerance=tolerance)
            seconds = time.perf_counter() - began
            shares = 100.0 * tolerance, len(found.kept), 100.0 * found.deviation
            size_of = 1e-6 * path.stat().st_size
            rows.append((*shares, 100.0 * found.volume_change, size_of, seconds))
    return rows
