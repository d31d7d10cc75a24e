"""Simulated hands for Qt: real mouse and key events, sent to a widget on a private X server.

Qt draws VTK by an OpenGL widget, which its "offscreen" platform cannot: it takes an X server.
The other tests of the same process go on drawing off-screen.  Where there is no Qt, no
pyvistaqt or no Xvfb, the tests of whoever imports this are skipped.
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable

import hands  # noqa: F401 - skips where nothing can be drawn
import numpy as np
import pytest
from solids import icosphere

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session.session import Session
from vtk_segdeform.widgets.scene.view import View

QtWidgets = pytest.importorskip("qtpy.QtWidgets", reason="needs Qt", exc_type=ImportError)
pytest.importorskip("pyvistaqt", reason="needs pyvistaqt", exc_type=ImportError)
from qtpy import QtCore, QtTest  # noqa: E402 - after the check for Qt

if not shutil.which("Xvfb"):
    pytest.skip("needs Xvfb (apt-get install xvfb)", allow_module_level=True)

Qt = QtCore.Qt
TRIED = "SEGDEFORM_QT_TRIED"  # set once Qt works, for child processes
ONE_SCREEN = "SEGDEFORM_ONE_SCREEN"  # set if VTK opens windows too, on Qt's screen
_SPECIAL = {"bracketleft": Qt.Key_BracketLeft, "bracketright": Qt.Key_BracketRight,
            "page_down": Qt.Key_PageDown}  # fmt: skip


@functools.cache
def application():
    """Return the Qt application of the process, on a private screen.

    Closing the last window of a test does not end it: that would close the windows of later tests.
    """
    app = _application()
    app.setQuitOnLastWindowClosed(False)
    return app


def _application():
    if ONE_SCREEN in os.environ:
        os.environ.pop("VTK_DEFAULT_OPENGL_WINDOW", None)
        os.environ.update(DISPLAY=new_screen(), QT_QPA_PLATFORM="xcb")
        return QtWidgets.QApplication(["segdeform tests"])
    # Without a library of X, Qt ends the process, so a child process tries first.
    code = "from qtpy import QtWidgets; QtWidgets.QApplication([])"
    # VTK's off-screen windows are EGL's; a thread cannot change between that and GLX.  Qt looks
    # when it first draws.
    os.environ["QT_XCB_GL_INTEGRATION"] = "xcb_egl"
    on_x = {"QT_QPA_PLATFORM": "xcb"}
    if TRIED not in os.environ:
        tried = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False,
            env={**os.environ, **on_x, "DISPLAY": new_screen()},
        )  # fmt: skip
        if tried.returncode:
            pytest.skip(f"Qt cannot use X here: {' '.join(tried.stderr.split())[:300]}")
        os.environ[TRIED] = "yes"
    with pytest.MonkeyPatch.context() as patch:  # the variables apply here only
        for name, value in {**on_x, "DISPLAY": new_screen()}.items():
            patch.setenv(name, value)
        return QtWidgets.QApplication(["segdeform tests"])


def new_screen() -> str:
    """Start an X server that ends with its last client; return its name."""
    reading, writing = os.pipe()
    os.set_inheritable(writing, True)
    screen = ["-screen", "0", "1600x1200x24", "-nolisten", "tcp"]
    os.posix_spawnp(
        "Xvfb", ["Xvfb", "-terminate", "-displayfd", str(writing), *screen], os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0)],
    )  # fmt: skip
    os.close(writing)
    with os.fdopen(reading) as numbers:
        return f":{numbers.readline().strip()}"


@functools.cache
def small():
    """Return an ellipsoid and the state of a session, complete except for a pose."""
    sphere, faces = icosphere(3)
    session = Session(Mesh(sphere * [3.0, 0.8, 0.8], faces))
    ball, ball_faces = icosphere(1)
    x = session.mesh.vertices[:, 0]
    session.set_regions(Regions.from_masks(session.mesh, np.array([x < 0.5, x > -0.5])))
    shapes = [ball * [3.5, 1.6, 1.6] + [shift, 0.0, 0.0] for shift in (-1.5, 1.5)]
    session.set_cages([Cage(shape, ball_faces) for shape in shapes])
    session.set_fixed(x < -2.4)
    session.handles.add(x > 2.4)
    return session.mesh, session.state


def until(seen: Callable[[], object], what: str, seconds: float = 30.0) -> None:
    """Let Qt's event loop run until *seen* returns something true."""
    end = time.monotonic() + seconds
    while not seen():
        assert time.monotonic() < end, f"waited in vain for {what}"
        application().processEvents()
        time.sleep(0.002)


