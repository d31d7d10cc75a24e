"""Benchmark meshes from a folder beside the checkout; tests that need them skip without it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

_ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("SEGDEFORM_DATA", _ROOT.parent / "shared" / "data"))


def path_of(name: str) -> Path:
    """Return the path of a benchmark file, or skip the current test."""
    path = DATA / name
    if not path.is_file():
        pytest.skip(f"{name} is not in {DATA}; set SEGDEFORM_DATA to the folder that has it")
    return path


def read_off(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return (vertices, faces) of a triangle OFF file, with or without colours."""
    lines = [line.split() for line in path_of(name).read_text().splitlines() if line.strip()]
    n, m = int(lines[1][0]), int(lines[1][1])
    vertices = np.array([line[:3] for line in lines[2 : 2 + n]], dtype=float)
    faces = np.array([line[1:4] for line in lines[2 + n : 2 + n + m]], dtype=int)
    return vertices, faces


def botsch_sorkine(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (vertices, faces, selection, matrix) of the pose "cactus" or "cylinder".

    selection is 0 for fixed, 1 for free and 2 for handle vertices; matrix (4, 4) moves the handle.
    """
    vertices, faces = read_off(f"botsch-sorkine/{name}.off")
    folder = "botsch-sorkine/"
    lines = path_of(f"{folder}{name}.sel").read_text().splitlines()
    selection = np.array([int(line) for line in lines if line and not line.startswith("#")])
    lines = path_of(f"{folder}{name}.def").read_text().splitlines()
    rows = [line.split() for line in lines if line and not line.startswith("#")]
    return vertices, faces, selection, np.array(rows, dtype=float)
