"""MeshLab projects: complete, readable by MeshLab, and safe to read from any source."""

from __future__ import annotations

import os

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from solids import icosphere, rotation
from test_meshlab import painted, same, with_pymeshlab, without_pymeshlab  # noqa: F401
from zoo_operations import bent, ends

from vtk_segdeform.errors import MeshError
from vtk_segdeform.io import Surface, meshlab, meshlab_project, polydata_of
from vtk_segdeform.io.convert import to_polydata, write_mesh
from vtk_segdeform.io.meshlab_project import read_project, write_project
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.pictures import palette
from vtk_segdeform.session.session import Session

BALL = Mesh(*icosphere(1))


def files(folder) -> list[str]:
    """Return the names of all files in a folder and below."""
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def project(folder, *layers: str, matrix: str = ""):
    """Write a project by hand, and a ball beside it."""
    write_mesh(folder / "ball.ply", BALL)
    inner = f"<MLMatrix44>{matrix}</MLMatrix44>" if matrix else ""
    meshes = "".join(f'<MLMesh label="a" filename="{name}">{inner}</MLMesh>' for name in layers)
    path = folder / "work.mlp"
    path.write_text(f"<MeshLabProject><MeshGroup>{meshes}</MeshGroup></MeshLabProject>")
    return path


@pytest.mark.usefixtures("with_pymeshlab")
def test_meshlab_opens_the_mesh_and_its_cages_unchanged(tmp_path):
    import pymeshlab

    scene = sausage(2)
    session = scene.caged()
    session.handles.add(scene.handle)
    write_project(tmp_path / "work.mlp", {**meshlab.as_layers(session), "painted": painted()})
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.load_project(str(tmp_path / "work.mlp"))
    layers = meshlab.layers_from_meshset(meshset)
    assert list(layers) == ["mesh", "cage 1", "cage 2", "painted"]
    assert same(layers["painted"], painted())
    assert_array_equal(layers["mesh"].points, scene.mesh.vertices)
    assert_array_equal(np.flatnonzero(layers["mesh"]["selection"]), scene.handle)
    assert_array_equal(layers["cage 2"].points, scene.cages[1].vertices)


def posed_session():
    """Return a session of a surface of quadrilaterals with a seam, bent, with two cages."""
    box = pv.Box((-3, 3, -1, 1, -1, 1), level=5, quads=True).clean()
    x, quads = np.asarray(box.points, float), box.regular_faces
    x[:, 1:] *= np.sqrt(1.2 - (x[:, :1] / 3.6) ** 2)
    side = np.repeat(x[quads].mean(axis=1)[:, 1] > 0, 4)
    keys, corners = np.unique(
        np.stack([quads.ravel(), side], axis=1), axis=0, return_inverse=True
    )  # the points between the sides are doubled
    counts = np.full(len(quads), 4)
    session = Session(Surface(polydata_of(x[keys[:, 0]], counts, corners.ravel())))
    session.segment(2)
    session.change_options(n_cage_vertices=60)
    session.fit_cages()
    fixed, handle = ends(session.mesh)
    session.set_fixed(fixed)
    session.handles.add(handle, "end")
    session.drag({"end": bent(session.mesh, handle)}, max_steps=2)
    return session


def test_the_layer_of_the_mesh_is_what_was_given_in_the_pose(tmp_path):
    session = posed_session()
    write_project(tmp_path / "work.mlp", session)
    layers = read_project(tmp_path / "work.mlp")
    assert list(layers) == ["mesh", "local volume change", "cage 1", "cage 2"]
    mesh, given = layers["mesh"], session.surface.given
    assert mesh.n_points > session.mesh.n_vertices  # the seam is still there
    assert_array_equal(mesh.faces, given.faces)
    assert_array_equal(mesh.points, session.deformed.points)
    assert_array_equal(mesh["selection"] > 0, given.points[:, 0] > 2.2)
    assert_array_equal(mesh["quality"], session.surface.at_points(session.regions.labels))
    for k, vertices in enumerate(session.cage_vertices):
        cage = layers[f"cage {k + 1}"]
        assert_array_equal(cage.points, vertices)
        assert_array_equal(cage.regular_faces, session.cages[k].faces)
        assert cage.n_open_edges == 0


