"""Carried files in the panel: added, hidden, saved beside the mesh, removed; faults are shown."""

from __future__ import annotations

from dataclasses import replace

import pytest
from numpy.testing import assert_allclose, assert_array_equal
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtk_segdeform import read_mesh, write_mesh
from vtk_segdeform.errors import MeshError
from vtk_segdeform.session.state import CarriedFile
from vtk_segdeform.widgets.editor import exporting
from vtk_segdeform.widgets.panel.panel import press, sections, use_file

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")


def shown(editor):
    """Return name, text and box of the rows."""
    section = next(each for each in sections(editor) if each.name == "carried")
    rows = section.tables[0].rows
    return [(row.key, row.cells[0].text, row.cells[1].checked) for row in rows]


def drawn(editor):
    """Return the points of what is visible of carried files."""
    found = []
    for actor in editor.view.renderer.GetActors():
        data = actor.GetMapper().GetInput()
        own = [each for each in editor.widgets.carried._drawn.values() if each.data is data]
        if own and actor.GetVisibility():
            assert not actor.GetPickable()
            found.append(vtk_to_numpy(data.GetPoints().GetData()))
    return found


def test_files_are_added_follow_the_frames_of_a_drag_are_hidden_and_saved(editor, tmp_path):
    session, x = editor.session, editor.session.mesh.vertices
    for name in ("skin.ply", "lining.ply"):
        write_mesh(tmp_path / name, session.mesh.with_vertices(x * (1.0 + 0.1 * (name[0] == "s"))))
    assert use_file(editor, "carried.add", tmp_path / "skin.ply", tmp_path / "lining.ply") is None
    assert editor.controller.messages.text.startswith("The mesh carries 2 files along")
    assert shown(editor) == [("skin.ply", f"{len(x):,}", True), ("lining.ply", f"{len(x):,}", True)]
    name, at = next(iter(session.targets.items()))
    session.drag({name: at + [0.0, 0.5, 0.0]})
    frame = drawn(editor)
    assert_allclose(frame[0], session.carried.points("skin.ply"), atol=1e-12)
    assert_allclose(frame[1], session.vertices, atol=1e-12)
    editor.widgets.carried.follows_drags = False
    session.drag({name: at + [0.0, 0.6, 0.0]})
    assert_array_equal(drawn(editor)[1], frame[1])
    session.commit()
    assert_allclose(drawn(editor)[1], session.vertices, atol=1e-12)
    press(editor, "carried.list.show", ("lining.ply", False))
    assert len(drawn(editor)) == 1
    editor.do(exporting(tmp_path / "out.ply"))
    assert "Beside it: skin-2.ply, lining-2.ply" in editor.controller.messages.text
    assert_allclose(read_mesh(tmp_path / "lining-2.ply").vertices, session.vertices, atol=1e-12)
    editor.do(exporting(tmp_path / "out.ply"))
    assert not (tmp_path / "lining-3.ply").exists()
    press(editor, "carried.list.select", ["lining.ply"])
    use_file(editor, "carried.save", tmp_path / "own.ply")
    assert_allclose(read_mesh(tmp_path / "own.ply").vertices, session.vertices, atol=1e-12)
    press(editor, "carried.remove")
    assert [row[0] for row in shown(editor)] == ["skin.ply"]
    editor.run("undo")
    assert shown(editor)[1] == ("lining.ply", f"{len(x):,}", False)


def test_a_file_that_cannot_be_read_is_listed_as_such_and_the_mesh_is_saved(editor, tmp_path):
    assert isinstance(use_file(editor, "carried.add", tmp_path / "none.ply"), MeshError)
    assert "none.ply" in editor.controller.messages.error
    session = editor.session
    broken = replace(session.state, carried=(CarriedFile("bone.ply", b"ply\nbroken"),))
    session.history.step("open", broken)
    assert shown(editor) == [("bone.ply", "cannot be read", None)]
    editor.do(exporting(tmp_path / "out.ply"))
    assert "bone.ply was not saved: bone.ply" in editor.controller.messages.text
    assert (tmp_path / "out.ply").exists()
