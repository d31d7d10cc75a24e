r"""The picture of the Qt example's window. It needs a screen, so it is kept in the repository.

    xvfb-run -s "-screen 0 1600x1200x24" \
        env PYTHONPATH=.:docs .venv/bin/python -m making.qt_window

writes docs/pictures/qt-application.png.  `examples/qt_application.py` runs unchanged, and its
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
PAUSE = 1500  # milliseconds, for layout and drawing


def story(window: Any) -> Iterator[None]:
    """Bend the cactus by its tip, show the local volume change and save a picture."""
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
    """Run the example, and continue the story whenever it is idle."""
    application = QtWidgets.QApplication(["qt_application"])
    started: list[Iterator[None]] = []

    def continue_story() -> None:
        window = next(w for w in application.topLevelWidgets() if hasattr(w, "show_volume"))
        started[:] = started or [story(window)]
        if window.editor.editor.is_busy or next(started[0], "ended") is None:
            QtCore.QTimer.singleShot(PAUSE, continue_story)

    QtCore.QTimer.singleShot(PAUSE, continue_story)
    sys.argv = ["qt_application"]
    runpy.run_path(str(EXAMPLES / "qt_application.py"))


if __name__ == "__main__":
    main()