def test_colours_show_regions_and_local_volume_change_and_none_are_replaced(tmp_path):
    session = posed_session()
    write_project(tmp_path / "work.mlp", session)
    layers = read_project(tmp_path / "work.mlp")
    labels = session.surface.at_points(session.regions.labels)
    expected = [[*palette.of_region(k), 255] for k in labels]
    assert_array_equal(layers["mesh"]["RGBA"], expected)
    change = layers["local volume change"]["quality"]
    colour = layers["local volume change"]["RGBA"].astype(int)
    swollen = change > 0.2 * np.abs(change).max()
    shrunken = change < -0.2 * np.abs(change).max()
    assert swollen.any()
    assert (colour[swollen, 0] > colour[swollen, 2]).all()  # red
    assert (colour[shrunken, 0] < colour[shrunken, 2]).all()  # blue
    own = painted()
    own.point_data["quality"] = np.arange(float(own.n_points))
    write_project(tmp_path / "own.mlp", own)
    assert_array_equal(read_project(tmp_path / "own.mlp")["mesh"]["RGBA"], own["RGBA"])


@pytest.mark.usefixtures("with_pymeshlab")
def test_meshlab_shows_cages_as_wires_that_hide_nothing(tmp_path):
    import pymeshlab

    session = posed_session()
    write_project(tmp_path / "work.mlp", session)
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.load_project(str(tmp_path / "work.mlp"))
    shown = {layer.label(): layer for layer in meshset if layer.is_visible()}
    hidden = {layer.label() for layer in meshset if not layer.is_visible()}
    assert set(shown) == {"mesh", "cage 1, wires", "cage 2, wires"}
    assert hidden == {"local volume change", "cage 1", "cage 2"}
    assert shown["mesh"].has_vertex_color()
    for k, cage in enumerate(session.cages, 1):
        wires = shown[f"cage {k}, wires"]
        assert wires.face_number() == 0
        assert wires.edge_number() == 3 * cage.n_faces // 2
        assert_array_equal(wires.vertex_matrix(), session.cage_vertices[k - 1])


@pytest.mark.usefixtures("with_pymeshlab")
def test_a_project_that_meshlab_saved_is_opened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # PyMeshLab writes projects to the working directory only
    meshset = meshlab.to_meshset({"one": painted(), "two": BALL})
    for number in (0, 1):
        meshset.set_current_mesh(number)
        meshset.save_current_mesh(f"{number}.ply")
    meshset.save_project("work.mlp")
    layers = read_project("work.mlp")
    assert_allclose(layers["one"].points, painted().points, atol=1e-6)
    assert_allclose(layers["two"].points, BALL.vertices, atol=1e-6)
    assert_array_equal(layers["one"]["RGBA"], painted()["RGBA"])


def test_the_matrix_of_a_layer_is_applied(tmp_path):
    turn = rotation([1, 2, 3], 0.5)
    matrix = np.vstack([np.column_stack([turn, [1, 2, 3]]), [0, 0, 0, 1]])
    path = project(
        tmp_path, "ball.ply", "ball.ply", matrix=" ".join(map(repr, matrix.ravel().tolist()))
    )
    layers = read_project(path)
    assert list(layers) == ["a", "a 2"]
    assert_allclose(layers["a 2"].points, BALL.vertices @ turn.T + [1, 2, 3], atol=1e-14)


def test_writing_again_replaces_all_layers_and_no_other_files(tmp_path):
    write_project(tmp_path / "work.mlp", {"a": BALL, "b": BALL, "c": BALL})
    for name in ("notes.ply", "7.ply", "../work-0.ply"):
        (tmp_path / "work.layers" / name).write_text("mine")
    before = set(files(tmp_path))
    write_project(tmp_path / "work.mlp", BALL)
    after = set(files(tmp_path))
    assert list(read_project(tmp_path / "work.mlp")) == ["mesh"]
    assert after <= before
    assert after - {"work.mlp"} > {"work.layers/notes.ply", "work.layers/7.ply", "work-0.ply"}
    assert len(after) == 5


