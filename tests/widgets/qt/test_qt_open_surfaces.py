"""The panel for surfaces with borders: lids, and no volume where there is none."""

from __future__ import annotations

import pytest
from open_surfaces import bottle, sheet
from qt_hands import Qt, QtCore, QtTest, application, small, until

from vtk_segdeform import Session, Surface
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.qt.widget import DeformWidget

pytestmark = pytest.mark.usefixtures("unprepared")


class Seen:
    """A widget on the screen in mode 4, and its options."""

    def __init__(self, given):
        self.widget = DeformWidget(given)
        self.widget.plotter.setUpdatesEnabled(False)  # the view is not tested, and slow to draw
        self.widget.resize(760, 640)
        self.widget.show()
        until(lambda: self.widget.windowHandle().isExposed(), "the window")
        self.editor, self.panel = self.widget.editor, self.widget.panel
        self.editor.mode = Mode.DEFORM
        self.settle()

    def control(self, name):
        return self.panel.controls[f"deform.{name}"]

    @property
    def session(self):
        return self.widget.session

    def settle(self):
        application().processEvents()
        until(lambda: self.panel.is_up_to_date and not self.editor.is_busy, "the panel")

    def choose(self, name):
        """Choose an entry of the box by its keys."""
        box = self.control("lids")
        box.setFocus()
        row = box.findText(name)
        while box.currentIndex() != row:
            key = Qt.Key_Down if box.currentIndex() < row else Qt.Key_Up
            QtTest.QTest.keyClick(box, key)
        self.settle()


@pytest.fixture
def make():
    application()
    made = []

    def over(given):
        made.append(Seen(given))
        return made[-1]

    yield over
    for seen in made:
        seen.widget.close()
        seen.widget.deleteLater()
    for _ in range(2):
        application().sendPostedEvents(None, QtCore.QEvent.DeferredDelete)
        application().processEvents()


def test_lids_are_chosen_for_an_open_surface_and_undone(make):
    seen = make(Session(Surface(bottle(3, 3))))
    notices = seen.editor.controller.notices
    assert seen.control("lids").isEnabled()
    assert seen.control("lids").currentText() == "Auto"
    assert notices.text == "3 holes: volume kept under lids"
    assert seen.control("volume").text() == "0 %"
    seen.choose("Off")
    assert seen.session.options.lids is False
    assert seen.control("volume").text() == "No volume to preserve"
    assert not seen.control("preserve").isEnabled()
    assert not seen.control("preserve").isChecked()
    assert "no volume" in notices.text
    seen.choose("Under lids")
    assert seen.session.options.lids is True
    while seen.session.undo():
        pass
    seen.settle()
    assert seen.control("lids").currentText() == "Auto"
    assert seen.control("preserve").isEnabled()
    assert seen.control("preserve").isChecked()


def test_a_sheet_has_no_volume_to_preserve_unless_lids_are_wanted(make):
    seen = make(sheet(6))
    assert seen.control("volume").text() == "No volume to preserve"
    assert not seen.control("preserve").isEnabled()
    assert not seen.control("per_region").isEnabled()


def test_for_a_closed_mesh_there_is_nothing_to_choose(make):
    mesh, state = small()
    seen = make(Session(mesh, state=state))
    assert not seen.control("lids").isEnabled()
    assert seen.control("preserve").isEnabled()
    assert seen.editor.controller.notices.text == ""
