"""Drawing fast while something moves, and in full quality when it has come to rest.

In software, multi-sampling takes half the time of a picture or more, and a mesh of a million
vertices half a second without it; in motion nobody sees the difference.  `Draft.begin` turns off
the anti-aliasing of a view, and announces the motion over its interactor: a `SurfaceDisplay` then
draws a large mesh decimated.  Where pictures are slow they remain drafts while the
view spares another thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, cast

from vtkmodules.util.vtkConstants import VTK_INT
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkRenderingOpenGL2 import vtkSSAAPass

from .view import Stop, View

SLOW = 0.040  # seconds for a picture, beyond which motion is not smooth
_ANNOUNCED = vtkCommand.UserEvent + 9703  # a number unlikely to be in use elsewhere
_REST = 0.2  # seconds without a move, after which pictures are drawn in full quality
_PERIOD = 50  # milliseconds between two looks at the time


def observe_drafts(interactor: Any, callback: Callable[[bool], None]) -> Stop:
    """Call ``callback(True)`` when pictures become drafts, ``callback(False)`` when they end."""

    def called(_: Any, __: str, begins: int) -> None:
        callback(bool(begins))

    called.CallDataType = VTK_INT  # type: ignore[attr-defined]
    tag = interactor.AddObserver(_ANNOUNCED, called)
    # During a camera drag the style withholds all events except from passive observers.
    interactor.GetCommand(tag).SetPassiveObserver(True)
    return lambda: interactor.RemoveObserver(tag)


class Draft:
    """Switches a view to drafts and back.

    Attributes
    ----------
    seconds : float
        What the last picture in full quality took.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._restore: list[Callable[[], object]] = []  # what `end` calls
        self._stop: Stop | None = None
        self._begun = 0.0
        self._is_slow = False
        self._drawn_since, self.seconds = 0.0, 0.0
        for event, callback in (("StartEvent", self._starts), ("EndEvent", self._ends)):
            view.renderer.AddObserver(event, callback)

    @classmethod
    def of(cls, view: View) -> Draft:
        """Return the one that all widgets in *view* share."""
        if view.draft is None:
            view.draft = cls(view)
        return cast(Draft, view.draft)

    @property
    def is_active(self) -> bool:
        """Whether pictures are drafts."""
        return self._stop is not None

    def begin(self, *, if_slow: bool = False) -> None:
        """Draw drafts until `end`, or until this was not called for 0.2 s.

        With *if_slow* only where the last picture took longer than smooth motion allows.
        """
        self._begun = time.perf_counter()
        window, renderer = self._view.window, self._view.renderer
        if window is None:
            return
        if self._stop is None:
            self._is_slow = self.seconds > SLOW
            if if_slow and not self._is_slow:
                return
        self._view.interactor.InvokeEvent(
            _ANNOUNCED, 1
        )  # again at each move: what was not ready may be now
        if self._stop is not None:
            return
        if samples := window.GetMultiSamples():
            window.SetMultiSamples(0)
            self._restore.append(lambda: window.SetMultiSamples(samples))
        if renderer.GetUseFXAA():
            renderer.SetUseFXAA(False)
            self._restore.append(lambda: renderer.SetUseFXAA(True))
        if isinstance(supersampling := renderer.GetPass(), vtkSSAAPass):
            renderer.SetPass(None)
            self._restore.append(lambda: renderer.SetPass(supersampling))
        self._stop = self._view.every(_PERIOD, self._tick)

    def end(self) -> None:
        """Draw as before `begin`, and once now if that makes a difference.

        Where pictures are slow, do so once the view spares no other thread.
        """
        self._begun = -math.inf
        if self._stop is None or (self._is_slow and self._view.is_sparing):
            return
        self._stop()
        self._stop = None
        is_open = self._view.window is not None
        changes = bool(self._restore)
        while self._restore:
            restore = self._restore.pop()
            if is_open:
                restore()
        self._view.interactor.InvokeEvent(_ANNOUNCED, 0)
        if changes:
            self._view.request_render()

    def _starts(self, *_: object) -> None:
        self._drawn_since = time.perf_counter()

    def _ends(self, *_: object) -> None:
        """Measure a picture; most drivers go on drawing after they have returned."""
        if self._stop is None:
            self._view.renderer.GetRenderWindow().WaitForCompletion()
            self.seconds = time.perf_counter() - self._drawn_since

    def _tick(self) -> None:
        if time.perf_counter() - self._begun > _REST:
            self.end()
        if self._stop is not None:  # what was not ready at the last move may be now
            self._view.interactor.InvokeEvent(_ANNOUNCED, 1)
