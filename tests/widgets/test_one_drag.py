"""Open, one drag: real windows of pyvista and Qt under Xvfb, pulled by xdotool."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("Xvfb", "xdotool"))), reason="needs Xvfb and xdotool"
)
SHIFT = np.array([40, -30])  # of the drag in pixels, down the screen positive

# The programs under test print the pixel of the screen to press, as soon as their window is shown,
# and the outcome once a pull is committed.
BOTH = """
import json
import numpy as np
import pyvista as pv
import vtk_segdeform as sd

pv.global_theme.multi_samples = 1  # many take five times as long in software
mesh = sd.models.sphere(300)
mesh = mesh.with_vertices(mesh.vertices * [0.5, 0.5, 1.0])
tip = int(np.argmax(mesh.vertices[:, 2]))

def follow(editor, close, is_shown, corner):
    session, view, volumes, is_told = editor.session, editor.view, [], False
    start = view.camera.GetPosition()

    def pixel(points):
        (left, top), (x, y) = corner(), view.to_display(points)[0, :2]
        return np.array([left + x, top + view.window.GetSize()[1] - 1 - y])

    def tick():
        nonlocal is_told
        if not is_told and is_shown():
            is_told = True
            print(json.dumps(np.rint(pixel(mesh.vertices[[tip]]) + [0, 2]).tolist()), flush=True)
        elif session.history.undo_label and not (
            session.is_dragging or editor.widgets.puller.is_refining
        ):
            ((name, pulled),) = session.handles.items()
            outcome = {
                "moved": (pixel(session.vertices[pulled]) - pixel(mesh.vertices[pulled])).tolist(),
                "handle": name, "label": session.undo(), "next": session.history.undo_label,
                "camera": start == view.camera.GetPosition(), "worst": max(map(abs, volumes)),
            }
            print(json.dumps(outcome), flush=True)
            close()

    session.on_change(lambda change: volumes.append(session.volume_change))
    view.every(20, tick)
"""
IN_PYVISTA = """
plotter = pv.Plotter(window_size=(300, 300))
editor = plotter.segdeform.edit(mesh)
plotter.show(interactive_update=True)
done = []
follow(editor, lambda: done.append(True), lambda: True, lambda: (0, 0))
while not done:
    plotter.update(20)
plotter.close()
"""
IN_QT = """
from qtpy import QtCore, QtWidgets
from vtk_segdeform.widgets.qt import DeformWidget

application = QtWidgets.QApplication([])
widget = DeformWidget(mesh)
widget.resize(600, 400)
widget.show()
view = widget.plotter

def is_shown():
    return widget.windowHandle() is not None and widget.windowHandle().isExposed()

def corner():
    point = view.mapToGlobal(QtCore.QPoint(0, 0))
    return point.x(), point.y()

follow(widget.editor, application.quit, is_shown, corner)
application.exec()
"""


@pytest.fixture
def screen():
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "1024x768x24", "-noreset"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    yield f":{server.stdout.readline().strip()}"
    server.kill()
    server.communicate()


@pytest.mark.campaign  # test_qt_widget and test_plugin drag in windows of their own process
@pytest.mark.parametrize("window", [IN_PYVISTA, IN_QT], ids=["pyvista", "Qt"])
def test_one_drag_right_after_opening_bends_the_mesh(screen, window):
    environment = {
        **{k: v for k, v in os.environ.items() if k != "VTK_DEFAULT_OPENGL_WINDOW"},
        "DISPLAY": screen, "PYVISTA_OFF_SCREEN": "false", "PYTHONPATH": str(ROOT),
        "QT_QPA_PLATFORM": "xcb",
    }  # fmt: skip
    program = subprocess.Popen(
        [sys.executable, "-c", BOTH + window],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    limit = threading.Timer(100.0, program.kill)  # a drag that is lost would wait forever
    limit.start()
    try:
        line = program.stdout.readline()
        assert line, program.communicate()[1]
        press = np.array(json.loads(line))
        words = ["mousemove", *press, "mousedown", 1]
        for k in range(1, 11):
            words += ["sleep", 0.01, "mousemove", *np.rint(press + k / 10 * SHIFT).astype(int)]
        subprocess.run(["xdotool", *map(str, words), "mouseup", "1"], env=environment, check=True)
        line = program.stdout.readline()
        assert line, program.communicate()[1]
        told = json.loads(line)
        np.testing.assert_allclose(told["moved"], SHIFT, atol=3)
        assert told["worst"] <= 1e-12
        assert (told["handle"], told["label"], told["next"]) == ("pull 1", "pull", None)
        assert told["camera"], "the camera has moved"
        assert program.wait() == 0, program.stderr.read()
    finally:
        limit.cancel()
        program.kill()
        program.communicate()
