"""The lines of a recording: what each kind says, how it is read, and how it is done again.

    Window WIDTH HEIGHT
    Camera position X Y Z focus X Y Z up X Y Z angle A parallel 0|1 scale S range NEAR FAR
    MouseMove X Y [shift] [control] [alt] [key=NAME] [code=NUMBER]      and all other `EVENTS`
    Timer TIMES
    Steps NUMBER                    the solver was given so many at the event before, or last tick

A line is believed in nothing: names are those listed here, numbers finite and of a size that
makes sense.  What can be read can be sent; nothing else is ever done.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Protocol

from vtk_segdeform.errors import SessionError

from ..scene import View
from .words import finite, so_many, whole

TITLE = "vtk_segdeform recording 1"
EVENTS = (
    "MouseMove", "LeftButtonPress", "LeftButtonRelease", "LeftButtonDoubleClick",
    "MiddleButtonPress", "MiddleButtonRelease", "MiddleButtonDoubleClick",
    "RightButtonPress", "RightButtonRelease", "RightButtonDoubleClick",
    "MouseWheelForward", "MouseWheelBackward", "MouseWheelLeft", "MouseWheelRight",
    "KeyPress", "Char", "KeyRelease", "Enter", "Leave",
)  # fmt: skip

_FARTHEST, _LARGEST, _MOST = 100_000, 16_384, 100_000  # pixels away, of a window; ticks
_MOST_STEPS = 100


class Entry(Protocol):
    """One line, without its time."""

    def send(self, view: View) -> None:
        """Do in *view* what the line says."""


@dataclass(frozen=True)
class Window:
    """How large the window is, in pixels."""

    width: int
    height: int

    @classmethod
    def of(cls, view: View) -> Window:
        """Return that of *view*."""
        return cls(*view.window.GetSize())

    @classmethod
    def read(cls, words: list[str]) -> Window:
        """Return what the *words* after the name say."""
        width, height = (whole(word, 1, _LARGEST) for word in so_many(words, 2))
        return cls(width, height)

    def __str__(self) -> str:
        return f"Window {self.width} {self.height}"

    def send(self, view: View) -> None:
        """Make the window this large; SessionError if it cannot be."""
        wanted = self.width, self.height
        if tuple(view.window.GetSize()) == wanted:
            return
        view.window.SetSize(*wanted)
        view.render()
        found = tuple(view.window.GetSize())
        if found != wanted:
            raise SessionError(
                f"the recorded window has {wanted[0]} x {wanted[1]} pixels, and this one stays at "
                f"{found[0]} x {found[1]}; replay it in a window of that size"
            )


@dataclass(frozen=True)
class Camera:
    """Where it stands and how it looks."""

    position: tuple[float, ...]
    focus: tuple[float, ...]
    up: tuple[float, ...]
    angle: tuple[float, ...]  # degrees
    parallel: tuple[float, ...]
    scale: tuple[float, ...]
    range: tuple[float, ...]

    @classmethod
    def of(cls, view: View) -> Camera:
        """Return that of *view*."""
        eye = view.camera
        one = eye.GetViewAngle(), eye.GetParallelProjection(), eye.GetParallelScale()
        angle, parallel, scale = ((float(value),) for value in one)
        places = eye.GetPosition(), eye.GetFocalPoint(), eye.GetViewUp()
        return cls(*places, angle, parallel, scale, eye.GetClippingRange())

    @classmethod
    def read(cls, words: list[str]) -> Camera:
        """Return what the *words* after the name say."""
        found = {}
        for field, n in zip(fields(cls), (3, 3, 3, 1, 1, 1, 2), strict=True):
            if words[:1] != [field.name] or len(words) <= n:
                raise ValueError(f"a camera needs {field.name!r} and {n} numbers here")
            found[field.name] = tuple(finite(word) for word in words[1 : n + 1])
            words = words[n + 1 :]
        so_many(words, 0)
        camera = cls(**found)
        near, far = camera.range
        sound = camera.position != camera.focus and any(camera.up) and camera.scale[0] > 0.0
        if not (sound and 0.0 < near < far and 0.0 < camera.angle[0] < 180.0):
            raise ValueError("no camera can stand like this")
        return camera

    def __str__(self) -> str:
        told = (
            f"{field.name} {' '.join(repr(float(x)) for x in getattr(self, field.name))}"
            for field in fields(self)
        )
        return f"Camera {' '.join(told)}"

    def send(self, view: View) -> None:
        """Put the camera there."""
        eye, now = view.camera, Camera.of(view)
        # Only what differs: VTK makes `up` a unit vector anew, and another in its last digit.
        for name, put in (
            ("position", eye.SetPosition), ("focus", eye.SetFocalPoint), ("up", eye.SetViewUp),
            ("angle", eye.SetViewAngle), ("parallel", lambda on: eye.SetParallelProjection(on > 0)),
            ("scale", eye.SetParallelScale), ("range", eye.SetClippingRange),
        ):  # fmt: skip
            if getattr(now, name) != getattr(self, name):
                put(*getattr(self, name))
        view.touch()


@dataclass(frozen=True)
class Input:
    """Something that the mouse or the keyboard did."""

    name: str
    x: int
    y: int
    shift: bool = False
    control: bool = False
    alt: bool = False
    key: str | None = None
    code: int = 0  # of the character that the key writes

    @classmethod
    def of(cls, name: str, interactor: Any) -> Input:
        """Return the event that *interactor* is telling its observers."""
        x, y = interactor.GetEventPosition()
        asked = interactor.GetShiftKey, interactor.GetControlKey, interactor.GetAltKey
        shift, control, alt = (bool(held()) for held in asked)
        key, code = None, 0
        if "Key" in name or name == "Char":
            symbol, code = interactor.GetKeySym() or "", ord(interactor.GetKeyCode() or "\0")
            key = symbol if symbol.split() == [symbol] else None
            code = code if code < 128 else 0  # the symbol says it
        return cls(name, x, y, shift, control, alt, key, code)

    @classmethod
    def read(cls, name: str, words: list[str]) -> Input:
        """Return what the *words* after the name say."""
        x, y = (whole(word, -_FARTHEST, _FARTHEST) for word in so_many(words[:2], 2))
        held: dict[str, Any] = {}
        for word in words[2:]:
            what, _, value = word.partition("=")
            if word in ("shift", "control", "alt"):
                held[word] = True
            elif what == "key" and value:
                held["key"] = value
            elif what == "code":
                held["code"] = whole(value, 0, 127)
            else:
                raise ValueError(f"{word!r} is nothing that can be held down")
        return cls(name, x, y, **held)

    def __str__(self) -> str:
        words = [self.name, str(self.x), str(self.y)]
        words += [word for word in ("shift", "control", "alt") if getattr(self, word)]
        words += [f"key={self.key}"] * bool(self.key) + [f"code={self.code}"] * bool(self.code)
        return " ".join(words)

    def send(self, view: View) -> None:
        """Have it happen again."""
        to = view.interactor
        to.SetEventInformation(
            self.x, self.y, self.control, self.shift, chr(self.code), 0, self.key
        )
        to.SetAltKey(self.alt)
        to.InvokeEvent(f"{self.name}Event")


@dataclass(frozen=True)
class Ticks:
    """Timers that went off, one after the other."""

    times: int

    def __str__(self) -> str:
        return f"Timer {self.times}"

    def send(self, view: View) -> None:
        """Let them go off again."""
        for _ in range(self.times):
            view.interactor.InvokeEvent("TimerEvent")


@dataclass(frozen=True)
class Steps:
    """How many the solver was given at the event before; a replay orders them before it."""

    number: int

    def __str__(self) -> str:
        return f"Steps {self.number}"

    def send(self, view: View) -> None:
        """Do nothing by itself."""


def read_entry(text: str) -> tuple[float, Entry]:
    """Return the time and the meaning of a line; ValueError says what is wrong with it."""
    moment, *words = text.split()
    if not words:
        raise ValueError(f"expected a time and an event; got {text[:60]!r}")
    time, name, rest = finite(moment), words[0], words[1:]
    if name in EVENTS:
        return time, Input.read(name, rest)
    if name == "Window":
        return time, Window.read(rest)
    if name == "Camera":
        return time, Camera.read(rest)
    if name == "Timer":
        return time, Ticks(whole(so_many(rest, 1)[0], 1, _MOST))
    if name == "Steps":
        return time, Steps(whole(so_many(rest, 1)[0], 1, _MOST_STEPS))
    raise ValueError(f"{name[:40]!r} is no event of a recording")
