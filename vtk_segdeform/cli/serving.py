"""``segdeform serve``: the editor in the browser."""

from __future__ import annotations

import errno
import socket
import webbrowser
from argparse import Namespace
from importlib.util import find_spec
from typing import TYPE_CHECKING

from ..errors import ArgumentError, MissingDependencyError
from ..files import open_regular

if TYPE_CHECKING:
    from ..progress import Progress
    from .outputs import Say

DEFAULT_PORT = 8765
_LIBRARIES = "aiohttp", "trame", "trame_vuetify"
_ANY = frozenset({"0.0.0.0", "::", ""})  # reached by all names of the machine
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})


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
    if (options.port or 0) > 65535:
        raise ArgumentError(f"--port must be at most 65535; got {options.port}")
    if options.upload_limit < 1:
        raise ArgumentError("--upload-limit must be at least 1")
    if options.input is not None:
        open_regular(options.input).close()
    port = _free_port(options.host, options.port)
    from ..widgets.web import serve_until_stopped

    host = socket.gethostname() if options.host in _ANY else options.host
    host = f"[{host}]" if ":" in host else host

    def started(port: int, secret: str, once: str) -> None:
        say(f"Open this address in a browser: http://{host}:{port}/{secret}/")
        if options.host not in _LOOPBACK:
            say(
                f"Warning: {options.host} can be reached from other machines. Whoever knows the "
                "address can use it, and nothing is encrypted."
            )
        say("Ctrl+C ends the server; download your work before.")
        if options.open:
            webbrowser.open(f"http://{host}:{port}/{once}")

    serve_until_stopped(
        options.input and options.input.absolute(),
        host=options.host,
        port=port,
        upload_limit=options.upload_limit * 1_000_000,
        started=started,
        say=say,
    )
    return True


def _free_port(host: str, port: int | None) -> int:
    """Return *port* if it is free, and 0 for any free one instead of a default that is in use."""
    wanted = DEFAULT_PORT if port is None else port
    family, _, _, _, place = socket.getaddrinfo(host, wanted, type=socket.SOCK_STREAM)[0]
    try:
        socket.create_server(place[:2], family=family).close()
    except OSError as fault:
        if port is not None or fault.errno != errno.EADDRINUSE:
            raise
        return 0
    return wanted
