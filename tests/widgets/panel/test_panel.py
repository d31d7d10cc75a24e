"""The models of the panel without any window: every control does what it says, and says so."""

from __future__ import annotations

import functools
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from bad_values import BAD
from hands import Hand, draw_seldom, plain_view
from scenes import sausage

from vtk_segdeform import Session
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions import segment
from vtk_segdeform.session.state import State
from vtk_segdeform.widgets.editor import Controller, controller
from vtk_segdeform.widgets.editor.editor import DeformEditor, Mode
from vtk_segdeform.widgets.panel.fields import Field, Table, tooltip
from vtk_segdeform.widgets.panel.panel import all_sections, checked, press, sections
from vtk_segdeform.widgets.panel.status import history, status, words_of
from vtk_segdeform.widgets.panel.toolbar import toolbar, view_entries
from vtk_segdeform.widgets.scene import Draft

# What some of the controls can have, among `BAD`.
SOMETIMES_GOOD = {"None", "True", "False", "numpy True", "0", "3", "2.5", "1e-320", "empty list"}
VALUES = ("toggle", "number", "integer", "slider", "choice")

pytestmark = pytest.mark.usefixtures("bound_once", "unprepared")


@functools.cache
def start() -> tuple[Mesh, State]:
    """Return the mesh and the state of a session that every control of the panel can change."""
    scene = sausage(is_coarse=True)
    session = scene.caged()
    session.set_fixed(scene.fixed)
    name = session.handles.add(scene.handle)
    session.handles.pin(int(np.argmin(np.abs(scene.mesh.vertices[:, 0]))))
    session.handles.set_pivot(name, scene.mesh.vertices[0])
    session.drag({name: scene.mesh.vertices[scene.handle] + [0.0, 0.0, 0.3]})
    session.commit()
    return session.mesh, session.state


def full() -> Session:
    """Return a session with a step to undo and one to redo."""
    mesh, state = start()
    session = Session(mesh, state=state)
    for point in mesh.vertices[1:3]:
        session.handles.set_pivot("handle 1", point)
    session.undo()
    return session


@contextmanager
def editing(mode: Mode, session: Session | None = None) -> Iterator[DeformEditor]:
    """Yield an editor in *mode*, in which the handle with the gizmo is selected."""
    view = plain_view()
    draw_seldom(view)
    editor = DeformEditor(view, session or full())
    editor.On()
    editor.mode = mode
    editor.wait()
    if "handle 1" in editor.session.handles and mode is Mode.HANDLES:
        press(editor, "handles.list.select", ["handle:handle 1"])
    yield editor
    editor.remove()


@pytest.fixture(scope="module", params=[*Mode], ids=lambda mode: mode.name)
def editor(request):
    """Yield an editor over a session of `full`, in each mode; tests do not change it."""
    with editing(request.param) as editor:
        yield editor


def of(editor: DeformEditor, name: str) -> Field:
    """Return the field *name* as it is now."""
    return next(f for each in all_sections(editor) for f in each.fields if f.name == name)


def table_of(editor: DeformEditor, name: str) -> Table:
    return next(t for each in all_sections(editor) for t in each.tables if t.name == name)


def another(field: Field) -> object:
    """Return another value that *field* can have."""
    if field.kind == "toggle":
        return not field.value
    if field.kind == "choice":
        return next((value for _, value in field.choices if value != field.value), field.value)
    if field.name.startswith("motion."):
        return field.value + 10.0 * field.step
    low = field.minimum
    high = min(field.maximum, low + 9.0 * abs(low) + 50.0 * field.step)
    value = round(low + 0.5 * (high - low), field.decimals)
    return value if field.kind == "number" else int(value)


def everything(editor: DeformEditor) -> tuple:
    """Return all that the panel shows."""
    return all_sections(editor), toolbar(editor), status(editor), history(editor)


QUIET = {"label", "file"}  # the skin uses the latter
# In mode HANDLES as in mode REGIONS; and in mode DEFORM as in modes HANDLES, CAGES and PULL.
TOOLS = ("brush", "lasso", "rectangle", "connected_part", "whole_region", "radius", "through")
VOLUMES = ("name", "change", "goal", "keep_part", "grow_part", "symmetry")
SAME = {
    Mode.HANDLES: {f"paint.{name}" for name in TOOLS},
    Mode.DEFORM: {"handles.remove", "handles.convert", "regions.stiffness", "poses.save"}
    | {f"volumes.{name}" for name in VOLUMES},
}


