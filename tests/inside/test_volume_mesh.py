"""`VolumeMesh`: kinds of meshes and cells, fields, patches and files."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import pyvista as pv
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from volumes import bar, ends

import vtk_segdeform as sd
from vtk_segdeform.cli import main
from vtk_segdeform.errors import ArgumentError, MeshError
from vtk_segdeform.inside.volume_files import write_volume_file

meshio = pytest.importorskip("meshio")
pytestmark = pytest.mark.usefixtures("bound_once")


def with_patches():
    """Return a bar of meshio with named faces at its ends, one as a set and one of Gmsh."""
    grid = bar("hexahedron")
    points = np.array(grid.points)
    volume = sd.VolumeMesh(grid)
    faces = np.array(volume.surface.given.regular_faces)
    height = points[faces][:, :, 2]
    tags = np.where(height.min(axis=1) > 3.99, 7, np.where(height.max(axis=1) < 0.01, 5, 2))
    return meshio.Mesh(
        points,
        [("hexahedron", grid.cells_dict[12]), ("quad", faces)],
        cell_sets={"lowest": [np.empty(0, dtype=int), np.flatnonzero(tags == 5)]},
        field_data={"tip": np.array([7, 2]), "base": np.array([5, 2])},
        cell_data={
            "gmsh:physical": [np.full(grid.n_cells, 1), tags],
            "fibre": [np.array(grid.cell_data["fibre"]), np.zeros((len(faces), 3))],
        },
        point_data={"height": points[:, 2].copy()},
    )


def given(kind, folder):
    if kind == "grid":
        return bar("tetra")
    if kind == "meshio":
        return with_patches()
    path = folder / f"bar{kind}"
    if kind == ".msh":
        write_volume_file(path, with_patches())
    else:
        bar("wedge").save(path)
    return path


@pytest.mark.parametrize("kind", every(2, ["meshio", ".vtu", "grid", ".vtk", ".msh"]))
def test_deform_and_pull_give_back_the_kind_with_its_inside_moved(kind, tmp_path):
    mesh = given(kind, tmp_path)
    is_meshio = kind in ("meshio", ".msh")
    before = sd.VolumeMesh.read(mesh) if kind.startswith(".") else sd.VolumeMesh(mesh)
    rest = np.array(before.grid.points, dtype=float)
    solution = sd.deform(mesh, *ends(rest, 40.0), n_regions=2, n_cage_vertices=60)
    assert isinstance(solution.mesh, meshio.Mesh if is_meshio else pv.UnstructuredGrid)
    assert not len(solution.inside.inverted)
    assert abs(solution.volume_change) < 1e-12
    assert_array_equal(solution.mesh.points, solution.inside.points)
    _, handle, targets = ends(rest, 40.0)
    on_surface = np.isin(handle, before.corners.faces)
    assert_allclose(solution.mesh.points[handle[on_surface]], targets[on_surface], atol=1e-6)
    assert_array_equal(solution.mesh.point_data["height"], rest[:, 2])
    tip = int(rest[:, 2].argmax())
    pulled = sd.pull(mesh, tip, rest[tip] + [0.3, 0.0, 0.0], n_regions=1, n_cage_vertices=40)
    assert pulled.inside.smallest > 0.0
    assert sd.segment(mesh, 2).n_regions == 2


def test_what_was_given_is_not_changed():
    mesh = with_patches()
    before = copy.deepcopy(mesh)
    sd.deform(mesh, *ends(mesh.points, 20.0), n_regions=1, n_cage_vertices=40)
    assert_array_equal(mesh.points, before.points)
    assert mesh.cell_sets.keys() == before.cell_sets.keys()
    assert mesh.cell_data.keys() == before.cell_data.keys()


def test_the_direction_in_which_cells_are_numbered_makes_no_difference():
    grid = bar("tetra")
    other = pv.UnstructuredGrid({10: grid.cells_dict[10][:, [0, 2, 1, 3]]}, grid.points)
    poses = []
    for each in (grid, other):
        volume = sd.VolumeMesh(each)
        x = volume.surface.mesh.vertices * [1.0, 1.0, 1.2]
        poses.append(volume.pose(x))
    assert poses[1].smallest_before == pytest.approx(poses[0].smallest_before)
    assert_allclose(poses[1].points, poses[0].points, atol=1e-6)


def test_voxels_become_hexahedra():
    voxels = pv.ImageData(dimensions=(4, 4, 9)).cast_to_unstructured_grid()
    voxels.cell_data["number"] = np.arange(voxels.n_cells)
    volume = sd.VolumeMesh(voxels)
    assert set(volume.grid.celltypes) == {12}
    assert volume.at_rest.smallest == pytest.approx(1.0)
    assert_array_equal(volume.moved(volume.at_rest).cell_data["number"], np.arange(72))


@pytest.mark.parametrize("name", ["quadratic", "polyhedra", "surface", "polydata", "nan"])
def test_other_cells_are_refused_by_name(name):
    grid = bar("tetra", 2, 2)
    if name == "quadratic":
        ten = pv.UnstructuredGrid(
            {24: np.arange(10)[None]}, np.random.default_rng(0).random((10, 3))
        )
        with pytest.raises(MeshError, match="QUADRATIC_TETRA"):
            sd.pull(ten, 0, [2, 2, 2])
    elif name == "polyhedra":
        with pytest.raises(MeshError, match="POLYHEDRON"):
            sd.VolumeMesh(pv.examples.cells.Polyhedron())
    elif name == "surface":
        with pytest.raises(MeshError, match="no tetrahedra"):
            sd.VolumeMesh(pv.Sphere().cast_to_unstructured_grid())
    elif name == "polydata":
        with pytest.raises(ArgumentError, match="UnstructuredGrid"):
            sd.VolumeMesh(pv.Sphere())
    else:
        grid.points[3] = np.nan
        with pytest.raises(MeshError, match="not finite"):
            sd.VolumeMesh(grid)


def test_patches_have_names():
    patches = sd.VolumeMesh(with_patches()).patches
    height = with_patches().points[:, 2]
    for name in ("base", "lowest"):
        assert_array_equal(patches[name], np.flatnonzero(height < 1e-9))
    assert_array_equal(patches["tip"], np.flatnonzero(height > 4.0 - 1e-9))


def test_vectors_turn_or_are_pushed_by_choice():
    volume = sd.VolumeMesh(bar("pyramid"))
    turn = Rotation.from_rotvec([0.3, -0.7, 0.2])
    pose = volume.pose(2.0 * turn.apply(np.array(volume.surface.mesh.vertices)))
    fibre = turn.apply([0.0, 0.0, 1.0])
    at = {}
    for how, length in (({}, None), ({"turn": ["fibre"]}, 1.0), ({"push": ["fibre"]}, 2.0)):
        found = volume.moved(pose, **how, displacement="u")
        expected = [0.0, 0.0, 1.0] if length is None else length * fibre
        assert_allclose(found.cell_data["fibre"], np.tile(expected, (found.n_cells, 1)), atol=2e-2)
        at[length] = found
    assert_allclose(at[None]["u"], pose.points - np.asarray(volume.grid.points))
    assert_array_equal(at[1.0].cell_data["number"], volume.grid.cell_data["number"])
    with pytest.raises(ArgumentError, match="no array 'number'"):
        volume.moved(pose, turn=["number"])


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh", ".mesh"])
def test_files_have_every_digit(suffix, tmp_path):
    volume = sd.VolumeMesh(bar("hexahedron"))
    pose = volume.pose(volume.surface.mesh.vertices * [1.1, 0.9, 1.0])
    path = tmp_path / f"bar{suffix}"
    volume.write(path, pose)
    again = sd.VolumeMesh.read(path)
    assert_allclose(np.asarray(again.grid.points), pose.points, atol=1e-15)
    assert_array_equal(again.grid.cells_dict[12], volume.grid.cells_dict[12])
    if suffix != ".mesh":
        assert_array_equal(again.grid.point_data["height"], volume.grid.point_data["height"])
    with pytest.raises(MeshError, match=r"cells cannot be written there; use one of \.mesh"):
        volume.write(tmp_path / "bar.ply", pose)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh", ".mesh"])
def test_a_damaged_file_is_an_error(suffix, tmp_path):
    path = tmp_path / f"bar{suffix}"
    with pytest.raises(MeshError, match=r"bar\."):
        sd.VolumeMesh.read(path)
    path.write_bytes(b"no mesh\n" * 9)
    with pytest.raises(MeshError, match=r"bar\."):
        sd.VolumeMesh.read(path)


def test_the_command_line_deforms_a_patch(tmp_path, capsys):
    path, out = tmp_path / "bar.msh", tmp_path / "out.msh"
    write_volume_file(path, with_patches())
    words = ["deform", str(path), "--fixed", "base", "--handle", "tip", "--translate", "1,0,0"]
    assert not main([*words, "-o", str(out)])
    assert "no cell inverted" in capsys.readouterr().out
    result = sd.VolumeMesh.read(out)
    tip = result.patches["tip"]
    assert_array_equal(tip, sd.VolumeMesh(with_patches()).patches["tip"])
    assert_allclose(result.grid.points[tip] - with_patches().points[tip], [[1, 0, 0]] * len(tip))
    assert main([*words, "-o", str(tmp_path / "out.ply")]) == 1
    assert "cells cannot be written there" in capsys.readouterr().err


def test_the_command_line_turns_vectors_and_tells_of_inverted_cells(tmp_path, capsys):
    path, out = tmp_path / "bar.vtu", tmp_path / "out.vtu"
    bar("hexahedron").save(path)
    words = [str(path), "-o", str(out), "--turn", "fibre", "--displacement", "u"]
    bend = ["--fixed", "z<8%", "--handle", "z>92%", "--rotate", "y,40"]
    assert not main(["deform", *words, *bend])
    assert "no cell inverted" in capsys.readouterr().out
    result = pv.read(out)
    expected = [np.sin(np.radians(40.0)), 0.0, np.cos(np.radians(40.0))]
    assert_allclose(result.cell_data["fibre"][-1], expected, atol=0.02)
    assert_allclose(result["u"], result.points - bar("hexahedron").points)
    assert main(["pull", *words, "--at", "0,0,4", "--to", "0,0,1", "--radius", "0.4"]) == 1
    assert "inverted" in capsys.readouterr().err
