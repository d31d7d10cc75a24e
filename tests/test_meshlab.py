"""PyMeshLab: to it and back changes nothing; without it a sentence says what to install."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from solids import icosphere, torus

from vtk_segdeform import meshlab
from vtk_segdeform.convert import read_mesh, write_mesh
from vtk_segdeform.errors import MeshError, MissingDependencyError
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.volume import signed_volume


@pytest.fixture
def without_pymeshlab(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymeshlab", None)


@pytest.fixture
def with_pymeshlab():
    if not meshlab.available():
        pytest.skip("PyMeshLab is not installed")


@pytest.mark.usefixtures("without_pymeshlab")
def test_without_it_every_call_says_what_to_install(tmp_path):
    mesh = Mesh(*icosphere(1))
    (tmp_path / "a.dae").write_text("x")
    assert not meshlab.available()
    for call in (
        lambda: meshlab.to_meshset(mesh),
        lambda: meshlab.simplify(mesh, 10),
        lambda: meshlab.read(tmp_path / "a.dae"),
        lambda: meshlab.write(tmp_path / "b.dae", mesh),
        lambda: read_mesh(tmp_path / "a.dae"),
        lambda: write_mesh(tmp_path / "b.dae", mesh),
    ):
        with pytest.raises(MissingDependencyError, match="pip install"):
            call()
    assert [path.name for path in tmp_path.iterdir()] == ["a.dae"]


@pytest.mark.usefixtures("with_pymeshlab")
def test_there_and_back_changes_nothing():
    mesh = Mesh(*torus())
    again = meshlab.from_meshset(meshlab.to_meshset(mesh))
    assert_array_equal(again.vertices, mesh.vertices)
    assert_array_equal(again.faces, mesh.faces)
    assert again.vertices.flags.c_contiguous


@pytest.mark.usefixtures("with_pymeshlab")
@pytest.mark.parametrize("suffix", sorted(meshlab.WRITES))
def test_a_file_only_it_can_write_is_read_back_by_the_same_call_as_any_other(tmp_path, suffix):
    mesh = Mesh(*icosphere(2))
    write_mesh(tmp_path / f"a{suffix}", mesh)
    again = read_mesh(tmp_path / f"a{suffix}")
    assert again.n_vertices == mesh.n_vertices
    assert_allclose(np.sort(again.vertices, axis=0), np.sort(mesh.vertices, axis=0), atol=1e-4)
    assert signed_volume(again.vertices, again.faces) == pytest.approx(
        signed_volume(mesh.vertices, mesh.faces), rel=1e-3
    )


@pytest.mark.usefixtures("with_pymeshlab")
@pytest.mark.parametrize("solid", [icosphere(4), torus()])
def test_simplifying_keeps_the_genus_and_nearly_the_volume(solid):
    mesh = Mesh(*solid)
    small = meshlab.simplify(mesh, 200)
    assert abs(small.n_vertices - 200) <= 2
    euler = [m.n_vertices - len(m.edges) + m.n_faces for m in (mesh, small)]
    assert euler[0] == euler[1]
    assert signed_volume(small.vertices, small.faces) == pytest.approx(
        signed_volume(mesh.vertices, mesh.faces), rel=0.05
    )


@pytest.mark.usefixtures("with_pymeshlab")
def test_what_it_cannot_read_is_an_error_that_names_the_file(tmp_path):
    (tmp_path / "a.dae").write_text("rubbish")
    with pytest.raises(MeshError, match=r"a\.dae"):
        read_mesh(tmp_path / "a.dae")
