"""The command that replays a recording: in a window, or off-screen as a film.

The recording may come from an untrusted source: its keys write files in ``--folder`` or not at all,
and its length is limited.
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
from ..widgets import plugin
from .commands import opened
from .outputs import Say

if TYPE_CHECKING:
    from ..widgets.recording import ReplayLimits


def replay_command(options: Namespace, say: Say, progress: Progress) -> bool:
    """Replay a recording over the session or mesh that it began with; tell what became of it."""
    from ..widgets.recording import ReplayLimits, require_film

    limits = ReplayLimits(events=options.events, seconds=options.seconds)
    if options.output is not None:
        io.require_writable(options.output)
    if options.film is not None:
        require_film(options.film)
    surface, session = opened(options.input)
    if options.folder is not None:
        options.folder.mkdir(parents=True, exist_ok=True)
    progress(0.0, "replaying")
    session, faults, pictures = replayed(
        options.recording, session, film=options.film, folder=options.folder, limits=limits
    )
    for fault in faults:
        say(f"said            {fault}")
    say(f"replayed        {options.recording}")
    say(f"volume          changed by {session.volume_change:+.1e} of itself")
    if options.film is not None:
        say(f"written         {options.film}, {pictures} pictures")
    if options.output is not None:
        io.write_mesh(options.output, plugin.deformed(surface, session))
        say(f"written         {options.output}")
    return True


def replayed(
    recording: Path,
    session: Session,
    *,
    film: Path | None = None,
    folder: Path | None = None,
    limits: ReplayLimits | None = None,
) -> tuple[Session, list[Exception], int]:
    """Do again what *recording* tells, over *session*.

    Parameters
    ----------
    recording : Path
        What a `Recorder` wrote in an editor.
    session : Session
        What it began with.
    film : Path, optional
        Off-screen, with all that is drawn written to this file.  Else in a window, as fast as it
        was recorded; it stays open for whoever wants to go on.
    folder : Path, optional
        For files that the recorded keys save; without one, saving fails.
    limits : ReplayLimits, optional
        Limits on events, time and window size.

    Returns
    -------
    session, faults, pictures : Session, list of Exception, int
        The session in the end, what the editor complained of, and how many pictures there are.

    Raises
    ------
    SessionError
        If the recording is damaged or exceeds the limits, or the film cannot be written; the text
        gives the line or the limit.
    MissingDependencyError
        If there is no screen, or nothing can be rendered.
    """
    from ..widgets.editor import DeformEditor
    from ..widgets.recording import Clock, Film, ReplayLimits, read_recording, replay

    limits = limits or ReplayLimits()
    read_recording(recording, limits)  # before a window opens

    unseen = film is not None or pv.OFF_SCREEN
    if unseen:
        require_offscreen()
    else:
        require_screen()
    plotter = pv.Plotter(off_screen=unseen, title=f"segdeform {recording.name}", notebook=False)
    faults: list[Exception] = []
    with ExitStack() as stack:
        stack.callback(plotter.close)
        editor = DeformEditor(plotter, session)
        stack.callback(editor.remove)  # also cancels a job, if the replay was stopped
        editor.view.on_failure(faults.append)
        editor.On()
        plotter.show(auto_close=False, interactive=False, interactive_update=not unseen)
        taken = Film(editor.view)
        stop = taken.watch() if film is not None else None
        clock, pace = Clock(limits.seconds), 0.0 if unseen else 1.0
        replay(
            plotter, recording, folder=folder, limits=limits, pace=pace,
            busy=lambda: editor.is_busy,
        )  # fmt: skip
        hands = editor.view.interactor
        clock.wait_while(lambda: editor.is_busy, lambda: hands.InvokeEvent("TimerEvent"))
        editor.wait()
        if film is not None and stop is not None:
            stop()
            taken.save(film)
        elif not unseen and editor.view.window is not None:
            plotter.iren.start()
        session = editor.session
    return session, faults, len(taken)
