"""Any surface in the desktop program: dropped, shown, and repaired if the user wants that."""

from __future__ import annotations

import gc
import threading
import weakref
from contextlib import contextmanager

import numpy as np
import pytest
from app_hands import AppHand, Window, delete, drop, settings_in
from open_surfaces import bottle, polydata, sheet, split_at_seam
from qt_hands import Qt, QtCore, QtHand, QtTest, application, until

from vtk_segdeform import load_session
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.io import read_polydata
from vtk_segdeform.widgets.app.repair_dialog import RepairDialog
from vtk_segdeform.widgets.editor import Autosaves

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")
BLANK = pytest.mark.usefixtures("unpainted")


@contextmanager
def program(folder):
    """Run the program with its settings in *folder*; yield a hand on it."""
    window = Window(settings_in(folder), Autosaves(folder / "unsaved"), interval=1000.0)
    hand = AppHand(window)
    yield hand
    if window.has_mesh:
        window.editor.controller.file.mark_saved(window.session)
    delete(window)
    window = hand = None
    gc.collect(0)  # what is new since the last one, all others being disabled


@pytest.fixture
def hand(tmp_path, boxes):
    """Return a hand on the program."""
    with program(tmp_path) as hand:
        yield hand


class Reader(QtCore.QObject):
    """A user who does *steps* with the next repair dialog, as soon as it is computed."""

    def __init__(self, steps):
        super().__init__()
        self.steps, self.failure, self.is_done = steps, None, False
        QtCore.QTimer.singleShot(10, self, self._look)

    def _look(self):
        dialog = application().activeModalWidget()
        if not isinstance(dialog, RepairDialog) or dialog.is_computing:
            QtCore.QTimer.singleShot(10, self, self._look)
            return
        try:
            self.steps(dialog)
        except AssertionError as failure:
            self.failure = failure
        self.is_done = True
        if dialog.isVisible():
            dialog.reject()

    def check(self):
        assert self.is_done
        if self.failure is not None:
            raise self.failure


