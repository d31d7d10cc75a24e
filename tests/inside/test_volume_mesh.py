"""`VolumeMesh`: kinds of meshes and cells, fields, patches and files."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from volumes import bar, ends

import vtk_segdeform as sd
from vtk_segdeform.cli import main
from vtk_segdeform.errors import ArgumentError, MeshError

meshio = pytest.importorskip("meshio")


def with_patches():
    """Return a bar of meshio with named faces at its ends, one as a set and one of Gmsh."""
    grid = bar("hexahedron")
    points = np.array(grid.points)
    volume = sd.VolumeMesh(grid)
    faces = np.array(volume.surface.given.regular_faces)
    low = (points[faces][:, :, 2] < 1e-9).all(axis=1)
    cells = [("hexahedron", grid.cells_dict[12]), ("quad", faces)]
    return meshio.Mesh(
        points,
        cells,
        cell_sets={"base": [np.empty(0, dtype=int), np.flatnonzero(low)]},
        field_data={"tip": np.array([7, 2])},
        cell_data={
            "gmsh:physical": [
                np.full(grid.n_cells, 1),
                np.where(points[faces][:, :, 2].min(1) > 3.99, 7, 2),
            ],
            "fibre": [grid.cell_data["fibre"].copy(), np.zeros((len(faces), 3))],
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
        meshio.gmsh.write(path, with_patches())
    else:
        bar("wedge").save(path)
    return path


@pytest.mark.parametrize("kind", ["grid", "meshio", ".vtu", ".vtk", ".msh"])
def test_deform_and_pull_give_back_the_kind_with_its_inside_moved(kind, tmp_path):
    mesh = given(kind, tmp_path)
    is_meshio = kind in ("meshio", ".msh")
    before = sd.VolumeMesh.read(mesh) if kind.startswith(".") else sd.VolumeMesh(mesh)
    rest = np.array(before.grid.points, dtype=float)
    solution = sd.deform(mesh, *ends(rest, 40.0), n_regions=2)
    assert isinstance(solution.mesh, meshio.Mesh if is_meshio else pv.UnstructuredGrid)
    assert solution.inside is not None and not len(solution.inside.inverted)
    assert abs(solution.volume_change) < 1e-12
    assert_array_equal(solution.mesh.points, solution.inside.points)
    fixed, handle, targets = ends(rest, 40.0)
    on_surface = np.isin(handle, before._corners.faces)
    assert_allclose(solution.mesh.points[handle[on_surface]], targets[on_surface], atol=1e-6)
    assert_array_equal(solution.mesh.point_data["height"], rest[:, 2])
    tip = int(rest[:, 2].argmax())
    pulled = sd.pull(mesh, tip, rest[tip] + [0.3, 0.0, 0.0], n_regions=1)
    assert pulled.inside.smallest > 0.0
    assert sd.segment(mesh, 2).n_regions == 2


def test_what_was_given_is_not_changed():
    mesh = with_patches()
    before = copy.deepcopy(mesh)
    sd.deform(mesh, *ends(mesh.points, 20.0), n_regions=1)
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
    assert_array_equal(patches["base"], np.flatnonzero(height < 1e-9))
    assert_array_equal(patches["tip"], np.flatnonzero(height > 4.0 - 1e-9))


def test_vectors_turn_or_are_pushed_by_choice():
    volume = sd.VolumeMesh(bar("pyramid"))
    turn = Rotation.from_rotvec([0.3, -0.7, 0.2])
    pose = volume.pose(2.0 * turn.apply(volume.surface.mesh.vertices))
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


def test_the_command_line_deforms_a_patch_and_tells_the_quality(tmp_path, capsys):
    path, out = tmp_path / "bar.msh", tmp_path / "out.vtu"
    meshio.gmsh.write(path, with_patches())
    words = ["deform", str(path), "-o", str(out), "--fixed", "base", "--handle", "tip"]
    assert not main([*words, "--rotate", "y,40", "--pivot", "0,0,2", "--turn", "fibre"])
    told = capsys.readouterr().out
    assert "no cell inverted" in told
    result = pv.read(out)
    tip = np.flatnonzero(np.asarray(result.point_data["height"]) > 4.0 - 1e-9)
    expected = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    fibre = np.asarray(result.cell_data["fibre"])
    last = fibre[np.linalg.norm(fibre, axis=1) > 0.5][-1]
    assert_allclose(last[[2, 0]], expected, atol=0.1)
    assert result.points[tip][:, 0].mean() > 1.0
    assert (
        main(["pull", str(path), "-o", str(tmp_path / "x.vtu"), "--at", "0,0,4", "--to", "1,0,4"])
        == 0
    )
    assert (
        main(
            [
                "deform",
                str(path),
                "-o",
                str(tmp_path / "x.ply"),
                "--fixed",
                "base",
                "--handle",
                "tip",
                "--rotate",
                "y,4",
            ]
        )
        == 1
    )
