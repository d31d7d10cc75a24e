"""Landmarks in a view: added by a press, their targets dragged, shown by dots, rings and lines."""

from __future__ import annotations

import numpy as np
import pytest
from hands import Hand, draw_seldom, look_from, picture, plain_view
from numpy.testing import assert_allclose, assert_array_equal
from scenes import sausage

from vtk_segdeform.pictures import rgb
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.puller.landmark_marks import BLUE

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")
X = sausage(is_coarse=True).mesh.vertices
FRONT = int(np.argmin(np.abs(X - [0.6, -0.8, 0.1]).sum(axis=1)))


@pytest.fixture
def editor():
    """Yield an editor of the coarse sausage in mode 0, seen from the front, and a hand."""
    view = plain_view()
    made = DeformEditor(view, sausage(is_coarse=True).caged())
    look_from(view, 0.0, -12.0, 0.0)
    draw_seldom(view)
    made.On()
    yield made, Hand(view)
    made.remove()


def test_a_press_adds_a_landmark_and_a_drag_leads_to_its_target_in_one_step(editor):
    made, hand = editor
    session, place = made.session, hand.at(X[FRONT])
    hand.types("shift+k", place)
    assert "Click the surface to add a landmark" in made.controller.hint
    hand.click(place)
    ((source, target),) = session.landmarks.values()
    assert_allclose(hand.at(source), np.round(place), atol=1.0)
    assert_allclose(source, target, atol=1e-9)
    assert session.history.labels[3:] == ("set landmark 1",)
    beside = place[0] - 40.0, place[1]
    hand.drag([beside, (beside[0], 300.0), (beside[0], 320.0)])
    assert session.history.labels[3:] == ("set landmark 1", "set landmark 2")
    source, target = session.landmarks["landmark 2"]
    assert_allclose(hand.at(source), beside, atol=1.0)
    assert_allclose(hand.at(target), (beside[0], 320.0), atol=1.0)
    assert session.state.pose is None  # it was no pull
    assert made.widgets.landmarks.chosen == "landmark 2"
    hand.press((place[0] + 40.0, place[1]))
    hand.move((place[0] + 40.0, 300.0))
    hand.key("Escape")
    assert len(session.landmarks) == 2
    assert not session.is_dragging


def test_a_target_is_dragged_and_other_presses_pull_the_surface(editor):
    made, hand = editor
    session = made.session
    session.bind()
    session.landmarks.add(FRONT, X[FRONT] + [0.0, 0.0, 1.5])
    ring = hand.at(X[FRONT] + [0.0, 0.0, 1.5])
    hand.drag([ring, (ring[0] + 20.0, ring[1]), (ring[0] + 30.0, ring[1])])
    assert session.history.labels[-1] == "move target of landmark 1"
    assert_allclose(hand.at(session.landmarks["landmark 1"][1]), (ring[0] + 30, ring[1]), atol=1.0)
    assert session.state.pose is None
    hand.types("shift+k")
    hand.types("shift+k")  # on, and off again
    tip = hand.at(X[X[:, 0].argmax()] * 0.95)
    hand.drag([tip, (tip[0], tip[1] + 20.0)])
    assert session.history.labels[-1] == "pull"
    assert len(session.landmarks) == 1


def test_a_press_gives_a_place_to_the_landmarks_of_a_file_of_targets(editor, tmp_path):
    made, hand = editor
    session, path = made.session, tmp_path / "targets.csv"
    path.write_text("nose,1,0,2\near,0,0,2\n")
    session.landmarks.read(path, targets=True)
    made.widgets.landmarks.chosen = "ear"
    hand.types("shift+k")
    place = hand.at(X[FRONT])
    hand.drag([place, (place[0], 300.0)])
    source, target = session.landmarks["ear"]
    assert_allclose(hand.at(source), np.round(place), atol=1.0)
    assert_array_equal(target, [0.0, 0.0, 2.0])
    hand.click((place[0] - 40.0, place[1]))
    assert not np.isnan(session.landmarks["nose"][0]).any()
    assert len(session.landmarks) == 2


def test_dots_rings_and_lines_are_where_the_landmarks_are_now_and_only_while_they_are_shown(editor):
    made, hand = editor
    session, marks = made.session, made.widgets.landmarks
    session.landmarks.add(FRONT, X[FRONT] + [0.0, 0.0, 1.5])

    def blue(point):
        x, y = hand.at(point)
        near = picture(made.view)[::-1][round(y) - 9 : round(y) + 10, round(x) - 9 : round(x) + 10]
        return int((np.abs(near.astype(int) - rgb(BLUE)).max(axis=2) < 30).sum())

    middle, target = X[FRONT] + [0.0, 0.0, 1.2], X[FRONT] + [0.0, 0.0, 1.5]
    assert blue(X[FRONT]) > 30
    assert blue(target) > 30
    assert 10 < blue(middle) < 60
    marks.is_hidden = True
    assert blue(X[FRONT]) == blue(target) == blue(middle) == 0
    marks.is_hidden = False
    made.mode = Mode.REGIONS
    assert blue(target) == 0
    made.mode = Mode.PULL
    tip = int(X[:, 0].argmax())
    session.pull(tip, X[tip] + [0.0, 0.0, 1.0], locality=0.0)
    assert np.linalg.norm(session.vertices[FRONT] - X[FRONT]) > 0.3
    assert blue(session.vertices[FRONT]) > 30
