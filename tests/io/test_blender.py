"""A round trip through Blender keeps smooth shading, hard edges, UVs, materials and quadrangles.

It needs Blender's bpy, in this Python or in the one that SEGDEFORM_BLENDER_PYTHON names:

    python3.11 -m venv bpy && bpy/bin/pip install bpy==5.0.1
    SEGDEFORM_BLENDER_PYTHON=bpy/bin/python pytest tests/io/test_blender.py
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import vtk_segdeform as sd

SCRIPT = Path(__file__).resolve().parents[1] / "support" / "blender.py"
PYTHON = os.environ.get("SEGDEFORM_BLENDER_PYTHON") or (
    sys.executable if importlib.util.find_spec("bpy") else ""
)
pytestmark = pytest.mark.skipif(not PYTHON, reason="needs bpy; see the docstring")


def blender(*arguments):
    """Run the script in Blender's Python; return what it printed."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [PYTHON, str(SCRIPT), *map(str, arguments)], env=environment, capture_output=True,
        text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def described(path):
    """Return what Blender reads from a file: one object."""
    lines = blender("describe", path).splitlines()
    (line,) = (each for each in lines if each.startswith("described "))
    (found,) = json.loads(line.removeprefix("described "))
    return {key: np.array(value) for key, value in found.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blender")
    blender("make", folder)
    return folder


def bent(points):
    return points + 0.1 * np.sin(points[:, [1, 2, 0]])


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply"])
def test_what_blender_wrote_is_the_same_to_it_after_a_deformation(folder, suffix):
    path, out = folder / f"body{suffix}", folder / f"bent{suffix}"
    surface = sd.Surface.read(path)
    assert surface.mesh.is_closed
    surface.write(out, bent(surface.mesh.vertices))
    before, after = described(path), described(out)
    names = () if suffix == ".ply" else ("name",)  # there it is that of the file
    for key in (*names, "counts", "materials"):
        assert before[key].tolist() == after[key].tolist()
    assert after["smooth"][before["smooth"]].all()
    assert_allclose(after["uv"], before["uv"], atol=1e-6)
    assert before["smooth"].any()
    assert len(before["uv"])
    if suffix != ".ply":  # which has neither
        assert set(before["materials"].tolist()) == {"skin", "paint"}
    if suffix != ".glb":  # which has none
        assert 4 in before["counts"]
    moved = np.linalg.norm(after["points"] - before["points"], axis=1)
    assert 0.02 < moved.mean() < 0.2
    # Corners with one normal at a vertex still have one, corners at a hard edge still several.
    _, vertex = np.unique(before["points"].round(4), axis=0, return_inverse=True)
    vertex = vertex.ravel()
    for number in range(vertex.max() + 1):
        here = vertex == number
        agree = before["normals"][here] @ before["normals"][here].T > 0.999
        still = after["normals"][here] @ after["normals"][here].T > 0.999
        assert (agree == still).all()
    assert (np.einsum("ij,ij->i", before["normals"], after["normals"]) > 0.9).all()
