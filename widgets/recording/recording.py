"""Recordings of user input as plain text that can be replayed, for tests and for bug reports.

Each line is one event: the time in seconds, the name, the position in pixels from the lower left
corner, and the modifier keys.  `Timer` stands for one or several ticks of the event loop.  A
recording begins with the window and the camera.  It repeats them before a press if they have
changed, so a replay is exact even if a program moved the camera.

    vtk_segdeform recording 1
    0.000 Window 800 600
    0.000 Camera position 0.0 -3.0 0.5 focus 0.0 0.0 0.5 up 0.0 0.0 1.0 angle 30.0 ...
    0.731 MouseMove 412 300
    0.802 LeftButtonPress 412 300 control
    2.004 KeyPress 412 300 control key=z code=26
    2.310 Timer 3
    2.310 Steps 5
    2.900 Keys undo=u

`Keys` are those keys of the editor that differ from the default ones; they hold for the replay.

Empty lines and lines that begin with # are ignored.  `Steps` is the number of solver steps of one
solve.  `Finish` finishes the pose on the mesh, which happened in the background.  A replay uses the
same number and ends in the same pose on any machine, bit by bit if numpy sums in the same order.  A
recording holds input only: replay it with the session and the view it began with.

During a camera drag VTK's interactor style withholds all events from other observers, and a widget
does so by its abort flag.  Neither affects VTK's passive observers, which are called first.  The
recorder uses passive observers.
"""

from __future__ import annotations

import itertools
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TextIO

from vtkmodules.vtkCommonCore import vtkVersion

from vtk_segdeform.arrays import is_number
from vtk_segdeform.checks import as_callable, as_path, as_text, require, shown
from vtk_segdeform.errors import ArgumentError, SessionError
from vtk_segdeform.files import replacing, require_place
from vtk_segdeform.version import __version__

from ..scene import View, observe_steps, prescribe_steps
from .confinement import confined
from .finishes import on_finish
from .limits import Clock, ReplayLimits
from .reading import Moment, read_recording
from .transcript import EVENTS, TITLE, Camera, Entry, Finish, Input, Keys, Steps, Ticks, Window

_LONGEST_PAUSE = 2.0  # seconds
_MOST_KEYS = 1000


