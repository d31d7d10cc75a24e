"""Formats that PyMeshLab reads; without it the error says what to install."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from foreign_files import HAS_PYMESHLAB, save_foreign
from numpy.testing import assert_allclose
from solids import icosphere

from vtk_segdeform.errors import MeshError, MissingDependencyError
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.io.convert import write_mesh
from vtk_segdeform.io.surface import read_mesh
from vtk_segdeform.mesh.mesh import Mesh

with_pymeshlab = pytest.mark.skipif(not HAS_PYMESHLAB, reason="needs PyMeshLab")


def test_without_pymeshlab_the_error_says_what_to_install(tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pymeshlab" else find(name)
    )
    (tmp_path / "a.dae").write_text("x")
    with pytest.raises(MissingDependencyError, match=r"a\.dae: .*pip install .*or convert"):
        read_mesh(tmp_path / "a.dae")


@with_pymeshlab
@pytest.mark.parametrize("suffix", [".3ds", ".dae", ".x3d"])
def test_files_in_formats_of_pymeshlab_are_read(tmp_path, suffix):
    mesh = Mesh(*icosphere(2))
    save_foreign(tmp_path / f"a{suffix}", mesh)
    again = read_mesh(tmp_path / f"a{suffix}")
    assert again.n_vertices == mesh.n_vertices
    assert_allclose(np.sort(again.vertices, axis=0), np.sort(mesh.vertices, axis=0), atol=1e-4)
    assert signed_volume(again.vertices, again.faces) == pytest.approx(
        signed_volume(mesh.vertices, mesh.faces), rel=1e-3
    )


@pytest.mark.parametrize("suffix", [".3ds", ".dae", ".x3d"])
def test_they_are_not_written_and_the_error_names_the_formats_that_are(tmp_path, suffix):
    with pytest.raises(MeshError, match=r"cannot be written; use one of \.glb, \.gltf, \.obj"):
        write_mesh(tmp_path / f"a{suffix}", Mesh(*icosphere(1)))
    assert not list(tmp_path.iterdir())


@with_pymeshlab
def test_an_unreadable_file_is_an_error_that_names_it(tmp_path):
    (tmp_path / "a.dae").write_text("rubbish")
    with pytest.raises(MeshError, match=r"a\.dae"):
        read_mesh(tmp_path / "a.dae")
