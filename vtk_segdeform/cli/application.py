"""``segdeform app``: open the desktop program."""

from __future__ import annotations

import signal
from argparse import Namespace
from pathlib import Path

from ..errors import MissingDependencyError
from ..pictures import require_screen
from ..progress import Progress
from .outputs import Say

_INSTALL = "pip install 'vtk-segdeform[app]'"


def app(options: Namespace, say: Say, progress: Progress) -> bool:
    """Open the main window, with a file if one is given; return when it is closed.

    Raises
    ------
    MissingDependencyError
        If Qt is not installed or there is no display.
    """
    del say, progress  # the window shows messages and progress itself
    try:
        from qtpy import QtCore, QtWidgets

        from ..widgets.app import Window
    except ImportError as missing:
        reason = str(missing).strip().rstrip(".")
        raise MissingDependencyError(
            f"the desktop program requires Qt ({reason}); install it with {_INSTALL}"
        ) from missing
    require_screen()
    QtWidgets.QApplication.setApplicationName("segdeform")
    program = QtWidgets.QApplication.instance() or QtWidgets.QApplication(["segdeform"])
    window = Window(first_run=True)
    window.show()
    path: Path | None = options.input
    QtCore.QTimer.singleShot(0, lambda: window.begin(path))
    # With Python's own handler, Ctrl+C in the terminal would take effect at the next Qt event only.
    # Unsaved work is in the autosave.
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        program.exec()
    finally:
        signal.signal(signal.SIGINT, before)
    return True
