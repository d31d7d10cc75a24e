"""Files and pyvista: order, digits, arrays and seams are preserved; errors name the file."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal
from solids import icosphere

from vtk_segdeform.errors import MeshError
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.io.convert import (
    from_polydata,
    read_points,
    read_polydata,
    to_polydata,
    with_vertices,
    write_mesh,
    write_points,
)
from vtk_segdeform.io.surface import read_mesh
from vtk_segdeform.mesh.mesh import Mesh

EXACT = [".obj", ".off", ".ply", ".vtk", ".vtp", ".vtu"]


def shuffled(seed: int = 1) -> Mesh:
    """Return a sphere far from the origin, in random order, that needs all its digits."""
    rng = np.random.default_rng(seed)
    vertices, faces = icosphere(2, radius=1 / 3)
    number = rng.permutation(len(vertices))
    moved = np.empty_like(vertices)
    moved[number] = vertices + [1e5 / 3, -1e-9, 7.0]
    return Mesh(moved, rng.permutation(number[faces]))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_normals_follow_the_surface_and_the_original_is_unchanged(dtype):
    ball = to_polydata(Mesh(*icosphere(2)))
    ball.point_data["Normals"] = np.asarray(ball.points, dtype=dtype)
    ball.point_data.active_normals_name = "Normals"
    ball.cell_data["Normals"] = np.tile([0.0, 0.0, 1.0], (ball.n_cells, 1))
    before = ball.copy(deep=True)
    turned = with_vertices(ball, ball.points[:, [1, 2, 0]])  # a rotation
    assert_array_equal(ball.points, before.points)
    assert_array_equal(ball.point_data["Normals"], before.point_data["Normals"])
    facing = np.einsum("ij,ij->i", turned.point_data["Normals"], turned.points)
    assert facing.min() > 0.99
    assert turned.point_data["Normals"].dtype == dtype
    assert turned.point_data.active_normals_name == "Normals"
    np.testing.assert_allclose(  # a given one, which is not the normal of the face
        turned.cell_data["Normals"], ball.cell_data["Normals"][:, [1, 2, 0]], atol=1e-12
    )


def test_strips_and_a_grid_of_triangles_become_the_same_mesh(tmp_path):
    mesh = Mesh(*icosphere(2))
    strips = to_polydata(mesh).strip()
    assert len(strips.strips)
    assert signed_volume(mesh.vertices, from_polydata(strips).faces) == pytest.approx(
        signed_volume(mesh.vertices, mesh.faces), rel=1e-13
    )
    grid = to_polydata(mesh).cast_to_unstructured_grid()
    grid.save(tmp_path / "a.vtu")
    assert_array_equal(read_mesh(tmp_path / "a.vtu").faces, mesh.faces)


SUFFIXES = [".obj", ".off", ".ply", ".stl", ".vtk", ".vtp", ".vtu", ".glb"]
RUBBISH = {
    "empty": b"",
    "text": b"hello\nthis is no mesh 1 2 3\n",
    "bytes": bytes(range(256)) * 8,
    "ply": b"ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nend_header\n1 2",
    "off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n",
    "obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("what", list(RUBBISH))
def test_invalid_files_are_errors_that_name_the_file(tmp_path, suffix, what, capfd):
    path = tmp_path / f"rubbish{suffix}"
    path.write_bytes(RUBBISH[what])
    with pytest.raises(MeshError, match=f"rubbish{suffix}"):
        read_polydata(path)
    assert list(tmp_path.iterdir()) == [path]
    capfd.readouterr()


def test_nan_is_read_and_reported_as_a_fault(tmp_path):
    path = tmp_path / "nan.off"
    path.write_text(
        "OFF\n4 4 0\n0 0 0\n1 0 0\nnan 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
    )
    assert np.isnan(read_polydata(path).points).sum() == 1
    with pytest.raises(MeshError, match=r"nan.off: .*1 vertex with NaN or infinite"):
        read_mesh(path)


def test_a_truncated_file_is_an_error_in_every_format(tmp_path):
    for suffix in (".off", ".ply", ".vtp"):  # of an OBJ the last faces cannot be missed
        path = tmp_path / f"a{suffix}"
        write_mesh(path, Mesh(*icosphere(2)))
        path.write_bytes(path.read_bytes()[:-200])
        with pytest.raises(MeshError, match="a\\" + suffix):
            read_mesh(path)


def test_errors_say_what_is_wrong_with_the_file(tmp_path):
    with pytest.raises(MeshError, match=r"nowhere\.obj: there is no such file"):
        read_mesh(tmp_path / "nowhere.obj")
    (tmp_path / "a.xyz").write_text("1 2 3")
    with pytest.raises(MeshError, match=r"\.xyz files cannot be read; use one of .*\.obj"):
        read_mesh(tmp_path / "a.xyz")
    pv.ImageData(dimensions=(3, 3, 3)).cast_to_unstructured_grid().save(tmp_path / "a.vtu")
    with pytest.raises(MeshError, match="other than triangles"):
        read_mesh(tmp_path / "a.vtu")
    pv.ImageData(dimensions=(3, 3, 3)).save(tmp_path / "image.vtk")
    with pytest.raises(MeshError, match="extract its surface first"):
        read_mesh(tmp_path / "image.vtk")
    with pytest.raises(MeshError, match=r"\.jpg files cannot be written"):
        write_mesh(tmp_path / "a.jpg", shuffled())
    with pytest.raises(MeshError, match="no folder"):
        write_mesh(tmp_path / "no" / "a.obj", shuffled())


@pytest.mark.parametrize("suffix", [*EXACT, ".stl", ".vtu", ".glb", ".gltf"])
def test_an_empty_file_is_called_empty(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_bytes(b"")
    with pytest.raises(MeshError, match=r"the file is empty \(0 bytes\); copy or export it again"):
        read_polydata(tmp_path / f"a{suffix}")


def test_a_file_without_polygons_says_what_it_holds(tmp_path):
    pv.PolyData().save(tmp_path / "a.vtp")
    with pytest.raises(MeshError, match="contains no surface: 0 points, 0 polygons"):
        read_polydata(tmp_path / "a.vtp")


@pytest.mark.parametrize("suffix", [".vtk", ".vtp", ".vtu"])
def test_a_file_with_the_suffix_of_another_format_says_so(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_text("v 0 0 0\n")
    with pytest.raises(MeshError, match=f"does not begin as a {suffix} file does"):
        read_polydata(tmp_path / f"a{suffix}")


def test_points_alone_and_grids_are_read_and_written_where_there_is_a_place_for_them(tmp_path):
    points = pv.PolyData(np.arange(12.0).reshape(4, 3))
    grid = pv.ImageData(dimensions=(3, 2, 2)).cast_to_unstructured_grid()
    for data, name in ((points, "a.ply"), (points, "a.vtp"), (grid, "a.vtu")):
        write_points(tmp_path / name, data)
        again = read_points(tmp_path / name)
        assert type(again) is type(data)
        assert_array_equal(again.points, data.points)
    for data, name in ((points, "b.obj"), (grid, "b.ply")):
        with pytest.raises(MeshError, match="points without faces are written to"):
            write_points(tmp_path / name, data)
        assert not (tmp_path / name).exists()
    (tmp_path / "c.ply").write_text("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")
    with pytest.raises(MeshError, match=r"c\.ply: the PLY file has no vertices"):
        read_points(tmp_path / "c.ply")
