"""PyMeshLab: conversion both ways changes nothing; without it the error says what to install."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import icosphere, torus

from vtk_segdeform.errors import MeshError, MissingDependencyError
from vtk_segdeform.geometry import local_volume_change
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io import Surface, meshlab
from vtk_segdeform.io.array_names import set_names
from vtk_segdeform.io.convert import from_polydata, read_polydata, to_polydata, write_mesh
from vtk_segdeform.io.surface import read_mesh
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.session.session import Session


@pytest.fixture
def without_pymeshlab(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymeshlab", None)


@pytest.fixture
def with_pymeshlab():
    if not meshlab.available():
        pytest.skip("PyMeshLab is not installed")


@pytest.mark.usefixtures("without_pymeshlab")
def test_without_pymeshlab_every_error_says_what_to_install(tmp_path):
    mesh = Mesh(*icosphere(1))
    (tmp_path / "a.dae").write_text("x")
    assert not meshlab.available()
    for call in (
        lambda: meshlab.to_meshset(mesh),
        lambda: meshlab.simplify(mesh, 10),
        lambda: meshlab.write(tmp_path / "b.dae", mesh),
        lambda: read_mesh(tmp_path / "a.dae"),
        lambda: write_mesh(tmp_path / "b.dae", mesh),
    ):
        with pytest.raises(MissingDependencyError, match="pip install"):
            call()
    assert [path.name for path in tmp_path.iterdir()] == ["a.dae"]


def painted() -> pv.PolyData:
    """Return a torus with random values of all attributes of MeshLab."""
    rng = np.random.default_rng(5)
    surface = to_polydata(Mesh(*torus()))
    for attributes, n in (
        (surface.point_data, surface.n_points),
        (surface.cell_data, surface.n_cells),
    ):
        attributes["selection"] = rng.integers(0, 2, n).astype(np.uint8)
        attributes["quality"] = 1e3 * rng.normal(size=n)
        attributes["RGBA"] = rng.integers(0, 256, (n, 4)).astype(np.uint8)
    surface.cell_data["TextureCorners"] = rng.random((surface.n_cells, 6)).astype(np.float32)
    surface.point_data["TextureCoordinates"] = rng.random((surface.n_points, 2)).astype(np.float32)
    surface.point_data.active_texture_coordinates_name = "TextureCoordinates"
    return surface


def same(a: pv.PolyData, b: pv.PolyData) -> bool:
    """Return whether two surfaces and their arrays are identical."""
    assert_array_equal(a.points, b.points)
    assert_array_equal(a.regular_faces, b.regular_faces)
    for mine, other in ((a.point_data, b.point_data), (a.cell_data, b.cell_data)):
        assert sorted(mine) == sorted(other)
        for name in mine:
            assert_array_equal(np.asarray(mine[name]), np.asarray(other[name]), err_msg=name)
    assert_array_equal(a.active_texture_coordinates, b.active_texture_coordinates)
    return True


@pytest.mark.usefixtures("with_pymeshlab")
def test_selection_quality_colours_and_texture_are_preserved_exactly():
    surface = painted()
    meshset = meshlab.to_meshset(surface)
    layer = meshset.current_mesh()
    chosen = surface.point_data["selection"].astype(bool)
    assert_array_equal(layer.vertex_selection_array(), chosen)
    assert layer.selected_face_number() == surface.cell_data["selection"].sum()
    again = meshlab.from_meshset(meshset)
    assert same(again, surface)
    assert same(meshlab.from_meshset(meshlab.to_meshset(again)), surface)


@pytest.mark.usefixtures("with_pymeshlab")
def test_other_arrays_become_custom_attributes_and_are_read_by_name():
    surface = to_polydata(Mesh(*icosphere(1)))
    rng = np.random.default_rng(3)
    surface.point_data["heat of\u00e4"] = rng.random(surface.n_points)
    surface.point_data["flow"] = rng.random((surface.n_points, 3))
    surface.cell_data["flow"] = rng.random(surface.n_cells)
    surface.cell_data["part"] = np.arange(surface.n_cells)
    surface.point_data["words"] = ["a"] * surface.n_points  # not numeric
    surface.point_data["tensor"] = rng.random((surface.n_points, 9))  # MeshLab has no tensors
    meshset = meshlab.to_meshset(surface)
    names = ["heat of\u00e4", "flow", "part"]
    again = meshlab.from_meshset(meshset, names)
    assert set(again.point_data.keys()) == set(names[:2])
    assert set(again.cell_data.keys()) == {"flow", "part"}
    for mine, other in (
        (again.point_data, surface.point_data),
        (again.cell_data, surface.cell_data),
    ):
        for name, values in mine.items():
            assert_array_equal(values, other[name])
    meshset.meshing_invert_face_orientation()  # attributes follow changes of the layer
    turned = meshlab.from_meshset(meshset, ["part"])
    assert_array_equal(turned.cell_data["part"], surface.cell_data["part"])
    assert not meshlab.from_meshset(meshset).point_data
    with pytest.raises(MeshError, match="no attribute 'cold'"):
        meshlab.from_meshset(meshset, ["cold"])


@pytest.mark.usefixtures("with_pymeshlab")
def test_a_session_becomes_layers_of_its_mesh_and_cages_in_their_pose():
    scene = sausage(2)
    session = scene.session()
    session.drag(scene.turned(20), max_steps=3)
    meshset = meshlab.to_meshset(session)
    assert_array_equal(meshlab.selected_vertices(meshset), scene.handle)
    layers = meshlab.layers_from_meshset(meshset)
    assert list(layers) == ["mesh", "local volume change", "cage 1", "cage 2"]
    assert_array_equal(layers["mesh"].points, session.vertices)
    change = local_volume_change(scene.mesh, session.vertices)
    assert_array_equal(layers["local volume change"]["quality"], change)
    assert_array_equal(layers["mesh"]["quality"], scene.regions.labels)
    for name, vertices in zip(("cage 1", "cage 2"), session.cage_vertices, strict=True):
        assert_array_equal(layers[name].points, vertices)


@pytest.mark.usefixtures("with_pymeshlab")
def test_a_surface_and_its_session_are_converted_as_given_but_for_the_pose():
    surface = Surface(pv.Cube(x_length=4.0).triangulate().subdivide(3))
    surface.given.point_data["heat"] = np.arange(float(surface.given.n_points))
    again = meshlab.from_meshset(meshlab.to_meshset(surface), ["heat"])
    assert_array_equal(again.points, surface.given.points)
    assert_array_equal(again.regular_faces, surface.given.regular_faces)
    assert_array_equal(again["heat"], surface.given["heat"])
    assert Surface(again).mesh.is_closed
    session = Session(surface)
    session.handles.add(session.mesh.vertices[:, 0] > 1.9)
    layer = meshlab.from_meshset(meshlab.to_meshset(session))
    assert_array_equal(layer.points, surface.given.points)
    assert_array_equal(layer["selection"] > 0, surface.given.points[:, 0] > 1.9)


@pytest.mark.usefixtures("with_pymeshlab")
def test_the_matrix_of_a_layer_is_applied_and_equal_names_get_a_number():
    ball = Mesh(*icosphere(1))
    meshset = meshlab.to_meshset({"a": ball})
    meshset.add_mesh(meshset.current_mesh())
    meshset.current_mesh().set_label("a")
    meshset.compute_matrix_from_translation(axisx=2.0, freeze=False)
    layers = meshlab.layers_from_meshset(meshset)
    assert list(layers) == ["a", "a 2"]
    assert_allclose(layers["a 2"].points - layers["a"].points, np.tile([2.0, 0.0, 0.0], (18, 1)))


@pytest.mark.usefixtures("with_pymeshlab")
def test_quadrangles_are_cut_and_other_types_are_errors():
    cube = pv.Cube().clean()
    cube.cell_data["quality"] = np.arange(6.0)
    again = meshlab.from_meshset(meshlab.to_meshset(cube))
    assert again.n_cells == 12
    assert_array_equal(np.sort(again.cell_data["quality"]), np.repeat(np.arange(6.0), 2))
    for wrong in (3, {"a": "b"}, pv.ImageData()):
        with pytest.raises(MeshError, match="expected a Mesh, a Surface, a PolyData, a Session"):
            meshlab.to_meshset(wrong)
    for ask in (meshlab.from_meshset, meshlab.selected_vertices):
        with pytest.raises(MeshError, match="has no layer"):
            ask(meshlab.to_meshset({}))


@pytest.mark.usefixtures("with_pymeshlab")
@pytest.mark.parametrize("suffix", every(8, sorted(meshlab.WRITES)))
def test_files_in_formats_of_pymeshlab_are_written_and_read(tmp_path, suffix):
    mesh = Mesh(*icosphere(2))
    write_mesh(tmp_path / f"a{suffix}", mesh)
    again = read_mesh(tmp_path / f"a{suffix}")
    assert again.n_vertices == mesh.n_vertices
    assert_allclose(np.sort(again.vertices, axis=0), np.sort(mesh.vertices, axis=0), atol=1e-4)
    assert signed_volume(again.vertices, again.faces) == pytest.approx(
        signed_volume(mesh.vertices, mesh.faces), rel=1e-3
    )


@pytest.mark.usefixtures("with_pymeshlab")
@pytest.mark.parametrize("suffix", every(2, [".x3d", ".dae"]))
def test_what_files_of_pymeshlab_do_not_store_is_told(tmp_path, caplog, suffix):
    surface = painted()
    set_names(surface, "groups", ["arm", "leg"])
    write_mesh(tmp_path / f"a{suffix}", surface)
    (message,) = caplog.messages
    assert message.startswith(f"{suffix} written by PyMeshLab cannot store point array 'selection'")
    for sort in ("point", "cell"):
        for name in getattr(surface, f"{sort}_data"):
            assert f"{sort} array '{name}'" in message
    assert message.endswith("field array 'groups': left out")
    assert not read_polydata(tmp_path / f"a{suffix}").array_names
    caplog.clear()
    write_mesh(tmp_path / f"b{suffix}", from_polydata(surface))
    assert not caplog.messages


@pytest.mark.usefixtures("with_pymeshlab")
@pytest.mark.parametrize("solid", [icosphere(4), torus()])
def test_simplifying_preserves_the_genus_and_nearly_the_volume(solid):
    mesh = Mesh(*solid)
    small = meshlab.simplify(mesh, 200)
    assert abs(small.n_vertices - 200) <= 2
    euler = [m.n_vertices - len(m.edges) + m.n_faces for m in (mesh, small)]
    assert euler[0] == euler[1]
    assert signed_volume(small.vertices, small.faces) == pytest.approx(
        signed_volume(mesh.vertices, mesh.faces), rel=0.05
    )


@pytest.mark.usefixtures("with_pymeshlab")
def test_an_unreadable_file_is_an_error_that_names_it(tmp_path):
    (tmp_path / "a.dae").write_text("rubbish")
    with pytest.raises(MeshError, match=r"a\.dae"):
        read_mesh(tmp_path / "a.dae")
