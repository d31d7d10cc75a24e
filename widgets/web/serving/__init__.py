"""``segdeform serve``: the editor in a browser, one process for each page.

    browser  --  server, 127.0.0.1:8765  --  client process, 127.0.0.1:any
                 token, cookies, limits      editor and trame, its own folder

The server passes on what a page may do, and reads no files itself.  The files, in reading order:

    limits          how many clients, how large, how long
    access          token, cookies, Host, Origin, headers
    secret          the client's side: its secret, life and port; pages of notebooks
    client          one client process and its folder
    clients         all clients: number, memory, absence
    connections     connections of all visitors: number, and time for a request
    proxy           requests and WebSockets, passed on with limits
    run_folder      the private folder of one run
    server          addresses, start and end
"""

from .limits import Limits
from .secret import announce, announce_error, below, end_with_stdin, guard, read_secret
from .server import Server, running, serve_until_stopped

__all__ = [
    "Limits",
    "Server",
    "announce",
    "announce_error",
    "below",
    "end_with_stdin",
    "guard",
    "read_secret",
    "running",
    "serve_until_stopped",
]
