"""``segdeform serve``: one editor in one process, at an address with a secret.

Its unsaved work is autosaved beside that of the desktop program.  Ctrl+C discards it; after any
other end, a crash as well, the next ``segdeform serve`` of the same file continues with it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import signal
import sys
from collections.abc import Callable
from pathlib import Path

from aiohttp import web
from aiohttp.http import HttpProcessingError

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.models import cactus
from vtk_segdeform.session import Session

from ..editor import About, Autosaver, Autosaves, Slot, is_mesh, read_session
from .web_editor import WebEditor

if sys.platform != "win32":
    import resource

_MOST_FILES = 65_536  # that the process may open, connections included
_ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP")


def _is_own_fault(record: logging.LogRecord) -> bool:
    """Return whether a message of aiohttp is about an error of this program, not of a visitor."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, HttpProcessingError | web.RequestPayloadError | ConnectionError)


logging.getLogger("aiohttp.server").addFilter(_is_own_fault)

Started = Callable[[int, str, str], object]
"""``started(port, secret, once)``, once the page can be opened at ``/SECRET/``, or at ``/ONCE``."""


def recoverable(autosaves: Autosaves, file: Path | None) -> Slot | None:
    """Return the latest unsaved work on *file*, or on anything, that a crash has left."""
    found = None
    for slot in autosaves.abandoned():
        if found is None and (file is None or str(file) in (slot.about.mesh, slot.about.session)):
            found = slot
        else:
            slot.release()
    return found


def serve_until_stopped(
    file: Path | None,
    *,
    host: str,
    port: int,
    upload_limit: int,
    started: Started,
    say: Callable[[str], None],
) -> None:
    """Serve *file*, or a sample model, until the process is interrupted or told to end.

    Parameters
    ----------
    file : Path or None
        A mesh or a session, as an absolute path.
    host, port
        Where to listen; port 0 is any that is free.
    upload_limit : int
        Largest upload, in bytes.
    started : callable
        See `Started`.
    say : callable
        Shows a sentence to the user.

    Raises
    ------
    SegDeformError
        If the file cannot be opened.
    OSError
        If the port is in use.
    """
    allow_many_connections()
    autosaves = Autosaves()
    slot, session = recoverable(autosaves, file), None
    about = _about(file) if slot is None else slot.about
    if slot is not None:
        try:
            session = slot.read(lambda *_: None)
            say(f"Recovered the unsaved work on {about.name} of {slot.when:%Y-%m-%d %H:%M}.")
        except SegDeformError as error:
            say(f"The unsaved work on {about.name} cannot be read: {error}")
            slot.release()
            slot, about = None, _about(file)
    if session is None:
        session = Session(cactus()) if file is None else read_session(file, lambda *_: None)
    web = WebEditor(session, name=about.name, upload_limit=upload_limit)
    controller, given = web.editor.controller, web.session
    controller.file.is_new = slot is not None
    autosaver = Autosaver(
        controller,
        autosaves,
        lambda: about if web.session is given else About(web.model.name),
        slot=slot,
    )
    is_kept = False
    try:
        is_kept = asyncio.run(_serve(web, autosaver, host, port, started))
    except Exception:
        is_kept = True
        raise
    finally:
        if not is_kept:
            autosaver.discard()


def allow_many_connections() -> None:
    """Raise the number of files that the process may open, as far as the system lets it.

    Anyone who reaches the port can open connections and send nothing, without the secret.  At the
    usual limit of 1,024 such a crowd would keep out the page.
    """
    if sys.platform == "win32":
        return  # no such limit
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, _MOST_FILES)
    if soft != resource.RLIM_INFINITY and soft < most:
        with contextlib.suppress(ValueError, OSError):  # macOS has a lower limit of its own
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def _about(file: Path | None) -> About:
    if file is None:
        return About("Sample model")
    return About(file.name, **{"mesh" if is_mesh(file) else "session": str(file)})


async def _serve(
    web: WebEditor, autosaver: Autosaver, host: str, port: int, started: Started
) -> bool:
    """Serve the page until a signal; return whether the work is to be kept."""
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    secret, once = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
    came: list[str] = []

    def end(name: str) -> None:
        came.append(name)
        for each in _ENDINGS:  # the second one ends at once
            loop.remove_signal_handler(getattr(signal, each))
        ended.set()

    for name in _ENDINGS if sys.platform != "win32" else ():  # there, Ctrl+C is an exception
        loop.add_signal_handler(getattr(signal, name), end, name)
    await web.serve_until(
        ended,
        host=host,
        port=port,
        secret=secret,
        once=once,
        ready=lambda port: started(port, secret, once),
        last=autosaver.save,
    )
    return came != ["SIGINT"]