def presses(editor: DeformEditor, name: str) -> None:
    """Press *name*, with another value if it has one, and check that this is what it says."""
    if name == "regions.merge":
        press(editor, "regions.list.select", ["0", "1"])
    if name == "paint.brush":
        press(editor, "paint.lasso")
    if name == "deform.range" and not of(editor, "deform.overlay").value:
        press(editor, "deform.overlay")
        editor.wait()
    field, before = of(editor, name), everything(editor)
    if name == "deform.lids":  # the mesh is closed
        assert not field.enabled
        return
    assert field.enabled, name
    value = another(field) if field.kind in VALUES else None
    assert press(editor, name, value) is None
    editor.wait()
    assert everything(editor) != before, name
    now = of(editor, name).value
    if value is None:
        assert field.value is None or now is True
        return
    if name.startswith(("motion.rotate", "motion.scale")):  # by so much from now
        assert now == field.value
        return
    near = 0.3 if name == "cages.detail" else 1e-12  # that is met only nearly

    def expected(wanted: object) -> object:
        return wanted if isinstance(wanted, str) else pytest.approx(wanted, rel=near)

    assert now == expected(value)
    assert now != field.value
    if field.special:
        press(editor, name, field.minimum)
        assert of(editor, name).value is None
        editor.wait()
    else:
        press(editor, name, field.value)
        editor.wait()
        assert of(editor, name).value == expected(field.value)


def seen(editor: DeformEditor) -> tuple:
    """Return the state of the session, by identity, and all that the sections show."""
    return id(editor.session.state), editor.session.history.position, all_sections(editor)


def undo(editor: DeformEditor, before: tuple) -> bool:
    """Undo what was done since *before*, and return whether all is as it was then."""
    editor.session.history.jump(before[1])
    editor.wait()
    return seen(editor) == before


@pytest.mark.parametrize("mode", [*Mode], ids=lambda mode: mode.name)
def test_every_control_does_what_it_says_and_then_says_so(mode):
    with editing(mode) as editor:
        shown = [field for section in sections(editor) for field in section.fields]
        kinds = {f.name: f.kind for f in shown if f.visible and f.kind not in QUIET}
        assert {*kinds} >= SAME.get(mode, set())
        names = sorted({*kinds} - SAME.get(mode, set()))
        for name in names:  # each has its old value again, so that it disables no other one
            if kinds[name] in VALUES:
                presses(editor, name)
    with ExitStack() as stack:
        before = None
        for name in names:
            if kinds[name] in VALUES:
                continue
            if before is None or not undo(editor, before):
                stack.close()
                editor = stack.enter_context(editing(mode))
                before = seen(editor)
            presses(editor, name)


def test_controls_that_are_disabled_or_not_shown_do_nothing():
    scene = sausage(is_coarse=True)
    with editing(Mode.PULL, Session(scene.mesh)) as editor:
        for mode in Mode:
            editor.mode = mode
            editor.wait()
            idle = [
                field
                for section in all_sections(editor)
                for field in section.fields
                if not (section.visible and field.visible and field.enabled)
            ]
            assert len(idle) > 20
            before = everything(editor), editor.session.state
            for field in idle:
                if field.kind not in QUIET:
                    value = another(field) if field.kind in VALUES else None
                    assert press(editor, field.name, value) is None
                    assert not editor.is_busy
            assert (everything(editor), editor.session.state) == before


