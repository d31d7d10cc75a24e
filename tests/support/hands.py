"""Simulated hands for the tests: real interactor events at display coordinates.

Where nothing can be rendered, VTK ends the process on its first picture: the tests of whoever
imports this are skipped there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.pictures.canvas import require_offscreen
from vtk_segdeform.widgets.scene.view import View

# Windows, and what is drawn in them.  A new one needs 80 ms for its context and its shaders, as
# much as twenty gestures.
_spare: list[vtkRenderWindow] = []
_in_use: list[tuple[vtkRenderWindow, vtkGenericRenderWindowInteractor]] = []


@contextmanager
def windows_again() -> Iterator[None]:
    """Let later views use the windows of the views that are made in the ``with`` block."""
    _in_use.clear()  # these are of fixtures of a module
    yield
    for window, interactor in _in_use:
        for renderer in [*window.GetRenderers()]:
            window.RemoveRenderer(renderer)
        window.RemoveAllObservers()
        window.SetNumberOfLayers(1)
        interactor.SetRenderWindow(None)
        window.SetInteractor(None)
        _spare.append(window)
    _in_use.clear()


def plain_view(size: tuple[int, int] = (400, 400), *, is_own: bool = False) -> View:
    """Return a renderer in an off-screen window, with VTK's trackball camera and no pyvista.

    The window may have shown views of earlier tests, and will show later ones, unless *is_own*.
    """
    renderer = vtkRenderer()
    window = vtkRenderWindow() if is_own or not _spare else _spare.pop()
    renderer.SetBackground(1.0, 1.0, 1.0)
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)
    window.SetSize(*size)
    window.AddRenderer(renderer)
    interactor = vtkGenericRenderWindowInteractor()
    interactor.SetRenderWindow(window)
    interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
    interactor.Initialize()
    if not is_own:
        _in_use.append((window, interactor))
    return View(renderer, interactor)


def look_from(view: View, *place: float) -> None:
    """Show all that is in *view* from the direction of *place*, z up.

    From (0, -4, 0) a unit sphere is seen as `Painter` expects.
    """
    view.camera.SetPosition(*place)
    view.camera.SetViewUp(0.0, 0.0, 1.0)
    view.renderer.ResetCamera()
    view.render()


class Painter:
    """What desks share whose `selector` paints a unit sphere with their `hand`."""

    @property
    def colours(self) -> np.ndarray:
        """(n, 3) uint8: the colours of the vertices."""
        shown = self.selector.surface.polydata.GetPointData().GetScalars()
        return np.array(vtk_to_numpy(shown))

    def under(self, x: float, z: float) -> tuple[float, float]:
        """Return the pixel of the point (x, y, z) on the near side of the sphere."""
        return self.hand.at([x, -np.sqrt(max(0.0, 1.0 - x * x - z * z)), z])


def draw_seldom(view: View) -> None:
    """Draw *view* only for `picture` and `View.render`: drawing is half the time of a gesture."""
    view.render = lambda: None  # type: ignore[method-assign]


# VTK's names of the keys that the editor's table has in lower case.
KEYSYMS = {"escape": "Escape", "home": "Home", "f1": "F1", "tab": "Tab", "delete": "Delete",
           "backspace": "BackSpace", "return": "Return",
           **{f"kp_{digit}": f"KP_{digit}" for digit in range(10)}}  # fmt: skip


class OneTimerHost:
    """An event loop with a single timer behind all of VTK's, as in pyvistaqt, fired by hand.

    Creating any timer starts it, and destroying any timer stops it, even if others still need it.

    Attributes
    ----------
    is_running : bool
        Whether the timer is running.
    made : list of int
        The period of every timer that was created, in milliseconds.
    """

    def __init__(self, interactor):
        self.is_running, self.made = False, []
        self._interactor = interactor
        interactor.AddObserver("CreateTimerEvent", self._create)
        interactor.AddObserver("DestroyTimerEvent", self._destroy)

    def tick(self, times: int = 1) -> None:
        """Fire, if the timer is running."""
        for _ in range(times):
            if self.is_running:
                self._interactor.TimerEvent()

    def _create(self, *_):
        self.is_running = True
        self.made.append(self._interactor.GetTimerEventDuration())

    def _destroy(self, *_):
        self.is_running = False


def picture(view: View) -> np.ndarray:
    """Return the picture of the view, (h, w, 3) uint8, upper row first."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

    View.render(view)  # even if it is drawn seldom
    grabbed = vtkWindowToImageFilter()
    grabbed.SetInput(view.window)
    grabbed.ReadFrontBufferOff()
    grabbed.Update()
    image = grabbed.GetOutput()
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1].copy()


try:
    require_offscreen()
except MissingDependencyError as missing:
    pytest.skip(str(missing), allow_module_level=True)


class Hand:
    """A hand on the mouse and the keyboard of a view.

    Positions are (x, y) pixels; `at` says where a point of the world is.  What the callbacks
    raise is collected in `failures`.
    """

    def __init__(self, view: View) -> None:
        self.view = view
        self.failures: list[Exception] = []
        view.on_failure(self.failures.append)

    def at(self, point: Iterable[float]) -> tuple[float, float]:
        """Return the display coordinates of a world *point*."""
        x, y, _ = self.view.to_display(np.array([list(point)]))[0]
        return float(x), float(y)

    def event(self, name, position=None, *, control=False, shift=False, key=""):
        """Send one event, as a device would."""
        interactor = self.view.interactor
        if position is None:
            position = interactor.GetEventPosition()
        x, y = (round(float(p)) for p in position)
        code = key if len(key) == 1 else chr(0)
        interactor.SetEventInformation(x, y, int(control), int(shift), code, 0, key or None)
        interactor.InvokeEvent(name)

    def hover(self, position, **held):
        self.event("MouseMoveEvent", position, **held)

    def press(self, position, **held):
        self.event("MouseMoveEvent", position, **held)  # as real devices do
        self.event("LeftButtonPressEvent", position, **held)

    def move(self, position, **held):
        self.event("MouseMoveEvent", position, **held)

    def release(self, position=None, **held):
        self.event("LeftButtonReleaseEvent", position, **held)

    def drag(self, positions, **held):
        """Press at the first of *positions*, move through the others, release at the last."""
        positions = list(positions)
        self.press(positions[0], **held)
        for position in positions[1:]:
            self.move(position, **held)
        self.release(positions[-1], **held)

    def click(self, position, **held):
        self.drag([position], **held)

    def wheel(self, clicks, position=None, **held):
        name = "MouseWheelForwardEvent" if clicks > 0 else "MouseWheelBackwardEvent"
        for _ in range(abs(clicks)):
            self.event(name, position, **held)

    def key(self, key, position=None, **held):
        """Type VTK's *key*: "z", "Escape", "bracketleft"."""
        self.event("KeyPressEvent", position, key=key, **held)
        self.event("CharEvent", position, key=key, **held)
        self.event("KeyReleaseEvent", position, key=key, **held)

    def types(self, key, position=None):
        """Type a key as the editor's table has it: "z", "escape", "ctrl+shift+z"."""
        *held, name = key.split("+")
        self.key(KEYSYMS.get(name, name), position, control="ctrl" in held, shift="shift" in held)

    def tick(self, times=1):
        """Let the event loop's timers fire."""
        for _ in range(times):
            self.view.interactor.InvokeEvent("TimerEvent")
