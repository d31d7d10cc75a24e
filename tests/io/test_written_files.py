"""All functions that write files keep modes, follow links, reject pipes and never lose data."""

from __future__ import annotations

import errno
import os
import struct

import numpy as np
import pytest
from solids import OCTAHEDRON

import vtk_segdeform as sd
from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.io.convert import write_mesh
from vtk_segdeform.io.meshlab_project import read_project, write_project
from vtk_segdeform.pictures import canvas
from vtk_segdeform.pictures.pictures import picture_distortion
from vtk_segdeform.widgets.films.film_files import write_film

pytestmark = pytest.mark.skipif(os.name != "posix", reason="modes, links and pipes of files")

MESH = sd.Mesh(*OCTAHEDRON)
PICTURES = np.zeros((2, 8, 8, 3), dtype=np.uint8)


WRITERS = {
    "session.segdeform": lambda path: sd.save_session(path, sd.Session(MESH)),
    "film.gif": lambda path: write_film(path, PICTURES, 20.0),
    "picture.png": lambda path: picture_distortion(path, MESH, MESH.vertices, np.zeros(8)),
    "project.mlp": lambda path: write_project(path, MESH),
    **{
        f"mesh{suffix}": lambda path: write_mesh(path, MESH)
        for suffix in (
            ".ply",
            ".obj",
            ".off",
            ".stl",
            ".vtk",
            ".vtp",
            ".vtu",
            ".glb",
            ".gltf",
        )
    },
}


@pytest.fixture(autouse=True)
def small_pictures(monkeypatch):
    monkeypatch.setattr(canvas, "_HEIGHT", 60)


@pytest.fixture(params=WRITERS)
def name(request):
    return request.param


def test_anything_but_a_regular_file_is_an_error_that_names_it(tmp_path, name):
    path = tmp_path / name
    for make in (os.mkfifo, os.mkdir, lambda path: os.symlink(name, path)):
        make(path)
        with pytest.raises(SegDeformError, match=name):
            WRITERS[name](path)
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        else:
            path.unlink()
    assert not [each for each in os.listdir(tmp_path) if not each.endswith(".layers")]


@pytest.mark.parametrize("fault", [errno.ENOSPC, errno.EACCES])
def test_a_failure_is_an_error_of_the_package_and_keeps_the_old_file(
    tmp_path, monkeypatch, name, fault
):
    def refused(*_):
        raise OSError(fault, os.strerror(fault))

    path = tmp_path / name
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(SegDeformError, match=os.strerror(fault)):
        WRITERS[name](path)
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert not list(tmp_path.rglob(".segdeform-*"))


def test_a_picture_has_the_pixels_it_was_given(tmp_path):
    from PIL import Image

    from vtk_segdeform.pictures.canvas import png_of

    pixels = np.random.default_rng(1).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    content = png_of(pixels)
    assert struct.unpack(">II", content[16:24]) == (7, 5)
    (tmp_path / "a.png").write_bytes(content)
    with Image.open(tmp_path / "a.png") as image:
        assert np.array_equal(np.asarray(image), pixels)


def test_projects_with_too_many_or_too_large_layers_are_errors_at_once(tmp_path, monkeypatch):
    path = tmp_path / "work.mlp"
    write_project(path, MESH)
    (layer,) = (tmp_path / "work.layers").iterdir()
    one = f'<MLMesh label="a" filename="work.layers/{layer.name}"/>'

    def read(name):
        raise AssertionError(f"{name} was read")

    monkeypatch.setattr("vtk_segdeform.io.meshlab_project.read_polydata", read)
    for count in (1001, 20_000):
        group = f"<MeshGroup>{one * count}</MeshGroup>"
        path.write_text(f"<MeshLabProject>{group}</MeshLabProject>")
        with pytest.raises(
            sd.errors.MeshError, match=rf"work\.mlp: has {count} layers; the limit is 1000"
        ):
            read_project(path)
    os.truncate(layer, 45_000_000_000)
    path.write_text(f"<MeshLabProject><MeshGroup>{one}</MeshGroup></MeshLabProject>")
    with pytest.raises(sd.errors.MeshError, match=r"work\.mlp: its layers have 4\.5e\+10 bytes"):
        read_project(path)