def test_the_toolbar_and_the_menu_do_what_they_say(monkeypatch):
    with editing(Mode.DEFORM) as editor:
        buttons = {field.name: field for field in toolbar(editor)}
        assert buttons["undo"].tip.startswith("Undo: ")
        pivots = editor.session.state.pivots
        assert press(editor, "undo") is None
        assert editor.session.state.pivots is not pivots
        editor.wait()
        press(editor, "redo")
        editor.wait()
        assert editor.session.state.pivots is pivots
        for stays in (True, False):  # a click keeps the mesh at rest until the next one
            press(editor, "compare", True)
            assert status(editor).hint == "The mesh at rest, while held"
            press(editor, "compare", False)
            assert editor.controller.shows_rest is stays
            assert ("Before/After again" in status(editor).hint) is stays
        press(editor, "compare", True)
        monkeypatch.setattr(controller, "_CLICK", -1.0)
        press(editor, "compare", False)  # after a longer press
        assert not editor.controller.shows_rest
        monkeypatch.setattr(Draft.of(editor.view), "seconds", 60.0)  # to draw the mesh at rest
        press(editor, "compare", True)
        press(editor, "compare", False)
        assert editor.controller.shows_rest
        press(editor, "compare", True)
        press(editor, "compare", False)
        assert not editor.controller.shows_rest
        press(editor, "help")
        assert editor.controller.help.is_shown
        editor.run("cancel")
        for name in ("show_regions", "show_cages", "orthographic", "cube", "up_x"):
            name, now = f"view.{name}", entries(editor)
            assert now[name].kind == "toggle"
            press(editor, name)
            assert entries(editor)[name].value is not now[name].value
        place = editor.view.camera.GetPosition()
        press(editor, "view.front")
        editor.view.render()
        assert editor.view.camera.GetPosition() != place
        for mode in Mode:
            press(editor, f"mode.{mode.name.lower()}")
            editor.wait()
            assert editor.mode is mode
            down = [f.name for f in toolbar(editor) if f.group == "modes" and f.value]
            assert down == [f"mode.{mode.name.lower()}"]


def entries(editor: DeformEditor | None) -> dict[str, Field]:
    """Return the entries of the menu about the view, by their names."""
    top = [field for field in view_entries(editor) if field is not None]
    return {f.name: f for field in top for f in (field, *field.items) if f is not None}


def test_without_an_editor_the_menu_has_the_same_entries_disabled(editor):
    none, some = entries(None), entries(editor)
    assert [*none] == [*some]
    assert not any(field.enabled or field.value for field in none.values())
    for name, field in some.items():
        assert (field.kind, field.label) == (none[name].kind, none[name].label)


def test_rows_are_selected_renamed_and_checked():
    with editing(Mode.HANDLES) as editor:
        handles = lambda: {row.key: row for row in table_of(editor, "handles.list").rows}  # noqa: E731
        assert [*handles()] == ["fixed", "handle:handle 1", "handle:pin 1"]
        press(editor, "handles.list.select", ["fixed"])
        assert [row.key for row in handles().values() if row.selected] == ["fixed"]
        press(editor, "handles.list.rename", ("handle:pin 1", " nose "))
        assert handles()["handle:nose"].renamable
        for place, (column, checked) in enumerate((("show", False), ("lock", True)), 1):
            press(editor, f"handles.list.{column}", ("handle:nose", checked))
            assert handles()["handle:nose"].cells[place].checked is checked
        error = press(editor, "handles.list.rename", ("handle:nose", "handle 1"))
        assert error is not None
        assert status(editor).is_error
        assert status(editor).text.lower() == str(error).lower()
    with editing(Mode.REGIONS) as editor:
        regions = lambda: table_of(editor, "regions.list").rows  # noqa: E731
        press(editor, "regions.list.rename", ("1", "arm"))
        press(editor, "regions.list.select", ["0", "1"])
        assert [(row.label, row.selected) for row in regions()] == [
            ("region 1", True),
            ("arm", True),
        ]
        assert not of(editor, "regions.split").enabled
        press(editor, "regions.list.cage", ("1", False))
        assert [row.cells[0].checked for row in regions()] == [True, False]
        press(editor, "regions.new")
        assert [row.selected for row in regions()] == [False, False, True]
        with pytest.raises(ArgumentError, match="cannot be renamed"):
            press(editor, "regions.list.rename", ("2", "x"))


def test_a_region_covered_by_others_has_no_stiffness_of_its_own():
    with editing(Mode.REGIONS) as editor:
        session = editor.session
        press(editor, "regions.list.select", ["1"])
        press(editor, "regions.stiffness", "3")
        assert of(editor, "regions.stiffness").value == "3"
        session.painting.paint(0, np.arange(session.mesh.n_vertices))
        assert 1 not in session.regions.labels
        assert of(editor, "regions.stiffness").value == "1"
        assert "region 2 is covered by other" in str(press(editor, "regions.stiffness", "10"))


