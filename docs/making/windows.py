r"""The pictures of Qt windows, kept in the repository because they need a screen.

    xvfb-run -s "-screen 0 1600x1200x24" env PYTHONPATH=.:docs .venv/bin/python -m making.windows

writes docs/pictures/app.png, of the desktop program, and docs/pictures/qt-application.png, of
`examples/qt_application.py`, which runs unchanged.
"""

from __future__ import annotations

import os
import runpy
import sys
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from qtpy import QtCore, QtWidgets

from making.made import DOCS, EXAMPLES
from making.scene import PIVOT
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.app import Window
from vtk_segdeform.widgets.editor import actions

PAUSE = 1500  # milliseconds, for layout and drawing


def main() -> None:
    """Draw both windows."""
    with tempfile.TemporaryDirectory() as folder:  # for autosaved and recent files
        os.environ.update(dict.fromkeys(["XDG_DATA_HOME", "XDG_CONFIG_HOME"], folder))
        application = QtWidgets.QApplication(["segdeform"])
        window = Window()
        window.resize(1180, 740)
        window.show()
        window.open_sample()
        when_idle(story(window, lambda: window.editor if window.has_mesh else None, "app.png"))
        application.exec()
        sys.argv = ["qt_application"]
        when_idle(example(application))
        runpy.run_path(str(EXAMPLES / "qt_application.py"))


def example(application: Any) -> Iterator[bool]:
    """Find the window of the example, and tell its story."""
    shown = (w for w in application.topLevelWidgets() if w.isVisible() and not w.parent())
    window = next(w for w in shown if isinstance(w, QtWidgets.QMainWindow))
    yield from story(window, lambda: window.editor.editor, "qt-application.png")


def story(window: Any, editor_of: Callable[[], DeformEditor | None], name: str) -> Iterator[bool]:
    """Bend the cactus, show the local volume change and save a picture; yield while it is busy."""
    while (editor := editor_of()) is None:
        yield True
    session = editor.session
    height, angle = session.mesh.vertices[:, 2], np.radians(45.0)
    session.segment(3)
    session.fit_cages()
    session.set_fixed(height < 0.08)
    session.handles.add(height > 0.92, "tip")
    cos, sin, turn = np.cos(angle), np.sin(angle), np.eye(4)
    turn[:3, :3] = [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]
    turn[:3, 3] = PIVOT - turn[:3, :3] @ PIVOT
    session.move_handle("tip", turn)
    session.commit()
    camera = editor.view.camera
    camera.SetPosition(0.38, -3.2, 0.75)
    camera.SetFocalPoint(0.2, 0.0, 0.44)
    camera.SetViewUp(0.0, 0.0, 1.0)
    editor.mode = Mode.DEFORM
    yield editor.is_busy
    if name == "app.png":
        editor.do(actions.toggle_cages)
    editor.do(actions.toggle_overlay)
    while editor.is_busy:
        yield True
    yield False
    window.grab().save(str(DOCS / "pictures" / name))
    window.hide()
    QtWidgets.QApplication.instance().quit()


def when_idle(steps: Iterator[bool]) -> None:
    """Take the steps one by one, with a pause before each."""

    def take() -> None:
        if next(steps, None) is not None:
            QtCore.QTimer.singleShot(PAUSE, take)

    QtCore.QTimer.singleShot(PAUSE, take)


if __name__ == "__main__":
    main()
