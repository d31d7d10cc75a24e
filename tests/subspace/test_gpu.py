"""The passes of a GPU, run with numpy, with torch on the processor, and on a GPU if there is one.

Without a GPU the same lines run with another library: numpy always, torch where it is installed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import icosphere, torus

from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.solver import exact_volume
from vtk_segdeform.solver.volume_constraints import total_volume
from vtk_segdeform.subspace import gpu, subspace
from vtk_segdeform.subspace.gpu import GPUError, GPUSurface, TorchArrays, gpu_arrays
from vtk_segdeform.subspace.subspace import Subspace, cage_subspace

ROOT = Path(__file__).resolve().parents[2]
SCENE = sausage()
SUBSPACE = cage_subspace(SCENE.regions, SCENE.cages)
SINGLE = replace(SUBSPACE, blocks=tuple(b.astype(np.float32) for b in SUBSPACE.blocks))
MOVES = 0.3 * np.random.default_rng(4).normal(size=(SUBSPACE.n_columns, 3))
BEAD = icosphere(3)
RING = torus(36, 24)


@pytest.fixture(params=["numpy", "torch", "gpu"])
def arrays(request, monkeypatch):
    """Return each library in turn; meshes are divided into pieces, as large ones are."""
    monkeypatch.setattr(gpu, "_FACES_AT_ONCE", 1000)
    monkeypatch.setattr(subspace, "_DENSE_NUMBERS", 5000)
    if request.param == "numpy":
        return np
    if request.param == "torch":
        return TorchArrays(pytest.importorskip("torch"), "cpu")
    return gpu_arrays() or pytest.skip("no GPU here")


def still(points, faces, arrays) -> GPUSurface:
    """Return a surface without cages."""
    return GPUSurface(Subspace(len(points), (), ()), points, faces, arrays)


@pytest.mark.parametrize("subspace", [SUBSPACE, SINGLE], ids=["double", "single"])
def test_the_map_is_that_of_the_subspace(arrays, subspace):
    rest = SCENE.mesh.vertices
    surface = GPUSurface(subspace, rest, SCENE.mesh.faces, arrays)
    for moves in (MOVES, 0.0 * MOVES, -MOVES):  # independent of the last call
        assert_allclose(
            surface.host(surface.map(moves)), subspace.map(moves, rest.copy()), rtol=0, atol=1e-14
        )


@pytest.mark.parametrize("far", [0.0, 1e4])
def test_the_volume_is_exact_and_reproducible(arrays, far):
    points, faces = RING[0] + far, RING[1]
    surface, x = still(points, faces, arrays), arrays.asarray(points)
    volume = surface.volume(x)
    assert volume == pytest.approx(signed_volume(points, faces), rel=1e-14)
    assert all(surface.volume(x) == volume for _ in range(5))
    # On a wire 400 times as long as thick, products of its corners would cost three digits.
    wire = points * [400.0, 1.0, 1.0]
    assert surface.volume(arrays.asarray(wire)) == pytest.approx(
        signed_volume(wire, faces), rel=1e-14
    )


def test_scaling_restores_the_volume_of_the_rest_shape(arrays):
    rest, faces = SCENE.mesh.vertices, SCENE.mesh.faces
    constraint = total_volume(SCENE.mesh)
    surface = GPUSurface(SINGLE, rest, faces, arrays)
    x = surface.map(MOVES)
    centre = np.array([0.3, -2.0, 1.0])
    there = surface.host(x).copy()
    assert abs(constraint.relative(there)) > 1e-2
    scale = surface.scale_to_volume(x, constraint.target, centre)
    expected = exact_volume.scale_to_volume(constraint, there, centre)
    assert scale == pytest.approx(expected, rel=1e-14)
    assert_allclose(surface.host(x), there, rtol=0, atol=1e-14)
    assert abs(constraint.relative(surface.host(x))) < 1e-14


def test_a_surface_that_is_inside_out_stays_as_it_is(arrays):
    points, faces = BEAD
    mirrored = points * [1.0, 1.0, -1.0]
    x = arrays.asarray(mirrored)
    surface = still(points, faces, arrays)
    assert surface.scale_to_volume(x, signed_volume(points, faces), np.ones(3)) == 1.0
    assert_array_equal(surface.host(x), mirrored)


def test_no_call_takes_more_memory_than_documented(monkeypatch):
    monkeypatch.setattr(gpu, "_FACES_AT_ONCE", 1 << 10)
    points, faces = torus(240, 120)
    n, m = len(points), len(faces)
    whole = np.arange(n)
    subspace = Subspace(n, (whole,), (np.ones((n, 2), dtype=np.float32),))
    piece = 300 * gpu._FACES_AT_ONCE

    def taken(call):
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        kept = call()
        after, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return kept, after - before, peak - before

    surface, stays, _ = taken(lambda: GPUSurface(subspace, points, faces, np))
    assert stays < 1.01 * (8 * 2 * n + 24 * n + 24 * m)
    x, _, most = taken(lambda: surface.map(np.zeros((2, 3))))
    assert most < 1.01 * 80 * n
    assert taken(lambda: surface.volume(x))[2] < 1.01 * (8 * m + piece)


@pytest.mark.parametrize("fault", [MemoryError("2 bytes wanted"), RuntimeError("CUDA error")])
def test_a_failure_of_the_gpu_raises_a_gpu_error(fault):
    def fails(*_, **__):
        raise fault

    full = types.SimpleNamespace(**{**vars(np), "empty": fails})
    with pytest.raises(GPUError, match=f"GPU computation failed: {fault}"):
        GPUSurface(SUBSPACE, SCENE.mesh.vertices, SCENE.mesh.faces, full)
    lost = still(*BEAD, types.SimpleNamespace(**{**vars(np), "take": fails}))
    for call in (lost.volume, lambda x: lost.scale_to_volume(x, 1.0, np.zeros(3))):
        with pytest.raises(GPUError, match=f"^GPU computation failed: {fault}$"):
            call(BEAD[0])


def test_a_library_is_used_only_if_its_results_are_right(monkeypatch, capsys):
    def absent():
        raise ImportError("no such library")

    wrong = types.SimpleNamespace(**{**vars(np), "cross": lambda a, b: -np.cross(a, b)})
    monkeypatch.setattr(gpu, "_driver_has_a_gpu", lambda: True)
    find = gpu._found.__wrapped__
    for cupy, torch, expected in (
        (lambda: np, absent, np),
        (absent, lambda: np, np),
        (lambda: wrong, lambda: np, np),
        (lambda: wrong, absent, None),
        (absent, absent, None),
    ):
        monkeypatch.setattr(gpu, "_cupy", cupy)
        monkeypatch.setattr(gpu, "_torch", torch)
        assert find() is expected
    monkeypatch.setattr(gpu, "_driver_has_a_gpu", lambda: False)
    assert find() is None
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("status", "number", "expected"), [(0, 2, True), (0, 0, False), (100, 1, False)]
)
def test_the_driver_reports_whether_there_is_a_gpu(monkeypatch, status, number, expected):
    def tell(place):
        place._obj.value = number
        return 0

    driver = types.SimpleNamespace(cuInit=lambda flags: status, cuDeviceGetCount=tell)
    monkeypatch.setattr(gpu.ctypes, "CDLL", lambda name: driver)
    assert gpu._driver_has_a_gpu() is expected


def test_an_environment_variable_turns_the_gpu_off(monkeypatch):
    monkeypatch.setattr(gpu, "_found", lambda: np)
    assert gpu_arrays() is np
    monkeypatch.setenv("SEGDEFORM_GPU", "0")
    assert gpu_arrays() is None


def test_without_a_gpu_neither_library_is_imported_and_nothing_is_printed(tmp_path):
    for name in ("cupy", "torch"):
        (tmp_path / f"{name}.py").write_text(f"print('{name} was imported')\n")
    program = (
        "import vtk_segdeform, vtk_segdeform.subspace.gpu\n"
        "assert vtk_segdeform.subspace.gpu.gpu_arrays() is None\n"
        "import torch\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)]),
            "CUDA_VISIBLE_DEVICES": "",  # none is seen where there is one
        },
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("torch was imported\n", "")