class Recorder:
    """Records every event of a view, from its construction until `stop`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to record.
    path : path, optional
        A text file to which each event is written at once, so that it survives a crash.
    keys : str
        Letters and digits that a replay types first.
    skips : callable, optional
        ``skips(input)`` returns whether to leave out an `Input`.

    Raises
    ------
    SessionError
        If *path* cannot be written.
    """

    def __init__(
        self,
        view: Any,
        path: str | os.PathLike[str] | None = None,
        *,
        keys: str = "",
        skips: Callable[[Input], bool] | None = None,
    ) -> None:
        self.view = View.of(view)
        as_text(keys, "keys", _MOST_KEYS)
        self._skips = None if skips is None else as_callable(skips, "skips")
        self.lines: list[str] = []
        self._start = time.monotonic()
        self._last: dict[type, Entry] = {}  # the last recorded window and camera
        self._ticks = 0
        self._file: TextIO | None = None
        if path is not None:
            self._file = _opened(path)
        self._write(TITLE)
        vtk = vtkVersion.GetVTKVersion()
        self._write(f"# vtk_segdeform {__version__}, VTK {vtk}, {sys.platform}")
        self._record_scene()
        x, y = self.view.interactor.GetEventPosition()
        for key, name in itertools.product(keys, ("KeyPress", "Char", "KeyRelease")):
            self._record(Input(name, x, y, key=key, code=ord(key)))
        self._tags = [self._observe(name) for name in (*EVENTS, "Timer")]
        self._stop_steps = observe_steps(self.view.interactor, self._on_steps)
        self._stop_finishes = on_finish(self.view, self._on_finish)

    def stop(self) -> None:
        """Stop recording and close the file."""
        if not self._tags:
            return
        for tag in self._tags:
            self.view.interactor.RemoveObserver(tag)
        self._tags = []
        self._stop_steps()
        self._stop_finishes()
        self._record_ticks()
        self._record_scene()
        if self._file is not None:
            self._file.close()

    def assign(self, keys: Mapping[str, Sequence[str]]) -> None:
        """Note that actions of the editor have other *keys* from now on."""
        entry = Keys.of(keys)
        self._record_ticks()
        self._record(entry)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the recording so far to a text file; SessionError if that fails."""
        path = as_path(path)
        try:
            with replacing(path) as draft:
                draft.write_text("".join(f"{line}\n" for line in self.lines), encoding="utf-8")
        except OSError as fault:
            raise SessionError(f"{path}: cannot be written ({fault.strerror or fault})") from fault

    def _observe(self, name: str) -> int:
        def called(*_: object) -> None:
            with self.view.guarded():
                self._on_event(name)

        interactor = self.view.interactor
        tag: int = interactor.AddObserver(f"{name}Event", called)
        interactor.GetCommand(tag).SetPassiveObserver(True)
        return tag

    def _on_event(self, name: str) -> None:
        if name == "Timer":
            self._ticks += 1
            return
        entry = Input.of(name, self.view.interactor)
        if self._skips is not None and self._skips(entry):
            return
        self._record_ticks()
        if name.endswith("Press"):  # the effect of a drag depends on the camera
            self._record_scene()
        self._record(entry)

    def _on_steps(self, steps: int) -> None:
        with self.view.guarded():
            self._record_ticks()  # the last tick caused the solve
            self._record(Steps(steps))

    def _on_finish(self) -> None:
        self._record_ticks()  # the finish takes effect after the last tick
        self._record(Finish())

    def _record_ticks(self) -> None:
        if self._ticks:
            self._record(Ticks(self._ticks))
            self._ticks = 0

    def _record_scene(self) -> None:
        if _is_closed(self.view.window):
            return
        for entry in (Window.of(self.view), Camera.of(self.view)):
            if self._last.get(type(entry)) != entry:
                self._last[type(entry)] = entry
                self._record(entry)

    def _record(self, entry: Entry) -> None:
        self._write(f"{time.monotonic() - self._start:.3f} {entry}")

    def _write(self, line: str) -> None:
        self.lines.append(line)
        if self._file is not None:
            self._file.write(f"{line}\n")


def replay(
    view: Any,
    source: str | os.PathLike[str] | Iterable[str],
    *,
    folder: str | os.PathLike[str] | None = None,
    limits: ReplayLimits | None = None,
    pace: float = 0.0,
    busy: Callable[[], bool] | None = None,
) -> None:
    """Replay in *view* a recording of a `Recorder`.

    The whole recording is checked before the first event is sent.  The replay ends early if an
    event closes the window.

    A recording may come from an untrusted source.  Its keys therefore read and write files only in
    *folder*, whatever `DeformEditor.path` is, and *limits* bound the duration.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view, with the session that the recording began with.
    source : path or iterable of str
        The file, or its lines.
    folder : path, optional
        An existing folder for the files that :kbd:`Ctrl+S`, :kbd:`Ctrl+R` and :kbd:`Ctrl+M` write
        and :kbd:`Ctrl+O` opens.  Without one these keys fail with an error.
    limits : ReplayLimits, optional
        By default 200,000 events, 300 seconds and windows of 16 million pixels.
    pace : float
        Factor of the recorded pauses: 1 is the original speed, 0.5 twice as fast, 0 without
        pauses.  Pauses of more than 2 seconds are shortened.
    busy : callable, optional
        ``busy()`` returns whether a background job is running; the next event then waits for its
        end, while timers tick.

    Raises
    ------
    SessionError
        If there is no such file or folder, a line is invalid, or a limit is exceeded; the message
        has the number of the line and the limit.
    """
    view = View.of(view)
    limits = ReplayLimits() if limits is None else require(limits, ReplayLimits, "limits")
    if not is_number(pace, 0.0):
        raise ArgumentError(f"pace must be a number, 0 or more; got {shown(pace)}")
    if busy is not None:
        as_callable(busy, "busy")
    directory = None if folder is None else as_path(folder, "folder")
    if directory is not None and not os.path.isdir(directory):
        raise SessionError(f"{directory}: no such folder; create it, or pass another one")
    moments = read_recording(source, limits)
    _require_short(moments, pace, limits.seconds)
    clock, tick = Clock(limits.seconds), Ticks(1)
    before = 0.0
    with confined(view.interactor, directory):
        for moment, entry, steps in moments:
            if busy is not None:
                clock.wait_while(busy, lambda: tick.send(view))
            time.sleep(_pause(before, moment) * pace)
            before = moment
            prescribe_steps(view.interactor, steps)
            try:
                for each in [tick] * entry.times if isinstance(entry, Ticks) else [entry]:
                    clock.check()
                    if _is_closed(view.window):
                        return
                    each.send(view)
            finally:
                prescribe_steps(view.interactor, ())


def _require_short(moments: list[Moment], pace: float, seconds: float) -> None:
    """Raise SessionError if the recorded pauses alone exceed the time limit."""
    times = [0.0, *(moment for moment, _, _ in moments)]
    planned = pace * sum(itertools.starmap(_pause, itertools.pairwise(times)))
    if planned > seconds:
        raise SessionError(
            f"the replay would take {planned:.0f} seconds, more than its limit of {seconds:g} "
            "seconds; raise it to replay the recording"
        )


def _pause(before: float, moment: float) -> float:
    return min(max(0.0, moment - before), _LONGEST_PAUSE)


def _is_closed(window: Any) -> bool:
    """Return whether a window is gone or finalised."""
    return window is None or not (window.GetNeverRendered() or window.GetInitialized())


def _opened(path: str | os.PathLike[str]) -> TextIO:
    """Open a text file, emptied if it exists, that is flushed after every line."""
    path = as_path(path)
    try:
        return open(require_place(path), "w", encoding="utf-8", buffering=1)
    except OSError as fault:
        raise SessionError(f"{path}: cannot be written ({fault.strerror or fault})") from fault