def test_before_cages_are_fitted_their_suggested_number_of_vertices_is_shown():
    mesh = sausage(is_coarse=True).mesh
    session = Session(mesh)
    session.set_regions(segment(mesh, 7))
    with editing(Mode.CAGES, session) as made:
        shown = [of(made, f"cages.{name}").value for name in ("detail", "total")]
        session.fit_cages()
        assert shown == [7 * 30] * 2
        assert shown[0] == sum(cage.n_vertices for cage in session.cages)


def test_the_newest_pull_is_selected_or_the_one_that_is_pulled_again():
    with editing(Mode.PULL) as editor:
        session, x = editor.session, editor.session.mesh.vertices
        middle = np.flatnonzero(np.abs(x[:, 0]) < 0.2 * np.ptp(x[:, 0]))

        def selected():
            table = table_of(editor, "handles.list")
            return [row.label for row in table.rows if row.selected]

        for n, vertex in enumerate((x[middle, 2].argmax(), x[middle, 2].argmin()), 1):
            pull = functools.partial(session.pull, middle[vertex], x[middle[vertex]] * 1.1)
            before = selected()
            pull()
            session.revert()
            assert selected() == before
            pull()
            session.commit()
            assert selected() == [f"pull {n}"]
        hand, (dot,) = Hand(editor.view), session.targets["pull 1"]
        editor.view.render()
        hand.click(hand.at(dot))
        assert selected() == ["pull 1"]
        press(editor, "handles.list.select", ["handle:pull 2"])
        press(editor, "handles.remove")
        assert "pull 1" in session.handles
        assert "pull 2" not in session.handles
        assert selected() == ["pull 1"]


def test_a_handle_is_a_part_whose_volume_is_listed_and_set():
    with editing(Mode.DEFORM) as editor:

        def select(row: str, on: bool) -> Exception | None:
            editor.mode = Mode.HANDLES
            press(editor, "handles.list.select", [row])
            error = press(editor, "handles.volume", on)
            assert error or of(editor, "handles.volume").value is on
            editor.mode = Mode.DEFORM
            editor.wait()
            return error

        select("handle:handle 1", True)
        assert ("Handle 1", "handle 1") in of(editor, "volumes.name").choices
        press(editor, "volumes.name", "handle 1")
        press(editor, "volumes.change", 25)
        editor.wait()
        assert abs(editor.session.volume("handle 1")[1] - 0.25) < 1e-12
        select("handle:handle 1", False)
        assert editor.session.options.volumes == ()
        assert of(editor, "volumes.name").value == "whole"
        error = select("handle:pin 1", True)
        assert "the part 'pin 1' encloses no volume under a lid" in str(error)


def test_an_area_is_set_and_a_centroid_is_kept_while_a_handle_moves():
    with editing(Mode.DEFORM) as editor:
        session = editor.session
        press(editor, "volumes.name", "area")
        press(editor, "volumes.change", 5)
        editor.wait()
        assert abs(session.volume("area")[1] - 0.05) < 1e-12
        assert of(editor, "volumes.value").value.endswith("(+5 %)")
        press(editor, "volumes.goal", "default")
        editor.wait()
        press(editor, "volumes.name", "centroid z")
        assert not of(editor, "volumes.change").enabled
        assert [goal for _, goal in of(editor, "volumes.goal").choices] == [
            "default", "keep", "free",
        ]  # fmt: skip
        press(editor, "volumes.goal", "keep")
        editor.wait()
        at = {name: each + 0.1 for name, each in session.targets.items()}
        session.drag(at)
        session.commit()
        assert abs(session.volume("centroid z")[1]) < 1e-12
        assert dict(session.options.volumes) == {"centroid z": "keep"}


