"""Landmarks in the panel: a list with residuals, files, numbers, and the fit as a job."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vtk_segdeform.errors import ArgumentError, MeshError
from vtk_segdeform.widgets.panel.panel import press, sections, use_file

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")


def shown(editor):
    """Return the rows, and the visible fields by name."""
    section = next(each for each in sections(editor) if each.name == "landmarks")
    rows = [(row.label, row.cells[0].text) for table in section.tables for row in table.rows]
    fields = (field for field in section.fields if field.visible)
    return rows, {field.name.removeprefix("landmarks."): field for field in fields}


def test_landmarks_are_loaded_listed_changed_by_numbers_fitted_and_saved(editor, tmp_path):
    session, x = editor.session, editor.session.mesh.vertices
    assert {"adds", "source", "target"} == {*shown(editor)[1]}
    own, other = tmp_path / "own.csv", tmp_path / "other.csv"
    ids = [0, 40, 90, 130, 200, 250]
    own.write_text("\n".join(",".join(map(str, (f"p{k}", *x[k]))) for k in ids))
    use_file(editor, "landmarks.source", own)
    assert shown(editor)[0][0] == ("p0", "no target")
    assert editor.controller.messages.text.startswith("6 landmarks; without a point or a target")
    session.landmarks.write(other)
    use_file(editor, "landmarks.target", other)
    assert shown(editor)[0] == [(f"p{k}", "0.0000") for k in ids]
    press(editor, "landmarks.list.select", ["p90"])
    press(editor, "landmarks.z", 0.1)
    press(editor, "landmarks.z", 0.2)
    assert session.history.labels[-2:] == ("load targets", "move target of p90")
    off = abs(0.2 - x[90, 2])
    rows, fields = shown(editor)
    assert rows[2] == ("p90", f"{off:.4f}")
    assert fields["off"].value == f"{off / np.sqrt(6):.4f}, at most {off:.4f}: p90"
    press(editor, "landmarks.list.rename", ("p90", "nose"))
    assert press(editor, "landmarks.fit") is None
    assert editor.is_busy
    editor.wait()
    assert session.history.undo_label == "fit landmarks"
    assert abs(session.volume_change) > 1e-4  # it may grow
    assert_allclose(session.vertices[90], [x[90, 0], x[90, 1], 0.2], atol=1e-9)
    assert [text for _, text in shown(editor)[0]] == ["0.0000"] * 6
    use_file(editor, "landmarks.save_target", other)
    assert "nose" in other.read_text()
    press(editor, "landmarks.remove")
    assert "nose" not in session.landmarks
    assert [editor.run("undo") for _ in range(2)] == [None, None]
    assert_array_equal(session.vertices, x)


def test_a_fit_is_cancelled_and_errors_are_shown(editor, tmp_path):
    session = editor.session
    for k in (0, 90, 200):
        session.landmarks.add(k, session.mesh.vertices[k] + [0.0, 0.0, 1.0])
    before = session.state
    press(editor, "landmarks.fit")
    editor.run("cancel")
    editor.wait()
    assert session.state is before
    fault = use_file(editor, "landmarks.source", tmp_path / "none.csv")
    assert isinstance(fault, MeshError)
    assert "none.csv" in editor.controller.messages.error
    for name in ("landmarks.fit", "none"):
        with pytest.raises(ArgumentError, match="no control"):
            use_file(editor, name, tmp_path)
    with pytest.raises(ArgumentError, match="asks for a file"):
        press(editor, "landmarks.source", str(tmp_path))
