"""The camera by mouse, alike in every host and every interactor style.

    Alt and left drag       orbit; beside the model without Alt
    middle drag             pan, as Shift with one of the drags above; orbit with `middle_orbits`
    right drag              zoom; also Control with one of the drags above
    right click             `Navigation.right_clicked`, which opens a menu
    wheel                   zoom to the pointer
    double click            frame the part under the pointer; beside the model, frame all

The widgets receive events first, except presses with Alt and wheel events without Shift.  The
events that move the camera do not reach the interactor style of the host; all other observers
receive them, and the style receives every other event.  No drag of the camera withholds keys,
timers or moves of the mouse from anybody.

A drag, or a click that has edited the session, is never the first half of a double click.
A left press while another button moves the camera ends that drag, and edits nothing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.checks import as_switch

from .draft import Draft
from .gestures import Phase, Pointer
from .view import Stop, View
from .viewpoint import Viewpoint

_BELOW_WIDGETS = 0.25  # priority: our widgets have 1, VTK's own 0.5, interactor styles 0
_DOUBLE_CLICKS = 1.25
_ABOVE_STYLE = 1.0  # of the observers of the style itself
_WHEEL = 1.2  # factor of one click of the wheel
_DOLLY = 3.0  # logarithm of the factor of a drag across the height of the view
_DOUBLE_CLICK = 0.4  # seconds between the presses of a double click
_SAME_PLACE = 4.0  # pixels
_BUTTONS = ("Left", "Middle", "Right")


class Navigation:
    """Moves the camera of a view by its mouse events; off until `On`.

    Parameters
    ----------
    view : View
        The view with the camera.
    viewpoint : Viewpoint
        Moves the camera.
    point_at : callable
        ``point_at(pointer)`` returns the point (3,) of the model at a pointer, or None beside it.
    part_at : callable
        ``part_at(pointer)`` returns the points (k, 3) to frame at a pointer, or None beside the
        model.
    state : callable
        Returns an object that is another one after an edit.
    double_clicked : callable, optional
        Handles a double click at a pointer; if it returns False, the part there is framed.

    Attributes
    ----------
    right_clicked : callable
        ``right_clicked(pointer)``, called for a right click: a press without a drag.
    middle_orbits : bool
        Whether the middle button orbits, as the left one beside the model; else it pans.
    """

    def __init__(
        self,
        view: View,
        viewpoint: Viewpoint,
        point_at: Callable[[Pointer], FloatArray | None],
        part_at: Callable[[Pointer], FloatArray | None],
        state: Callable[[], object],
        double_clicked: Callable[[Pointer], bool] = lambda _: False,
    ) -> None:
        self.view, self.viewpoint = view, viewpoint
        self._point_at, self._part_at, self._state = point_at, part_at, state
        self._double_clicked = double_clicked
        self._stops: list[Stop] = []
        self._move: Callable[[float, float], None] | None = None  # of the drag
        self._button = ""
        self._last = np.zeros(2)
        self._click: tuple[float, Pointer, object] | None = None  # the last press
        self.right_clicked: Callable[[Pointer], object] = lambda _: None
        self.middle_orbits = False
        self._right: Pointer | None = None  # the press of the right button
        self._draft = Draft.of(view)
        self._withheld: list[tuple[Any, int]] = []  # observers of styles, for one event

    @property
    def is_dragging(self) -> bool:
        """Whether a drag moves the camera."""
        return self._move is not None

    def On(self) -> None:  # noqa: N802 - VTK's word
        """Start moving the camera."""
        if self._stops:
            return
        observe = self.view.observe
        self._stops = [
            observe("LeftButtonPressEvent", self._left_press, _DOUBLE_CLICKS),
            observe("MouseMoveEvent", self._moved, _BELOW_WIDGETS),
            observe("MouseWheelForwardEvent", lambda: self._wheel("Forward", 1), _BELOW_WIDGETS),
            observe("MouseWheelBackwardEvent", lambda: self._wheel("Backward", -1), _BELOW_WIDGETS),
        ]
        for button in _BUTTONS:
            press, release = f"{button}ButtonPressEvent", f"{button}ButtonReleaseEvent"
            self._stops += [
                observe(press, partial(self._press, button), _BELOW_WIDGETS),
                # Before the widgets: a release must never be missed.
                observe(release, partial(self._release, button), _DOUBLE_CLICKS),
            ]

    def Off(self) -> None:  # noqa: N802
        """Leave the camera to the interactor style."""
        self.viewpoint.finish()
        self._move = self._click = self._right = None
        self._end_withholding()
        self._draft.end()
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
        """Return whether it is on."""
        return bool(self._stops)

    def orbit(self, pointer: Pointer, button: str = "Left") -> None:
        """Orbit with the drag that *pointer* begins, until *button* is released."""
        self._begin(pointer, button, "orbit", None)

    def end_drag(self) -> None:
        """End a drag of the camera."""
        self._move = None

    # Events.

    def _press(self, button: str) -> bool:
        self._end_withholding()
        pointer = self.view.pointer(Phase.PRESS)
        if not self.view.contains(pointer) or not self._is_mine(pointer):
            return False
        self._withhold(f"{button}ButtonPressEvent")
        kind = {"Left": "orbit", "Middle": "pan", "Right": "zoom"}[button]
        if button == "Left" or (button == "Middle" and self.middle_orbits):
            kind = "pan" if pointer.shift else "zoom" if pointer.control else "orbit"
        self._begin(pointer, button, kind, self._point_at(pointer))
        self._right = pointer if button == "Right" else None
        return False

    def _begin(self, pointer: Pointer, button: str, kind: str, point: FloatArray | None) -> None:
        viewpoint = self.viewpoint
        viewpoint.finish()
        focus = np.array(self.view.camera.GetFocalPoint())
        if kind == "orbit":
            axis, pivot = viewpoint.turning_axis(), focus if point is None else point
            self._move = lambda dx, dy: viewpoint.orbit(dx, dy, pivot, axis)
        elif kind == "pan":
            pivot = viewpoint.pivot_at(pointer) if point is None else point
            self._move = lambda dx, dy: viewpoint.pan(dx, dy, pivot)
        else:
            height = max(1, self.view.renderer.GetSize()[1])
            self._move = lambda _, dy: viewpoint.zoom(math.exp(_DOLLY * dy / height), focus)
        self._button, self._last = button, pointer.position

    def _moved(self) -> bool:
        self._end_withholding()
        if self._move is not None:
            place = self.view.pointer(Phase.MOVE).position
            dx, dy = place - self._last
            self._last = place
            if dx or dy:
                self._draft.begin()
                self._move(float(dx), float(dy))
        return False

    def _release(self, button: str) -> bool:
        self._end_withholding()
        if button == self._button:
            self._move = None
        pointer, press = self.view.pointer(Phase.RELEASE), self._right
        if button == "Right" and press is not None:
            self._right = None
            if not press.alt and np.linalg.norm(pointer.position - press.position) <= _SAME_PLACE:
                self.right_clicked(press)
        if button == "Left" and self._click is not None:
            moved = self.view.pointer(Phase.RELEASE).position - self._click[1].position
            if np.linalg.norm(moved) > _SAME_PLACE:
                self._click = None  # it was a drag
        return False

    def _wheel(self, direction: str, clicks: int) -> bool:
        self._end_withholding()
        pointer = self.view.pointer(Phase.HOVER)
        if not self.view.contains(pointer) or not self._is_mine(pointer):
            return False
        self._withhold(f"MouseWheel{direction}Event")
        self.viewpoint.finish()
        point = self._point_at(pointer)
        pivot = self.viewpoint.pivot_at(pointer) if point is None else point
        self._draft.begin()
        self.viewpoint.zoom(_WHEEL**clicks, pivot)
        return False

    def _left_press(self) -> bool:
        self._end_withholding()
        is_second = self._move is not None and self._button != "Left"
        self._move = None  # in case the last release never arrived
        if is_second:
            self._click = None
            return True
        pointer, now = self.view.pointer(Phase.PRESS), time.monotonic()
        last, self._click = self._click, (now, pointer, self._state())
        if (
            last is None
            or now - last[0] > _DOUBLE_CLICK
            or np.linalg.norm(pointer.position - last[1].position) > _SAME_PLACE
            or last[2] is not self._click[2]
            or any(
                (each.alt, each.shift, each.control) != (False,) * 3 for each in (pointer, last[1])
            )
            or not (self.view.contains(pointer) and self._is_mine(pointer))
        ):
            return False
        self._click = None
        self._withhold("LeftButtonPressEvent")
        if not self._double_clicked(pointer):
            self.viewpoint.frame(self._part_at(pointer))
        return True

    def _is_mine(self, pointer: Pointer) -> bool:
        """Return whether no interactive renderer above this one is at *pointer*."""
        window = self.view.renderer.GetRenderWindow()
        renderers = window.GetRenderers()
        x, y = pointer.position
        for k in range(renderers.GetNumberOfItems()):
            other = renderers.GetItemAsObject(k)
            if (
                other is not self.view.renderer
                and other.GetInteractive()
                and other.GetLayer() > self.view.renderer.GetLayer()
                and other.IsInViewport(round(x), round(y))
            ):
                return False
        return True

    # The interactor style.

    def _withhold(self, event: str) -> None:
        """Keep the current *event* from the interactor style, and only from that."""
        style = self.view.interactor.GetInteractorStyle()
        if hasattr(style, "GetCurrentStyle"):  # VTK's default switches between several
            style = style.GetCurrentStyle()
        if style is None:
            return

        def withhold(*_: object) -> None:
            style.GetCommand(tag).SetAbortFlag(1)

        tag: int = style.AddObserver(event, withhold, _ABOVE_STYLE)
        self._withheld.append((style, tag))

    def _end_withholding(self) -> None:
        for style, tag in self._withheld:
            style.RemoveObserver(tag)
        self._withheld = []
