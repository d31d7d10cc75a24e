"""Press, move, release, told as one function; no toolkit in sight.

A gesture is a generator.  It begins at a press, is sent every `Pointer` that follows, and ends
by returning; what happens from press to release is read from top to bottom:

    def stroke(press: Pointer) -> Gesture:
        painted = [press.position]
        while (pointer := (yield)).phase is Phase.MOVE:
            painted.append(pointer.position)
        if pointer.phase is Phase.RELEASE:  # and not CANCEL
            keep(painted)

`Grab` runs one gesture at a time.  Positions are those of the window, as VTK counts: pixels from
its lower left corner.

Source
------
The manner is that of napari's mouse callbacks (napari contributors, https://napari.org).
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from vtk_segdeform.arrays import FloatArray


class Phase(enum.Enum):
    """What the pointer does."""

    HOVER = enum.auto()
    PRESS = enum.auto()
    MOVE = enum.auto()
    RELEASE = enum.auto()
    CANCEL = enum.auto()


@dataclass(frozen=True)
class Pointer:
    """Where the pointer is, and what is held down."""

    phase: Phase
    x: float
    y: float
    shift: bool = False
    control: bool = False

    @property
    def position(self) -> FloatArray:
        """(2,) float: x and y, pixels from the window's lower left corner."""
        return np.array([self.x, self.y])


Gesture = Generator[None, Pointer, None]


class Grab:
    """The gesture that has the pointer, if any.

    A gesture that raises has lost the pointer; the exception goes on to whoever sent the event.

    An event may arrive while the gesture is still handling another one, if a listener lets the
    event loop run; it is queued until the gesture is ready for it.
    """

    def __init__(self) -> None:
        self._gesture: Gesture | None = None
        self._last: Pointer | None = None
        self._waiting: deque[Pointer] = deque()
        self._is_working = False

    @property
    def is_active(self) -> bool:
        """Whether a gesture is going on."""
        return self._gesture is not None

    def begin(self, gesture: Gesture, press: Pointer) -> None:
        """Run *gesture* until it waits for the next pointer; finish an ongoing one first."""
        self.finish()
        self._gesture, self._last = gesture, press
        self._advance(None)

    def send(self, pointer: Pointer) -> None:
        """Tell the gesture of *pointer*; after a release or a cancel it has ended."""
        if self._waiting and self._waiting[-1].phase is pointer.phase is Phase.MOVE:
            self._waiting.pop()  # superseded by the later position
        self._waiting.append(pointer)
        if self._is_working:
            return
        self._is_working = True
        try:
            while self._waiting:
                self._pass_on(self._waiting.popleft())
        finally:
            self._waiting.clear()
            self._is_working = False

    def _pass_on(self, pointer: Pointer) -> None:
        if self._gesture is None:
            return
        self._last = pointer
        gesture = self._gesture
        self._advance(pointer)
        if pointer.phase in (Phase.RELEASE, Phase.CANCEL) and self._gesture is gesture:
            self._gesture = None
            gesture.close()

    def finish(self) -> None:
        """Finish the gesture, if there is one, as if the button had been released."""
        self._end(Phase.RELEASE)

    def cancel(self) -> None:
        """End the gesture, if there is one, as if it had never begun."""
        self._end(Phase.CANCEL)

    def _end(self, phase: Phase) -> None:
        if self._last is not None:
            self.send(replace(self._last, phase=phase))

    def _advance(self, pointer: Pointer | None) -> None:
        gesture = self._gesture
        if gesture is None:
            return
        going_on = False
        try:
            if pointer is None:
                next(gesture)
            else:
                gesture.send(pointer)
            going_on = True
        except StopIteration:
            pass
        finally:
            if not going_on and self._gesture is gesture:
                self._gesture = None
