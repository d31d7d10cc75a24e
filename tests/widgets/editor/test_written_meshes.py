"""Meshes that the editor has written: what is lost is told of the file as it is read again."""

from __future__ import annotations

import re
import threading

import numpy as np
import pytest
from hands import plain_view
from numpy.testing import assert_allclose

from vtk_segdeform import Mesh, Session, Surface, models
from vtk_segdeform.geometry import signed_volume
from vtk_segdeform.io import meshlab, read_polydata, stored, to_polydata, triangles_of
from vtk_segdeform.regions import Regions
from vtk_segdeform.widgets import DeformEditor
from vtk_segdeform.widgets.editor import Task, exporting, write_posed
from vtk_segdeform.widgets.panel import press

pytestmark = pytest.mark.usefixtures("unprepared")
UTM = np.array([500_000.0, 5_400_000.0, 100.0])
BALL = models.sphere(500)
FAR = Mesh(BALL.vertices + UTM, BALL.faces)
TOLD = re.compile(
    r"In the file, vertices moved by up to (\S+) \((\S+) % of model size\)"
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


@pytest.fixture
def gate(monkeypatch):
    """Return an event for which reading again waits."""
    go_on, read = threading.Event(), stored.read_polydata

    def gated(path):
        assert threading.current_thread() is not threading.main_thread()
        assert go_on.wait(30.0)
        return read(path)

    monkeypatch.setattr(stored, "read_polydata", gated)
    yield go_on
    go_on.set()


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
def test_what_a_body_far_from_the_origin_loses_is_told_of_the_file(
    edited, gate, tmp_path, has_surface
):
    editor = edited(FAR, has_surface=has_surface)
    editor.do(exporting(tmp_path / "far.stl"))
    assert f"Mesh saved to {tmp_path / 'far.stl'} · " in editor.status  # the window does not wait
    assert told(editor) is None
    gate.set()
    assert not editor.controller.saved_intact()
    assert f"Mesh saved to {tmp_path / 'far.stl'}. In the file" in editor.status
    assert_allclose(told(editor), measured(tmp_path / "far.stl", FAR), rtol=0.06)
    assert told(editor)[0] > 0.2
    assert abs(told(editor)[2]) > 0.1


@pytest.mark.parametrize("suffix", [".ply", ".vtp", ".vtk", ".obj", ".off", ".glb"])
def test_nothing_is_said_where_all_digits_are_stored(edited, tmp_path, suffix):
    editor = edited(FAR)
    editor.do(exporting(tmp_path / f"far{suffix}"))
    said = editor.status
    assert editor.controller.saved_intact()
    assert editor.status == said
    assert f"Mesh saved to {tmp_path / f'far{suffix}'} · " in said


@pytest.mark.parametrize("suffix", [".stl", *([".3ds"] if meshlab.available() else [])])
def test_nothing_is_said_of_a_loss_that_cannot_be_seen(edited, tmp_path, suffix):
    editor = edited(BALL)
    editor.do(exporting(tmp_path / f"near{suffix}"))
    assert editor.controller.saved_intact()
    assert "In the file" not in editor.status


@pytest.mark.parametrize("suffix", [".stl", ".vtp"])
def test_a_file_that_cannot_be_read_again_is_said_to_be_so(edited, gate, tmp_path, suffix):
    editor, path = edited(FAR), tmp_path / f"far{suffix}"
    editor.do(exporting(path))
    path.write_bytes(path.read_bytes()[:500])
    gate.set()
    assert not editor.controller.saved_intact()
    assert editor.status.startswith("The file cannot be read again: save the mesh again")
    assert str(path) in editor.status
    editor.do(exporting(path.with_suffix(".ply")))
    assert editor.controller.saved_intact()


@pytest.mark.parametrize("has_surface", [True, False])
def test_the_displacement_is_written_while_it_is_wanted(edited, tmp_path, has_surface):
    editor, path = edited(BALL, has_surface=has_surface), tmp_path / "ball.vtp"
    session = editor.session
    session.change_options(n_cage_vertices=24)
    session.set_regions(Regions.single(session.mesh))
    session.fit_cages()
    session.move_cage(0, session.cages[0].vertices + np.array([0.0, 0.0, 0.2]))
    session.commit()
    editor.do(exporting(path))
    assert "displacement" not in read_polydata(path).point_data
    assert press(editor, "save.displacement", True) is None
    editor.do(exporting(path))
    away = read_polydata(path).point_data["displacement"]
    assert_allclose(away, session.vertices - BALL.vertices, atol=1e-12)
    assert_allclose(away.mean(axis=0), [0.0, 0.0, 0.2], atol=1e-3)
    assert editor.controller.saved_intact()
    press(editor, "save.displacement", False)
    editor.do(exporting(path))
    assert "displacement" not in read_polydata(path).point_data


def test_during_a_job_it_is_said_afterwards(edited, tmp_path):
    editor, path, go_on = edited(FAR), tmp_path / "far.stl", threading.Event()
    controller = editor.controller
    written = write_posed(editor.session, path)
    path.unlink()
    controller.start("Waiting", lambda _: go_on.wait(30.0), lambda _: "Done")
    controller.read_again(written)
    controller.saved_intact()
    assert "Waiting" in editor.status
    go_on.set()
    editor.wait()
    assert not controller.saved_intact()
    assert editor.status.startswith("The file cannot be read again")


def read(view, gate):
    """Let all files be read again, and the window be told of them."""
    gate.set()
    for thread in threading.enumerate():
        if thread.name.startswith("segdeform job"):
            thread.join(30.0)
    view.interactor.InvokeEvent("TimerEvent")


def test_a_later_file_is_told_of_instead(edited, view, gate, tmp_path):
    editor = edited(FAR)
    editor.do(exporting(tmp_path / "far.stl"))
    editor.do(exporting(tmp_path / "far.ply"))
    read(view, gate)
    assert editor.controller.saved_intact()
    assert "In the file" not in editor.status


def test_a_removed_editor_is_told_nothing(edited, view, gate, tmp_path, monkeypatch):
    delivered = []
    monkeypatch.setattr(Task, "hand_over", lambda task: delivered.append(task))
    for is_there in (False, True):
        editor = edited(FAR)
        editor.do(exporting(tmp_path / "far.stl"))
        if not is_there:
            editor.remove()
        read(view, gate)
        assert bool(delivered) == is_there
