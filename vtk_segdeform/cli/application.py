"""The command that opens the desktop program."""

from __future__ import annotations

import signal
from argparse import Namespace
from pathlib import Path

from ..errors import MissingDependencyError
from ..pictures import require_screen
from ..progress import Progress
from .outputs import Say

_NEEDED = "pip install 'vtk-segdeform[app]'"


def application(options: Namespace, say: Say, progress: Progress) -> bool:
    """Open a window for one file, or for none yet, and stay until it is closed.

    Raises
    ------
    MissingDependencyError
        If there is no Qt, or no screen.
    """
    del say, progress  # the window has its own
    try:
        from qtpy import QtCore, QtWidgets

        from ..widgets.app import Window
    except ImportError as missing:
        reason = str(missing).strip().rstrip(".")
        raise MissingDependencyError(
            f"the desktop program needs Qt, which is not here ({reason}); install it by {_NEEDED}"
        ) from missing
    require_screen()
    QtWidgets.QApplication.setApplicationName("segdeform")
    program = QtWidgets.QApplication.instance() or QtWidgets.QApplication(["segdeform"])
    window = Window()
    window.show()
    path: Path | None = options.input
    QtCore.QTimer.singleShot(0, lambda: window.begin(path))
    # Qt's loop would hear of Ctrl+C in the terminal at the next event only; unsaved work is kept.
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        program.exec()
    finally:
        signal.signal(signal.SIGINT, before)
    return True
