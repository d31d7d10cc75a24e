"""The editor in a browser: an off-screen view, a trame server, and a page around the view.

    web = WebEditor(mesh)
    web.start(port=8080)             # blocks; or await web.serve(port=8080)

One `WebEditor` is for one person: all pages of its server show the same view.
"""

from __future__ import annotations

import asyncio
import itertools
import os
import secrets
import shutil
import sys
import tempfile
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pyvista as pv
import trame.app  # noqa: F401 - which registers the types of a page's files
from trame.ui.vuetify3 import VAppLayout
from trame_client.widgets.core import VirtualNode
from trame_server import Server
from trame_server.protocol import CoreServer
from wslink import server as wslink_server

from vtk_segdeform.checks import as_text
from vtk_segdeform.pictures import require_offscreen
from vtk_segdeform.session import Session

from ..editor import DeformEditor, KeyChoice, keys_of
from ..hosting import add_editor, session_of
from ..scene import set_background, set_lights
from .access import below
from .page_drawing import PageDrawing, Surface, Update
from .page_model import PageModel
from .pictures import Picture
from .protocol import ViewProtocol
from .stream import Stream
from .timers import Timers
from .transfer import UPLOAD_LIMIT, Transfer, formats

_PAGE = Path(__file__).with_name("page")
# These write to files of the server, or read them: the page uploads and downloads instead.
_NO_KEYS = dict.fromkeys(("save", "open"), ())
_COMPRESS = "WSLINK_WS_COMPRESS"
_SIZE = 1000, 700  # pixels, until the page tells its own
_SAMPLES = 8  # per pixel, for smooth edges
_COLOURS = {
    "light": {"primary": "#2f7fc1", "surface": "#fbfbfa", "background": "#f0f0ee"},
    "dark": {"primary": "#5aa2dd", "surface": "#26282c", "background": "#1d1e21"},
}
_numbers = itertools.count(1)


