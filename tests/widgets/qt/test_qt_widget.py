"""The editor as a Qt widget and as a dock: real mouse and keys on the view and on the panel."""

from __future__ import annotations

import threading
from itertools import pairwise

import numpy as np
import pytest
from bad_values import BAD
from campaign import every
from hands import plain_view
from numpy.testing import assert_array_equal
from PIL import Image
from qt_hands import (
    Qt,
    QtCore,
    QtHand,
    QtTest,
    QtWidgets,
    application,
    small,
    until,
)
from qt_moments import delete_now
from qtpy import QtGui

import pyvistaqt  # isort: skip
from vtk_segdeform import Session, models
from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.session.store import load_session
from vtk_segdeform.widgets import Mode, Paint, Tool
from vtk_segdeform.widgets.editor import keys_of
from vtk_segdeform.widgets.panel.panel import all_sections
from vtk_segdeform.widgets.panel.toolbar import toolbar
from vtk_segdeform.widgets.qt.keys_dialog import KeysDialog
from vtk_segdeform.widgets.qt.widget import DeformDock, DeformWidget, close_view, deform_dock

MESH = models.cactus(500)
pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")


@pytest.fixture
def state():
    """Return the mesh and the state of a session, complete except for a pose."""
    return small()


class Seen:
    """A widget on the screen, its signals, and a simulated hand."""

    def __init__(self, widget, window=None):
        window = window or widget
        window.resize(1000, 560)  # below, the panel is closed at first
        window.show()
        until(lambda: window.windowHandle() and window.windowHandle().isExposed(), "the window")
        window.activateWindow()
        until(window.isActiveWindow, "the focus")
        self.widget, self.panel, self.editor = widget, widget.panel, widget.editor
        self.radius = self.editor.widgets.selector.radius
        self.deformed, self.errors, self.sessions, self.regions = [], [], [], []
        widget.deformed.connect(lambda: self.deformed.append(self.session.volume_change))
        widget.regions_changed.connect(lambda: self.regions.append(self.session.regions))
        widget.error.connect(self.errors.append)
        widget.session_changed.connect(self.sessions.append)

    @property
    def session(self):
        return self.editor.session

    def reset(self, camera):
        """Undo all steps, and return to the first mode with the settings that tests change."""
        while self.session.undo() is not None:
            pass
        widgets, selector = self.editor.widgets, self.editor.widgets.selector
        selector.tool, selector.through, selector.paints = Tool.BRUSH, False, Paint.REGION
        selector.region, selector.handle, selector.radius = 0, None, self.radius
        widgets.choose_regions([])
        widgets.overlay_wanted = widgets.dragger.local = False
        self.editor.controller.camera.viewpoint.restore(camera)
        self.editor.mode = Mode.REGIONS
        self.settle()
        self.widget.plotter.setFocus()
        for signals in (self.deformed, self.errors, self.sessions, self.regions):
            signals.clear()

    def look(self):
        """Return the session, the camera, and what the panel and the toolbar show, except redo."""
        panel, controller = self.panel, self.editor.controller
        window, plotter = self.widget.window(), self.widget.plotter
        return (
            self.session, self.session.state, self.editor.path, self.editor.keys.changes,
            controller.file.is_modified(self.session), controller.notices.text,
            controller.camera.viewpoint.settings(),
            window.isVisible(), window.isActiveWindow(), window.size(), plotter.hasFocus(),
            panel.isEnabled(), panel.status.sign.isVisible(), panel.history.fold.isChecked(),
            [box.isVisible() for box in panel.boxes.values()],
            [field for field in toolbar(self.editor) if field.name != "redo"],
            all_sections(self.editor), self.editor.keys.changes,
        )  # fmt: skip

    def view_hand(self):
        """Return a hand on the view, seen from the front."""
        plotter = self.widget.plotter
        plotter.camera_position = "xz"
        plotter.render()
        plotter.setFocus()
        return QtHand(plotter.interactor, self.editor.view)

    def settle(self):
        """Let Qt run until no job is running and the panel is up to date."""
        application().processEvents()
        until(lambda: not self.editor.is_busy, "the job")
        until(lambda: self.panel.is_up_to_date, "the panel")

    def click(self, button):
        """Click on a button, or on the box of a check box."""
        assert button.isVisible()
        assert button.isEnabled()
        check = isinstance(button, QtWidgets.QCheckBox)
        place = QtCore.QPoint(8, button.height() // 2) if check else button.rect().center()
        QtTest.QTest.mouseClick(button, Qt.LeftButton, Qt.NoModifier, place)
        self.settle()

    def click_row(self, tree, row, column=0, held=Qt.NoModifier):
        """Click on a row of a list; in a column with a tick, on the tick."""
        box = tree.visualItemRect(tree.topLevelItem(row))
        box = tree.visualRect(tree.indexFromItem(tree.topLevelItem(row), column)) if column else box
        place = QtCore.QPoint(box.left() + 10, box.center().y())
        QtTest.QTest.mouseClick(tree.viewport(), Qt.LeftButton, held, place)
        self.settle()

    def type_number(self, box, number):
        """Type a number into a field, and Enter."""
        box.setFocus()
        box.selectAll()
        QtTest.QTest.keyClicks(box, box.locale().toString(number))
        QtTest.QTest.keyClick(box, Qt.Key_Return)
        self.settle()

    def mode(self, mode):
        self.click(self.panel.toolbar.buttons[f"mode.{mode.name.lower()}"])


def shown(mesh):
    """Show a widget over a mesh or a session."""
    application()
    seen = Seen(DeformWidget(mesh))
    seen.editor.wait()
    seen.editor.mode = Mode.REGIONS
    seen.settle()
    return seen


def close(*every):
    for seen in every:
        seen.widget.close()
        seen.widget.deleteLater()
    delete_now()


@pytest.fixture
def make():
    """Yield a function that shows a widget over a mesh or a session, for one test."""
    made = []

    def over(mesh):
        made.append(shown(mesh))
        return made[-1]

    yield over
    close(*made)


@pytest.fixture(scope="module")
def last(unprepared):
    """Yield a list of the widget of the last test that used `seen`, its camera and first look."""
    last = []
    yield last
    close(*last[:1])


@pytest.fixture(autouse=True)
def alone(request, last):
    """Close that widget before tests that open others: pyvistaqt's windows share contexts."""
    if "seen" not in request.fixturenames:
        close(*last[:1])
        last.clear()


@pytest.fixture
def seen(state, last):
    """Return a widget over a session that is ready to be deformed.

    It is that of the test before, if it can be made to look as it did at first, or a new one.
    """
    if last:
        before, camera, look = last
        last.clear()
        if before.editor.GetEnabled():
            before.reset(camera)
            if before.look() == look:
                last[:] = before, camera, look
                return before
        close(before)
    mesh, now = state
    new = shown(Session(mesh, state=now))
    new.widget.plotter.setUpdatesEnabled(False)  # the view is slow to draw, and seldom looked at
    new.widget.plotter.setFocus()
    last[:] = new, new.editor.controller.camera.viewpoint.settings(), new.look()
    return new


def rows(tree):
    return [
        tuple(tree.topLevelItem(k).text(c) for c in range(tree.columnCount()))
        for k in range(tree.topLevelItemCount())
    ]


def around(seen, mask):
    """Return two corners of a rectangle on the screen around some vertices."""
    places = seen.editor.view.to_display(seen.session.vertices[mask])[:, :2]
    return places.min(axis=0) - 4.0, places.max(axis=0) + 4.0


@pytest.mark.campaign  # test_editor and test_web_editor tell such stories; others use each control
def test_the_whole_story_by_mouse_on_the_panel_and_the_view(make):
    seen = make(MESH)
    panel, hand, height = seen.panel, seen.view_hand(), MESH.vertices[:, 2]
    seen.click(panel.controls["regions.segment"])
    assert seen.session.regions.n_regions == len(rows(panel.controls["regions.list"])) > 1
    seen.mode(Mode.CAGES)
    seen.type_number(panel.controls["cages.total"], 60)
    seen.click(panel.controls["cages.fit"])
    assert [str(cage.n_vertices) for cage in seen.session.cages] == [
        cage for _, cage, _ in rows(panel.controls["regions.list"])
    ]

    seen.mode(Mode.HANDLES)
    seen.click(panel.controls["paint.rectangle"])
    seen.click(panel.controls["paint.through"])
    seen.click_row(panel.controls["handles.list"], 0)  # fixed vertices
    hand.drag(around(seen, height < 0.08))
    seen.click(panel.controls["handles.new"])
    hand.drag(around(seen, height > 0.92))
    seen.settle()
    assert set(seen.session.fixed) <= set(np.flatnonzero(height < 0.12))
    (name,) = seen.session.handles
    counts = [len(seen.session.fixed), len(seen.session.handles[name])]
    assert [int(count) for _, count, *_ in rows(panel.controls["handles.list"])] == counts
    assert min(counts) > 5

    seen.mode(Mode.DEFORM)
    start = np.array(hand.at(seen.editor.widgets.dragger.gizmo.centre))
    seen.deformed.clear()
    hand.drag(start + t * np.array([80.0, -25.0]) for t in np.linspace(0.0, 1.0, 7))
    moved = np.array(hand.at(seen.editor.widgets.dragger.gizmo.centre)) - start
    assert moved == pytest.approx([80.0, -25.0], abs=3.0)
    until(lambda: not seen.editor.widgets.dragger.is_refining, "refinement")
    assert len(seen.deformed) >= 7
    assert max(map(abs, seen.deformed)) < 1e-12
    finishing = seen.editor.controller.finishing
    until(lambda: not (finishing.is_pending or finishing.glide.is_running), "the finish")
    bent = seen.session.vertices
    seen.settle()
    volumes = [text for _, _, text in rows(panel.controls["regions.list"])]
    assert any(text not in ("", "0 %") for text in volumes)
    compare, surface = panel.toolbar.buttons["compare"], seen.editor.widgets.surface
    for expected in (MESH.vertices, bent):  # a click keeps it until the next one
        seen.click(compare)
        assert_array_equal(surface.points, expected)
    seen.click(panel.toolbar.buttons["undo"])
    assert_array_equal(seen.session.vertices, MESH.vertices)
    seen.click(panel.toolbar.buttons["redo"])
    assert_array_equal(seen.session.vertices, bent)
    seen.click(panel.controls["deform.reset"])
    assert seen.session.state.pose is None
    assert seen.errors == hand.failures == []


def test_a_handle_called_fixed_is_not_mistaken_for_the_fixed_vertices(seen):
    seen.session.handles.rename(next(iter(seen.session.handles)), "Fixed")
    seen.mode(Mode.HANDLES)
    tree, selector = seen.panel.controls["handles.list"], seen.editor.widgets.selector
    assert [name for name, *_ in rows(tree)][:2] == ["Fixed", "Fixed"]
    seen.click_row(tree, 0)
    assert selector.paints is Paint.FIXED
    assert not seen.panel.controls["handles.remove"].isEnabled()
    seen.click_row(tree, 1)
    assert (selector.paints, selector.handle) == (Paint.HANDLE, "Fixed")
    seen.click(seen.panel.controls["handles.remove"])
    assert not seen.session.handles


def test_sliders_set_the_number_of_regions_and_the_detail_of_cages_when_released(seen):
    session, before, part = seen.session, seen.session.cages, seen.panel.controls
    seen.mode(Mode.REGIONS)
    bend(seen, 0.1)
    part["regions.count"].setValue(3)
    seen.settle()
    assert "3 regions found. The pose was reset; Ctrl+Z brings it back" in seen.editor.status
    assert session.regions.n_regions == part["regions.count"].value() == 3
    seen.mode(Mode.CAGES)
    slider = part["cages.detail"]
    assert slider.minimum() == 3 * 12  # for each region
    slider.setSliderDown(True)
    slider.setSliderPosition(40)
    seen.panel.refresh()
    assert slider.sliderPosition() == 40  # a refresh leaves it to the hand
    assert slider.figure.text() == "40"
    assert session.cages == ()
    slider.setSliderDown(False)
    seen.settle()
    assert sum(cage.n_vertices for cage in session.cages) == slider.value() == 40
    assert part["cages.total"].text() == "40"
    assert "40 vertices in total" in seen.editor.status
    for _ in range(2):  # the cages with their number, the regions
        seen.click(seen.panel.toolbar.buttons["undo"])
    count = sum(cage.n_vertices for cage in before)
    assert session.cages == before
    assert session.state.pose is not None
    assert slider.figure.text() == part["cages.total"].text() == str(count)
    session.change_options(n_cage_vertices=90)
    seen.settle()
    assert part["cages.total"].text() == f"90 ({count} fitted)"


def test_the_panel_follows_keys_and_the_wheel(seen):
    hand, part = seen.view_hand(), seen.panel.controls
    hand.key("l")
    seen.settle()
    assert part["paint.lasso"].isChecked()
    assert not part["paint.radius"].isEnabled()
    for key in "bv":
        hand.key(key)
    seen.settle()
    assert part["paint.through"].isChecked()
    before = part["paint.radius"].value()
    QtTest.QTest.keyClick(hand.widget, "]")
    seen.settle()
    assert part["paint.radius"].value() == pytest.approx(1.2 * before, rel=1e-3)
    seen.type_number(part["paint.radius"], 0.25)
    assert seen.editor.widgets.selector.radius == pytest.approx(0.25)
    for key in "qe4":  # Q and E would close a window of pyvista or VTK
        hand.key(key)
    seen.settle()
    assert seen.panel.toolbar.buttons["mode.deform"].isChecked()
    assert seen.panel.boxes["paint"].isHidden()
    seen.click(seen.panel.controls["deform.overlay"])
    assert seen.editor.widgets.overlay.is_shown


def turn_wheel(field, clicks=-1):
    """Turn the wheel over *field*, as the window system would; return whether it was taken."""
    middle = QtCore.QPointF(field.rect().center())
    step = QtGui.QWheelEvent(
        middle, QtCore.QPointF(field.mapToGlobal(middle.toPoint())), QtCore.QPoint(0, 0),
        QtCore.QPoint(0, 120 * clicks), Qt.NoButton, Qt.NoModifier, Qt.ScrollPhase.NoScrollPhase,
        False,
    )  # fmt: skip
    application().sendEvent(field, step)
    application().processEvents()
    return step.isAccepted()


@pytest.mark.parametrize("mode", every(4, Mode))
def test_the_wheel_over_the_panel_changes_nothing_but_a_field_that_was_clicked(seen, mode):
    seen.mode(mode)
    before, options = seen.session.history.undo_label, seen.session.options
    kinds = QtWidgets.QAbstractSpinBox, QtWidgets.QComboBox, QtWidgets.QSlider
    fields = [
        each for each in seen.panel.findChildren(QtWidgets.QWidget) if isinstance(each, kinds)
    ]
    assert len(fields) > 4
    for field in fields:
        turn_wheel(field)
        turn_wheel(field, 1)
        assert not field.hasFocus()
    assert (seen.session.history.undo_label, seen.session.options) == (before, options)
    seen.settle()
    number = next(
        each
        for each in fields
        if isinstance(each, QtWidgets.QAbstractSpinBox) and each.isVisible() and each.isEnabled()
    )
    value = number.value()
    QtTest.QTest.mouseClick(number.lineEdit(), Qt.LeftButton)
    assert turn_wheel(number, 1 if value == number.minimum() else -1)
    assert number.value() != value


def test_a_job_shows_its_progress_and_is_cancelled(seen):
    go_on, delivered = threading.Event(), []

    def work(progress):
        progress(0.4, "by hand")
        assert go_on.wait(30.0)
        progress(0.5, "by foot")

    seen.editor.do(lambda controller: controller.start("counting", work, delivered.append))
    foot = seen.panel.status
    until(lambda: foot.bar.isVisible() and foot.bar.value() == 400, "the bar")
    assert foot.words.text() == "Counting: by hand · 40 % · Esc to cancel"
    assert not seen.panel.controls[
        "regions.segment"
    ].isEnabled()  # nothing else is possible meanwhile
    assert not seen.panel.toolbar.buttons["mode.deform"].isEnabled()
    QtTest.QTest.mouseClick(foot.cancel, Qt.LeftButton)
    until(lambda: "Stopping" in foot.words.text(), "the answer")
    go_on.set()
    seen.settle()
    assert delivered == []
    assert "cancelled" in foot.words.text().lower()
    assert not foot.bar.isVisible()
    assert seen.panel.controls["regions.segment"].isEnabled()


def bend(seen, height=0.4):
    """Move the handle upwards by a script."""
    shift = np.eye(4)
    shift[2, 3] = height
    seen.session.move_handle("handle 1", shift)
    seen.session.commit()


def test_the_history_previews_under_the_pointer_and_jumps_at_a_click_or_enter(seen):
    part, surface = seen.panel.history, lambda: seen.editor.widgets.surface
    rows, keys = part.list, lambda key: QtTest.QTest.keyClick(part.list, key)
    poses = [seen.session.vertices]
    for height in (0.4, 0.2):
        bend(seen, height)
        poses.append(seen.session.vertices)
    until(lambda: rows.count() == len(seen.session.history.labels), "the second drag")
    start = rows.count() - 3

    def place(row):
        return rows.visualItemRect(rows.item(row)).center()

    def hover(row):
        QtTest.QTest.mouseMove(rows.viewport(), place(row))  # by the X server, a moment later
        until(lambda: rows.currentRow() == row, "the pointer")

    def looks(position, shown):
        seen.settle()
        assert seen.session.history.position == start + position
        assert_array_equal(surface().points, poses[shown])
        assert [rows.item(k).font().bold() for k in range(rows.count())].index(True) == (
            start + position
        )
        return rows.currentRow() - start

    state = seen.session.state
    for row in (2, 1, 0):
        hover(start + row)
        assert looks(2, row) == row
    assert seen.session.state is state
    assert "History: " in seen.editor.status
    hover(start + 1)
    QtTest.QTest.mouseClick(rows.viewport(), Qt.LeftButton, Qt.NoModifier, place(start + 1))
    assert looks(1, 1) == 1
    assert rows.item(start + 2).foreground() != rows.item(start + 1).foreground()
    hover(start + 2)
    assert looks(1, 2) == 2
    application().sendEvent(rows, QtCore.QEvent(QtCore.QEvent.Leave))
    assert looks(1, 1) == 1
    rows.setFocus()
    keys(Qt.Key_Up)
    assert looks(1, 0) == 0
    keys(Qt.Key_Escape)
    assert looks(1, 1) == 1
    keys(Qt.Key_Down)
    keys(Qt.Key_Return)
    assert looks(2, 2) == 2
    assert seen.session.state is state
    keys(Qt.Key_Up)
    seen.widget.plotter.setFocus()
    assert looks(2, 2) == 2
    height = seen.widget.height()
    seen.widget.resize(seen.widget.width(), 300)  # the list has two rows
    seen.settle()
    assert rows.visualItemRect(rows.item(start + 2)).bottom() < rows.viewport().height()
    seen.widget.resize(seen.widget.width(), height)
    seen.settle()
    QtTest.QTest.mousePress(rows.viewport(), Qt.LeftButton, Qt.NoModifier, place(start + 2))
    rows.itemEntered.emit(rows.item(start))  # with a button down it is no hover
    assert looks(2, 2) == 2
    QtTest.QTest.mouseRelease(rows.viewport(), Qt.LeftButton, Qt.NoModifier, place(start + 2))
    seen.click(part.fold)
    assert not rows.isVisible()


def dialog_of(widget):
    """Wait for the dialog with the keys, and return it."""
    until(lambda: widget.findChildren(KeysDialog), "the dialog")
    return widget.findChildren(KeysDialog)[0]


def test_keys_are_listed_and_assigned_in_a_dialog(seen):
    editor, changes = seen.editor, []
    seen.widget.keys_changed.connect(lambda: changes.append(editor.keys.changes))
    seen.widget.taken_keys = lambda: {"ctrl+q": "Quit"}
    editor.run("help")
    assert not editor.controller.help.is_shown
    dialog = dialog_of(seen.widget)
    rows = {dialog.table.topLevelItem(k).text(1): dialog.table.topLevelItem(k)
            for k in range(dialog.table.topLevelItemCount())}  # fmt: skip
    labels = {label for _, pairs in editor.keys.sections() for _, label in pairs}
    assert labels <= set(rows)

    def typed(label, key, held=Qt.NoModifier):
        dialog.table.setCurrentItem(rows[label])
        QtTest.QTest.keyClick(dialog.key, key, held)
        dialog.key.editingFinished.emit()
        return rows[label].text(0), dialog.message.text()

    assert typed("Undo", Qt.Key_J, Qt.ControlModifier) == ("Ctrl+J", "")
    assert typed("Redo", Qt.Key_F5) == ("F5", "")
    shown, message = typed("Shrink by one ring", Qt.Key_V)
    assert (shown, message[:21]) == ("-", "V is assigned to both")
    shown, message = typed("Auto-segment", Qt.Key_Q, Qt.ControlModifier)
    assert (shown, message) == ("G", "Ctrl+Q is assigned to 'Quit'; choose another key")
    dialog.table.setCurrentItem(rows["Pan"])
    assert not dialog.key.isEnabled()
    dialog.table.setCurrentItem(rows["Cancel"])
    dialog.remove.click()
    assert rows["Cancel"].text(0) == ""
    assert changes == []
    dialog.accept()
    wanted = {"undo": ("ctrl+j",), "redo": ("f5",), "cancel": ()}
    assert changes == [wanted]
    assert editor.keys.changes == wanted


def test_the_dialog_with_the_keys_resets_them_to_a_preset_and_can_be_cancelled(seen):
    editor = seen.editor
    editor.run("help")
    dialog = dialog_of(seen.widget)
    dialog.preset.setCurrentText("Blender")
    dialog.reset.click()
    assert dialog.keys.changes == keys_of("Blender").changes
    dialog.reject()
    assert editor.keys.changes == {}


def test_a_right_click_opens_a_menu_whose_entries_act(seen):
    hand, session = seen.view_hand(), seen.session
    x = session.mesh.vertices
    front = np.argmin(x[:, 1] + np.abs(x[:, 0]) + np.abs(x[:, 2]))
    place = hand._pixel(hand.at(x[front]))
    for _ in range(2):  # pins the point, and removes the pin
        QtTest.QTest.mouseMove(hand.widget, place)
        QtTest.QTest.mousePress(hand.widget, Qt.RightButton, Qt.NoModifier, place)
        QtTest.QTest.mouseRelease(hand.widget, Qt.RightButton, Qt.NoModifier, place)
        until(application().activePopupWidget, "the menu")
        menu, before = application().activePopupWidget(), list(session.handles)
        texts = [entry.text() for entry in menu.actions()]
        assert any(text.startswith("Reset region") for text in texts)
        assert "Reset pose\tHome" in texts
        entry = next(e for e in menu.actions() if e.text().startswith(("Pin this", "Remove pin")))
        spot = menu.actionGeometry(entry).center()
        QtTest.QTest.mouseClick(menu, Qt.LeftButton, Qt.NoModifier, spot)
        seen.settle()
        assert list(session.handles) != before
    assert not any(name.startswith("pin") for name in session.handles)
    assert hand.failures == []


def test_an_error_is_shown_emitted_and_then_cleared(seen):
    seen.mode(Mode.HANDLES)
    seen.panel.controls["handles.list"].topLevelItem(1).setText(0, "")  # not a valid name
    seen.settle()
    (error,) = seen.errors
    assert "name" in error
    assert seen.panel.status.words.text().lower() == error.lower()
    assert seen.panel.status.sign.isVisible()
    assert rows(seen.panel.controls["handles.list"])[1][0] == "handle 1"
    seen.mode(Mode.DEFORM)
    assert not seen.panel.status.sign.isVisible()


# Files.


def answer(monkeypatch, path):
    for name in ("getOpenFileName", "getSaveFileName"):
        monkeypatch.setattr(QtWidgets.QFileDialog, name, lambda *_: (str(path), ""))


def test_a_session_is_saved_and_opened_again(seen, tmp_path, monkeypatch):
    path = tmp_path / "arm.segdeform"
    answer(monkeypatch, tmp_path / "arm")
    seen.panel.toolbar.ask_and_save()
    assert list(load_session(path).handles) == ["handle 1"]
    before = seen.session
    answer(monkeypatch, path)
    seen.click(seen.panel.toolbar.buttons["open"])  # saved, so no question
    assert seen.sessions == [seen.session]
    assert seen.session is not before
    assert seen.session.regions.n_regions == len(rows(seen.panel.controls["regions.list"])) == 2
    before.painting.merge([0, 1])  # the previous session is no longer observed
    assert seen.regions == []
    seen.session.painting.merge([0, 1])
    assert seen.regions == [seen.session.regions]
    seen.session.handles.remove("handle 1")
    seen.mode(Mode.HANDLES)
    assert len(seen.session.fixed) == int(rows(seen.panel.controls["handles.list"])[0][1]) > 0


def test_unsaved_changes_are_discarded_only_if_confirmed(seen, tmp_path, monkeypatch):
    path = tmp_path / "ball.ply"
    from vtk_segdeform.io.convert import write_mesh

    write_mesh(path, models.sphere(300))
    answer(monkeypatch, path)
    seen.session.set_fixed([])
    before, buttons = seen.session, QtWidgets.QMessageBox.StandardButton
    for button, goes in ((buttons.Cancel, False), (buttons.Discard, True)):
        monkeypatch.setattr(QtWidgets.QMessageBox, "question", lambda *_, b=button: b)
        seen.click(seen.panel.toolbar.buttons["open"])
        assert (seen.session is not before) is goes
    assert seen.session.mesh.n_vertices == models.sphere(300).n_vertices
    assert seen.editor.path == tmp_path / "ball.segdeform"  # a mesh is never overwritten


# Hosts.


def test_two_widgets_and_a_dock_in_one_window_are_independent(state):
    app, (mesh, now) = application(), state
    window = QtWidgets.QMainWindow()
    tabs = QtWidgets.QSplitter(window)
    first, second = (DeformWidget(Session(mesh, state=now)) for _ in range(2))
    plotter = pyvistaqt.QtInteractor(tabs, auto_update=False, off_screen=False)
    dock = deform_dock(plotter, Session(mesh, state=now), window)
    for each in (first, second, plotter):
        tabs.addWidget(each)
    window.setCentralWidget(tabs)
    window.addDockWidget(Qt.RightDockWidgetArea, dock)
    window.resize(1100, 450)
    hands = [Seen(widget, window) for widget in (first, second, dock)]
    window.resize(1100, 450)
    app.processEvents()
    for seen, mode in zip(hands, (Mode.DEFORM, Mode.REGIONS, Mode.CAGES), strict=True):
        seen.mode(mode)
    assert [seen.editor.mode for seen in hands] == [Mode.DEFORM, Mode.REGIONS, Mode.CAGES]
    bend(hands[0])
    assert [len(seen.deformed) for seen in hands] == [1, 0, 0]
    hands[1].click(second.panel_button)  # a narrow widget, whose panel is closed at first
    hands[1].click_row(second.panel.controls["regions.list"], 1)
    hands[1].click(second.panel.controls["regions.split"])
    assert [seen.session.regions.n_regions for seen in hands] == [2, 3, 2]
    first.close()  # the others stay
    hands[2].mode(Mode.DEFORM)
    assert not first.editor.GetEnabled()
    assert second.editor.GetEnabled()
    close_view(plotter)  # this removes the dock's editor
    assert not dock.editor.GetEnabled()
    until(lambda: not dock.panel.isEnabled(), "the panel")
    second.close()
    window.close()
    window.deleteLater()
    delete_now()


def test_a_window_deleted_by_qt_releases_everything(state):
    application()
    mesh, now = state
    session, window = Session(mesh, state=now), QtWidgets.QMainWindow()
    widget = DeformWidget(session, window)
    window.setCentralWidget(widget)
    Seen(widget, window)
    editor = widget.editor
    window.deleteLater()
    delete_now()
    assert not editor.GetEnabled()
    session.painting.merge([0, 1])  # no longer observed, and no error
    application().processEvents()


@pytest.mark.parametrize("is_closed", [True, False])
def test_a_view_forgets_what_qt_deletes_with_it(state, is_closed):
    """PySide took a new menu for the surface of a view that had been closed, or crashed."""
    application()
    mesh, now = state
    window = QtWidgets.QMainWindow()
    widget = DeformWidget(Session(mesh, state=now), window)
    window.setCentralWidget(widget)
    Seen(widget, window)
    plotter = widget.plotter
    until(lambda: plotter._surface is not None, "the context")
    if is_closed:
        widget.close()
    else:
        window.deleteLater()
        delete_now()
    assert plotter._surface is plotter._ctx is None
    if is_closed:
        window.deleteLater()
        delete_now()


def test_deleting_a_dock_leaves_the_editor_unchanged(state):
    application()
    mesh, now = state
    window = QtWidgets.QMainWindow()
    plotter = pyvistaqt.QtInteractor(window, auto_update=False, off_screen=False)
    window.setCentralWidget(plotter)
    dock = deform_dock(plotter, Session(mesh, state=now), window)
    window.show()
    editor, failures = dock.editor, []
    editor.view.on_failure(failures.append)
    dock.deleteLater()
    delete_now()
    editor.mode = Mode.CAGES
    editor.session.painting.merge([0, 1])
    application().processEvents()
    assert editor.GetEnabled()
    assert failures == []
    close_view(plotter)
    window.close()
    window.deleteLater()
    delete_now()


def test_in_a_narrow_widget_the_panel_opens_over_the_view(seen):
    widget, panel, wide = seen.widget, seen.panel, seen.widget.size()
    radius = panel.controls["pull.radius"]
    seen.mode(Mode.PULL)
    assert panel.isVisible()
    assert panel.geometry().left() >= widget.plotter.geometry().right()  # beside it
    widget.resize(700, 500)
    until(lambda: not panel.isVisible() and widget.plotter.width() == 700, "the whole width")
    seen.click(widget.panel_button)
    assert widget.plotter.width() == 700
    assert panel.geometry().right() == widget.rect().right()
    at = radius.mapTo(widget, radius.rect().center())
    assert panel.isAncestorOf(widget.childAt(at))  # not hidden by the view
    for is_shown in (False, True):
        QtTest.QTest.keyClick(widget.plotter, Qt.Key_F9)
        assert panel.isVisible() is widget.panel_button.isChecked() is is_shown
    widget.resize(wide)
    until(lambda: widget.plotter.width() < wide.width() - 300, "the view")
    assert panel.isVisible()
    assert widget.panel_button.isChecked()
    QtTest.QTest.keyClick(widget.plotter, Qt.Key_F9)  # also where there is room
    assert not panel.isVisible()
    seen.click(widget.panel_button)


# Accessibility.


@pytest.mark.parametrize("mode", every(4, Mode))
def test_every_control_is_reached_by_tab_and_has_a_tooltip(seen, mode):
    seen.mode(mode)
    size = seen.widget.size()
    seen.widget.resize(size.width(), 1600)  # so that nothing scrolls
    kinds = (QtWidgets.QAbstractButton, QtWidgets.QAbstractSpinBox, QtWidgets.QTreeWidget)
    wanted = {
        each
        for kind in kinds
        for part in (seen.panel.toolbar, seen.panel)
        for each in part.findChildren(kind)
        if each.isVisible() and each.isEnabled()
    }
    assert len(wanted) > 8
    assert [each for each in wanted if not each.toolTip()] == []
    reached, rows = set(), []
    seen.panel.toolbar.buttons["open"].setFocus()
    until(seen.panel.toolbar.buttons["open"].hasFocus, "the focus")
    for _ in range(60):
        here = application().focusWidget()
        if here in wanted and here not in reached:
            reached.add(here)
            top = here.mapTo(seen.widget, here.rect().topLeft()).y()
            rows.append((top, top + here.height()))
        QtTest.QTest.keyClick(here, Qt.Key_Tab)
    # From the top down: none ends above the top of the one before.
    assert all(end > top for (top, _), (_, end) in pairwise(rows))
    assert {each for each in wanted if each.focusPolicy() != Qt.NoFocus} <= reached
    exclusive = {each for each in wanted - reached if each.group() is not None}
    assert wanted - reached == exclusive  # reached by the arrow keys
    seen.widget.resize(size)
    here = seen.panel.toolbar.buttons[f"mode.{mode.name.lower()}"]
    here.setFocus()
    QtTest.QTest.keyClick(here, Qt.Key_Left if mode is Mode.DEFORM else Qt.Key_Right)
    assert seen.editor.mode is not mode


def test_enter_presses_the_focused_button_and_words_of_the_hint_run_keys(seen):
    bar, panel = seen.panel.toolbar, seen.panel
    for button, mode in (
        (bar.buttons["mode.handles"], Mode.HANDLES),
        (panel.controls["handles.new"], None),
    ):
        button.setFocusPolicy(Qt.StrongFocus)
        button.setFocus()
        QtTest.QTest.keyClick(button, Qt.Key_Return)
        seen.settle()
        assert mode is None or seen.editor.mode is mode
    assert seen.editor.widgets.selector.handle is None
    assert 'href="deform"' in panel.status.words.text()
    panel.status.words.linkActivated.emit("deform")
    seen.settle()
    assert seen.editor.mode is Mode.DEFORM
    (name,) = seen.session.handles
    seen.session.move_handle(name, np.eye(4) + 0.1 * np.eye(4, k=3))
    seen.session.commit()
    seen.settle()
    bar.buttons["compare"].pressed.emit()
    assert seen.editor.controller.shows_rest
    QtTest.QTest.qWait(350)  # a shorter press would be a click
    bar.buttons["compare"].released.emit()
    assert not seen.editor.controller.shows_rest


def test_in_a_dark_palette_the_panel_is_dark_and_its_text_is_light(seen, tmp_path):
    before = application().palette()
    application().setPalette(QtGui.QPalette(QtGui.QColor("#3a3a3a"), QtGui.QColor("#2b2b2b")))
    try:
        seen.settle()
        application().processEvents()
        seen.panel.grab().save(str(tmp_path / "panel.png"))
        assert max(seen.widget.plotter.renderer.GetBackground()) < 0.2
        grey = np.array(Image.open(tmp_path / "panel.png").convert("L"))
        assert np.median(grey) < 60
        assert grey.max() > 200
        assert seen.panel.history.list.item(0).foreground().color().lightness() > 128
        through, rows = seen.panel.controls["paint.through"], seen.panel.controls["regions.list"]
        seen.click_row(rows, 1, column=1)  # no tick any more
        seen.click_row(rows, 0)  # highlights another row
        tick = rows.visualRect(rows.indexFromItem(rows.topLevelItem(1), 1))
        for part, box in ((through, through.rect()), (rows.viewport(), tick)):
            part.grab(box.adjusted(0, 0, 20 - box.width(), 0)).save(str(tmp_path / "box.png"))
            grey = np.array(Image.open(tmp_path / "box.png").convert("L"))
            assert grey[:, :18].max() > 90  # the frame of an empty box
    finally:
        application().setPalette(before)


def test_a_dock_is_made_for_a_view_of_plain_vtk():
    view = plain_view((200, 150))
    dock = deform_dock((view.renderer, view.interactor), MESH)
    assert dock.editor.GetEnabled()
    assert dock.panel.isEnabled()
    dock.editor.remove()
    dock.deleteLater()


def test_a_bad_argument_is_one_of_our_errors_before_anything_is_created():
    application()
    mesh, view = models.sphere(100), plain_view((64, 64))
    before = len(QtWidgets.QApplication.allWidgets())
    for kind in sorted(set(BAD) - {"None"}):
        calls = [
            lambda bad: DeformWidget(bad),
            lambda bad: DeformWidget(mesh, bad),
            lambda bad: deform_dock(bad, mesh),
            lambda bad: deform_dock(view, bad),
            lambda bad: DeformDock(bad),
        ]
        for call in calls:
            with pytest.raises(SegDeformError):
                call(BAD[kind]())
    assert len(QtWidgets.QApplication.allWidgets()) == before
