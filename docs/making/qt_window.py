r"""The picture of the Qt example's window, which the site cannot make by itself: it takes a screen.

    xvfb-run -s "-screen 0 1600x1200x24" \
        env PYTHONPATH=.:docs .venv/bin/python -m making.qt_window

writes docs/pictures/qt-application.png.  `examples/qt_application.py` runs as it is; then its
cactus is bent.
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from qtpy import QtCore, QtWidgets

from making.made import DOCS, EXAMPLES
from making.scene import PIVOT
from vtk_segdeform.widgets import Mode
from vtk_segdeform.widgets.editor import actions

PICTURE = DOCS / "pictures" / "qt-application.png"
PAUSE = 1500  # milliseconds for the window to lay itself out and draw


def story(window: Any) -> Iterator[None]:
    """Bend the cactus by its tip, colour what has swollen and keep what is seen."""
    editor, session = window.editor.editor, window.editor.session
    height, angle = session.mesh.vertices[:, 2], np.radians(45.0)
    session.segment(3)
    session.fit_cages()
    session.set_fixed(height < 0.08)
    session.add_handle(height > 0.92, "tip")
    cos, sin, turn = np.cos(angle), np.sin(angle), np.eye(4)
    turn[:3, :3] = [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]
    turn[:3, 3] = PIVOT - turn[:3, :3] @ PIVOT
    session.move_handle("tip", turn)
    session.commit()
    window.editor.plotter.camera_position = [(0.38, -3.2, 0.75), (0.2, 0, 0.44), (0, 0, 1)]
    editor.mode = Mode.DEFORM
    yield
    editor.do(actions.toggle_overlay)
    yield
    window.grab().save(str(PICTURE))
    window.close()


def main() -> None:
    """Run the example, and go on with the story whenever it has nothing to do."""
    application = QtWidgets.QApplication(["qt_application"])
    told: list[Iterator[None]] = []

    def go_on() -> None:
        window = next(w for w in application.topLevelWidgets() if hasattr(w, "show_volume"))
        told[:] = told or [story(window)]
        if window.editor.editor.is_busy or next(told[0], "ended") is None:
            QtCore.QTimer.singleShot(PAUSE, go_on)

    QtCore.QTimer.singleShot(PAUSE, go_on)
    sys.argv = ["qt_application"]
    runpy.run_path(str(EXAMPLES / "qt_application.py"))


if __name__ == "__main__":
    main()
