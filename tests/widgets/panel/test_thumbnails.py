"""Thumbnails of saved poses: of that pose, drawn once, and at no cost for the next refresh."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from hands import plain_view
from numpy.testing import assert_array_equal
from scenes import sausage

from vtk_segdeform.pictures import PAPER, rgb
from vtk_segdeform.widgets.editor.editor import DeformEditor
from vtk_segdeform.widgets.panel import thumbnails
from vtk_segdeform.widgets.panel.poses import poses_section
from vtk_segdeform.widgets.panel.thumbnails import thumbnail

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")


@pytest.fixture
def editor():
    editor = DeformEditor(plain_view(), sausage(is_coarse=True).session())
    editor.session.bind()
    yield editor
    editor.remove()


def covered(url: str, path: Path) -> np.ndarray:
    """Return which pixels of a data URL show the body, the top row first."""
    path.write_bytes(base64.b64decode(url.partition(",")[2]))
    image = pv.read(path)
    width, height, _ = image.dimensions
    pixels = image.active_scalars.reshape(height, width, 3)[::-1]
    return (pixels != rgb(PAPER)).any(axis=2)


def test_a_thumbnail_shows_its_pose_and_is_drawn_once(editor, monkeypatch, tmp_path):
    session, (name,) = editor.session, editor.session.handles
    session.saved_poses.save("rest")
    lift = np.eye(4)
    lift[2, 3] = 2.0
    session.move_handle(name, lift)
    session.commit()
    session.saved_poses.save("up")
    rows = {row.label: row for row in poses_section(editor).tables[0].rows}
    shapes = [covered(rows[each].picture, tmp_path / "one.png") for each in ("rest", "up")]
    for shape in shapes:  # it fills the picture, but for a margin
        assert shape.any(axis=0).sum() > 55 or shape.any(axis=1).sum() > 39
        assert not shape[[0, -1]].any()
        assert not shape[:, [0, -1]].any()
    assert shapes[1].any(axis=1).sum() > 1.3 * shapes[0].any(axis=1).sum()  # bent upwards
    assert shapes[0].sum() > 0.3 * shapes[0].any(axis=1).sum() * shapes[0].any(axis=0).sum()
    monkeypatch.setattr(thumbnails, "_drawn", None)
    assert thumbnail(editor, "up") == rows["up"].picture
    session.change_options(stretch=0.5)  # which needs another binding
    assert thumbnail(editor, "up") == rows["up"].picture  # of before, at no cost


def test_the_places_of_some_vertices_in_a_saved_pose(editor):
    session, (name,) = editor.session, editor.session.handles
    lift = np.eye(4)
    lift[2, 3] = 1.0
    session.move_handle(name, lift)
    session.commit()
    ids = np.array([3, 77, 200])
    session.saved_poses.save("up")
    assert np.abs(session.saved_poses.places("up", ids) - session.vertices[ids]).max() < 1e-9
    session.finish()
    session.saved_poses.save("finished")
    assert_array_equal(session.saved_poses.places("finished", ids), session.vertices[ids])
    session.reset_pose()
    session.saved_poses.save("rest")
    assert_array_equal(session.saved_poses.places("rest", ids), session.mesh.vertices[ids])
    session.change_options(stretch=0.5)  # which needs another binding
    assert session.saved_poses.places("up", ids) is None
