"""Press, move and release as one generator function, independent of any toolkit.

A gesture is a generator.  It starts at a press, receives every following `Pointer`, and ends
when it returns.  The code from press to release reads from top to bottom:

    def stroke(press: Pointer) -> Gesture:
        painted = [press.position]
        while (pointer := (yield)).phase is Phase.MOVE:
            painted.append(pointer.position)
        if pointer.phase is Phase.RELEASE:  # and not CANCEL
            keep(painted)

`Grab` runs one gesture at a time.  Positions are in pixels from the window's lower left corner,
as in VTK.

Source
------
The design follows napari's mouse callbacks (napari contributors, https://napari.org).
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from vtk_segdeform.arrays import FloatArray


class Phase(enum.Enum):
    """The kind of a pointer event."""

    HOVER = enum.auto()
    PRESS = enum.auto()
    MOVE = enum.auto()
    RELEASE = enum.auto()
    CANCEL = enum.auto()


@dataclass(frozen=True)
class Pointer:
    """A pointer event: its phase, its position, and the modifier keys."""

    phase: Phase
    x: float
    y: float
    shift: bool = False
    control: bool = False
    alt: bool = False

    @property
    def position(self) -> FloatArray:
        """(2,) float: x and y, pixels from the window's lower left corner."""
        return np.array([self.x, self.y])


Gesture = Generator[None, Pointer, None]


class Grab:
    """Runs the current gesture, if there is one.

    A gesture that raises has ended; the exception propagates to the sender of the event.

    An event may arrive while the gesture still handles another one, if a listener runs the event
    loop.  It is queued until the gesture is ready.
    """

    def __init__(self) -> None:
        self._gesture: Gesture | None = None
        self._last: Pointer | None = None
        self._queue: deque[Pointer] = deque()
        self._is_handling = False

    @property
    def is_active(self) -> bool:
        """Whether a gesture is running."""
        return self._gesture is not None

    def begin(self, gesture: Gesture, press: Pointer) -> None:
        """Run *gesture* up to its first yield; finish a running one first."""
        self.finish()
        self._gesture, self._last = gesture, press
        self._advance(None)

    def send(self, pointer: Pointer) -> None:
        """Send *pointer* to the gesture; a release or a cancel ends it."""
        if self._queue and self._queue[-1].phase is pointer.phase is Phase.MOVE:
            self._queue.pop()  # superseded by the later position
        self._queue.append(pointer)
        if self._is_handling:
            return
        self._is_handling = True
        try:
            while self._queue:
                self._handle(self._queue.popleft())
        finally:
            self._queue.clear()
            self._is_handling = False

    def _handle(self, pointer: Pointer) -> None:
        if self._gesture is None:
            return
        self._last = pointer
        gesture = self._gesture
        self._advance(pointer)
        if pointer.phase in (Phase.RELEASE, Phase.CANCEL) and self._gesture is gesture:
            self._gesture = None
            gesture.close()

    def finish(self) -> None:
        """Finish a running gesture, as if the button had been released."""
        self._end(Phase.RELEASE)

    def cancel(self) -> None:
        """Cancel a running gesture; it undoes its changes."""
        self._end(Phase.CANCEL)

    def _end(self, phase: Phase) -> None:
        if self._last is not None:
            self.send(replace(self._last, phase=phase))

    def _advance(self, pointer: Pointer | None) -> None:
        gesture = self._gesture
        if gesture is None:
            return
        is_running = False
        try:
            if pointer is None:
                next(gesture)
            else:
                gesture.send(pointer)
            is_running = True
        except StopIteration:
            pass
        finally:
            if not is_running and self._gesture is gesture:
                self._gesture = None
