"""Files of gigabytes, pipes and devices: refused at once, by every function that reads a file."""

from __future__ import annotations

import json
import os
import time

import numpy as np
import pytest
from gltf_files import octahedron
from solids import OCTAHEDRON

import vtk_segdeform as sd
from vtk_segdeform import models
from vtk_segdeform.cli.main import main
from vtk_segdeform.errors import ArgumentError, SegDeformError
from vtk_segdeform.files import open_regular, read_regular
from vtk_segdeform.geometry.motion import read_matrix
from vtk_segdeform.io import meshlab, read_polydata, write_mesh
from vtk_segdeform.io.meshlab_project import read_project
from vtk_segdeform.mesh.selection import parse_selection
from vtk_segdeform.session.store import saved_view

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sparse files, pipes")
POINTS = np.asarray(OCTAHEDRON[0], dtype=float)
MESHES = [".ply", ".obj", ".off", ".stl", ".glb", ".gltf", ".vtk", ".vtp", ".vtu"]
MESHES += [".dae", ".x3d"] if meshlab.available() else []
DOORS = {
    **dict.fromkeys(MESHES, read_polydata),
    ".segdeform": sd.load_session, ".mlp": read_project,
    ".def": read_matrix, ".txt": lambda path: parse_selection(str(path), POINTS),
    ".sel": lambda path: parse_selection(str(path), POINTS, role="fixed"),
    ".any": open_regular,
}  # fmt: skip
OURS = (SegDeformError, OSError, ArgumentError)


@pytest.fixture(params=DOORS)
def suffix(request):
    return request.param


def test_a_sparse_file_of_20_gigabytes_is_refused_at_once(tmp_path, suffix):
    path = tmp_path / f"vast{suffix}"
    if suffix in MESHES[:9]:
        write_mesh(path, models.sphere(30))  # a sound file with a hole after it
    else:
        path.touch()
    os.truncate(path, 20_000_000_000)
    began = time.process_time()
    with pytest.raises(OURS, match=r"vast.*(has 20 GB|exceed|\d bytes)|has 20 GB"):
        DOORS[suffix](path)
    assert time.process_time() - began < 0.5


def test_a_pipe_a_folder_and_a_device_are_refused_at_once(tmp_path, suffix):
    path = tmp_path / f"pipe{suffix}"
    os.mkfifo(path)
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    link = tmp_path / f"device{suffix}"
    link.symlink_to("/dev/zero")
    for each in (path, folder, link):
        with pytest.raises(OURS, match=each.name):
            DOORS[suffix](each)


@pytest.mark.skipif(not os.path.exists("/proc/self/mem"), reason="needs Linux")
@pytest.mark.parametrize("name", ["/proc/self/environ", "/proc/self/mem", "/proc/kmsg"])
def test_files_of_the_kernel_are_refused(tmp_path, name):
    for suffix in {*DOORS} - {".any"}:  # with which nothing is read
        link = tmp_path / f"kernel{suffix}"
        link.symlink_to(name)
        with pytest.raises(OURS, match=f"kernel{suffix}"):
            DOORS[suffix](link)


def test_a_view_of_such_a_file_is_empty(tmp_path):
    path = tmp_path / "vast.segdeform"
    path.touch()
    os.truncate(path, 20_000_000_000)
    assert saved_view(path) == {}


@pytest.mark.parametrize("key", ["buffers", "images"])
def test_a_file_of_a_gltf_file_is_not_read_if_it_is_too_large(tmp_path, key, caplog):
    document = octahedron(*OCTAHEDRON)
    path = document.save(tmp_path / "a.gltf")
    head = json.loads(path.read_text())
    with open(tmp_path / "vast.bin", "wb") as file:
        file.truncate(20_000_000_000)
    if key == "buffers":
        head["buffers"][0]["uri"] = "vast.bin"
    else:
        head["images"] = [{"uri": "vast.bin"}]
    path.write_text(json.dumps(head))
    if key == "buffers":
        with pytest.raises(SegDeformError, match="has 20 GB"):
            read_polydata(path)
    else:
        assert read_polydata(path).n_points == 6
        assert "has 20 GB" in caplog.text


@pytest.mark.parametrize("command", ["check", "edit", "deform", "serve", "pull"])
def test_commands_refuse_such_files_in_one_line(tmp_path, capsys, command):
    path = tmp_path / "vast.ply"
    path.touch()
    os.truncate(path, 20_000_000_000)
    words = {
        "deform": ["-o", f"{path}.obj", "--fixed", "z<10%", "--handle", "z>90%"],
        "pull": ["-o", f"{path}.obj", "--at", "0,0,0", "--to", "0,0,1"],
    }  # fmt: skip
    assert main([command, str(path), *words.get(command, [])]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"segdeform {command}: ")
    assert "has 20 GB; the limit is 2.15 GB" in error
    assert error.count("\n") == 1


def test_a_regular_file_is_read(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    assert read_regular(tmp_path / "a") == b"abc"
