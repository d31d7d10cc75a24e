"""A renderer and its interactor, wherever they come from, and what widgets need of the two.

Callbacks are guarded: an exception in one would be printed by VTK, or turned into a warning by
pyvista, and be lost.  Here it reaches the listeners of `on_failure`: a status line, a test.

While a camera style drags it keeps all mouse events to itself, so whoever has to follow the
camera asks for `before_render` instead.  Keys it would keep as well, and answer by VTK's own
commands, such as stereo at "3": a key, unless it only modifies, ends the camera's drag first.

`View.every` shares a single repeating timer among all views of an interactor, and nothing else in
this package creates or destroys timers.  Some hosts, pyvistaqt among them, drive all VTK timers by
one timer of their own, and stop it when any VTK timer is destroyed.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from weakref import WeakValueDictionary

import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - both: what renders, for whom pyvista is not
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindowInteractor

from vtk_segdeform.arrays import is_number, is_whole
from vtk_segdeform.checks import as_callable, as_text, shown
from vtk_segdeform.errors import ArgumentError

from .front import Front
from .gestures import Phase, Pointer
from .sight import Sight

_log = logging.getLogger(__name__)

Stop = Callable[[], None]
_LONGEST = 86_400_000  # milliseconds between ticks: a day
ABOVE_CAMERA = 1.0  # priority: VTK's own widgets have 0.5, camera styles 0
_MODIFIERS = ("Shift", "Control", "Alt", "Super", "Meta", "Caps_Lock", "ISO_Level")
_HEARS_KEYS = vtkCommand.UserEvent + 411  # never happens: a mark on renderers whose views do


class View(Sight):
    """One renderer in one window.

    Parameters
    ----------
    renderer : vtkRenderer
        Where the widgets are drawn.
    interactor : vtkRenderWindowInteractor
        That of the renderer's window.
    """

    def __init__(self, renderer: Any, interactor: Any) -> None:
        super().__init__(renderer)
        self.interactor = interactor
        self._timer = _SharedTimer.of(interactor)
        self._failures: list[Callable[[Exception], None]] = []
        self._front: Front | None = None
        self._stop_front: Stop | None = None
        self._depth = 0  # of callbacks within callbacks
        self._touched = False

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
            return cls(view.renderer, view.iren.interactor)
        raise ArgumentError(
            f"view must be a pyvista plotter or (renderer, interactor); got {shown(view)}"
        )

    @property
    def window(self) -> Any:
        """The vtkRenderWindow, or None once it is closed."""
        window = self.renderer.GetRenderWindow()
        # pyvista finalises a window and keeps it; before its first picture none is initialised.
        closed = window is not None and not (window.GetNeverRendered() or window.GetInitialized())
        return None if closed else window

    @property
    def front(self) -> Any:
        """A vtkRenderer that looks the same way, its actors hidden by nothing; made on demand."""
        if self._front is None:
            self._front = Front(self.renderer)
            self._stop_front = self.before_render(self._front.follow)
        return self._front.renderer

    def remove_front(self) -> None:
        """Take the `front` renderer out of the window, with all that is in it."""
        if self._front is not None and self._stop_front is not None:
            self._stop_front()
            self._front.remove()
            self._front = None

    def render(self) -> None:
        """Draw everything; nothing happens once the window is closed."""
        if self.window is not None:
            self.window.Render()

    def touch(self) -> None:
        """See that what has changed is drawn: at the end of the event in hand, or else now.

        Nothing happens before the window was drawn for the first time.
        """
        if self._depth:
            self._touched = True
        elif self.window is not None and not self.window.GetNeverRendered():
            self.render()

    # What happens.

    def observe(
        self, event: str, callback: Callable[[], bool | None], priority: float = ABOVE_CAMERA
    ) -> Stop:
        """Call *callback* at each of an interactor's events.

        Where it returns True, or fails, those of lower priority do not hear of the event.
        """
        as_text(event, "event")
        as_callable(callback, "callback")
        if not is_number(priority):
            raise ArgumentError(f"priority must be a number; got {shown(priority)}")
        tag = 0

        def called(*_: object) -> None:
            taken: bool | None = True
            try:
                with self.guarded(), self._drawn_after():
                    taken = callback()
            finally:  # also where a listener of failures fails: a camera would hear half a drag
                command = self.interactor.GetCommand(tag)
                if taken and command is not None:  # the callback may have stopped itself
                    command.SetAbortFlag(1)

        tag = self.interactor.AddObserver(event, called, priority)
        if event != "KeyPressEvent":
            return _once(lambda: self.interactor.RemoveObserver(tag))
        mark = self.renderer.AddObserver(_HEARS_KEYS, lambda *_: None)
        first = self.interactor.AddObserver(event, self._end_camera_drag)
        self.interactor.GetCommand(first).SetPassiveObserver(1)  # heard whoever has the focus

        def stop() -> None:
            self.interactor.RemoveObserver(first)
            self.interactor.RemoveObserver(tag)
            self.renderer.RemoveObserver(mark)

        return _once(stop)

    def before_render(self, callback: Callable[[], None]) -> Stop:
        """Call *callback* each time the renderer is about to draw; what it touches is drawn."""
        as_callable(callback, "callback")

        def called(*_: object) -> None:
            touched, self._depth = self._touched, self._depth + 1
            try:
                with self.guarded():
                    callback()
            finally:
                self._touched, self._depth = touched, self._depth - 1

        tag = self.renderer.AddObserver("StartEvent", called)
        return _once(lambda: self.renderer.RemoveObserver(tag))

    def every(self, milliseconds: int, callback: Callable[[], None]) -> Stop:
        """Call *callback* again and again from the event loop, until stopped.

        All subscribers of an interactor share one timer with the shortest of their periods, and
        each is called at every tick, so at least once in *milliseconds*.  A callback may stop
        itself and others; if one raises, the others are still called.

        Not while a camera style drags: it keeps the timer's events to itself as well; see `pulse`.
        """
        if not is_whole(milliseconds, 1, _LONGEST):
            raise ArgumentError(
                f"milliseconds must be a whole number, 1 to {_LONGEST}; got {shown(milliseconds)}"
            )
        as_callable(callback, "callback")

        def ticked(*_: object) -> None:
            with self.guarded(), self._drawn_after():
                callback()

        tag = self.interactor.AddObserver("TimerEvent", ticked, ABOVE_CAMERA)
        release = self._timer.require(milliseconds)

        def stop() -> None:
            self.interactor.RemoveObserver(tag)
            release()

        return _once(stop)

    def pulse(self, callback: Callable[[], None]) -> Stop:
        """Call *callback* at every tick of any timer, also during a drag of a camera style.

        It may draw, but neither observe the interactor nor stop anything there.
        """
        as_callable(callback, "callback")

        def ticked(*_: object) -> None:
            with self.guarded(), self._drawn_after():
                callback()

        tag = self.interactor.AddObserver("TimerEvent", ticked)
        self.interactor.GetCommand(tag).SetPassiveObserver(1)
        return _once(lambda: self.interactor.RemoveObserver(tag))

    @property
    def is_addressed(self) -> bool:
        """Whether keys are meant for this view, not for another one that the pointer is in."""
        pointer = self.pointer(Phase.HOVER)
        other = self.interactor.FindPokedRenderer(*self.interactor.GetEventPosition())
        elsewhere = other is not None and other.HasObserver(_HEARS_KEYS)
        return self.contains(pointer) or not (elsewhere and Sight(other).contains(pointer))

    def pointer(self, phase: Phase) -> Pointer:
        """Return where the interactor has the pointer, as the given *phase*."""
        x, y = self.interactor.GetEventPosition()
        shift, control = self.interactor.GetShiftKey(), self.interactor.GetControlKey()
        return Pointer(phase, float(x), float(y), shift=bool(shift), control=bool(control))

    def _end_camera_drag(self, *_: object) -> None:
        """End what a camera style has in hand, as if the button had been released."""
        if (self.interactor.GetKeySym() or "").startswith(_MODIFIERS):
            return
        style = self.interactor.GetInteractorStyle()
        if hasattr(style, "GetCurrentStyle"):  # VTK's default switches between several
            style = style.GetCurrentStyle()
        if style is not None and getattr(style, "GetState", int)():
            style.OnLeftButtonUp()
            style.OnMiddleButtonUp()
            style.OnRightButtonUp()

    # What goes wrong.

    def on_failure(self, listener: Callable[[Exception], None]) -> Stop:
        """Tell *listener* of every exception in a callback, from now on until stopped."""
        self._failures.append(as_callable(listener, "listener"))
        return _once(lambda: self._failures.remove(listener))

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """Hand what is raised inside to those who asked; with nobody there it is raised on."""
        try:
            yield
        except Exception as error:  # the border to the event loop: anything may come
            _log.info("a callback failed", exc_info=True)
            if not self._failures:
                raise
            with ExitStack() as told:  # one that fails keeps nobody from hearing
                for listener in reversed(self._failures):
                    told.callback(listener, error)

    @contextmanager
    def _drawn_after(self) -> Iterator[None]:
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1
            if self._touched and not self._depth:
                self._touched = False
                self.render()


class _SharedTimer:
    """The shared repeating timer of an interactor, running while any subscriber requires it.

    If the host stops it together with a timer of another owner, such as a hovering widget or a
    camera style, it is restarted.

    Parameters
    ----------
    interactor : vtkRenderWindowInteractor
        Owner of the timer; use `of` to share it.
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
        # It keeps its interactor alive, so no other one can have the same id meanwhile.
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
                # The lowest priority: after the host has stopped its timer.
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
    """Return a callable that does *action* the first time it is called."""
    waiting = [action]

    def stop() -> None:
        if waiting:
            waiting.pop()()

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
