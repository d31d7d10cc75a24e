"""A renderer with its interactor, from VTK alone, a pyvista plotter or a Qt widget.

Exceptions in callbacks are caught: VTK would only print them, and pyvista would turn them into
warnings.  Here they reach the listeners of `on_failure`, such as a status line or a test.

During a camera drag VTK's interactor style withholds all events from other observers, unless the
camera is moved by `Navigation`.  Anything that follows the camera therefore uses `before_render`.

`View.every` shares a single repeating timer among all views of an interactor, and nothing else in
this package creates or destroys timers.  Some hosts, pyvistaqt among them, drive all VTK timers by
one timer of their own, and stop it when any VTK timer is destroyed.

Long because events, timers and drawing of one window depend on each other.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - both register the rendering backends
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkCommand, vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindowInteractor

from vtk_segdeform.arrays import is_number, is_whole
from vtk_segdeform.checks import as_callable, as_text, shown
from vtk_segdeform.errors import ArgumentError, ConstraintError
from vtk_segdeform.importing import imported

from .foreground import Foreground
from .gestures import Phase, Pointer
from .projection import Projection

_log = logging.getLogger(__name__)

Stop = Callable[[], None]
_LONGEST_PERIOD = 86_400_000  # milliseconds between ticks: a day
ABOVE_CAMERA = 1.0  # priority: VTK's own widgets have 0.5, camera styles 0
_SHARE_DRAWN = 0.1  # of the time, at most, while another thread is spared
_LONGEST_PAUSE = 0.5  # seconds; the next picture may be a draft, and quick to draw
_KEY_MARK = vtkCommand.UserEvent + 411  # never invoked: marks renderers whose views observe keys


class View(Projection):
    """One renderer in one window.

    Parameters
    ----------
    renderer : vtkRenderer
        Draws the widgets.
    interactor : vtkRenderWindowInteractor
        Belongs to the renderer's window.
    """

    def __init__(self, renderer: Any, interactor: Any) -> None:
        super().__init__(renderer)
        self.interactor = interactor
        self._widget: Any = None  # of Qt, if the view is known to be in one
        self._timer = _SharedTimer.of(interactor)
        self._failures: list[Callable[[Exception], None]] = []
        self._foreground: Foreground | None = None
        self._stop_foreground: Stop | None = None
        self._depth = 0  # number of nested callbacks
        self._render_requested = False
        self.draft: Any = None  # of `Draft.of`
        self.host: Callable[[], None] | None = None
        """Called by `render` instead of `draw`, by a host that calls `draw` later, as in a page."""
        self._n_spared = 0  # threads that drawing must not hold up
        self._drawn, self._drawing_time = -math.inf, 0.0  # end and duration of the last picture

    @classmethod
    def of(cls, view: Any) -> View:
        """Return the view of a pyvista plotter, of a (renderer, interactor), or *view* itself."""
        if isinstance(view, cls):
            return view
        if isinstance(view, tuple) and len(view) == 2:
            return cls(*_checked_pair(*view))
        if hasattr(view, "iren") and hasattr(view, "renderer"):
            if view.iren is None:
                raise ArgumentError("view: this plotter has no interactor, or was closed")
            made = cls(view.renderer, view.iren.interactor)
            made._widget = view if hasattr(view, "installEventFilter") else None
            return made
        raise ArgumentError(
            f"view must be a pyvista plotter or (renderer, interactor); got {shown(view)}"
        )

    @property
    def window(self) -> Any:
        """The vtkRenderWindow, or None once it is closed."""
        window = self.renderer.GetRenderWindow()
        # A closed pyvista plotter keeps its finalised window.  No window is initialised before
        # its first picture.
        closed = window is not None and not (window.GetNeverRendered() or window.GetInitialized())
        return None if closed else window

    @property
    def foreground(self) -> Any:
        """A vtkRenderer with the same camera, drawn over this one; created on first access."""
        if self._foreground is None:
            self._foreground = Foreground(self.renderer)
            self._stop_foreground = self.before_render(self._foreground.follow)
        return self._foreground.renderer

    def remove_foreground(self) -> None:
        """Remove the `foreground` renderer, with all its actors, from the window."""
        if self._foreground is not None and self._stop_foreground is not None:
            self._stop_foreground()
            self._foreground.remove()
            self._foreground = None

    def render(self) -> None:
        """Draw the window, or let the `host` do so; do nothing once it is closed."""
        if self.host is not None:
            self.host()
        else:
            self.draw()

    def draw(self) -> None:
        """Draw the window now; do nothing once it is closed."""
        if self.window is not None:
            began = time.perf_counter()
            self.window.Render()
            self._drawn = time.perf_counter()
            self._drawing_time = self._drawn - began

    def pixels(self) -> NDArray[np.uint8]:
        """Return the last picture of the window, (h, w, 3), the lowest row first."""
        (width, height), values = self.window.GetSize(), vtkUnsignedCharArray()
        self.window.GetPixelData(0, 0, width - 1, height - 1, 0, values, 0)
        pixels: NDArray[np.uint8] = vtk_to_numpy(values).reshape(height, width, 3)
        return pixels

    def request_render(self) -> None:
        """Draw the window once, at the end of the current event; outside an event, draw it now.

        In a widget of pyvistaqt, Qt draws it when it next paints.  Do nothing before the first
        picture of the window.
        """
        if self.window is None or self.window.GetNeverRendered():
            return
        if self._depth:
            self._render_requested = True
        else:
            self._draw_soon()

    def _draw_soon(self) -> None:
        """Draw the window once the host paints its widget, or else now.

        A widget of pyvistaqt draws the scene whenever Qt paints it, and asks to be painted after
        every other picture too: drawn here, each scene would be drawn twice.
        """
        paints = hasattr(self._widget, "paintGL")
        if paints and self.host is None and not self.is_sparing:  # which measures `draw`
            with suppress(RuntimeError):  # Qt has deleted it
                self._widget.update()
        else:
            self.render()

    @property
    def is_sparing(self) -> bool:
        """Whether another thread is left most of the time; see `spare`."""
        return self._n_spared > 0

    def spare(self) -> Stop:
        """Leave most of the time to another thread, until stopped.

        Drawing holds Python's lock, and all processors in software.  Pictures requested by events
        therefore take at most a tenth of the time, or one each half second: one that comes too soon
        is drawn by a later event, so a timer must be running.  `render` and the camera still draw
        at once.
        """
        self._n_spared += 1

        def stop() -> None:
            self._n_spared -= 1
            if self._render_requested and not self._depth:
                with self.drawing_once():
                    pass

        return _once(stop)

    # Events.
    def complete_events(self) -> Stop:
        """Give VTK the events, or parts of them, that the host omits, until the returned call.

        pyvistaqt omits the Alt key and the keypad, among others.
        """
        if self._widget is None:
            return lambda: None
        imported(f"{__package__}.qt_events")  # imports Qt
        from .qt_events import EventFilter

        return EventFilter(self._widget).remove

    def observe(
        self, event: str, callback: Callable[[], bool | None], priority: float = ABOVE_CAMERA
    ) -> Stop:
        """Call *callback* at each *event* of the interactor.

        If it returns True or raises, observers of lower priority do not receive the event.
        """
        as_text(event, "event")
        as_callable(callback, "callback")
        if not is_number(priority):
            raise ArgumentError(f"priority must be a number; got {shown(priority)}")
        tag = 0

        def called(*_: object) -> None:
            consumed: bool | None = True
            try:
                with self.guarded(), self.drawing_once():
                    consumed = callback()
            finally:  # even if a failure listener raises: the camera must not see half a drag
                command = self.interactor.GetCommand(tag)
                if consumed and command is not None:  # the callback may have stopped itself
                    command.SetAbortFlag(1)

        tag = self.interactor.AddObserver(event, called, priority)
        if event != "KeyPressEvent":
            return _once(lambda: self.interactor.RemoveObserver(tag))
        mark = self.renderer.AddObserver(_KEY_MARK, lambda *_: None)

        def stop() -> None:
            self.interactor.RemoveObserver(tag)
            self.renderer.RemoveObserver(mark)

        return _once(stop)

    def before_render(self, callback: Callable[[], None]) -> Stop:
        """Call *callback* before each picture; its changes are part of that picture."""
        as_callable(callback, "callback")

        def called(*_: object) -> None:
            touched, self._depth = self._render_requested, self._depth + 1
            try:
                with self.guarded():
                    callback()
            finally:
                self._render_requested, self._depth = touched, self._depth - 1

        tag = self.renderer.AddObserver("StartEvent", called)
        return _once(lambda: self.renderer.RemoveObserver(tag))

    def lay_out(self) -> None:
        """Run the callbacks of `before_render` without drawing, for hosts that draw themselves."""
        self.renderer.InvokeEvent("StartEvent")

    def every(self, milliseconds: int, callback: Callable[[], None]) -> Stop:
        """Call *callback* repeatedly from the event loop, until stopped.

        All subscribers of an interactor share one timer with the shortest of their periods, and
        each is called at every tick, so at least once in *milliseconds*.  A callback may stop
        itself and others; if one raises, the others are still called.
        """
        if not is_whole(milliseconds, 1, _LONGEST_PERIOD):
            raise ArgumentError(
                f"milliseconds must be a whole number, 1 to {_LONGEST_PERIOD}; "
                f"got {shown(milliseconds)}"
            )
        as_callable(callback, "callback")

        def ticked(*_: object) -> None:
            with self.guarded(), self.drawing_once():
                callback()

        tag = self.interactor.AddObserver("TimerEvent", ticked, ABOVE_CAMERA)
        release = self._timer.require(milliseconds)

        def stop() -> None:
            self.interactor.RemoveObserver(tag)
            release()

        return _once(stop)

    @property
    def is_addressed(self) -> bool:
        """Whether key presses go to this view: the pointer is not over another view with keys."""
        pointer = self.pointer(Phase.HOVER)
        other = self.interactor.FindPokedRenderer(*self.interactor.GetEventPosition())
        elsewhere = other is not None and other.HasObserver(_KEY_MARK)
        return self.contains(pointer) or not (elsewhere and Projection(other).contains(pointer))

    def pointer(self, phase: Phase) -> Pointer:
        """Return the current pointer position of the interactor, with the given *phase*."""
        x, y = self.interactor.GetEventPosition()
        shift, control = self.interactor.GetShiftKey(), self.interactor.GetControlKey()
        alt = bool(self.interactor.GetAltKey())
        return Pointer(phase, float(x), float(y), bool(shift), bool(control), alt)

    # Failures.
    def on_failure(self, listener: Callable[[Exception], None]) -> Stop:
        """Call ``listener(error)`` for every exception in a callback, until stopped."""
        self._failures.append(as_callable(listener, "listener"))
        return _once(lambda: self._failures.remove(listener))

    @contextmanager
    def guarded(self, *, only_refusals: bool = False) -> Iterator[None]:
        """Pass exceptions raised inside to the failure listeners; without any, re-raise them.

        With *only_refusals*, pass on `ConstraintError` only.
        """
        try:
            yield
        except Exception as error:  # the border to the event loop: any exception may arrive
            if only_refusals and not isinstance(error, ConstraintError):
                raise
            _log.info("a callback failed", exc_info=True)
            if not self._failures:
                raise
            with ExitStack() as stack:  # every listener is called, even if another one raises
                for listener in reversed(self._failures):
                    stack.callback(listener, error)

    @contextmanager
    def drawing_once(self) -> Iterator[None]:
        """Request a picture, if any, at the end of the outermost ``with`` block or event."""
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1
            if self._render_requested and not self._depth and self._is_due():
                self._render_requested = False
                self._draw_soon()

    def _is_due(self) -> bool:
        """Return whether a picture may be drawn now; see `spare`."""
        pause = min(self._drawing_time * (1.0 / _SHARE_DRAWN - 1.0), _LONGEST_PAUSE)
        return not self._n_spared or time.perf_counter() >= self._drawn + pause


class _SharedTimer:
    """The shared repeating timer of an interactor, running while any subscriber requires it.

    If the host stops it together with a timer of another owner, such as a hovering widget or a
    camera style, it is restarted.
    """

    _shared: WeakValueDictionary[int, _SharedTimer] = WeakValueDictionary()

    def __init__(self, interactor: Any) -> None:
        self._interactor = interactor
        self._periods: list[int] = []
        self._period: int | None = None  # of the running timer
        self._id = self._tag = 0
        self._is_changing = False

    @classmethod
    def of(cls, interactor: Any) -> _SharedTimer:
        """Return the timer of *interactor*, the same one as long as it is referenced."""
        # The timer keeps its interactor alive, so its id stays unique.
        return cls._shared.setdefault(id(interactor), cls(interactor))

    def require(self, milliseconds: int) -> Stop:
        """Tick at least once in *milliseconds*, until the returned function is called."""
        self._periods.append(milliseconds)
        self._update()

        def release() -> None:
            self._periods.remove(milliseconds)
            self._update()

        return release

    def _update(self) -> None:
        """Run a timer with the shortest required period, or none."""
        period = min(self._periods, default=None)
        if period == self._period:
            return
        self._is_changing = True
        try:
            if self._period is not None:
                self._interactor.DestroyTimer(self._id)
                self._interactor.RemoveObserver(self._tag)
            if period is not None:
                self._id = self._interactor.CreateRepeatingTimer(period)
                # Lowest priority: called after the host has stopped its timer.
                self._tag = self._interactor.AddObserver("DestroyTimerEvent", self._revive, -1.0)
            self._period = period
        finally:
            self._is_changing = False

    def _revive(self, *_: object) -> None:
        """Restart the timer if a different one is being destroyed."""
        interactor = self._interactor
        destroyed = interactor.GetVTKTimerId(interactor.GetTimerEventPlatformId())
        if destroyed != self._id and not self._is_changing:
            self._is_changing = True
            try:
                interactor.ResetTimer(self._id)
            finally:
                self._is_changing = False


def _once(action: Callable[[], object]) -> Stop:
    """Return a function that calls *action* only the first time."""
    pending = [action]

    def stop() -> None:
        if pending:
            pending.pop()()

    return stop


def _checked_pair(renderer: Any, interactor: Any) -> tuple[Any, Any]:
    kinds = (renderer, vtkRenderer), (interactor, vtkRenderWindowInteractor)
    for thing, kind in kinds:
        if not isinstance(thing, kind):
            raise ArgumentError(f"view must be (vtkRenderer, {kind.__name__}); got {shown(thing)}")
    if renderer.GetRenderWindow() is None:
        raise ArgumentError(
            "view: the renderer has no window; call window.AddRenderer(renderer) first"
        )
    return renderer, interactor
