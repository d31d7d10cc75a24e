"""Meshes that the editor has written: what the format loses is told."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hands import plain_view
from numpy.testing import assert_allclose

from vtk_segdeform import Mesh, Session, Surface, models
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.io import read_polydata, to_polydata, triangles_of
from vtk_segdeform.widgets import DeformEditor
from vtk_segdeform.widgets.editor import exporting

pytestmark = pytest.mark.usefixtures("unprepared")
UTM = np.array([500_000.0, 5_400_000.0, 100.0])
BALL = models.sphere(500)
FAR = Mesh(BALL.vertices + UTM, BALL.faces)
TOLD = re.compile(
    r"STL stores single precision: vertices moved by up to (\S+) \((\S+) % of model size\)"
    r"(?:, the volume changed by (\S+) %)?; \.ply and \.vtp keep all digits"
)


@pytest.fixture(scope="module")
def view():
    return plain_view((300, 200))


@pytest.fixture
def edited(view):
    """Return a function that opens a mesh, as a surface or without one, in an editor."""
    editors = []

    def edit(mesh, *, has_surface=True):
        session = Session(Surface(to_polydata(mesh)) if has_surface else mesh)
        editors.append(DeformEditor(view, session))
        editors[-1].On()
        return editors[-1]

    yield edit
    for editor in editors:
        editor.remove()


def told(editor):
    """Return displacement, its share and the volume change in per cent that the status tells."""
    found = TOLD.search(editor.status)
    return None if found is None else [float(number or 0.0) for number in found.groups()]


def measured(path, mesh):
    """Return the same, from the corners of the triangles in the file."""
    again, middle = read_polydata(path), mesh.vertices.mean(axis=0)
    before = mesh.vertices[mesh.faces] - middle
    after = np.asarray(again.points, dtype=float)[triangles_of(again)] - middle
    moved = np.linalg.norm(after - before, axis=2).max()
    volumes = [
        signed_volume(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
        for corners in (before, after)
    ]
    return moved, 100.0 * moved / mesh.diagonal, 100.0 * (volumes[1] / volumes[0] - 1.0)


@pytest.mark.parametrize("has_surface", [True, False])
def test_what_a_body_far_from_the_origin_loses_is_told(edited, tmp_path, has_surface):
    editor = edited(FAR, has_surface=has_surface)
    editor.do(exporting(tmp_path / "far.stl"))
    assert f"Mesh saved to {tmp_path / 'far.stl'}. STL stores" in editor.status
    assert_allclose(told(editor), measured(tmp_path / "far.stl", FAR), rtol=0.06)
    assert told(editor)[0] > 0.2
    assert abs(told(editor)[2]) > 0.1


@pytest.mark.parametrize("suffix", [".ply", ".vtp", ".vtk", ".obj", ".off", ".glb"])
def test_nothing_is_said_where_all_digits_are_stored(edited, tmp_path, suffix):
    editor = edited(FAR)
    editor.do(exporting(tmp_path / f"far{suffix}"))
    assert f"Mesh saved to {tmp_path / f'far{suffix}'} · " in editor.status


def test_nothing_is_said_of_a_loss_that_cannot_be_seen(edited, tmp_path):
    editor = edited(BALL)
    editor.do(exporting(tmp_path / "near.stl"))
    assert f"Mesh saved to {tmp_path / 'near.stl'} · " in editor.status
