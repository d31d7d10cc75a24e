"""``segdeform replay``: replay a recording in a window, or off-screen into a film.

Recordings may come from untrusted sources: recorded keys access files only in ``--folder``, and
events, time and window size are limited.
"""

from __future__ import annotations

from argparse import Namespace
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pyvista as pv

from .. import io
from ..pictures import require_offscreen, require_screen
from ..progress import Progress
from ..session import Session
from .commands import opened
from .outputs import Say, report_session

if TYPE_CHECKING:
    from ..widgets.recording import ReplayLimits


def replay(options: Namespace, say: Say, progress: Progress) -> bool:
    """Replay a recording on the mesh or session it started from, and write the results."""
    from ..widgets.recording import ReplayLimits, require_film

    limits = ReplayLimits(events=options.events, seconds=options.seconds)
    if options.output is not None:
        io.require_writable(options.output)
    if options.film is not None:
        require_film(options.film)
    session = opened(options.input)
    if options.folder is not None:
        options.folder.mkdir(parents=True, exist_ok=True)
    progress(0.0, "replaying")
    session, faults, pictures = replayed(
        options.recording, session, film=options.film, folder=options.folder, limits=limits
    )
    for fault in faults:
        say(f"message         {fault}")
    say(f"replayed        {options.recording}")
    if options.film is not None:
        say(f"written         {options.film}, {pictures} frames")
    report_session(session, options.output, say)
    return True


def replayed(
    recording: Path,
    session: Session,
    *,
    film: Path | None = None,
    folder: Path | None = None,
    limits: ReplayLimits | None = None,
) -> tuple[Session, list[Exception], int]:
    """Replay a recording in an editor of *session*.

    Parameters
    ----------
    recording : Path
        A file written by a `Recorder`.
    session : Session
        The session at the start of the recording.
    film : Path, optional
        Replay off-screen and write all frames to this file.  By default, replay in a window at the
        recorded speed; the window then stays open for editing.
    folder : Path, optional
        Folder for files that recorded keys save; by default, saving fails.
    limits : ReplayLimits, optional
        Limits on events, time and window size.

    Returns
    -------
    session, faults, pictures : Session, list of Exception, int
        The session at the end, the errors shown by the editor, and the number of frames.

    Raises
    ------
    SessionError
        If the recording is damaged or exceeds the limits, or the film cannot be written; the text
        gives the line or the limit.
    MissingDependencyError
        If there is no display, or off-screen rendering fails.
    """
    from ..widgets.editor import DeformEditor
    from ..widgets.recording import Clock, Film, ReplayLimits, read_recording
    from ..widgets.recording import replay as replay_events

    limits = limits or ReplayLimits()
    read_recording(recording, limits)  # report errors before a window opens

    off_screen = film is not None or pv.OFF_SCREEN
    if off_screen:
        require_offscreen()
    else:
        require_screen()
    plotter = pv.Plotter(off_screen=off_screen, title=f"segdeform {recording.name}", notebook=False)
    faults: list[Exception] = []
    with ExitStack() as stack:
        stack.callback(plotter.close)
        editor = DeformEditor(plotter, session)
        stack.callback(editor.remove)  # also cancels background work if the replay was stopped
        editor.view.on_failure(faults.append)
        editor.On()
        plotter.show(auto_close=False, interactive=False, interactive_update=not off_screen)
        frames = Film(editor.view)
        stop = frames.watch() if film is not None else None
        clock, pace = Clock(limits.seconds), 0.0 if off_screen else 1.0
        replay_events(
            plotter, recording, folder=folder, limits=limits, pace=pace,
            busy=lambda: editor.is_busy or editor.is_preparing,
        )  # fmt: skip
        interactor = editor.view.interactor
        clock.wait_while(lambda: editor.is_busy, lambda: interactor.InvokeEvent("TimerEvent"))
        editor.wait()
        if film is not None and stop is not None:
            stop()
            frames.save(film)
        elif not off_screen and editor.view.window is not None:
            plotter.iren.start()
        session = editor.session
    return session, faults, len(frames)
