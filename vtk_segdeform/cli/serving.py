"""``segdeform serve``: the editor in the browser."""

from __future__ import annotations

import asyncio
import webbrowser
from argparse import Namespace
from importlib.util import find_spec
from typing import TYPE_CHECKING

from ..errors import ArgumentError, MissingDependencyError
from ..files import open_regular

if TYPE_CHECKING:  # not imported at run time, so that the server loads neither numpy nor VTK
    from ..progress import Progress
    from ..widgets.web.serving import Server
    from .outputs import Say

_LIBRARIES = "aiohttp", "trame", "trame_vuetify"


def serve(options: Namespace, say: Say, progress: Progress) -> bool:
    """Serve the editor, with a file if one is given, until Ctrl+C.

    Raises
    ------
    ArgumentError
        If the port or a limit is out of range.
    MissingDependencyError
        If trame is not installed.
    OSError
        If the file cannot be read, or the port is in use.
    """
    del progress
    if missing := [name for name in _LIBRARIES if find_spec(name) is None]:
        raise MissingDependencyError(
            f"the editor in the browser requires {missing[0]}; install it with "
            "pip install 'vtk-segdeform[web]'"
        )
    from ..widgets.web.serving import Limits, serve_until_stopped

    if (options.port or 0) > 65535:
        raise ArgumentError(f"--port must be at most 65535; got {options.port}")
    for name in ("clients", "upload_limit", "memory", "keep"):
        if getattr(options, name) < 1:
            raise ArgumentError(f"--{name.replace('_', '-')} must be at least 1")
    if options.input is not None:
        open_regular(options.input).close()

    def started(server: Server) -> None:
        say(f"Open this address in a browser: {server.address(server.access.token)}")
        if not server.is_local:
            say(
                f"Warning: {options.host} can be reached from other machines. Whoever knows the "
                "token can use it, and nothing is encrypted."
            )
        say("Ctrl+C ends the server and all its clients; download your work before.")
        if options.open:
            webbrowser.open(server.address(server.access.token_for_once()))

    limits = Limits(
        clients=options.clients,
        upload=options.upload_limit * 1_000_000,
        memory=options.memory * 1_000_000,
        keep=float(options.keep),
    )
    asyncio.run(
        serve_until_stopped(
            options.input, host=options.host, port=options.port, limits=limits, started=started
        )
    )
    return True
