"""``segdeform app``: open the desktop program."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from argparse import Namespace
from importlib.util import find_spec
from pathlib import Path

from ..errors import MissingDependencyError
from ..pictures import require_screen
from ..progress import Progress
from .outputs import Say

_INSTALL = "pip install 'vtk-segdeform[app]'"
_BINDINGS = ("PySide6", "PyQt6")


def app(options: Namespace, say: Say, progress: Progress) -> bool:
    """Open the main window, with a file if one is given; return when it is closed.

    Raises
    ------
    MissingDependencyError
        If Qt or a library that it needs is not installed, or there is no display.
    """
    del say, progress  # the window shows messages and progress itself
    _require_libraries()
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
    window = Window()
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


def _require_libraries() -> None:
    """Check that Qt's platform plugin can be loaded; without it Qt ends the process.

    Raises
    ------
    MissingDependencyError
        If not; the message names the libraries that it needs, and their Debian packages.
    """
    missing: list[str] = []
    for plugin in _platform_plugins():  # Qt takes the first one that can be loaded
        missing = _missing_libraries(plugin)
        if not missing:
            return
    if missing:
        packages = " ".join(sorted({_debian_package(library) for library in missing}))
        raise MissingDependencyError(
            f"no window can be opened: Qt needs {', '.join(missing)}; on Debian or Ubuntu: "
            f"apt-get install --no-install-recommends {packages}"
        )


def _platform_plugins() -> list[Path]:
    """Return the platform plugins that Qt tries on Linux, in its order."""
    if sys.platform != "linux":
        return []
    platforms = os.environ.get("QT_QPA_PLATFORM") or (
        "wayland;xcb" if os.environ.get("WAYLAND_DISPLAY") else "xcb"
    )
    if given := os.environ.get("QT_QPA_PLATFORM_PLUGIN_PATH"):
        folders = [Path(given)]
    else:
        specs = filter(None, map(find_spec, _BINDINGS))
        packages = [Path(each) for spec in specs for each in spec.submodule_search_locations or ()]
        folders = [f for package in packages for f in package.glob("Qt*/plugins/platforms")]
    names = [f"libq{platform.partition(':')[0]}*.so" for platform in platforms.split(";")]
    return [plugin for name in names for folder in folders for plugin in folder.glob(name)]


def _missing_libraries(plugin: Path) -> list[str]:
    """Return the libraries that the dynamic linker does not find."""
    if not (ldd := shutil.which("ldd")):
        return []
    done = subprocess.run([ldd, str(plugin)], capture_output=True, text=True, check=False)
    return list(dict.fromkeys(re.findall(r"(?m)^\s*(\S+) => not found$", done.stdout)))


def _debian_package(library: str) -> str:
    """Return the package of a library by Debian's rule: libxcb-icccm.so.4 is in libxcb-icccm4."""
    name, _, version = library.lower().partition(".so.")
    if name in ("libglib-2.0", "libgthread-2.0"):
        return "libglib2.0-0"
    return f"{name}-{version}" if name[-1:].isdigit() else f"{name}{version}"