class _Pointer(QtCore.QObject):
    """Where a widget last saw the mouse, in Qt's pixels, or None if it never did."""

    def __init__(self, widget):
        super().__init__(widget)
        self.place = None
        widget.installEventFilter(self)

    def eventFilter(self, _, event):  # noqa: N802 - Qt's name
        if event.type() in (QtCore.QEvent.MouseMove, QtCore.QEvent.MouseButtonPress):
            self.place = event.position().toPoint() if hasattr(event, "position") else event.pos()
        return False


class QtHand:
    """A hand on the mouse and the keyboard of a Qt widget that shows a view.

    Positions are VTK's, in its pixels from the lower left corner.
    """

    def __init__(self, widget, view: View) -> None:
        self.widget, self.view = widget, view
        self.failures: list[Exception] = []
        view.on_failure(self.failures.append)
        self._pointer = _Pointer(widget)

    def at(self, point: Iterable[float]) -> tuple[float, float]:
        """Return the display coordinates of a world *point*."""
        x, y, _ = self.view.to_display(np.array([list(point)]))[0]
        return float(x), float(y)

    def move(self, position) -> None:
        QtTest.QTest.mouseMove(self.widget, self._pixel(position))
        application().processEvents()

    def press(self, position, held=Qt.NoModifier) -> None:
        self.move(position)
        QtTest.QTest.mousePress(self.widget, Qt.LeftButton, held, self._pixel(position))
        application().processEvents()

    def release(self, position, held=Qt.NoModifier) -> None:
        QtTest.QTest.mouseRelease(self.widget, Qt.LeftButton, held, self._pixel(position))
        application().processEvents()

    def drag(self, positions, held=Qt.NoModifier) -> None:
        """Press at the first of *positions*, move through the others, release at the last."""
        positions = list(positions)
        self.press(positions[0], held)
        for position in positions[1:]:
            self.move(position)
        self._wait_for_move(positions[-1])
        self.release(positions[-1], held)

    def _wait_for_move(self, position) -> None:
        """Wait until the widget has seen the mouse at *position*.

        Moves come through the X server and the release does not, so it could arrive first.  The
        server sends nothing if the mouse is where it was, so the move is repeated now and then.
        """
        place, x, y = self._pixel(position), *position
        end = time.monotonic() + 0.5

        def seen() -> bool:
            nonlocal end
            if time.monotonic() > end:
                end += 0.5
                self.move((x + 3, y))
                self.move(position)
            return self._pointer.place == place

        until(seen, "the last move")

    def key(self, key: str, held=Qt.NoModifier) -> None:
        """Type a letter, a digit, or "Escape", "plus" and the like."""
        code = _SPECIAL.get(key) or getattr(Qt, f"Key_{key.capitalize()}")
        QtTest.QTest.keyClick(self.widget, code, held)
        application().processEvents()

    def types(self, key: str) -> None:
        """Type a key as the editor's table has it: "z", "escape", "ctrl+shift+z"."""
        *held, name = key.split("+")
        modifiers = Qt.ControlModifier if "ctrl" in held else Qt.NoModifier
        modifiers |= Qt.ShiftModifier if "shift" in held else Qt.NoModifier
        if name.startswith("kp_"):
            modifiers |= Qt.KeypadModifier
        self.key(name.removeprefix("kp_"), modifiers)

    def _pixel(self, position):
        """Return a position in Qt's coordinates: device-independent, from the upper left corner."""
        x, y = np.asarray(position, dtype=float) / self.widget.devicePixelRatioF()
        return QtCore.QPoint(round(float(x)), round(self.widget.height() - 1 - float(y)))
