"""A GLB as Blender writes it, split at its seams: opened, bent and saved in the desktop program."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import pyvista as pv
from app_hands import AppHand, Boxes, Window, delete, drop, settings_in
from campaign import every
from gltf_files import Gltf
from qt_hands import application
from solids import icosphere

from vtk_segdeform import Regions
from vtk_segdeform.io import read_polydata
from vtk_segdeform.io.gltf.buffers import Document
from vtk_segdeform.widgets.editor import Autosaves

PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(40))


def split_ball():
    """Return a document of an ellipsoid with texture coordinates, cut along their seam."""
    points, faces = icosphere(2)
    u = np.arctan2(points[:, 1], points[:, 0]) / (2.0 * np.pi) + 0.5
    corners = u[faces]
    crossing = np.ptp(corners, axis=1) > 0.5  # the seam, u = 0 and u = 1, is within these faces
    around = np.where(crossing[:, None] & (corners < 0.5), corners + 1.0, corners)
    keys = np.stack([faces.ravel(), np.round(around.ravel(), 9)], axis=1)
    split, first, ids = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    at = split[:, 0].astype(int)
    assert len(at) > len(points)
    texture = np.stack([around.ravel()[first], 0.5 * points[at, 2] + 0.5], axis=1)
    document = Gltf()
    attributes = {
        "NORMAL": document.array(points[at]),
        "TEXCOORD_0": document.array(texture),
    }
    mesh = document.mesh(
        points[at] * [1.0, 1.0, 2.0], ids.reshape(-1, 3), attributes=attributes, material=0
    )
    image = {"bufferView": document.view(PNG), "mimeType": "image/png"}
    base = {"baseColorTexture": {"index": 0}}
    document.head |= {
        "materials": [{"name": "skin", "pbrMetallicRoughness": base}],
        "textures": [{"source": 0}],
        "images": [image],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
    }
    document.add("nodes", mesh=mesh, name="body", translation=[1, 2, 3])
    return document


@pytest.fixture
def hand(tmp_path):
    """Return a hand on the program."""
    smooth, pv.global_theme.anti_aliasing = pv.global_theme.anti_aliasing, None
    gc.collect()
    application()
    boxes = Boxes()
    window = Window(settings_in(tmp_path), Autosaves(tmp_path / "unsaved"), interval=1000.0)
    hand = AppHand(window)
    hand.answers = boxes.answers
    yield hand
    assert boxes.unexpected == hand.answers == []
    window.editor.controller.file.mark_saved(window.session)
    delete(window)
    pv.global_theme.anti_aliasing = smooth


@pytest.mark.parametrize("suffix", every(2, [".glb", ".gltf"]))
def test_a_dropped_file_is_bent_by_the_mouse_and_saved_with_only_its_shape_changed(
    hand, suffix, tmp_path, monkeypatch
):
    path, out = split_ball().save(tmp_path / f"ball{suffix}"), tmp_path / f"bent{suffix}"
    content = path.read_bytes()
    assert drop(hand, path)
    hand.settle()
    session, editor = hand.window.session, hand.window.editor
    assert hand.title == f"ball{suffix} - segdeform"
    assert editor.controller.notices.text.startswith("Welded ")
    assert session.mesh.is_closed
    z = session.mesh.vertices[:, 2]
    session.change_options(n_cage_vertices=40)
    session.set_regions(Regions.single(session.mesh))
    session.fit_cages()
    session.set_fixed(z < np.quantile(z, 0.2))
    session.handles.add(z > np.quantile(z, 0.9))
    view = hand.view_hand()
    view.drag(hand.way(by=(40.0, 0.0)))
    hand.settle()
    assert view.failures == []
    expected = session.deformed
    moved = np.linalg.norm(expected.points - read_polydata(path).points, axis=1)
    assert moved.max() > 0.3
    asked = []

    def choose(_, __, proposed, kinds):
        asked.append((proposed, kinds))
        return str(out), ""

    monkeypatch.setattr("qtpy.QtWidgets.QFileDialog.getSaveFileName", choose)
    hand.choose("File", "Save mesh as")
    ((proposed, kinds),) = asked
    assert proposed == str(tmp_path / f"ball-deformed{suffix}")
    assert all(f"*{each}" in kinds for each in (".glb", ".gltf", ".vtu"))
    found = read_polydata(out)
    assert np.abs(found.points - expected.points).max() < 1e-5
    assert np.abs(found.point_data["NORMAL"] - expected.point_data["NORMAL"]).max() < 1e-5
    assert path.read_bytes() == content
    if suffix == ".glb":
        old, new = (Document(each.read_bytes()).json for each in (path, out))
        for each in (old, new):
            for accessor in each["accessors"]:
                accessor.pop("min", None)
                accessor.pop("max", None)
        assert old == new  # materials, textures, images, nodes, seams
    hand.answers.append("Discard")  # regions, cages and handles
    hand.window.open(out)
    hand.settle()
    assert np.abs(hand.window.session.surface.given.points - expected.points).max() < 1e-5