def click(button):
    place = QtCore.QPoint(8, button.height() // 2)
    QtTest.QTest.mouseClick(button, Qt.LeftButton, Qt.NoModifier, place)


def lines(dialog):
    return [dialog.steps.item(k).text() for k in range(dialog.steps.count())]


def rows(hand):
    return hand.window.editor_widget.panel.history.list


def repair(hand, steps):
    """Open the repair dialog from the menu, and do *steps* with it."""
    reader = Reader(steps)
    hand.choose("File", "Repair and open")
    reader.check()
    hand.settle()


def opened(hand, given, path):
    given.save(path)
    hand.window.open(path)
    hand.settle()
    return path


def soup():
    """Return a ball whose triangles share no points, as in an STL file."""
    ball = split_at_seam(2)
    corners = ball.points[ball.regular_faces].reshape(-1, 3)
    return polydata(corners, np.arange(len(corners)).reshape(-1, 3))


@BLANK
@pytest.mark.parametrize(
    ("given", "name", "text"),
    [
        (bottle, "bottle.ply", "12 holes: volume kept under lids"),
        (split_at_seam, "seam.ply", "Welded 64 seam points"),
        pytest.param(
            lambda: sheet(6), "sheet.obj", "Open sheet: no volume to preserve",
            marks=pytest.mark.campaign,
        ),
        pytest.param(soup, "soup.stl", "", marks=pytest.mark.campaign),
    ],
)  # fmt: skip
def test_a_dropped_surface_opens_at_once_and_one_line_says_how(hand, given, name, text, tmp_path):
    given().save(tmp_path / name)
    assert drop(hand, tmp_path / name)
    hand.settle()
    assert hand.title == f"{name} - segdeform"
    notices = hand.window.editor.controller.notices
    assert notices.text == text or name == "soup.stl"  # which PyVista may weld when it reads
    assert notices.is_open is bool(notices.text)
    assert ("Repair ..." in notices.offers) is (name in ("bottle.ply", "sheet.obj"))


@BLANK
def test_a_repaired_copy_is_a_new_unsaved_document_and_the_original_stays(hand, boxes, tmp_path):
    """Undo returns to the original with its edits, redo to the copy with its own."""
    path = opened(hand, bottle(3, 3), tmp_path / "bottle.ply")
    content = path.read_bytes()
    original = hand.window.session
    original.set_fixed([0, 1, 2])

    def accept(dialog):
        assert lines(dialog)[0].startswith("Fill 3 holes of ")
        assert dialog.after.isChecked()
        click(dialog.accepting)

    dialogs = []
    repair(hand, lambda dialog: (dialogs.append(weakref.ref(dialog)), accept(dialog)))
    assert dialogs[0]() is None  # PySide would take new objects for those of its view
    assert hand.title == "bottle (repaired)* - segdeform"
    session = hand.window.session
    assert session.mesh.is_closed
    assert hand.window.editor.controller.notices.text == ""
    given = read_polydata(path)
    kept = np.asarray(session.surface.given.points)[: given.n_points]
    assert np.abs(kept - given.points).max() == 0.0
    assert path.read_bytes() == content
    assert sorted(p.suffix for p in tmp_path.iterdir() if p.is_file()) == [".ini", ".ply"]
    boxes.answers.append("Cancel")
    hand.window.open(path)
    assert hand.title == "bottle (repaired)* - segdeform"
    session.set_fixed([5, 6])

    def shows(row, wanted, title):
        shown = rows(hand)
        until(lambda: shown.count() == 4 and shown.currentRow() == row, "the history")
        names = [shown.item(k).text() for k in range(4)]
        assert names == ["Opened", "Set fixed vertices", "Repair", "Set fixed vertices"]
        assert hand.window.session is wanted
        assert hand.title == f"{title} - segdeform"

    shows(3, session, "bottle (repaired)*")
    hand.choose("Edit", "Undo set fixed vertices")
    hand.choose("Edit", "Undo repair")
    shows(1, original, "bottle.ply*")
    assert hand.window.document.source == path
    assert len(original.mesh.borders) == 3
    hand.choose("Edit", "Undo set fixed vertices")
    shows(0, original, "bottle.ply")
    hand.choose("Edit", "Redo set fixed vertices")
    hand.choose("Edit", "Redo repair")
    shows(2, session, "bottle (repaired)*")
    rows(hand).item(0).setSelected(True)
    rows(hand).itemClicked.emit(rows(hand).item(0))
    shows(0, original, "bottle.ply")
    hand.choose("Edit", "Redo set fixed vertices")
    boxes.answers.append("Discard")
    hand.choose("File", "Open recent", "1  bottle.ply")
    hand.settle()
    assert hand.title == "bottle.ply - segdeform"
    assert hand.window.session is not original


@pytest.mark.campaign
def test_a_saved_repaired_copy_is_no_longer_new(hand, tmp_path, monkeypatch):
    opened(hand, bottle(2), tmp_path / "bottle.ply")
    repair(hand, lambda dialog: click(dialog.accepting))
    proposals = []

    def choose(_, __, proposed, *___):
        proposals.append(proposed)
        return proposed, ""

    monkeypatch.setattr("qtpy.QtWidgets.QFileDialog.getSaveFileName", choose)
    hand.choose("File", "Save session as")
    assert proposals == [str(tmp_path / "bottle (repaired).segdeform")]
    assert hand.title == "bottle (repaired).segdeform - segdeform"
    assert load_session(proposals[0]).mesh.is_closed


@pytest.mark.campaign
def test_settings_start_the_repair_again_without_blocking(hand, tmp_path):
    opened(hand, bottle(3), tmp_path / "bottle.ply")

    def limit(dialog):
        dialog.edges.setValue(3)
        assert dialog.is_computing
        assert not dialog.accepting.isEnabled()
        until(lambda: not dialog.is_computing, "the repair")
        nothing, holes = lines(dialog)
        assert nothing == "Nothing to repair with these settings"
        assert "remain open; the largest one has" in holes
        assert not dialog.accepting.isEnabled()
        dialog.edges.setValue(100)
        until(lambda: not dialog.is_computing, "the repair")
        assert dialog.accepting.isEnabled()
        click(dialog.fill)
        until(lambda: not dialog.is_computing, "the repair")
        assert not dialog.accepting.isEnabled()

    repair(hand, limit)


def with_invalid_points():
    """Return a ball with coordinates that are no numbers, at two of its vertices."""
    ball = split_at_seam(2)
    ball.points[[3, 40]] = np.nan
    return ball


@pytest.mark.campaign
def test_a_file_with_invalid_points_is_repaired_and_opened(hand, boxes, tmp_path):
    with_invalid_points().save(tmp_path / "ball.ply")
    boxes.answers.append("Repair and open ...")

    def accept(dialog):
        assert lines(dialog)[0].startswith("Remove 2 vertices with NaN")
        click(dialog.before)
        picture = np.asarray(dialog.preview.plotter.screenshot())
        assert len(np.unique(picture.reshape(-1, picture.shape[-1]), axis=0)) > 50  # shades
        click(dialog.accepting)

    reader = Reader(accept)
    hand.window.open(tmp_path / "ball.ply")
    until(lambda: hand.window.has_mesh, "the repaired file")
    hand.settle()
    reader.check()
    assert hand.title == "ball (repaired)* - segdeform"
    assert hand.window.session.mesh.is_closed
    assert "NaN" in boxes.seen[0]


@BLANK
def test_repair_is_not_offered_where_it_cannot_help(hand, boxes, tmp_path):
    points = np.outer(np.arange(3.0), [1.0, 0.0, 0.0])  # in a line
    polydata(points, [[0, 1, 2]]).save(tmp_path / "line.ply")
    given = with_invalid_points()
    given.points[:] = np.nan
    given.save(tmp_path / "nan.ply")
    (tmp_path / "damaged.ply").write_bytes(b"ply\nformat")
    for name in ("line", "nan", "damaged"):
        boxes.answers.append("OK")  # the only button
        hand.window.open(tmp_path / f"{name}.ply")
        hand.settle()
    assert not hand.window.has_mesh


@pytest.fixture(scope="module")
def shared(unprepared, tmp_path_factory):
    """Return a hand on a program that shows a bottle; tests leave both as they are."""
    application()
    with program(tmp_path_factory.mktemp("shared")) as hand:
        opened(hand, bottle(3, 3), tmp_path_factory.mktemp("bottle") / "bottle.ply")
        yield hand


def test_repair_is_offered_beside_the_notice(shared):
    editor, plotter = shared.window.editor, shared.window.editor_widget.plotter
    plotter.render()
    reader = Reader(lambda dialog: click(dialog.cancelling))
    pointer = QtHand(plotter.interactor, editor.view)
    pointer.drag([editor.controller.notices._line.centre_of("Repair ...")])
    until(lambda: reader.is_done, "the dialog")
    reader.check()
    application().processEvents()
    assert shared.title == "bottle.ply - segdeform"


def test_the_view_of_the_dialog_outlines_holes_before_and_colours_lids_after(shared):
    shared.window.editor.view.camera.SetPosition(0.0, 0.0, 10.0)  # the first hole is at the top
    shades = {}

    def look(dialog):
        for name, button in (("before", dialog.before), ("after", dialog.after)):
            click(button)
            application().processEvents()
            picture = np.asarray(dialog.preview.plotter.screenshot()).astype(int)
            shades[name] = picture.reshape(-1, picture.shape[-1])[:, :3]

    repair(shared, look)
    vermilion, orange = [213, 94, 0], [230, 159, 0]

    def count(name, colour):
        there = shades[name]
        parts = there / np.maximum(there.sum(axis=1, keepdims=True), 1)
        return int((np.abs(parts - np.array(colour) / sum(colour)).max(axis=1) < 0.05).sum())

    assert count("before", vermilion) > 50
    assert count("before", orange) < 20
    assert count("after", orange) > 200
    assert count("after", vermilion) < 20


@BLANK
def test_a_surface_that_cannot_be_repaired_says_why(shared, monkeypatch):
    def refuse(*_, **__):
        raise ValueError("no faces are left")

    monkeypatch.setattr("vtk_segdeform.widgets.app.repair_dialog.repair_surface", refuse)

    def read(dialog):
        assert lines(dialog) == ["no faces are left"]
        assert not dialog.accepting.isEnabled()
        assert not dialog.after.isEnabled()

    repair(shared, read)


@BLANK
def test_declining_a_repair_keeps_the_open_document(shared, boxes, tmp_path):
    with_invalid_points().save(tmp_path / "ball.ply")
    boxes.answers.append("Cancel")
    shared.window.open(tmp_path / "ball.ply")
    shared.settle()
    assert shared.title == "bottle.ply - segdeform"


@BLANK
def test_the_dialog_shows_the_progress_and_a_cancelled_repair_stops(shared, monkeypatch):
    stopped = threading.Event()

    def work_for_long(*_, progress, **__):
        try:
            for _ in range(2000):
                progress(0.4, "Filling 2 holes of 6 edges")
                stopped.wait(0.002)
        except Cancelled:
            stopped.set()
            raise

    monkeypatch.setattr("vtk_segdeform.widgets.app.repair_dialog.repair_surface", work_for_long)

    def watch(times_left=1000):
        dialog = application().activeModalWidget()
        is_open = isinstance(dialog, RepairDialog)
        if is_open and (dialog.stage.text() or not times_left):
            shown.append((dialog.stage.text(), dialog.bar.value() / max(dialog.bar.maximum(), 1)))
            click(dialog.cancelling)
        else:
            QtCore.QTimer.singleShot(5, lambda: watch(times_left - is_open))

    shown = []
    QtCore.QTimer.singleShot(5, watch)
    shared.choose("File", "Repair and open")
    assert shown == [("Filling 2 holes of 6 edges", 0.36)]
    until(stopped.is_set, "the end of the repair")
    assert shared.title == "bottle.ply - segdeform"


def type_in_preview(dialog, key):
    """Type a key that ends the dialog while its preview has the focus."""
    dialog.activateWindow()
    dialog.preview.plotter.setFocus()
    until(dialog.preview.plotter.hasFocus, "the focus")
    QtTest.QTest.keyClick(dialog.preview.plotter, key)
    until(lambda: not dialog.isVisible(), "the end of the dialog")


def test_enter_opens_the_repaired_copy_even_if_the_preview_has_the_keys(hand, tmp_path):
    opened(hand, bottle(), tmp_path / "bottle.ply")

    def enter(dialog):
        until(lambda: dialog.accepting.isEnabled(), "the repair")
        type_in_preview(dialog, Qt.Key_Return)

    repair(hand, enter)
    assert hand.title == "bottle (repaired)* - segdeform"


def test_escape_closes_the_dialog_even_if_its_preview_has_the_keys(shared):
    repair(shared, lambda dialog: type_in_preview(dialog, Qt.Key_Escape))