class WebEditor:
    """The editor behind a trame server.

    Parameters
    ----------
    mesh : pyvista.PolyData, pyvista.MultiBlock, Surface, Mesh or Session
        What to edit first; the page can open other files.
    plotter : pyvista.Plotter, optional
        An off-screen plotter that is not shown yet, to which the editor is added.  Its owner shows
        it before `serve`, and its lights and background do not change.
    name : str
        The name that the page shows for it.
    keys : str or mapping of str to str or sequence of str
        As in `edit`.  Keys of files do nothing: the page uploads and downloads.
    folder : Path, optional
        A private folder for uploads; by default a temporary one, which `close` deletes.
    upload_limit : int
        Largest upload, in bytes.

    Raises
    ------
    MissingDependencyError
        If off-screen rendering is unavailable.

    Attributes
    ----------
    plotter : pyvista.Plotter
        The off-screen view; anything that pyvista draws can be added to it.
    editor : DeformEditor
        The editor in the view.
    server : trame_server.core.Server
        The server of the page.
    stream : Stream
        The view's input and pictures; ``stream.want()`` is the one place that asks for a picture.
    transfer : Transfer
        Uploads and downloads.
    endpoint : wslink.protocol.WslinkHandler or None
        Where `Tunnel` connects its pages, while this is served without a port.
    """

    def __init__(
        self,
        mesh: Any,
        *,
        plotter: pv.Plotter | None = None,
        name: str = "Untitled",
        keys: KeyChoice = "pyvista",
        folder: Path | None = None,
        upload_limit: int = UPLOAD_LIMIT,
    ) -> None:
        session = session_of(mesh)
        as_text(name, "name")
        require_offscreen()
        own = Path(tempfile.gettempdir()) / f"segdeform-{secrets.token_hex(16)}"
        self._folder = folder or own  # the own one exists from the first upload on
        self._remove_own = weakref.finalize(self, shutil.rmtree, own, ignore_errors=True)
        self._is_plotter_ours = plotter is None
        self.plotter = plotter or pv.Plotter(off_screen=True, notebook=False, window_size=[*_SIZE])
        self.plotter.iren.clear_key_event_callbacks()
        if self._is_plotter_ours:
            self.plotter.render_window.SetMultiSamples(_SAMPLES)
            set_lights(self.plotter.renderer)
            set_background(self.plotter.renderer)
        timers = Timers(self.plotter.iren.interactor)  # before the editor creates the first one
        table = {**keys_of(keys).changes, **_NO_KEYS}
        self.editor: DeformEditor = add_editor(self.plotter, session, keys=table)
        self.editor.controller.messages.show_line(False)  # which the page shows
        self.editor.widgets.carried.follows_drags = False  # a page that draws would get all of it
        if self._is_plotter_ours:
            self.plotter.show(interactive=False, auto_close=False)
        names = {str(self.editor.path): name}
        # Not `get_server`, which keeps every server, and thereby its editor, for ever.
        self.server = Server(f"segdeform {next(_numbers)}", VirtualNode)
        self.server.client_type = "vue3"
        self.model = PageModel(self.editor, self.server.state, names)
        drawing = PageDrawing(self.editor)
        self.stream = Stream(self.editor.view, timers, self._send, self.model.changed, drawing)
        self._stop = self.editor.controller.messages.on_change(self.stream.wake)
        self._aim: tuple[float, ...] | None = tuple(self.plotter.camera.position)
        self._protocol = ViewProtocol(self.stream, drawing, self._sized)
        self.transfer = Transfer(self.editor, self._folder, upload_limit, names, self.model.changed)
        self.endpoint: Any = None
        self._secret, self._once = "", ""
        self._hidden: Any = None  # the application behind the secret
        self._make_page()

    @property
    def session(self) -> Session:
        """The session being edited; another one after the page has opened a file."""
        return self.editor.session

    def start(self, *, port: int = 0, ready: Callable[[int], object] | None = None) -> None:
        """Serve the page at 127.0.0.1 until interrupted, then `close`.

        Parameters
        ----------
        port : int
            The port; 0 for any that is free.
        ready : callable, optional
            ``ready(port)`` is called once the page can be opened.
        """
        asyncio.run(self.serve(port=port, ready=ready))

    async def serve(
        self,
        *,
        port: int | None = 0,
        host: str = "127.0.0.1",
        secret: str = "",
        once: str = "",
        ready: Callable[[int], object] | None = None,
    ) -> None:
        """Serve the page, as `start` does, in the running event loop.

        Parameters
        ----------
        port, ready
            As for `start`; if *port* is None, listen nowhere, for the pages of a `Tunnel`.
        host : str
            The address to listen on.
        secret : str
            Serve the page at ``/SECRET/``, and nothing elsewhere.
        once : str
            Redirect the first request for ``/ONCE`` there.
        """
        self._secret, self._once = secret, once
        own = asyncio.get_running_loop()
        if own.get_exception_handler() is None:
            own.set_exception_handler(_ignore_lost_pages)

        def begin(**_: object) -> None:
            loop = asyncio.get_running_loop()
            self.stream.start(loop)
            self.model.start(loop)
            if ready is not None:
                ready(self.server.port)

        self.server.controller.on_server_ready.add(begin)
        with _own_settings():
            running = self.server.start(
                port=port or 0,
                host=host,
                exec_mode="coroutine",
                backend="generic" if port is None else "aiohttp",
                open_browser=False,
                show_connection_info=False,
                disable_logging=True,
                thread=True,  # leaves signals to the caller
                timeout=0,
            )
        try:
            await running
        finally:
            await self.stream.stop()
            self.close()
            self._forget()

    async def serve_until(
        self,
        ended: asyncio.Event,
        *,
        last: Callable[[], object] | None = None,
        **where: Any,
    ) -> None:
        """Serve the page, as `serve` does, until the event *ended* is set; call *last* before."""
        loop = asyncio.get_running_loop()
        serving = loop.create_task(self.serve(**where))
        ending = loop.create_task(ended.wait())
        await asyncio.wait([serving, ending], return_when=asyncio.FIRST_COMPLETED)
        if last is not None:
            last()
        ending.cancel()
        if self.server.running:
            await self.server.stop()
        else:  # ended before it began
            serving.cancel()
        with suppress(asyncio.CancelledError):
            await serving

    def close(self) -> None:
        """Release the view and the folder of uploads; the session is unchanged."""
        self.model.stop()
        self._stop()
        if self._is_plotter_ours:
            self.plotter.close()  # which removes the editor first
        elif self.editor in self.plotter.segdeform.added:
            self.plotter.segdeform.added.remove(self.editor)
            self.editor.remove()
        self._remove_own()

    def _forget(self) -> None:
        """Release the server; trame and wslink keep a reference to the last one."""
        if CoreServer.server is self.server:
            CoreServer.server = wslink_server.ws_server = None

    def _sized(self) -> None:
        """Frame the model once the size of the page is known, unless the camera was moved."""
        if self._aim == tuple(self.plotter.camera.position):
            self.editor.controller.camera.viewpoint.frame(animate=False)
        self._aim = None

    def _send(self, picture: Picture | Update | Surface, number: int) -> None:
        self._protocol.send(picture, number)

    def _make_page(self) -> None:
        server, address = self.server, "__segdeform"
        server.enable_module(
            {
                "serve": {address: str(_PAGE)},
                "module_scripts": [f"{address}/page.js"],
                "styles": [f"{address}/page.css"],
                "vue_use": ["segdeform"],
            }
        )
        server.add_protocol_to_configure(self._configure)
        server.controller.on_server_bind.add(self._bound)
        server.controller.trigger("press")(self.model.press)
        state = server.state
        state.formats = formats()
        state.upload_limit = self.transfer.limit
        state.dark = False
        state.change("dark")(self._set_dark)
        themes = {name: {"dark": name == "dark", "colors": c} for name, c in _COLOURS.items()}
        config = {"theme": {"defaultTheme": "light", "themes": themes}}
        theme = ("dark ? 'dark' : 'light'",)
        with VAppLayout(server, vuetify_config=config, theme=theme) as layout:
            layout.root.add_child((_PAGE / "page.html").read_text(encoding="utf-8"))
        with VirtualNode():  # without a server: trame keeps that of the last node, and its editor
            pass
        # When the connection is lost, the page itself says so; trame would replace it.
        state.trame__template_error = state.trame__template_main

    def _bound(self, server: Any) -> None:
        """Add the routes of files to wslink's *server*; hide it if there is a secret."""
        if server.app is None:  # it listens nowhere
            self.endpoint = server["ws"]
            return
        self.transfer.add_routes(server.app)
        if self._secret:
            self._hidden = server.app
            server.set_app(below(self._secret, server.app, once=self._once))

    def _configure(self, root: Any) -> None:
        """Add the messages of the view; remove those by which a page could end this process."""
        root.registerLinkProtocol(self._protocol)
        root.exit = root.exitLater = None

    def _set_dark(self, dark: object, **_: object) -> None:
        if self._is_plotter_ours:
            set_background(self.plotter.renderer, dark=dark is True)
        self.stream.want()


def _ignore_lost_pages(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Report errors of tasks, but not where a page has gone while wslink was sending to it."""
    of = getattr(context.get("future"), "get_coro", lambda: None)()
    is_wslinks = getattr(of, "__qualname__", "").startswith("WslinkHandler.")
    if not (is_wslinks and isinstance(context.get("exception"), ConnectionResetError)):
        loop.default_exception_handler(context)


@contextmanager
def _own_settings() -> Iterator[None]:
    """Hide the arguments of this program from trame, which would parse them.

    Pictures are compressed already; wslink would compress them once more.
    """
    arguments, compress = sys.argv, os.environ.get(_COMPRESS)
    sys.argv, os.environ[_COMPRESS] = arguments[:1], "0"
    try:
        yield
    finally:
        sys.argv = arguments
        if compress is None:
            del os.environ[_COMPRESS]
        else:
            os.environ[_COMPRESS] = compress
