"""The base class of the widgets: event handling, gestures, and VTK's widget interface.

A widget returns the gesture that a press starts from `on_press`.  If there is one, the press does
not reach the camera, moves and the release are sent to the gesture, and Escape or the right button
cancels it.  A press with Alt always reaches the camera.  Any other interruption, such as a change
of tool or a background job, finishes the gesture like a release, so no work is lost.  Elsewhere in
the view the camera works as usual.

The interface follows VTK's widgets: `On`, `Off`, `SetEnabled`, `GetEnabled`, and observers of
``StartInteractionEvent``, ``InteractionEvent`` and ``EndInteractionEvent``, each invoked after the
change; and of ``ModifiedEvent``, invoked after a property was set.
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
    """Base class of the widgets over one view and one session; off until `On`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to work in.  Call `remove` before its window closes.
    session : Session
        The session to show and edit.

    Attributes
    ----------
    remark : str
        A message to the user about the last gesture; "" if there is none.
    """

    def __init__(self, view: Any, session: Session) -> None:
        self.view = View.of(view)
        self.session = require(session, Session, "session")
        self.remark = ""
        self._grab = Grab()
        self._stops: list[Stop] = []
        self._observers: dict[int, tuple[str, Callable[[Widget, str], None]]] = {}
        self._next_tag = 1
        self._consumed_key = False

    # Hooks of subclasses.
    def on_press(self, press: Pointer) -> Gesture | None:
        """Return the gesture that *press* starts, or None to pass the press to the camera."""
        del press
        return None

    def on_hover(self, pointer: Pointer) -> None:
        """Highlight the target of a press at *pointer*; called on moves with no button down."""
        del pointer

    def leave(self) -> None:  # noqa: B027 - most widgets show something
        """Show nothing at the pointer until it moves again; called when it leaves the view."""

    def on_wheel(self, pointer: Pointer, clicks: int) -> bool:
        """Handle +1 or -1 *clicks* of the wheel; return False to pass them to the camera.

        Called with Shift held, and during a gesture; otherwise the wheel always zooms.
        """
        del pointer, clicks
        return False

    def on_key(self, key: str, pointer: Pointer) -> bool:
        """Handle a *key* by VTK's name, such as "z" or "Escape"; return False to pass it on."""
        del key, pointer
        return False

    @abc.abstractmethod
    def remove(self) -> None:
        """Remove the widget from the view permanently."""

    # VTK's widget interface.
    def On(self) -> None:  # noqa: N802 - VTK's word
        """Start handling events."""
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
            observe("CharEvent", lambda: self._consumed_key),  # follows each KeyPressEvent
            observe("LeaveEvent", self.leave),
        ]

    def Off(self) -> None:  # noqa: N802
        """Stop handling events; finish a running gesture."""
        try:
            self.finish()
        finally:
            for stop in self._stops:
                stop()
            self._stops = []
            self.leave()

    def SetEnabled(self, enabled: bool) -> None:  # noqa: N802
        """Switch the widget on or off."""
        if as_switch(enabled, "enabled"):
            self.On()
        else:
            self.Off()

    def GetEnabled(self) -> bool:  # noqa: N802
        """Return whether the widget is on."""
        return bool(self._stops)

    def AddObserver(self, event: str, callback: Callable[[Widget, str], None]) -> int:  # noqa: N802
        """Call ``callback(widget, event)`` at one of the events above; return the tag."""
        if not isinstance(event, str) or event not in _EVENTS:
            raise ArgumentError(f"event must be one of {', '.join(_EVENTS)}; got {shown(event)}")
        as_callable(callback, "callback")
        tag, self._next_tag = self._next_tag, self._next_tag + 1
        self._observers[tag] = event, callback
        return tag

    def RemoveObserver(self, tag: int) -> None:  # noqa: N802
        """Remove the observer with this *tag*."""
        if not is_whole(tag, 0):
            raise ArgumentError(f"tag must be a value returned by AddObserver; got {shown(tag)}")
        self._observers.pop(tag, None)

    @property
    def is_grabbing(self) -> bool:
        """Whether a gesture is running."""
        return self._grab.is_active

    def finish(self) -> bool:
        """Finish a running gesture as a release would; return False if there was none."""
        return self._end(self._grab.finish)

    def cancel(self) -> bool:
        """Cancel a running gesture and undo its changes; return False if there was none."""
        return self._end(self._grab.cancel)

    def _end(self, end: Callable[[], None]) -> bool:
        if not self._grab.is_active:
            return False
        try:
            end()
        finally:
            self._invoke("EndInteractionEvent")
        return True

    # VTK's events.
    def _press(self) -> bool:
        press = self.view.pointer(Phase.PRESS)
        self.finish()  # in case the last release never arrived
        if self.is_grabbing:  # the gesture is still handling the event that caused this one
            return True
        is_mine = self.view.contains(press) and not press.alt  # with Alt the camera moves
        gesture = self.on_press(press) if is_mine else None
        if gesture is None:
            return False
        self._grab.begin(gesture, press)
        self._invoke("StartInteractionEvent")
        return True

    def _move(self) -> bool:
        if not self._grab.is_active:
            self.on_hover(self.view.pointer(Phase.HOVER))
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
        except BaseException:  # Ctrl+C as well: every start of an interaction has an end
            self._invoke("EndInteractionEvent")
            raise
        self._invoke(event if self._grab.is_active else "EndInteractionEvent")

    def _wheel(self, clicks: int) -> bool:
        pointer = self.view.pointer(Phase.HOVER)
        is_mine = self.view.contains(pointer) and (pointer.shift or self.is_grabbing)
        return is_mine and self.on_wheel(pointer, clicks)

    def _key(self) -> bool:
        key = self.view.interactor.GetKeySym() or ""
        if not (self.is_grabbing or self.view.is_addressed):
            self._consumed_key = False
            return False
        self._consumed_key = True  # even if the next line raises
        self._consumed_key = (key == "Escape" and self.cancel()) or self.on_key(
            key, self.view.pointer(Phase.HOVER)
        )
        return self._consumed_key

    def _invoke(self, event: str) -> None:
        with ExitStack() as stack:  # every observer is called, even if another one raises
            for name, callback in reversed(self._observers.values()):
                if name == event:
                    stack.callback(callback, self, event)
