"""The Qt panel beside its models: what is visible, what it says, and that a click presses it."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from bodies import ball, joined
from qt_hands import Qt, QtTest, QtWidgets, application, small, until
from qtpy import QtCore, QtGui

from vtk_segdeform import Session
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.panel.fields import Row, Table, tooltip
from vtk_segdeform.widgets.panel.panel import all_sections, press, sections
from vtk_segdeform.widgets.panel.toolbar import toolbar
from vtk_segdeform.widgets.qt import icons
from vtk_segdeform.widgets.qt.tables import TableView
from vtk_segdeform.widgets.qt.widget import DeformWidget

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")


@pytest.fixture(scope="module")
def widget(unprepared):
    """Return a widget over a session with regions, cages, a handle and a pin."""
    application()
    mesh, state = small()
    session = Session(mesh, state=state)
    session.handles.pin(int(np.argmin(np.abs(mesh.vertices[:, 0]))))
    session.landmarks.add(0, mesh.vertices[0])
    widget = DeformWidget(session)
    widget.plotter.setUpdatesEnabled(False)  # the view is not tested, and slow to draw
    widget.resize(1000, 900)
    widget.show()
    until(lambda: widget.windowHandle().isExposed(), "the window")
    for name in ("volumes", "advanced", "landmarks", "carried"):
        box = widget.panel.boxes[name]
        assert not any(control.isVisibleTo(box) for control in box.controls.values())
        box.fold.click()
    yield widget
    widget.close()
    widget.deleteLater()


def settle(widget):
    application().processEvents()
    until(lambda: widget.panel.is_up_to_date and not widget.editor.is_busy, "the panel")


def focus(control):
    control.window().activateWindow()
    control.setFocus()
    until(control.hasFocus, "the focus")


def said(control):
    """Return what a control shows, as its user reads it."""
    if isinstance(control, QtWidgets.QAbstractButton):
        return control.text(), control.isChecked() if control.isCheckable() else None
    if isinstance(control, QtWidgets.QComboBox):
        return control.currentText()
    if isinstance(control, QtWidgets.QSlider):
        return control.minimum(), control.value(), control.maximum()
    return control.text()


def expected(field):
    """Return what the control of *field* has to show."""
    if field.kind in ("button", "toggle", "file"):
        return field.label, field.value
    if field.kind == "choice":
        return next(label for label, value in field.choices if value == field.value)
    if field.kind == "slider":
        return field.minimum, field.value, field.maximum
    if field.kind == "label":
        return field.value
    if field.value is None:
        return field.special
    number = f"{field.value:.{field.decimals}f}"
    return " ".join(filter(None, (field.prefix, number, field.unit)))


@pytest.mark.parametrize("mode", [*Mode], ids=lambda mode: mode.name)
def test_the_visible_controls_are_those_of_the_models_and_say_the_same(widget, mode):
    panel, editor = widget.panel, widget.editor
    editor.mode = mode
    settle(widget)
    shown = sections(editor)
    assert [name for name, box in panel.boxes.items() if not box.isHidden()] == [
        section.name for section in shown
    ]
    titles = {panel.boxes[section.name].title(): section.title for section in shown}
    assert all(seen == said for seen, said in titles.items())
    fields = [field for section in shown for field in section.fields]
    known = {field.name for field in fields if field.visible}
    known |= {table.name for section in shown for table in section.tables if table.visible}
    boxes = [panel.boxes[section.name] for section in shown]
    visible = {
        name for box in boxes for name, each in box.controls.items() if each.isVisibleTo(box)
    }
    assert visible == known
    for field in fields:
        control = panel.controls[field.name]
        assert control.isEnabledTo(panel) is field.enabled
        assert said(control) == expected(field)
        assert control.toolTip() == tooltip(field, editor.keys)
    for table in (table for section in shown for table in section.tables):
        compare(panel.controls[table.name], table)
    for field in toolbar(editor):
        button = widget.panel.toolbar.buttons[field.name]
        assert (button.text(), button.isEnabled()) == (field.label, field.enabled)
        assert button.isChecked() is bool(field.kind == "button" and field.value)


def test_the_volumes_to_choose_from_follow_the_session(widget):
    panel, editor = widget.panel, widget.editor
    editor.mode = Mode.DEFORM
    for _ in range(2):  # without a bound deformer there are none, then those of its regions
        settle(widget)
        fields = [f for each in sections(editor) for f in each.fields if f.name == "volumes.name"]
        (labels,) = ([label for label, _ in field.choices] for field in fields)
        box = panel.controls["volumes.name"]
        assert [box.itemText(k) for k in range(box.count())] == labels
        assert said(box) == expected(fields[0])
        editor.session.bind()
        editor.session.change_options(stretch=2.0)
        editor.session.bind()
    assert len(labels) > 1


def compare(tree, table: Table):
    """Check that a list shows the rows of *table*."""
    assert tree.topLevelItemCount() == len(table.rows)
    for k, row in enumerate(table.rows):
        item = tree.topLevelItem(k)
        assert (item.text(0), item.isSelected()) == (row.label, row.selected)
        assert bool(item.flags() & Qt.ItemFlag.ItemIsEditable) is row.renamable
        for place, cell in enumerate(row.cells, 1):
            state = item.data(place, Qt.ItemDataRole.CheckStateRole)
            checked = None if state is None else Qt.CheckState(state) == Qt.CheckState.Checked
            assert (item.text(place), checked) == (cell.text, cell.checked)


def test_every_visible_control_presses_its_field(widget, monkeypatch):
    pressed = []
    module = "vtk_segdeform.widgets.qt.controls.press"
    monkeypatch.setattr(module, lambda _, name, value=None: pressed.append((name, value)))
    monkeypatch.setattr(f"{module.rpartition('.')[0]}.use_file", lambda *a: pressed.append(a[1:]))
    for ask in ("getOpenFileName", "getSaveFileName"):
        monkeypatch.setattr(QtWidgets.QFileDialog, ask, lambda *_, ask=ask: (f"/{ask}", ""))
    several = lambda *_: (["/one", "/other"], "")  # noqa: E731
    monkeypatch.setattr(QtWidgets.QFileDialog, "getOpenFileNames", several)
    panel, editor = widget.panel, widget.editor
    kinds = set()
    for mode in Mode:
        editor.mode = mode
        settle(widget)
        for section in sections(editor):
            for field in section.fields:
                if not (field.visible and field.enabled) or field.kind == "label":
                    continue
                pressed.clear()
                use(panel.controls[field.name], field)
                assert [name for name, *_ in pressed] == [field.name]
                if field.several:
                    assert pressed[0][1:] == (Path("/one"), Path("/other"))
                elif field.kind == "file":  # asked for by the skin
                    name = "getSaveFileName.csv" if field.saves else "getOpenFileName"
                    assert pressed[0][1] == Path(f"/{name}")
                kinds.add(field.kind)
                panel.refresh()  # nothing was done, which the control shows
                assert said(panel.controls[field.name]) == expected(field)
    assert kinds >= {"button", "toggle", "number", "integer", "slider", "file"}


def test_rows_that_are_selected_elsewhere_are_selected_in_the_list(widget):
    editor = widget.editor
    editor.mode = Mode.REGIONS
    for keys in (["0", "1"], ["1"], ["0"]):
        press(editor, "regions.list.select", keys)
        settle(widget)
        (table,) = (table for section in sections(editor) for table in section.tables)
        assert [row.key for row in table.rows if row.selected] == keys
        compare(widget.panel.controls["regions.list"], table)


def use(control, field):
    """Use a control by its keyboard, as a person would."""
    control.setFocus()
    if isinstance(control, QtWidgets.QAbstractButton):
        control.click()
    elif isinstance(control, QtWidgets.QAbstractSpinBox):
        control.stepBy(-1 if control.value() == control.maximum() else 1)
    elif isinstance(control, QtWidgets.QComboBox):
        is_last = control.currentIndex() == control.count() - 1
        QtTest.QTest.keyClick(control, Qt.Key_Up if is_last else Qt.Key_Down)
    else:
        key = Qt.Key_Left if control.value() == control.maximum() else Qt.Key_Right
        QtTest.QTest.keyClick(control, key)


def test_the_panel_has_a_control_for_every_field_of_every_mode(widget):
    every = all_sections(widget.editor)
    names = [each.name for section in every for each in (*section.fields, *section.tables)]
    assert sorted(names) == sorted(widget.panel.controls)


def test_a_control_that_the_editor_refuses_shows_the_value_again(widget):
    panel, editor = widget.panel, widget.editor
    editor.mode = Mode.CAGES
    settle(widget)
    editor.session.painting.merge([0, 1])  # which removes the cages
    panel.controls["cages.shown"].click()  # before the panel is refreshed
    settle(widget)
    assert not panel.controls["cages.shown"].isChecked()
    assert not panel.controls["cages.shown"].isEnabled()
    editor.session.undo()


def test_icons_differ_and_have_the_colours_of_the_palette():
    application()

    def looks(name, background):
        palette = QtGui.QPalette(QtGui.QColor(background), QtGui.QColor(background))
        return icons.icon(name, palette).pixmap(icons.SIZE, icons.SIZE).toImage()

    assert looks("undo", "#eee") == looks("undo", "#eee") != looks("redo", "#eee")
    assert looks("undo", "#222") != looks("undo", "#eee")


def entered(widget, mode, name):
    """Give a control of the panel the focus that the view had, and return the control."""
    widget.editor.mode = mode
    settle(widget)
    control = widget.panel.controls[name]
    focus(widget.plotter)
    focus(control)
    return control


@pytest.mark.parametrize("key", ["Key_Return", "Key_Escape"])
def test_keys_act_on_the_view_again_after_a_field(widget, key):
    field = entered(widget, Mode.PULL, "pull.radius")
    QtTest.QTest.keyClick(field.lineEdit(), getattr(Qt.Key, key))
    until(widget.plotter.hasFocus, "the focus")


def test_letters_and_digits_in_a_list_are_keys_of_the_editor(widget):
    table = entered(widget, Mode.HANDLES, "handles.list")
    table.setCurrentItem(table.topLevelItem(1))
    QtTest.QTest.keyClick(table, Qt.Key.Key_0)
    assert widget.editor.mode is Mode.PULL
    assert table.currentIndex().row() == 1


def test_keys_act_on_the_view_again_after_renaming(widget):
    table = entered(widget, Mode.HANDLES, "handles.list")
    table.setCurrentItem(table.topLevelItem(1))
    QtTest.QTest.keyClick(table, Qt.Key.Key_F2)
    editor = table.findChild(QtWidgets.QLineEdit)
    editor.setText("arm")
    QtTest.QTest.keyClick(editor, Qt.Key.Key_Return)
    until(widget.plotter.hasFocus, "the focus")
    settle(widget)
    assert "arm" in widget.editor.session.handles


def test_keys_act_on_the_view_while_a_job_disables_the_panel(widget):
    table, box = (
        entered(widget, Mode.PULL, "handles.list"),
        widget.panel.controls["volumes.symmetry"],
    )
    QtTest.QTest.mouseClick(box, Qt.LeftButton)
    until(box.view().isVisible, "the choices")
    QtTest.QTest.keyClick(box.view(), Qt.Key.Key_Escape)
    until(table.hasFocus, "the focus")
    go_on = threading.Event()
    widget.editor.do(lambda c: c.start("counting", lambda _: go_on.wait(30.0), lambda _: None))
    until(lambda: not table.isEnabled(), "the job")
    assert widget.plotter.hasFocus()
    go_on.set()
    settle(widget)


@pytest.mark.parametrize("key", ["Key_G", "Key_W"])
def test_letters_in_a_field_are_no_keys_of_the_editor(widget, key):
    field = entered(widget, Mode.PULL, "pull.radius")
    state, style = widget.editor.session.state, widget.editor.widgets.surface.style
    QtTest.QTest.keyClick(field.lineEdit(), getattr(Qt.Key, key))
    QtTest.QTest.keyClick(field, getattr(Qt.Key, key))
    settle(widget)
    assert widget.editor.session.state is state
    assert widget.editor.widgets.surface.style is style


def test_a_list_is_as_high_as_its_rows_up_to_a_largest_height():
    application()
    rows = tuple(Row(str(k), f"region {k}", (0, 0, 0)) for k in range(30))
    view = TableView(Table("list", "Region", (), rows[:1], n_rows=7), lambda *_: None)
    heights = []
    for count in (1, 7, 12, 14, 30):
        view.draw(Table("list", "Region", (), rows[:count], n_rows=7))
        heights.append(view.sizeHint().height())
    least, seven, twelve, most, still = heights
    assert least == seven < twelve < most == still
    assert view.minimumHeight() < seven  # where there is no room


@pytest.fixture
def two_bodies():
    """Return a widget over two balls, of which the second follows the first."""
    application()
    session = Session(joined(ball(1.0, (0.0, 0.0, 0.0), 2), ball(0.4, (1.3, 0.0, 0.0), 1)))
    session.change_options(n_cage_vertices=60)
    session.segment(1)
    session.fit_cages()
    session.bind()
    widget = DeformWidget(session)
    widget.plotter.setUpdatesEnabled(False)
    widget.resize(1000, 900)
    widget.show()
    until(lambda: widget.windowHandle().isExposed(), "the window")
    yield widget
    widget.close()
    widget.deleteLater()


def test_what_a_body_follows_is_chosen_by_mouse_and_undone_by_a_key(two_bodies):
    widget, session = two_bodies, two_bodies.session
    table = entered(widget, Mode.PULL, "bodies.list")
    place = table.visualItemRect(table.topLevelItem(1)).center()
    QtTest.QTest.mouseClick(table.viewport(), Qt.LeftButton, Qt.NoModifier, place)
    settle(widget)
    assert [table.topLevelItem(k).text(3) for k in range(2)] == ["Nothing", "Body 1"]
    box = widget.panel.controls["bodies.follows"]
    QtTest.QTest.mouseClick(box, Qt.LeftButton)
    until(box.view().isVisible, "the choices")
    for key in (Qt.Key.Key_Down, Qt.Key.Key_Return):
        QtTest.QTest.keyClick(box.view(), key)
    settle(widget)
    assert session.history.labels[-1] == "body 2 follows nothing"
    assert table.topLevelItem(1).text(3) == box.currentText() == "Nothing"
    QtTest.QTest.keyClick(widget.focusWidget(), Qt.Key.Key_Z, Qt.ControlModifier)
    settle(widget)
    assert session.regions.carrier.tolist() == [0, 0]


def test_a_body_is_hidden_by_mouse_and_locked_by_keys_in_the_list(two_bodies):
    widget, session = two_bodies, two_bodies.session
    table, surface = entered(widget, Mode.PULL, "bodies.list"), widget.editor.widgets.surface
    own, box = session.mesh.components == 1, table.visualRect(table.model().index(1, 4))
    place = QtCore.QPoint(box.left() + 10, box.center().y())
    QtTest.QTest.mouseClick(table.viewport(), Qt.LeftButton, Qt.NoModifier, place)
    settle(widget)
    np.testing.assert_array_equal(surface.only, ~own)
    keys = [Qt.Key.Key_Down, *[Qt.Key.Key_Right] * 6, Qt.Key.Key_Left, Qt.Key.Key_Space]
    for key in (*keys, Qt.Key.Key_Right, Qt.Key.Key_Space):
        QtTest.QTest.keyClick(table, key)
    assert surface.only is None
    settle(widget)
    np.testing.assert_array_equal(session.fixed, np.flatnonzero(own))
