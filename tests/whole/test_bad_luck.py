"""Kills and full disks leave files intact.

A limit on the size of files simulates a disk that is full at byte n; the system enforces it for
native code as well.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import pytest
from solids import OCTAHEDRON, icosphere

import vtk_segdeform as sd
from vtk_segdeform.errors import MeshError
from vtk_segdeform.io import meshlab
from vtk_segdeform.io.convert import write_mesh

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"
posix = pytest.mark.skipif(sys.platform != "linux", reason="needs fork and limits")
SUFFIXES = [".ply", ".obj", ".off", ".stl", ".vtk", ".vtp"]
FOREIGN = [".dae", ".ctm", ".x3d", ".wrl", ".3ds"] if meshlab.available() else []


def killed(folder, count, seed):
    """Return the counts of `killed_saver`."""
    done = subprocess.run(
        [sys.executable, SUPPORT / "killed_saver.py", folder, str(count), str(seed)],
        capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": f"{SUPPORT}:{ROOT}:{Path(__file__).parent}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    counts = re.findall(r"(\d+) ([a-z ]+)", done.stdout)
    return Counter({what: int(number) for number, what in counts})


@posix
def test_a_save_that_is_killed_leaves_the_old_file_or_the_new(tmp_path):
    found = killed(tmp_path, 12, seed=1)
    assert found["old"] + found["new"] == 12
    assert found["killed while writing"] > 0  # otherwise nothing was tested


@posix
@pytest.mark.campaign
def test_a_thousand_killed_saves_lose_no_file(tmp_path):
    found = killed(tmp_path, 1000, seed=2)
    print(f"\n1000 kills: {found}")
    assert found["old"] + found["new"] == 1000
    assert found["killed while writing"] > 200


@contextmanager
def limited_to(size):
    """Limit files to *size* bytes."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def contents(folder):
    """Return the contents of all files, by name."""
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def require_kept_on_a_full_disk(folder, suffix):
    """Check that a mesh file is unchanged if there is not enough space for its replacement."""
    path = folder / f"a{suffix}"
    larger = sd.Mesh(*icosphere(2))
    write_mesh(path, larger)
    size = path.stat().st_size
    write_mesh(path, sd.Mesh(*OCTAHEDRON))
    before = contents(folder)
    nearly = [] if suffix in FOREIGN else [size - 1]  # in other formats the last byte is optional
    for space in (0, 100, size // 2, *nearly):
        with limited_to(space), pytest.raises(MeshError, match=rf"a\{suffix}: cannot be written"):
            write_mesh(path, larger)
        assert contents(folder) == before, space
    write_mesh(path, larger)
    assert contents(folder) != before


@posix
@pytest.mark.parametrize(
    "suffix",
    [
        *SUFFIXES,
        *(pytest.param(each, marks=pytest.mark.campaign) for each in FOREIGN),
    ],
)
def test_on_a_full_disk_a_mesh_file_is_unchanged_and_the_error_names_it(tmp_path, suffix, capfd):
    here = os.getcwd()
    require_kept_on_a_full_disk(tmp_path, suffix)
    assert os.getcwd() == here  # PyMeshLab changes the folder when it fails
    capfd.readouterr()
