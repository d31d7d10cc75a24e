"""The list of bodies in the panel: volumes, what they follow, and changes of that."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np
import pytest
from bodies import ball, joined, rod, tube
from hands import Hand, draw_seldom, look_from, plain_view
from numpy.testing import assert_array_equal
from scenes import sausage

from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.session import Session
from vtk_segdeform.widgets.editor.editor import DeformEditor
from vtk_segdeform.widgets.editor.widget_set import Mode
from vtk_segdeform.widgets.panel.fields import Section
from vtk_segdeform.widgets.panel.panel import all_sections, press
from vtk_segdeform.widgets.region_selector import Paint, Tool
from vtk_segdeform.widgets.scene import Phase

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")

SOLIDS = [
    rod(0.5, 0.0, 4.0, n=10, step=0.5),
    tube(0.55, 0.62, 1.0, 3.0, n=10, step=0.5),
    ball(0.35, (1.8, 0.0, 2.0), 1),
]


def editing(session: Session) -> Iterator[DeformEditor]:
    view = plain_view()
    draw_seldom(view)
    editor = DeformEditor(view, session)
    editor.On()
    hand = Hand(view)
    yield editor
    assert hand.failures == []
    editor.remove()


def ready(*solids) -> Session:
    session = Session(joined(*solids))
    session.change_options(n_cage_vertices=80)
    session.segment()
    session.fit_cages()
    session.bind()
    return session


@functools.cache
def start() -> Session:
    return ready(*SOLIDS)


@pytest.fixture
def editor():
    session = Session(start().mesh, state=start().state)
    session.bind()
    yield from editing(session)


def bodies(editor: DeformEditor) -> Section:
    return next(each for each in all_sections(editor) if each.name == "bodies")


def rows(editor: DeformEditor) -> list[tuple[str, ...]]:
    (table,) = bodies(editor).tables
    return [(row.label, *(cell.text for cell in row.cells)) for row in table.rows]


def follows(editor: DeformEditor):
    return next(field for field in bodies(editor).fields if field.name == "bodies.follows")


def test_bodies_are_listed_with_their_volumes_and_what_they_follow(editor):
    volumes = editor.session.volumes()
    shown = rows(editor)
    assert [(row[0], *row[2:4]) for row in shown] == [
        ("Body 1", "0 %", "Nothing"), ("Body 2", "0 %", "Body 1"), ("Body 3", "0 %", "Nothing"),
    ]  # fmt: skip
    assert [row[1] for row in shown] == [f"{volumes[f'body {k}']:.4g}" for k in range(3)]
    editor.session.set_volume("body 2", "+10%")
    editor.session.commit()
    assert rows(editor)[2][1:3] == (f"{1.1 * volumes['body 2']:.4g}", "+10.0 %")


def test_what_a_body_follows_is_changed_at_once_in_one_step(editor):
    session = editor.session
    assert press(editor, "bodies.list.select", ["body 1"]) is None
    assert follows(editor).value == "auto"
    assert [label for label, _ in follows(editor).choices] == [
        "Automatic", "Nothing", "Body 1", "Body 3"
    ]  # fmt: skip
    press(editor, "bodies.follows", "free")
    editor.wait()
    assert_array_equal(session.regions.carrier, [0, 1, 2])
    assert (follows(editor).value, rows(editor)[1][3]) == ("free", "Nothing")
    session.bind()
    press(editor, "bodies.list.select", ["body 2"])
    press(editor, "bodies.follows", "0")
    editor.wait()
    assert session.options.attach == ((1, "free"), (2, 0))
    assert session.history.labels[-2:] == ("body 2 follows nothing", "body 3 follows body 1")
    assert editor.status.startswith("Body 3 follows body 1")
    assert_array_equal(session.regions.carrier, [0, 1, 0])
    session.bind()
    editor.run("segment")  # which keeps to it
    editor.wait()
    assert_array_equal(session.regions.carrier, [0, 1, 0])
    for expected in ([0, 1, 0], [0, 1, 2], [0, 0, 2]):
        session.undo()
        assert_array_equal(session.regions.carrier, expected)
    assert session.options.attach == ()


def test_the_selected_body_is_the_volume_that_the_slider_changes(editor):
    press(editor, "bodies.list.select", ["body 2"])
    press(editor, "volumes.change", -20)
    editor.wait()
    assert abs(editor.session.volume("body 2")[1] + 0.2) < 1e-12
    press(editor, "volumes.name", "whole")
    (table,) = bodies(editor).tables
    assert [row.selected for row in table.rows] == [True, False, False]


def test_a_circle_is_refused_and_said(editor):
    press(editor, "bodies.list.select", ["body 2"])
    press(editor, "bodies.follows", "0")
    editor.wait()
    editor.session.bind()
    press(editor, "bodies.list.select", ["body 0"])
    press(editor, "bodies.follows", "2")
    with pytest.raises(Exception, match="must not lead back to a component"):
        editor.wait()
    assert editor.session.options.attach == ((2, 0),)


def test_of_hundreds_of_bodies_the_largest_are_listed():
    places = np.stack(np.meshgrid(*[np.arange(3.0)] * 2, [0.0]), axis=-1).reshape(-1, 3)
    dots = [ball(0.1 + 0.01 * k, place, 0) for k, place in enumerate(places)]
    far = [ball(0.05, place + [4.0, 0.0, 0.0], 0) for place in places]
    for editor in editing(ready(*dots, *far)):
        shown = rows(editor)
        assert len(shown) == 12
        assert [row[0] for row in shown[:3]] == ["Body 9", "Body 8", "Body 7"]
        (more,) = (field for field in bodies(editor).fields if field.name == "bodies.more")
        assert (more.value, more.visible) == ("6 smaller ones", True)


def test_one_body_is_no_list():
    scene = sausage(is_coarse=True)
    for editor in editing(scene.session()):
        assert not bodies(editor).visible


def boxes(editor: DeformEditor, column: str) -> list[bool | None]:
    (table,) = bodies(editor).tables
    place = [each.name for each in table.columns].index(column)
    return [row.cells[place].checked for row in table.rows]


def vertices_of(editor: DeformEditor, component: int) -> np.ndarray:
    return np.flatnonzero(editor.session.mesh.components == component)


def point_at(editor: DeformEditor, component: int) -> Hand:
    """Return a hand at the vertex of a component that is nearest to the eye."""
    look_from(editor.view, 20.0, 0.0, 0.0)
    ids, hand = vertices_of(editor, component), Hand(editor.view)
    near = ids[editor.session.vertices[ids, 0].argmax()]
    hand.hover(hand.at(editor.session.vertices[near]))
    return hand


def test_a_hidden_body_is_not_drawn_picked_or_painted_until_everything_is_shown(editor):
    session, widgets = editor.session, editor.widgets
    editor.controller.finishing.is_wanted = False
    balls = vertices_of(editor, 2)
    name = session.handles.add(balls[:5])
    editor.mode = Mode.DEFORM
    editor.wait()
    assert boxes(editor, "show") == [True, True, True]
    hand = point_at(editor, 2)
    assert widgets.spot_at(editor.view.pointer(Phase.HOVER)).vertex in balls
    assert press(editor, "bodies.list.show", ["body 2", False]) is None
    assert boxes(editor, "show") == [True, True, False]
    assert "Body 3 is hidden. /: show everything" in editor.status
    shown = widgets.surface.polydata.GetNumberOfPolys()
    assert shown == session.mesh.n_faces - len(SOLIDS[2][1])
    spot = widgets.spot_at(editor.view.pointer(Phase.HOVER))
    assert spot is None or spot.vertex not in balls
    assert widgets.dragger.gizmo.centre is None  # of the handle on it
    editor.mode = Mode.HANDLES
    widgets.selector.paints = Paint.FIXED
    widgets.selector.through = True
    widgets.selector.select_all()
    assert len(session.fixed) == session.mesh.n_vertices - len(balls)
    session.set_fixed(balls[-5:])  # some that are hidden
    widgets.selector.invert()
    assert len(session.fixed) == session.mesh.n_vertices - len(balls) + 5
    session.set_fixed([])
    widgets.selector.tool = Tool.RECTANGLE
    hand.drag([(1, 1), (399, 399)])
    assert len(session.fixed) == session.mesh.n_vertices - len(balls)
    widgets.selector.paints = Paint.STIFFNESS
    hand.drag([(1, 1), (399, 399)])
    assert (session.state.stiffness[balls] == 1.0).all()
    assert (np.delete(session.state.stiffness, balls) == 10.0).all()
    hand.types("slash", (2, 2))
    assert boxes(editor, "show") == [True, True, True]
    assert not session.history.redo_label
    editor.mode = Mode.DEFORM
    editor.wait()
    assert widgets.dragger.handle == name
    assert widgets.dragger.gizmo.centre is not None
    hand = point_at(editor, 2)
    hand.types("shift+h", None)
    assert boxes(editor, "show") == [True, True, False]
    press(editor, "bodies.list.show", ["body 2", True])
    assert widgets.surface.only is None


def test_a_locked_body_stays_where_it_is_until_it_is_unlocked(editor):
    session, dragger = editor.session, editor.widgets.dragger
    editor.controller.finishing.is_wanted = False
    ids = vertices_of(editor, 2)
    session.pull(int(ids[0]), session.vertices[ids[0]] + [0.0, 0.3, 0.0])
    session.commit()
    there, (pulled,) = session.vertices, session.handles
    assert np.abs(there - session.mesh.vertices)[ids].max() > 0.2
    assert press(editor, "bodies.list.lock", ["body 2", True]) is None
    editor.wait()
    assert editor.status.startswith("Body 3 is locked")
    assert boxes(editor, "lock") == [False, False, True]
    assert_array_equal(np.union1d(session.fixed, session.state.handle), ids)
    assert session.history.undo_label == "lock body 3"
    assert dragger.locked == {pulled}
    with pytest.raises(ConstraintError, match="Unlock it in the list of bodies"):
        dragger.set_locked(pulled, False)
    view = editor.controller.camera.settings(editor.mode)
    rod_end = int(vertices_of(editor, 0)[-1])
    session.pull(rod_end, session.vertices[rod_end] + [0.5, 0.0, 0.0])
    session.commit()
    assert np.abs(session.vertices - there)[ids].max() < 1e-3
    assert np.abs(session.vertices - there).max() > 0.4
    session.undo()
    session.undo()
    assert boxes(editor, "lock") == [False, False, False]
    assert dragger.locked == frozenset()
    session.redo()
    editor.controller.camera.restore(view)  # as with the session from a file
    session.undo()
    assert dragger.locked == frozenset()
    hand = point_at(editor, 2)
    for is_locked in (True, False):
        hand.types("shift+l", None)
        editor.wait()
        assert boxes(editor, "lock") == [False, False, is_locked]
    assert dragger.locked == frozenset()
    assert session.history.labels[-2:] == ("lock body 3", "unlock body 3")