def test_a_job_disables_all_sections_until_it_ends():
    with editing(Mode.REGIONS) as editor:
        before, go_on = sections(editor), threading.Event()
        editor.controller.start("counting", lambda _: go_on.wait(20.0), lambda _: None)
        during = sections(editor)
        assert [section.name for section in during] == [section.name for section in before]
        assert not any(field.enabled for section in during for field in section.fields)
        assert not any(table.enabled for section in during for table in section.tables)
        assert press(editor, "regions.new") is None
        now = status(editor)
        assert (now.is_busy, now.work, now.progress, now.cancel.visible) == (
            True, "counting", 0.0, True,
        )  # fmt: skip
        free = [field.name for field in toolbar(editor) if field.enabled]
        assert free == ["help"]
        assert press(editor, "cancel") is None
        go_on.set()
        editor.wait()
        assert sections(editor) == before
        assert not status(editor).is_busy


def test_the_history_is_named_previewed_and_jumped_to():
    with editing(Mode.DEFORM) as editor:
        entries = history(editor)
        assert [entry.is_current for entry in entries] == [False, True, False]
        assert [entry.is_undone for entry in entries] == [False, False, True]
        editor.session.reset_pose()
        editor.wait()
        press(editor, "history.preview", 1)
        assert editor.widgets.surface.instead is not None
        press(editor, "history.preview")
        assert editor.widgets.surface.instead is None
        assert press(editor, "history", 0) is None
        assert history(editor)[0].is_current


def test_words_of_the_hint_with_actions_are_keys(editor):
    hint = "No regions yet. Press G to detect them, or 1 to paint one"
    words = words_of(hint, editor.keys, editor.mode)
    assert "".join(word.text for word in words) == hint
    assert [word.action for word in words if word.action] == ["segment", "regions"]
    words = words_of("Shift+wheel: radius (4.8 %). Press 4.", editor.keys, editor.mode)
    assert [word.text for word in words if word.action] == ["4"]
    assert words[0].text.endswith("(4.8 %). Press ")
    assert status(editor).hint == editor.controller.hint


def test_names_and_tooltips_are_complete(editor):
    fields = [field for section in all_sections(editor) for field in section.fields]
    tables = [table for section in all_sections(editor) for table in section.tables]
    known = [*fields, *tables, *toolbar(editor), *entries(editor).values()]
    assert len({each.name for each in known}) == len(known)
    for field in (*fields, *toolbar(editor)):
        assert field.label[:1].isupper()
        assert field.tip
        idle = field.kind in ("label", "menu", "file") or not field.enabled
        assert idle or field.act or editor.keys[field.action].action
    assert tooltip(of(editor, "paint.grow"), editor.keys) == "Grow by one ring (+)"


def test_actions_hold_no_editor(editor):
    fields = [field for section in all_sections(editor) for field in section.fields]
    acts = [f.act for f in (*fields, *toolbar(editor), *entries(editor).values()) if f.act]
    acts += [act for each in all_sections(editor) for t in each.tables for act in t.acts.values()]
    assert len(acts) > 20
    for act in acts:
        for cell in getattr(act, "__closure__", None) or ():
            assert not isinstance(cell.cell_contents, DeformEditor | Controller | Session)


def test_wrong_names_and_values_are_refused_by_name():
    with editing(Mode.DEFORM) as editor:
        state = editor.session.state
        fields = [field for each in all_sections(editor) for field in each.fields]
        tables = [table for each in sections(editor) for table in each.tables]
        verbs = [f"{table.name}.{verb}" for table in tables for verb in table.acts]
        for name in ("", "no such", "regions.list", "pull.radius.select"):
            with pytest.raises(ArgumentError, match="name: there is no control"):
                press(editor, name)
        for name in ("open", "save", "save.session", "view", "deform.volume"):
            with pytest.raises(ArgumentError, match=name):
                press(editor, name)
        with pytest.raises(
            ArgumentError, match=r"deform\.stretch must be a number from 0 to 1e\+06"
        ):
            press(editor, "deform.stretch", -1.0)
        for k, (label, make) in enumerate(BAD.items()):
            with pytest.raises(ArgumentError):
                press(editor, make())
            if label in SOMETIMES_GOOD:
                continue
            for field in fields:
                if label == "-1" and field.minimum < 0:
                    continue
                with pytest.raises(ArgumentError, match=field.name):
                    checked(field, make())
            for name in (*verbs, "history", "history.preview")[k % 6 :: 6]:
                with pytest.raises(ArgumentError, match=name):
                    press(editor, name, make())
        assert editor.session.state is state
