"""The editor of one person, as a process of a server.

    python -m vtk_segdeform.widgets.web.client FILE --folder FOLDER

The first line of its standard input is a secret, which each request must carry.  It listens on
127.0.0.1, prints ``{"port": N}`` as one line once the page can be opened, and ends when its
standard input is closed.  The work is saved in FOLDER after each change, and opened again by the
next process there.
"""

from __future__ import annotations

import argparse
import asyncio
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.files import replacing
from vtk_segdeform.models import cactus
from vtk_segdeform.session import Session, save_session

from ..editor import read_session
from .serving import announce, announce_error, end_with_stdin, guard, read_secret
from .transfer import UPLOAD_LIMIT
from .web_editor import WebEditor

AUTOSAVE = "autosave.segdeform"
_PAUSE = 1.0  # seconds after a change; changes meanwhile are saved with it


class Autosave:
    """Saves the work on *web* to *place*, in another thread, from `start` on.

    Parameters
    ----------
    web : WebEditor
        The editor.
    place : Path
        A session file.
    """

    def __init__(self, web: WebEditor, place: Path) -> None:
        self._web, self._place = web, place
        self._saved = web.session.state
        self._saving: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Save after each change from now on, in the running event loop."""
        self._loop = asyncio.get_running_loop()
        self._web.editor.controller.messages.on_change(self._changed)

    def save(self) -> None:
        """Save now, if anything has changed; an error is shown in the page."""
        session, controller = self._web.session, self._web.editor.controller
        state = session.state
        if state is self._saved:
            return
        try:
            save_session(self._place, session, view=controller.camera.settings(controller.mode))
            with replacing(_name_file(self._place)) as draft:
                draft.write_text(self._web.model.name, encoding="utf-8")
            self._saved = state
        except SegDeformError as error:
            self._saved = state  # tried again after the next change
            self._loop.call_soon_threadsafe(controller.messages.report_error, error)

    def _changed(self) -> None:
        is_saving = self._saving is not None and not self._saving.done()
        if not is_saving and self._web.session.state is not self._saved:
            self._saving = self._loop.create_task(self._save_soon())

    async def _save_soon(self) -> None:
        await asyncio.sleep(_PAUSE)
        await self._loop.run_in_executor(None, self.save)
        self._loop.call_soon(self._changed)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the process; return its exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", nargs="?", type=Path, help="a mesh or a session")
    parser.add_argument("--port", type=int, default=0, help="0: any that is free")
    parser.add_argument("--folder", type=Path, required=True, help="a private folder")
    parser.add_argument("--upload-limit", type=int, default=UPLOAD_LIMIT, help="bytes")
    options = parser.parse_args(arguments)
    secret = read_secret()
    end_with_stdin()
    place: Path = options.folder / AUTOSAVE
    try:
        session, name = _first_session(options.file, place)
        web = WebEditor(
            session, name=name, folder=options.folder, upload_limit=options.upload_limit
        )
    except SegDeformError as error:
        announce_error(str(error))
        return 1
    web.server.controller.on_server_bind.add(
        lambda bound: bound.app.middlewares.append(guard(secret))
    )
    asyncio.run(_serve(web, Autosave(web, place), options.port))
    return 0


def _first_session(file: Path | None, place: Path) -> tuple[Session, str]:
    """Return the session to begin with, and its name."""
    name = "Last session"
    if place.is_file():
        with suppress(OSError, ValueError):
            name = _name_file(place).read_text(encoding="utf-8")
        return read_session(place, lambda *_: None), name
    if file is not None:
        return read_session(file, lambda *_: None), file.name
    return Session(cactus()), "Sample model"


def _name_file(place: Path) -> Path:
    """Return the file with the name that the page shows for the session at *place*."""
    return place.with_suffix(".name")


async def _serve(web: WebEditor, autosave: Autosave, port: int) -> None:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def ready(port: int) -> None:
        autosave.start()
        announce(port)

    with suppress(NotImplementedError):  # on Windows
        loop.add_signal_handler(signal.SIGTERM, ended.set)
    await web.serve_until(ended, port=port, ready=ready, last=autosave.save)


if __name__ == "__main__":
    sys.exit(main())
