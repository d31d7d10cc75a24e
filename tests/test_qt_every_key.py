"""Every key of the editor in mid-drag, while a pose converges, and during a job, in Qt.

What is seen to hold is told in `key_moments`; here the panel is to be there again as well.
"""

from __future__ import annotations

import time

import pytest
from key_moments import Stand, aim, ready, slow_down, table
from qt_hands import QtCore, QtHand, application, until

from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.qt import DeformWidget
from vtk_segdeform.widgets.view import View


class QtStand(Stand):
    """In a `DeformWidget`, with Qt's own event loop and timers."""

    def __init__(self, folder, *, is_drawn):
        application()
        self.widget = DeformWidget(ready())
        self.widget.resize(640, 360)
        self.widget.show()
        window = self.widget.windowHandle
        until(lambda: window() and window().isExposed(), "the window")
        view = self.widget.editor.view
        aim(view)
        if not is_drawn:  # nine tenths of the time would be spent on it
            view.render = lambda: None
        hand = QtHand(self.widget.plotter.interactor, self.widget.editor.view)
        super().__init__(self.widget.editor, hand, folder)

    def loop(self):
        application().processEvents()
        time.sleep(0.001)

    def has_timers(self):
        return any(timer.isActive() for timer in self.widget.findChildren(QtCore.QTimer))

    def draw(self):
        View.render(self.editor.view)

    def begin(self, mode):
        super().begin(mode)
        self.widget.plotter.setFocus()  # Tab leads away from it

    def settle(self):
        super().settle()
        panel = self.widget.panel
        assert panel.isEnabled()
        assert panel.head.open.isEnabled()
        assert panel.log.isEnabled()
        assert not panel.foot.cancel.isVisible()
        assert panel.regions.isEnabledTo(panel)
        assert panel.head.undo.isEnabled() is self.session.can_undo

    def close(self):
        self.widget.close()
        assert not self.has_timers()
        self.widget.deleteLater()
        for _ in range(2):
            application().sendPostedEvents(None, QtCore.QEvent.DeferredDelete)
            application().processEvents()


@pytest.fixture(
    scope="module", params=["seldom-drawn", pytest.param("drawn", marks=pytest.mark.campaign)]
)
def stand(request, tmp_path_factory):
    """Yield an editor that is used again and again."""
    with pytest.MonkeyPatch.context() as patch:
        slow_down(patch)
        stand = QtStand(tmp_path_factory.mktemp("qt"), is_drawn=request.param == "drawn")
        yield stand
        stand.close()


@pytest.mark.parametrize(("mode", "key"), table(Mode.DEFORM))
def test_in_mid_drag(stand, mode, key):
    stand.during(mode, key)


@pytest.mark.parametrize(("mode", "key"), table(Mode.DEFORM))
def test_while_the_pose_converges(stand, mode, key):
    stand.just_after(mode, key)


@pytest.mark.parametrize(("mode", "key"), table(Mode.DEFORM))
def test_during_a_job(stand, mode, key):
    stand.in_a_job(mode, key)
