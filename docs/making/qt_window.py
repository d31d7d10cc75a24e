"""The picture of the Qt example's window, which the site cannot make by itself: it takes a screen.

    xvfb-run -s "-screen 0 1600x1200x24" env PYTHONPATH=.:docs .venv/bin/python -m making.qt_window

writes docs/pictures/qt-application.png.  `examples/qt_application.py` runs as it is; then its
cactus is bent.
"""

from __future__ import annotations

import runpy
import sys
from typing import Any

import numpy as np
from qtpy import QtCore, QtWidgets

from making.made import DOCS, EXAMPLES
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.editing import actions

PICTURE = DOCS / "pictures" / "qt-application.png"


def bend(window: Any) -> None:
    """Find regions, fit cages, and bend the cactus by its tip."""
    editor, session = window.editor.editor, window.editor.session
    height = session.mesh.vertices[:, 2]
    session.segment(3)
    session.fit_cages()
    session.set_fixed(height < 0.08)
    session.add_handle(height > 0.92, "tip")
    angle, pivot = np.radians(45.0), np.array([0.0, 0.0, 0.4])
    turn = np.eye(4)
    turn[:3, :3] = [
        [np.cos(angle), 0, np.sin(angle)],
        [0, 1, 0],
        [-np.sin(angle), 0, np.cos(angle)],
    ]
    turn[:3, 3] = pivot - turn[:3, :3] @ pivot
    session.move_handle("tip", turn)
    session.commit()
    editor.mode = Mode.DEFORM
    editor.do(actions.toggle_overlay)
    window.editor.plotter.camera_position = [(0.38, -3.2, 0.75), (0.2, 0, 0.44), (0, 0, 1)]


def main() -> None:
    """Run the example, look at its window and close it."""
    application = QtWidgets.QApplication(["qt_application"])

    def window() -> Any:
        return next(w for w in application.topLevelWidgets() if hasattr(w, "show_volume"))

    QtCore.QTimer.singleShot(1000, lambda: bend(window()))
    QtCore.QTimer.singleShot(
        6000, lambda: (window().grab().save(str(PICTURE)), window().close(), None)[-1]
    )
    sys.argv = ["qt_application"]
    runpy.run_path(str(EXAMPLES / "qt_application.py"))


if __name__ == "__main__":
    main()
