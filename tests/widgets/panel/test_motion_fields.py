"""Numbers that move, rotate and scale the active handle, and that a drag shows."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hands import Hand
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage
from scipy.spatial.transform import Rotation

from vtk_segdeform.deformer.path import Path
from vtk_segdeform.widgets.handle_dragger import STEPS
from vtk_segdeform.widgets.handle_dragger.gizmo_shapes import Kind, Part
from vtk_segdeform.widgets.panel import press, sections
from vtk_segdeform.widgets.scene import Phase, Pointer

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")
SCENE = sausage(is_coarse=True)
REST = SCENE.mesh.vertices[SCENE.handle]


def shown(editor):
    """Return the numbers of the section by name; {} if it is not shown."""
    found = (each for each in sections(editor) if each.name == "motion")
    return {f.name.removeprefix("motion."): f.value for each in found for f in each.fields}


def test_numbers_move_rotate_and_scale_the_handle_each_as_one_step(editor):
    session, (name,) = editor.session, editor.session.handles
    assert press(editor, "motion.move_z", 0.7) is None
    assert press(editor, "motion.move_z", 0.4) is None  # from rest, and not in addition
    assert press(editor, "motion.move_x", -0.1) is None
    assert session.history.labels[-2:] == (f"drag {name}", f"drag {name}")
    assert_allclose(session.targets[name], REST + [-0.1, 0.0, 0.4], atol=1e-12)
    assert press(editor, "motion.rotate_y", 270.0) is None
    centre = REST.mean(axis=0) + [-0.1, 0.0, 0.4]
    pivot = session.handles.pivot(name)
    turned = Rotation.from_euler("y", 270, degrees=True).apply(REST - REST.mean(axis=0))
    assert_allclose(session.targets[name] - session.targets[name].mean(axis=0), turned, atol=1e-12)
    assert np.linalg.norm(pivot - centre) < 0.1
    assert session.history.undo_label == f"rotate {name}"
    assert press(editor, "motion.scale", 1.2) is None
    assert_allclose(
        session.targets[name] - session.targets[name].mean(axis=0), 1.2 * turned, atol=1e-12
    )
    now = shown(editor)
    assert (now["rotate_y"], now["scale"]) == (0.0, 1.0)  # of the next ones
    assert abs(session.volume_change) < 1e-12
    for _ in range(5):
        editor.run("undo")
    assert session.state.pose is None
    assert_array_equal(list(shown(editor).values())[:3], np.zeros(3))


def test_a_turn_of_more_than_half_a_round_goes_the_way_that_was_asked_for(editor):
    session, solved = editor.session, []
    session.on_change(lambda _: solved.append(session.vertices))
    press(editor, "motion.rotate_x", 180.0)
    (name,) = session.handles
    a, b = SCENE.handle[np.argsort(REST[:, 2])[[0, -1]]]  # the lowest and the highest
    between = [each for each in solved if abs(each[b, 1] - each[a, 1]) > 0.8 * np.ptp(REST[:, 2])]
    assert between  # it stopped half-way
    assert_allclose(session.targets[name][:, 2], -REST[:, 2], atol=1e-9)


def test_a_far_number_is_reached_by_solves_of_a_few_steps_each(editor, monkeypatch):
    """Where contact is avoided, waypoints are near each other; the window stays usable."""
    session, hand, steps, solve = editor.session, Hand(editor.view), [], Path.solve

    def counted(self, *how, **more):
        pose = solve(self, *how, **more)
        steps.append(pose.steps)
        return pose

    monkeypatch.setattr(Path, "solve", counted)
    session.change_options(avoid_contact=True)
    press(editor, "motion.move_x", 6.0)
    assert session.is_unsettled
    assert session.vertices[SCENE.handle].mean(axis=0)[0] < REST.mean(axis=0)[0] + 3.0
    ticks = itertools.takewhile(lambda _: session.is_unsettled, range(200))
    for _ in ticks:
        hand.tick()
    assert max(steps) < 2 * STEPS
    assert_allclose(session.vertices[SCENE.handle], REST + [6.0, 0.0, 0.0], atol=0.01)
    editor.run("undo")
    assert session.state.pose is None


def test_a_drag_shows_its_numbers(editor):
    hand, gizmo = Hand(editor.view), editor.widgets.dragger.gizmo
    start = np.array(hand.at(gizmo.centre))
    hand.press(start)
    hand.move(start + [0.0, 40.0])
    hand.key("z")
    hand.key("2")
    seen = shown(editor)
    assert seen["move_z"] == pytest.approx(2.0)
    assert seen["move_x"] == pytest.approx(0.0, abs=1e-12)
    hand.key("Escape")
    assert shown(editor)["move_z"] == 0.0
    editor.view.draw()  # which sets the size of the gizmo
    ring = Part(Kind.ROTATION, 1)
    line = np.round(gizmo.line(ring)[:, :2])
    hand.press(next(p for p in line if gizmo.part_at(Pointer(Phase.HOVER, *p)) == ring))
    hand.key("3")
    hand.key("0")
    assert shown(editor)["rotate_y"] == pytest.approx(30.0)
    hand.key("Return")
    assert shown(editor)["rotate_y"] == 0.0
    assert hand.failures == []


def test_a_locked_handle_and_a_single_vertex_are_not_rotated(editor):
    session, (name,) = editor.session, editor.session.handles
    editor.widgets.dragger.set_locked(name, True)
    state = session.state
    for field in ("move_x", "rotate_x", "scale"):
        press(editor, f"motion.{field}", 2.0)
    assert session.state is state
    editor.widgets.dragger.set_locked(name, False)
    session.handles.to_pin(name)
    press(editor, "motion.rotate_x", 20.0)
    assert session.history.undo_label != f"rotate {name}"
    press(editor, "motion.move_z", 0.3)
    (ids,) = session.handles.values()
    assert_allclose(session.vertices[ids, 2] - SCENE.mesh.vertices[ids, 2], 0.3, atol=1e-6)
    session.handles.remove(*session.handles)
    assert shown(editor) == {}
