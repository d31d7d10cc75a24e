"""An editor in the Qt widget, operated by `key_moments`."""

from __future__ import annotations

import time

from key_moments import Stand, aim, ready
from qt_hands import QtCore, QtHand, application, until

from vtk_segdeform.widgets.qt.keys_dialog import KeysDialog
from vtk_segdeform.widgets.qt.widget import DeformWidget
from vtk_segdeform.widgets.scene.view import View


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
        if not is_drawn:  # rendering would take nine tenths of the time
            view.render = lambda: None
            self.widget.plotter.setUpdatesEnabled(False)
        timer = self.widget.plotter._Timer  # pyvistaqt's, of 10 ms whatever is asked for
        timer.start = lambda _: QtCore.QTimer.start(timer, 3)
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
        for dialog in self.widget.findChildren(KeysDialog):
            dialog.reject()
        super().begin(mode)
        self.widget.plotter.setFocus()  # Tab moves the focus

    def settle(self):
        super().settle()
        panel = self.widget.panel
        assert panel.isEnabled()
        assert panel.toolbar.buttons["open"].isEnabled()
        assert panel.history.isEnabled()
        assert not panel.status.cancel.isVisible()
        assert panel.boxes["regions"].isEnabledTo(panel)
        assert panel.toolbar.buttons["undo"].isEnabled() is self.session.history.can_undo

    def close(self):
        self.widget.close()
        assert not self.has_timers()
        self.widget.deleteLater()
        delete_now()


def delete_now():
    """Let Qt process deferred deletes, and then collect the wrappers."""
    for _ in range(2):
        application().sendPostedEvents(None, QtCore.QEvent.DeferredDelete)
        application().processEvents()
