"""The input of a page, as events of an interactor.

A page names positions as fractions of the view, from its upper left corner, so an event means the
same place whatever size the picture has.  A move that nobody has handled yet is replaced by the
next one: only the latest place of the pointer matters.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from vtk_segdeform.arrays import is_number
from vtk_segdeform.checks import shown
from vtk_segdeform.errors import ArgumentError

from ..scene import View
from .key_names import vtk_key

_MOVE = "MouseMove"
_MOUSE = frozenset(
    {_MOVE, "MouseWheelForward", "MouseWheelBackward"}
    | {f"{b}Button{e}" for b in ("Left", "Middle", "Right") for e in ("Press", "Release")}
)
_KEYS = frozenset({"KeyPress", "KeyRelease"})
_MODIFIERS = ("shift", "control", "alt")
_FARTHEST_FRACTION = 4.0  # views, from the corner of this one
_LONGEST_KEY_NAME = 40  # letters of the name of a key
_MOST_WAITING = 500  # events that wait: nobody types or clicks as fast


@dataclass(frozen=True)
class Input:
    """An event of the mouse or the keyboard."""

    name: str
    x: int
    y: int
    shift: bool = False
    control: bool = False
    alt: bool = False
    key: str | None = None
    code: int = 0  # of the character of the key

    def send(self, view: View) -> None:
        """Send the event to a view."""
        to = view.interactor
        to.SetEventInformation(
            self.x, self.y, self.control, self.shift, chr(self.code), 0, self.key
        )
        to.SetAltKey(self.alt)
        to.InvokeEvent(f"{self.name}Event")


class Inputs:
    """Events that wait for the view.

    Attributes
    ----------
    time : float
        The time of the last event that was sent to the view; see `put`.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._waiting: deque[tuple[Input, float]] = deque()
        self.time = 0.0

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, message: object) -> None:
        """Queue the event of a page's *message*.

        Parameters
        ----------
        message : mapping
            ``name``, such as "MouseMove" or "KeyPress"; ``x`` and ``y``, fractions of the view;
            ``shift``, ``control``, ``alt``; ``key`` and ``code`` of a key as in KeyboardEvent;
            ``time``, if given, in milliseconds of the page's clock.

        Raises
        ------
        ArgumentError
            If it is no such message, or more events wait than anybody can make.
        """
        event = self._event_of(message)
        if event is None:
            return
        time: Any = message.get("time", 0.0) if isinstance(message, Mapping) else 0.0
        if not is_number(time):
            raise ArgumentError(f"time must be a number; got {shown(time)}")
        last = self._waiting[-1][0] if self._waiting else None
        if last is not None and event.name == _MOVE and replace(event, x=last.x, y=last.y) == last:
            self._waiting[-1] = event, float(time)
        elif len(self._waiting) < _MOST_WAITING:
            self._waiting.append((event, float(time)))
        else:
            raise ArgumentError(
                f"More than {_MOST_WAITING} events wait for the editor; send them slower"
            )

    def send_next(self) -> None:
        """Send the oldest event that waits."""
        event, self.time = self._waiting.popleft()
        event.send(self._view)

    def release_all(self) -> None:
        """Forget what waits, and release the buttons: the page has gone in the middle of a drag."""
        self._waiting.clear()
        x, y = self._view.interactor.GetEventPosition()
        for button in ("Left", "Middle", "Right"):
            Input(f"{button}ButtonRelease", x, y).send(self._view)

    def _event_of(self, message: object) -> Input | None:
        """Return the event of a message; None for a key without a name in VTK."""
        if not isinstance(message, Mapping):
            raise ArgumentError(f"an event must be a mapping; got {shown(message)}")
        name = message.get("name")
        if not isinstance(name, str) or name not in _MOUSE | _KEYS:
            raise ArgumentError(f"there is no event {shown(name)}")
        width, height = self._view.window.GetSize()
        x = round(_fraction(message, "x") * width)
        y = height - 1 - round(_fraction(message, "y") * height)
        held: dict[str, Any] = {each: message.get(each) is True for each in _MODIFIERS}
        if name in _MOUSE:
            return Input(name, x, y, **held)
        key, place = message.get("key"), message.get("code", "")
        for word in (key, place):
            if not isinstance(word, str) or len(word) > _LONGEST_KEY_NAME:
                raise ArgumentError(f"there is no key {shown(word)}")
        named = vtk_key(str(key), str(place))
        return None if named is None else Input(name, x, y, **held, key=named[0], code=named[1])


def _fraction(message: Mapping[Any, Any], name: str) -> float:
    value: Any = message.get(name)
    if not is_number(value) or not abs(value) <= _FARTHEST_FRACTION:
        raise ArgumentError(f"{name} must be a fraction of the view; got {shown(value)}")
    return float(value)