def test_an_interrupted_write_keeps_the_old_project_complete(tmp_path, monkeypatch):
    write_project(tmp_path / "work.mlp", {"a": BALL, "b": painted()})
    real, left = os.replace, iter(range(100))
    for last in range(4):  # three layers, and the project
        left = iter(range(last))

        def break_off(a, b, left=left):
            if next(left, None) is None:
                raise OSError("the power went")
            real(a, b)

        monkeypatch.setattr(os, "replace", break_off)
        with pytest.raises(MeshError, match="power"):
            write_project(tmp_path / "work.mlp", {"a": painted(), "b": BALL, "c": BALL})
        layers = read_project(tmp_path / "work.mlp")
        assert same(layers["a"], to_polydata(BALL))
        assert same(layers["b"], painted())


@pytest.mark.parametrize(
    "name", ["../secret.ply", "{}/secret.ply", "link.ply", "", "x" * 5000, "."]
)
def test_a_layer_outside_the_folder_is_not_read(tmp_path, name):
    write_mesh(tmp_path / "secret.ply", BALL)
    here = tmp_path / "here"
    here.mkdir()
    (here / "link.ply").symlink_to(tmp_path / "secret.ply")
    before = files(tmp_path)
    path = project(here, name.format(tmp_path))
    with pytest.raises(MeshError, match="is not a file in the project's folder"):
        read_project(path)
    assert set(files(tmp_path)) - set(before) == {"here/ball.ply", "here/work.mlp"}


BOMB = "<!DOCTYPE b [<!ENTITY a 'aaaa'><!ENTITY c '&a;&a;'>]><MeshLabProject>&c;</MeshLabProject>"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is not a MeshLab project"),
        ("rubbish", "is not a MeshLab project"),
        ("<MeshLabProject>", "is not a MeshLab project"),
        ("<html/>", "its root is 'html'"),
        (BOMB, "declares entities"),
        ("<?xml version='1.0' encoding='no-such'?><MeshLabProject/>", "is not a MeshLab project"),
        ("<MeshLabProject><MeshGroup/></MeshLabProject>", "has no layers"),
    ],
)
def test_an_invalid_project_is_an_error_that_names_it(tmp_path, text, says):
    (tmp_path / "work.mlp").write_text(text)
    with pytest.raises(MeshError, match=rf"work\.mlp: .*{says}"):
        read_project(tmp_path / "work.mlp")
    assert files(tmp_path) == ["work.mlp"]


@pytest.mark.parametrize(
    "matrix", ["1 2 3", "nan " * 16, "1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1", "x " * 16]
)
def test_a_matrix_that_is_not_affine_is_an_error(tmp_path, matrix):
    with pytest.raises(MeshError, match="matrix of layer 'a' is not affine"):
        read_project(project(tmp_path, "ball.ply", matrix=matrix))


def test_nothing_is_written_if_the_project_cannot_be(tmp_path):
    (tmp_path / "taken.layers").write_text("mine")
    for name, says in (
        ("a.ply", "must end in .mlp"),
        ("no/a.mlp", "no folder"),
        ("taken.mlp", "not a folder"),
    ):
        with pytest.raises(MeshError, match=says):
            write_project(tmp_path / name, BALL)
    with pytest.raises(MeshError, match="expected a Mesh"):
        write_project(tmp_path / "a.mlp", 3)
    with pytest.raises(MeshError, match="no such file"):
        read_project(tmp_path / "a.mlp")
    assert files(tmp_path) == ["taken.layers"]


def test_a_large_file_is_not_parsed(tmp_path, monkeypatch):
    monkeypatch.setattr(meshlab_project, "_LARGEST", 10)
    with pytest.raises(MeshError, match="too large"):
        read_project(project(tmp_path, "ball.ply"))
