"""Saved poses in the panel: saved, returned to, and blended by a slider as one step."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vtk_segdeform.widgets.panel import press, sections

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")


def shown(editor):
    """Return the section, or None, and its visible fields by name."""
    found = next((each for each in sections(editor) if each.name == "poses"), None)
    fields = () if found is None else found.fields
    return found, {field.name.removeprefix("poses."): field for field in fields if field.visible}


def settle(editor):
    while editor.widgets.dragger.is_refining:
        editor.view.interactor.InvokeEvent("TimerEvent")


def test_poses_are_saved_selected_renamed_and_blended(editor):
    session = editor.session
    assert list(shown(editor)[1]) == ["copy"]  # nothing to save yet
    press(editor, "motion.move_z", 0.5)
    settle(editor)
    up = session.vertices
    assert list(shown(editor)[1]) == ["save", "copy"]
    press(editor, "poses.save")
    press(editor, "motion.move_z", -2.5)
    assert editor.widgets.is_settling
    press(editor, "poses.save")  # once the pose has settled
    assert list(session.saved_poses) == ["pose 1"]
    settle(editor)
    editor.view.interactor.InvokeEvent("TimerEvent")
    assert list(session.saved_poses) == ["pose 1", "pose 2"]
    assert not session.is_unsettled
    press(editor, "poses.list.rename", ("pose 2", "down"))
    section, _ = shown(editor)
    (table,) = section.tables
    assert [(row.label, row.selected) for row in table.rows] == [("pose 1", False), ("down", True)]
    assert press(editor, "poses.list.select", ["pose 1"]) is None
    assert_array_equal(session.vertices, up)
    assert session.history.undo_label == "go to pose 1"
    press(editor, "poses.first", "pose:pose 1")
    assert [label for label, _ in shown(editor)[1]["second"].choices] == ["Rest", "pose 1", "down"]
    steps = len(session.history.labels)
    for share in (10.0, 30.0, 50.0):  # the moves of a slider
        assert press(editor, "poses.share", share) is None
        settle(editor)
        assert shown(editor)[1]["share"].value == share
    assert session.history.labels[steps:] == ("blend pose 1 and down",)
    (name,) = session.handles
    half = session.mesh.vertices[session.handles[name]] - [0.0, 0.0, 1.0]
    assert np.abs(session.targets[name] - half).max() < 1e-6
    assert abs(session.volume_change) < 1e-12
    editor.run("undo")
    assert_array_equal(session.vertices, up)
    assert shown(editor)[1]["share"].value == 0.0
    press(editor, "poses.remove")  # the selected one
    assert list(session.saved_poses) == ["down"]
    assert shown(editor)[1]["first"].value == "rest"


def test_a_pose_of_other_cages_is_fitted_in_the_background(editor):
    session = editor.session
    press(editor, "motion.move_z", 0.5)
    settle(editor)
    up = session.vertices
    press(editor, "poses.save")
    session.change_options(n_cage_vertices=100)
    session.fit_cages()
    editor.wait()
    press(editor, "poses.list.select", ["pose 1"])
    assert editor.is_busy
    editor.wait()
    assert np.abs(session.vertices - up).max() < 0.02 * session.mesh.diagonal
    assert not shown(editor)[1]["share"].enabled
