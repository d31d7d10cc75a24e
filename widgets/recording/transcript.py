"""The lines of a recording: writing, parsing and replaying each kind of entry.

    Window WIDTH HEIGHT
    Camera position X Y Z focus X Y Z up X Y Z angle A parallel 0|1 scale S range NEAR FAR
    MouseMove X Y [shift] [control] [alt] [key=NAME] [code=NUMBER]      and all other `EVENTS`
    Timer TIMES
    Steps NUMBER                    solver steps of a solve caused by the last event or tick
    Finish                          the pose was finished on the mesh, in the background
    Keys ACTION=KEY[,KEY ...] ...   the keys of actions from here on, others than the default ones

Lines are not trusted: only the names above are accepted, and numbers must be finite and within
limits.  A replay does nothing but send these events.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

from vtk_segdeform.checks import all_of, require, shown
from vtk_segdeform.errors import ArgumentError, SessionError

from ..scene import View
from .confinement import set_recorded_keys
from .finishes import request_finish
from .parsing import parse_float, parse_int, require_count

TITLE = "vtk_segdeform recording 1"
EVENTS = (
    "MouseMove", "LeftButtonPress", "LeftButtonRelease", "LeftButtonDoubleClick",
    "MiddleButtonPress", "MiddleButtonRelease", "MiddleButtonDoubleClick",
    "RightButtonPress", "RightButtonRelease", "RightButtonDoubleClick",
    "MouseWheelForward", "MouseWheelBackward", "MouseWheelLeft", "MouseWheelRight",
    "KeyPress", "Char", "KeyRelease", "Enter", "Leave",
)  # fmt: skip

_FARTHEST = 100_000  # pixels, of the pointer from the window's corner
_LARGEST = 16_384  # pixels, width or height of the window
_MOST_TICKS, _MOST_STEPS = 100_000, 100
_MOST_ACTIONS = 200
_ASSIGNED = re.compile(r"([a-z0-9_]{1,40})=([a-z0-9_+,]{0,200})")


class Entry(Protocol):
    """One line, without its time."""

    def send(self, view: View) -> None:
        """Replay the line in *view*."""


@dataclass(frozen=True)
class Window:
    """The size of the window in pixels."""

    width: int
    height: int

    @classmethod
    def of(cls, view: View) -> Window:
        """Return the size of the window of *view*."""
        return cls(*view.window.GetSize())

    @classmethod
    def read(cls, words: list[str]) -> Window:
        """Parse the *words* after the name."""
        width, height = (parse_int(word, 1, _LARGEST) for word in require_count(words, 2))
        return cls(width, height)

    def __str__(self) -> str:
        return f"Window {self.width} {self.height}"

    def send(self, view: View) -> None:
        """Resize the window; SessionError if it keeps another size."""
        wanted = self.width, self.height
        if tuple(view.window.GetSize()) == wanted:
            return
        view.window.SetSize(*wanted)
        view.render()
        found = tuple(view.window.GetSize())
        if found != wanted:
            raise SessionError(
                f"the recorded window has {wanted[0]} x {wanted[1]} pixels, but this window stays "
                f"at {found[0]} x {found[1]}; replay in a window of the recorded size"
            )


@dataclass(frozen=True)
class Camera:
    """The state of the camera."""

    position: tuple[float, ...]
    focus: tuple[float, ...]
    up: tuple[float, ...]
    angle: tuple[float, ...]  # degrees
    parallel: tuple[float, ...]
    scale: tuple[float, ...]
    range: tuple[float, ...]

    @classmethod
    def of(cls, view: View) -> Camera:
        """Return the camera of *view*."""
        camera = view.camera
        values = camera.GetViewAngle(), camera.GetParallelProjection(), camera.GetParallelScale()
        angle, parallel, scale = ((float(value),) for value in values)
        vectors = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
        return cls(*vectors, angle, parallel, scale, camera.GetClippingRange())

    @classmethod
    def read(cls, words: list[str]) -> Camera:
        """Parse the *words* after the name."""
        found = {}
        for field, n in zip(fields(cls), (3, 3, 3, 1, 1, 1, 2), strict=True):
            if words[:1] != [field.name] or len(words) <= n:
                raise ValueError(
                    f"expected {field.name!r} and {n} numbers; got {' '.join(words)[:60]!r}"
                )
            found[field.name] = tuple(parse_float(word) for word in words[1 : n + 1])
            words = words[n + 1 :]
        require_count(words, 0)
        camera = cls(**found)
        near, far = camera.range
        sound = camera.position != camera.focus and any(camera.up) and camera.scale[0] > 0.0
        if not (sound and 0.0 < near < far and 0.0 < camera.angle[0] < 180.0):
            raise ValueError(
                "invalid camera: position and focus must differ, up and scale must not be 0, angle "
                "must be between 0 and 180, and range must be positive and increasing"
            )
        return camera

    def __str__(self) -> str:
        parts = (
            f"{field.name} {' '.join(repr(float(x)) for x in getattr(self, field.name))}"
            for field in fields(self)
        )
        return f"Camera {' '.join(parts)}"

    def send(self, view: View) -> None:
        """Set the camera of *view*."""
        to, now = view.camera, Camera.of(view)
        # Only changed values: VTK normalises `up` whenever it is set, which changes its last digit.
        for name, set_value in (
            ("position", to.SetPosition), ("focus", to.SetFocalPoint), ("up", to.SetViewUp),
            ("angle", to.SetViewAngle), ("parallel", lambda on: to.SetParallelProjection(on > 0)),
            ("scale", to.SetParallelScale), ("range", to.SetClippingRange),
        ):  # fmt: skip
            if getattr(now, name) != getattr(self, name):
                set_value(*getattr(self, name))
        view.request_render()


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

    @classmethod
    def of(cls, name: str, interactor: Any) -> Input:
        """Return the current event of *interactor*."""
        x, y = interactor.GetEventPosition()
        modifiers = interactor.GetShiftKey(), interactor.GetControlKey(), interactor.GetAltKey()
        shift, control, alt = map(bool, modifiers)
        key, code = None, 0
        if "Key" in name or name == "Char":
            symbol, code = interactor.GetKeySym() or "", ord(interactor.GetKeyCode() or "\0")
            key = symbol if symbol.split() == [symbol] else None
            code = code if code < 128 else 0  # the key symbol suffices
        return cls(name, x, y, shift, control, alt, key, code)

    @classmethod
    def read(cls, name: str, words: list[str]) -> Input:
        """Parse the *words* after the name."""
        x, y = (parse_int(word, -_FARTHEST, _FARTHEST) for word in require_count(words[:2], 2))
        keys: dict[str, Any] = {}
        for word in words[2:]:
            option, _, value = word.partition("=")
            if word in ("shift", "control", "alt"):
                keys[word] = True
            elif option == "key" and value:
                keys["key"] = value
            elif option == "code":
                keys["code"] = parse_int(value, 0, 127)
            else:
                raise ValueError(f"{word!r} is not shift, control, alt, key=NAME or code=NUMBER")
        return cls(name, x, y, **keys)

    def __str__(self) -> str:
        words = [self.name, str(self.x), str(self.y)]
        words += [word for word in ("shift", "control", "alt") if getattr(self, word)]
        words += [f"key={self.key}"] * bool(self.key) + [f"code={self.code}"] * bool(self.code)
        return " ".join(words)

    def send(self, view: View) -> None:
        """Send the event again."""
        to = view.interactor
        to.SetEventInformation(
            self.x, self.y, self.control, self.shift, chr(self.code), 0, self.key
        )
        to.SetAltKey(self.alt)
        to.InvokeEvent(f"{self.name}Event")


@dataclass(frozen=True)
class Ticks:
    """Consecutive timer events."""

    times: int

    def __str__(self) -> str:
        return f"Timer {self.times}"

    def send(self, view: View) -> None:
        """Send the timer events again."""
        for _ in range(self.times):
            view.interactor.InvokeEvent("TimerEvent")


@dataclass(frozen=True)
class Steps:
    """The number of solver steps of a solve during the last event; prescribed before the event."""

    number: int

    def __str__(self) -> str:
        return f"Steps {self.number}"

    def send(self, view: View) -> None:
        """Do nothing; see `step_budget.prescribe_steps`."""


@dataclass(frozen=True)
class Finish:
    """The pose was finished on the mesh in the background."""

    def __str__(self) -> str:
        return "Finish"

    def send(self, view: View) -> None:
        """Finish the pose."""
        request_finish(view.interactor)


@dataclass(frozen=True)
class Keys:
    """The keys of actions of the editor; the other actions have their default keys."""

    assigned: tuple[tuple[str, tuple[str, ...]], ...]

    @classmethod
    def of(cls, keys: Mapping[str, Sequence[str]]) -> Keys:
        """Return the *keys* of actions; ArgumentError if a recording cannot store them."""
        names = all_of([*require(keys, Mapping, "keys")], str, "keys")
        entry = cls(tuple((name, all_of(keys[name], str, f"keys[{name!r:.40}]")) for name in names))
        words = str(entry).split(" ")[1:]
        if len(words) > _MOST_ACTIONS or not all(map(_ASSIGNED.fullmatch, words)):
            raise ArgumentError(f"keys must be those of actions, undo=u; got {shown(keys)}")
        return entry

    @classmethod
    def read(cls, words: list[str]) -> Keys:
        """Parse the *words* after the name."""
        found = [_ASSIGNED.fullmatch(word) for word in words[: _MOST_ACTIONS + 1]]
        if len(found) > _MOST_ACTIONS or not all(found):
            raise ValueError("expected actions with their keys, as in undo=ctrl+z,u")
        pairs = [each.groups() for each in found if each is not None]
        return cls(tuple((name, tuple(filter(None, keys.split(",")))) for name, keys in pairs))

    def __str__(self) -> str:
        return " ".join(["Keys", *(f"{name}={','.join(keys)}" for name, keys in self.assigned)])

    def send(self, view: View) -> None:
        """Use these keys until the replay ends."""
        set_recorded_keys(view.interactor, dict(self.assigned))


def read_entry(text: str) -> tuple[float, Entry]:
    """Parse a line into its time and its entry; a ValueError describes the fault."""
    moment, *words = text.split()
    if not words:
        raise ValueError(f"expected a time and an event; got {text[:60]!r}")
    time, name, rest = parse_float(moment), words[0], words[1:]
    if name in EVENTS:
        return time, Input.read(name, rest)
    if name == "Window":
        return time, Window.read(rest)
    if name == "Camera":
        return time, Camera.read(rest)
    if name == "Timer":
        return time, Ticks(parse_int(require_count(rest, 1)[0], 1, _MOST_TICKS))
    if name == "Steps":
        return time, Steps(parse_int(require_count(rest, 1)[0], 1, _MOST_STEPS))
    if name == "Finish":
        require_count(rest, 0)
        return time, Finish()
    if name == "Keys":
        return time, Keys.read(rest)
    raise ValueError(f"{name[:40]!r} is not an event of a recording")
