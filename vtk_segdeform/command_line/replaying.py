"""The command that does again what somebody recorded: in a window, or off-screen as a film."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import pyvista as pv

from .. import convert, plugin
from ..canvas import require_offscreen, require_screen
from ..progress import Progress
from ..session import Session
from .commands import opened
from .outputs import Say


def replay_command(options: Namespace, say: Say, progress: Progress) -> bool:
    """Replay a recording over the session or mesh that it began with; tell what became of it."""
    from ..widgets.filming.film_files import require_film

    if options.output is not None:
        convert.require_writable(options.output)
    if options.film is not None:
        require_film(options.film)
    surface, session = opened(options.input)
    progress(0.0, "replaying")
    session, faults, pictures = replayed(options.recording, session, film=options.film)
    for fault in faults:
        say(f"said            {fault}")
    say(f"replayed        {options.recording}")
    say(f"volume          changed by {session.volume_change:+.1e} of itself")
    if options.film is not None:
        say(f"written         {options.film}, {pictures} pictures")
    if options.output is not None:
        convert.write_mesh(options.output, plugin.deformed(surface, session))
        say(f"written         {options.output}")
    return True


def replayed(
    recording: Path, session: Session, *, film: Path | None = None
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

    Returns
    -------
    session, faults, pictures : Session, list of Exception, int
        The session in the end, what the editor complained of, and how many pictures there are.

    Raises
    ------
    SessionError
        If the recording is damaged; the text has the line.  Or if the film cannot be written.
    MissingDependencyError
        If there is no screen, or nothing can be rendered.
    """
    from ..widgets.editor import DeformEditor
    from ..widgets.film import Film
    from ..widgets.recording import replay

    unseen = film is not None or pv.OFF_SCREEN
    if unseen:
        require_offscreen()
    else:
        require_screen()
    plotter = pv.Plotter(off_screen=unseen, title=f"segdeform {recording.name}", notebook=False)
    faults: list[Exception] = []
    try:
        editor = DeformEditor(plotter, session)
        editor.view.on_failure(faults.append)
        editor.On()
        plotter.show(auto_close=False, interactive=False, interactive_update=not unseen)
        taken = Film(editor.view)
        stop = taken.watch() if film is not None else None
        replay(plotter, recording, pace=0.0 if unseen else 1.0, busy=lambda: editor.is_busy)
        editor.wait()
        if film is not None and stop is not None:
            stop()
            taken.save(film)
        elif not unseen and editor.view.window is not None:
            plotter.iren.start()
        session = editor.session
        editor.remove()
    finally:
        plotter.close()
    return session, faults, len(taken)
