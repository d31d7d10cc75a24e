"""Events of a view, recorded and sent again to another one, with the camera of each moment.

The poses are the same to the bit if both views solve with `steady` steps and finish no pose in the
background, whose moment depends on the machine.
"""

from __future__ import annotations

import time

import pytest

from vtk_segdeform.widgets.handle_dragger import Pace

EVENTS = (
    "MouseMoveEvent", "LeftButtonPressEvent", "LeftButtonReleaseEvent", "MiddleButtonPressEvent",
    "MiddleButtonReleaseEvent", "RightButtonPressEvent", "RightButtonReleaseEvent",
    "MouseWheelForwardEvent", "MouseWheelBackwardEvent", "KeyPressEvent", "KeyReleaseEvent",
    "TimerEvent",
)  # fmt: skip
CAMERA = ("Position", "FocalPoint", "ViewUp", "ViewAngle", "ParallelProjection", "ParallelScale",
          "ClippingRange")  # fmt: skip


def steady(patch: pytest.MonkeyPatch) -> None:
    """Let each event solve with as many steps, however fast the machine is."""
    patch.setattr(Pace, "_steps_in", lambda self, seconds, fewest: fewest)


class Recorder:
    """Records the events of *view* until `stop`.

    Passive observers are called first, also where others are kept from seeing an event.
    """

    def __init__(self, view):
        self.view, self.events = view, []
        self._tags = [view.interactor.AddObserver(name, self._note) for name in EVENTS]
        for tag in self._tags:
            view.interactor.GetCommand(tag).SetPassiveObserver(True)

    def _note(self, interactor, name):
        held = interactor.GetControlKey(), interactor.GetShiftKey()
        key = interactor.GetKeyCode() or "\0", 0, interactor.GetKeySym()
        camera = [getattr(self.view.camera, f"Get{each}")() for each in CAMERA]
        self.events.append((name, (*interactor.GetEventPosition(), *held, *key), camera))

    def stop(self):
        for tag in self._tags:
            self.view.interactor.RemoveObserver(tag)

    def replay(self, view, busy):
        """Send the events to *view*, each once *busy* returns False."""
        for name, information, camera in self.events:
            while busy():
                view.interactor.InvokeEvent("TimerEvent")
                time.sleep(0.005)
            for each, value in zip(CAMERA, camera, strict=True):
                if getattr(view.camera, f"Get{each}")() != value:  # VTK would normalise it again
                    getattr(view.camera, f"Set{each}")(value)
            view.interactor.SetEventInformation(*information)
            view.interactor.InvokeEvent(name)
