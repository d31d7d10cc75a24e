"""Batches: two processes against one, and bytes.

The times are those of the clock, since processes side by side are the point: on a machine that
does other work they say little.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..batches import batch
from ..models import random_limbs
from ..progress import Progress, tell
from .measuring import in_own_process
from .results import Cell, Scale, Section, Table

_LARGE = 20_000  # vertices of the mesh whose poses are read
_COLUMNS = ("quantity", "value")
_TEXT = """\
Random poses of random bodies that have not been bound before, by one process and by two, with \
their start. *Reading a pose*: its vertices, not counting the first one of the mesh. All times are \
of the clock."""


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table of quantities."""
    tell(progress, 0.0, "batches in one process and in two")
    rows = in_own_process(measured, *scale.batch)
    n_meshes, n_poses, size = scale.batch
    title = f"{n_meshes} meshes of {size} vertices, {n_poses} poses each"
    return Section("Batches", _TEXT, [Table(_COLUMNS, rows, title, mixed=True)])


def measured(n_meshes: int, n_poses: int, size: int) -> list[tuple[Cell, ...]]:
    """Return the rows of so many meshes and poses, measured in this process."""
    meshes = [random_limbs(size, seed) for seed in range(n_meshes)]
    plan: dict[str, Any] = {"meshes": meshes, "poses": [{"random": n_poses, "seed": 1}]}
    with TemporaryDirectory() as name:
        folder = Path(name)
        stores, seconds = [], []
        for count in (1, 2):
            os.environ["SEGDEFORM_CACHE"] = str(folder / f"cache {count}")
            store, each = _timed(partial(batch, plan, folder / f"{count}", n_workers=count))
            stores.append(store)
            seconds.append(each)
        table, poses = stores[0].table(), n_meshes * n_poses
        draws = [each for each in table["draws"] if each is not None]
        large = {"meshes": [random_limbs(_LARGE, 1)], "poses": [{"random": 10, "seed": 1}]}
        store = batch(large, folder / "large", n_workers=1)
        store.vertices(0)
        reads = [_timed(partial(store.vertices, number))[1] for number in range(1, 10)]
        return [
            ("one process, s", seconds[0]),
            ("two processes, s", seconds[1]),
            ("one process / two", seconds[0] / seconds[1]),
            ("same bytes", "yes" if stores[0].digest() == stores[1].digest() else "no"),
            ("poses without vertices", sum(not each for each in draws) + poses - len(draws)),
            ("refused random poses, %", 100.0 * (1.0 - len(draws) / sum(draws))),
            ("largest volume change", max(abs(v) for v in table["volume_change"] if v is not None)),
            ("seconds of a pose", statistics.mean(table["seconds"])),
            ("seconds of one process for a mesh", seconds[0] / n_meshes),
            ("bytes of a pose", sum(len(each.tobytes()) for each in stores[0].cage_vertices(0))),
            ("bytes of the file for each pose", stores[0].path.stat().st_size / poses),
            (f"reading a pose of {_LARGE} vertices, ms", 1e3 * statistics.median(reads)),
        ]


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    began = time.perf_counter()
    return work(), time.perf_counter() - began
