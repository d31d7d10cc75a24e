"""A real window under Xvfb, operated by xdotool: events come from an X server."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from vtk_segdeform import load_session

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("Xvfb", "xdotool")
pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(
        not all(map(shutil.which, TOOLS)), reason="needs Xvfb and xdotool (apt-get install)"
    ),
]

# The program under test, with pyvista or with VTK alone.  At each frame it writes the mode, the
# status and the position of the gizmo, and in the end the largest volume change.
WINDOW = """
import json, sys
import vtk_segdeform as sd

place, log, path = sys.argv[1:]
mesh = sd.models.cactus(1500)
session = sd.Session(mesh)
{opened}
session.set_fixed(mesh.vertices[:, 2] < 0.1)
session.handles.add(mesh.vertices[:, 2] > 0.9, "tip")
volumes = []

def drawn(*_):
    volumes.append(session.volume_change)
    centre = editor.widgets.dragger.gizmo.centre
    at = None if centre is None else editor.view.to_display(centre[None])[0, :2].tolist()
    with open(place, "w") as file:
        json.dump([editor.mode.name, editor.is_busy, editor.status, at, len(volumes)], file)

camera = editor.view.camera
camera.SetFocalPoint(0.0, 0.0, 0.5)
camera.SetPosition(0.0, -4.0, 0.5)
camera.SetViewUp(0.0, 0.0, 1.0)
editor.view.renderer.AddObserver("EndEvent", drawn)
show()
with open(log, "w") as file:
    json.dump({{"worst": max(map(abs, volumes)), "drawn": len(volumes)}}, file)
"""
OPENED = {
    "pyvista": """
import pyvista as pv
plotter = pv.Plotter(window_size=(800, 600), title="real window")
editor = plotter.segdeform.edit(session, path=path)
show = plotter.show
""",
    "vtk": """
import vtkmodules.vtkRenderingUI
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow, vtkRenderWindowInteractor
from vtk_segdeform.widgets import DeformEditor
renderer, window, interactor = vtkRenderer(), vtkRenderWindow(), vtkRenderWindowInteractor()
renderer.SetBackground(1.0, 1.0, 1.0)
window.SetSize(800, 600)
window.SetWindowName("real window")
window.AddRenderer(renderer)
interactor.SetRenderWindow(window)
interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
editor = DeformEditor((renderer, interactor), session)
editor.path = path
editor.On()

def show():
    window.Render()
    interactor.Initialize()
    interactor.Start()
    editor.remove()
""",
}


class Person:
    """Operates mouse and keyboard of an X server, and reads the state the program writes."""

    def __init__(self, place: Path, display: str, process: subprocess.Popen) -> None:
        self.place, self.process = place, process
        self.environment = {**os.environ, "DISPLAY": display}
        self.window = ""

    def do(self, *words: object) -> str:
        done = subprocess.run(
            ["xdotool", *map(str, words)], env=self.environment, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        return done.stdout.strip()

    def sees(self):
        try:
            return json.loads(self.place.read_text())
        except (OSError, ValueError):  # not written yet, or being written
            return None

    def waits_for(self, seen, what: str, seconds: float = 60.0) -> list:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            now = self.sees()
            if now is not None and seen(now):
                return now
            assert self.process.poll() is None, "the window has closed"
            time.sleep(0.1)
        raise AssertionError(f"waited in vain for {what}; last seen {self.sees()}")

    def finds_its_window(self) -> None:
        for _ in range(600):
            found = self.do("search", "--onlyvisible", "--name", "real window").splitlines()
            if found:
                self.window = found[0]
                return
            time.sleep(0.1)
        raise AssertionError("no window on the screen")

    def presses(self, key: str) -> None:
        self.do("key", "--window", self.window, key)
        time.sleep(0.3)

    def gets(self, key: str, seen, what: str) -> list:
        """Press a key until *seen* is true; a loaded machine may lose events of xdotool."""
        for _ in range(5):
            self.presses(key)
            try:
                return self.waits_for(seen, what, seconds=12.0)
            except AssertionError:
                if self.process.poll() is not None:
                    raise
        raise AssertionError(f"pressed {key} in vain for {what}; last seen {self.sees()}")

    def drags(self, start, end, moves: int) -> None:
        for k in range(moves + 1):
            x, y = np.asarray(start) + k / moves * (np.asarray(end) - start)
            self.do("mousemove", "--window", self.window, round(x), round(599 - y))
            time.sleep(0.05)
            if k == 0:
                self.do("mousedown", 1)
                time.sleep(0.1)
        self.do("mouseup", 1)
        time.sleep(0.3)


@pytest.fixture(params=OPENED)
def person(tmp_path, request):
    number = 90 + os.getpid() % 900
    server = subprocess.Popen(
        ["Xvfb", f":{number}", "-screen", "0", "1024x768x24"], stderr=subprocess.DEVNULL
    )
    environment = {
        **{k: v for k, v in os.environ.items() if k != "VTK_DEFAULT_OPENGL_WINDOW"},
        "DISPLAY": f":{number}", "PYVISTA_OFF_SCREEN": "false", "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    time.sleep(1.0)
    files = [str(tmp_path / name) for name in ("place.json", "log.json", "work.segdeform")]
    script = tmp_path / "window.py"
    script.write_text(WINDOW.format(opened=OPENED[request.param]))
    process = subprocess.Popen(
        [sys.executable, str(script), *files], env=environment, stderr=subprocess.PIPE, text=True
    )
    yield Person(tmp_path / "place.json", f":{number}", process)
    for each in (process, server):
        each.kill()
        each.communicate()


def test_a_cactus_is_bent_undone_and_saved_in_a_real_window(person, tmp_path):
    person.waits_for(lambda now: True, "the window")
    person.finds_its_window()
    person.do("windowfocus", person.window)
    person.gets("g", lambda now: not now[1] and "F" in now[2], "regions")
    person.gets("f", lambda now: not now[1] and "4" in now[2], "cages")
    for _ in range(20):  # binding starts automatically and blocks the keys
        person.presses("4")
        if person.sees()[0] == "DEFORM":
            break
    *_, at, _ = person.waits_for(lambda now: now[0] == "DEFORM" and not now[1] and now[3], "gizmo")
    time.sleep(2.0)  # binding may be about to start, which blocks the keys
    person.waits_for(lambda now: not now[1], "binding")
    person.drags(at, np.add(at, [120, -30]), moves=20)
    person.waits_for(lambda now: now[3] and abs(now[3][0] - at[0] - 120) < 12, "a drag")
    time.sleep(1.0)  # a busy machine lags behind the pointer
    moved = person.waits_for(lambda now: now[3], "the pose")
    assert moved[3][0] == pytest.approx(at[0] + 120, abs=12)
    person.presses("z")
    person.waits_for(lambda now: np.allclose(now[3], at, atol=1.0), "undo")
    person.presses("y")
    person.waits_for(lambda now: np.allclose(now[3], moved[3], atol=1.0), "redo")
    person.presses("ctrl+s")
    person.waits_for(lambda now: (tmp_path / "work.segdeform").exists(), "the file")
    person.presses("q")
    _, errors = person.process.communicate(timeout=30)
    assert "Traceback" not in errors
    told = json.loads((tmp_path / "log.json").read_text())
    print(f"{told['drawn']} frames drawn in a real window, |dV|/V at most {told['worst']:.1e}")
    assert told["worst"] <= 1e-12
    again = load_session(tmp_path / "work.segdeform")
    assert abs(again.volume_change) <= 1e-12
    assert np.linalg.norm(again.vertices - again.mesh.vertices, axis=1).max() > 0.1
