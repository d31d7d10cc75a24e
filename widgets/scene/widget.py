"""What every widget is: something in a view that speaks to a session, and can be switched off.

A widget says what a press begins (`begins`), and the rest is done here: the press is taken from
the camera only if it begins something, moves and the release go to the gesture, Escape or the
right button cancels it.  Anything else that ends it, such as another tool or a job, finishes it as
a release would: nothing is lost.  Elsewhere in the view the camera works as usual.

VTK's words are kept: `On`, `Off`, `SetEnabled`, `GetEnabled`, and observers of
``StartInteractionEvent``, ``InteractionEvent`` and ``EndInteractionEvent``, called after whatever
they tell of; and of ``ModifiedEvent``, where the widget has something that is set.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from vtk_segdeform.arrays import is_whole
from vtk_segdeform.checks import as_callable, as_switch, require, shown
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.session import Session

from .gestures import Gesture, Grab, Phase, Pointer
from .view import Stop, View

INTERACTION_EVENTS = ("StartInteractionEvent", "InteractionEvent", "EndInteractionEvent")
_EVENTS = (*INTERACTION_EVENTS, "ModifiedEvent")


class Widget(abc.ABC):
    """A piece of interface over one view and one session; off until `On`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        Where it lives.  Call `remove` before its window closes.
    session : Session
        What it shows and changes.

    Attributes
    ----------
    remark : str
        What is to be said of the last gesture, if anything.
    """

    def __init__(self, view: Any, session: Session) -> None:
        self.view = View.of(view)
        self.session = require(session, Session, "session")
        self.remark = ""
        self._grab = Grab()
        self._stops: list[Stop] = []
        self._observers: dict[int, tuple[str, Callable[[Widget, str], None]]] = {}
        self._next_tag = 1
        self._took_key = False

    # What a widget says of itself.

    def begins(self, press: Pointer) -> Gesture | None:
        """Return the gesture that *press* begins, or None to leave it to the camera."""
        del press
        return None

    def hovers(self, pointer: Pointer) -> None:
        """Show what a press here would do; the pointer moves and no button is down."""
        del pointer

    def wheels(self, pointer: Pointer, clicks: int) -> bool:
        """Turn the wheel by +1 or -1 *clicks*; False leaves it to the camera."""
        del pointer, clicks
        return False

    def types(self, key: str, pointer: Pointer) -> bool:
        """Take a key, VTK's name of it ("z", "Escape", "bracketleft"); False leaves it."""
        del key, pointer
        return False

    @abc.abstractmethod
    def remove(self) -> None:
        """Take everything out of the view, for good."""

    # Switching.

    def On(self) -> None:  # noqa: N802 - VTK's word
        """Listen to the view."""
        if self._stops:
            return
        observe = self.view.observe
        self._stops = [
            observe("LeftButtonPressEvent", self._press),
            observe("MouseMoveEvent", self._move),
            observe("LeftButtonReleaseEvent", self._release),
            observe("RightButtonPressEvent", self.cancel),
            observe("MouseWheelForwardEvent", lambda: self._wheel(+1)),
            observe("MouseWheelBackwardEvent", lambda: self._wheel(-1)),
            observe("KeyPressEvent", self._key),
            observe("CharEvent", lambda: self._took_key),  # comes after each press of a key
        ]

    def Off(self) -> None:  # noqa: N802
        """Stop listening; an ongoing gesture is finished."""
        try:
            self.finish()
        finally:
            for stop in self._stops:
                stop()
            self._stops = []

    def SetEnabled(self, enabled: bool) -> None:  # noqa: N802
        """Switch on or off."""
        if as_switch(enabled, "enabled"):
            self.On()
        else:
            self.Off()

    def GetEnabled(self) -> bool:  # noqa: N802
        """Tell whether it is on."""
        return bool(self._stops)

    def AddObserver(self, event: str, callback: Callable[[Widget, str], None]) -> int:  # noqa: N802
        """Call ``callback(widget, event)`` at one of the events above; return its tag."""
        if not isinstance(event, str) or event not in _EVENTS:
            raise ArgumentError(f"event must be one of {', '.join(_EVENTS)}; got {shown(event)}")
        as_callable(callback, "callback")
        tag, self._next_tag = self._next_tag, self._next_tag + 1
        self._observers[tag] = event, callback
        return tag

    def RemoveObserver(self, tag: int) -> None:  # noqa: N802
        """Forget the observer with this *tag*."""
        if not is_whole(tag, 0):
            raise ArgumentError(f"tag must be a value returned by AddObserver; got {shown(tag)}")
        self._observers.pop(tag, None)

    @property
    def is_grabbing(self) -> bool:
        """Whether a gesture is going on."""
        return self._grab.is_active

    def finish(self) -> bool:
        """Finish the gesture as if the button had been released; False if there was none."""
        return self._end(self._grab.finish)

    def cancel(self) -> bool:
        """End the gesture as if it had never begun; False if there was none."""
        return self._end(self._grab.cancel)

    def _end(self, end: Callable[[], None]) -> bool:
        if not self._grab.is_active:
            return False
        try:
            end()
        finally:
            self._tell("EndInteractionEvent")
        return True

    # From VTK's events to ours.

    def _press(self) -> bool:
        press = self.view.pointer(Phase.PRESS)
        self.finish()  # the release never arrived
        if self.is_grabbing:  # it is still handling an event, within which this one arrived
            return True
        gesture = self.begins(press) if self.view.contains(press) else None
        if gesture is None:
            return False
        self._grab.begin(gesture, press)
        self._tell("StartInteractionEvent")
        return True

    def _move(self) -> bool:
        if not self._grab.is_active:
            self.hovers(self.view.pointer(Phase.HOVER))
            return False
        self._send(Phase.MOVE, "InteractionEvent")
        return True

    def _release(self) -> bool:
        if not self._grab.is_active:
            return False
        self._send(Phase.RELEASE, "EndInteractionEvent")
        return True

    def _send(self, phase: Phase, event: str) -> None:
        try:
            self._grab.send(self.view.pointer(phase))
        except BaseException:
            self._tell("EndInteractionEvent")
            raise
        self._tell(event if self._grab.is_active else "EndInteractionEvent")

    def _wheel(self, clicks: int) -> bool:
        pointer = self.view.pointer(Phase.HOVER)
        return self.view.contains(pointer) and self.wheels(pointer, clicks)

    def _key(self) -> bool:
        key = self.view.interactor.GetKeySym() or ""
        if not (self.is_grabbing or self.view.is_addressed):
            self._took_key = False
            return False
        self._took_key = True  # also where it fails
        self._took_key = (key == "Escape" and self.cancel()) or self.types(
            key, self.view.pointer(Phase.HOVER)
        )
        return self._took_key

    def _tell(self, event: str) -> None:
        with ExitStack() as told:  # one that raises keeps nobody from hearing
            for name, callback in reversed(self._observers.values()):
                if name == event:
                    told.callback(callback, self, event)
