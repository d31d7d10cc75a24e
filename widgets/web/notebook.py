"""The editor in a notebook: a page in the output of a cell.

    editor = sd.edit(mesh)           # the output shows the page, the cell ends at once
    editor.session.volume_change     # in the next cell

The kernel's event loop runs the editor, between cells, so both use the session in one thread.  The
page talks to the kernel through the channel of the notebook's widgets, wherever the kernel is;
nothing listens on the network.

An editor ends when nothing refers to it any more, when it is closed, and with the kernel.
"""

from __future__ import annotations

import asyncio
import base64
import logging
import secrets
import string
import sys
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.importing import imported
from vtk_segdeform.session import Session

from ..hosting import add_editor, edited

if TYPE_CHECKING:
    from ..editor import DeformEditor, KeyChoice
    from .web_editor import WebEditor

_log = logging.getLogger(__name__)
_TEMPLATE = Path(__file__).with_name("page") / "notebook.html"
_LIVE = ("trame", "server", "client")


def shows_in_notebook(theme: Any) -> bool:
    """Return whether plotters with this *theme* show in the notebook that runs this code."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    is_marimo = "marimo" in sys.modules and sys.modules["marimo"].running_in_notebook()
    has_kernel = getattr(shell, "kernel", None) is not None or is_marimo
    is_wanted = has_kernel if theme.notebook is None else bool(theme.notebook)
    return has_kernel and is_wanted and _backend(theme) != "none"


class NotebookEditor:
    """An editor in the output of a cell.

    Made by `edit` in a notebook; displayed where it is the last value of a cell.

    Attributes
    ----------
    web : WebEditor
        The editor.
    """

    def __init__(self, given: Any, web: WebEditor) -> None:
        self.web, self._given = web, given
        self._picture = f"segdeform-{secrets.token_hex(8)}"  # a class of elements
        self._widget: Any = None
        self._serving: asyncio.Task[None] | None = None
        self._stop: weakref.finalize[Any, Any] | None = None

    @property
    def session(self) -> Session:
        """The session being edited; another one after the page has opened a file."""
        return self.web.session

    @property
    def mesh(self) -> Any:
        """The deformed surface as it is now, of the type that was given to `edit`."""
        return edited(self._given, self.session)

    @property
    def is_live(self) -> bool:
        """Whether the editor runs."""
        is_wanted = self._stop is not None and self._stop.alive
        return is_wanted and self._serving is not None and not self._serving.done()

    def start(self) -> None:
        """Run the editor in the running event loop; again, do nothing."""
        if self._stop is not None:
            return
        tunnel, self._widget = _tunnel_of()(self.web, self._picture)
        loop, ended = asyncio.get_running_loop(), asyncio.Event()
        work = self.web.serve_until(ended, last=tunnel.close, port=None)
        self._serving = loop.create_task(work)
        self._serving.add_done_callback(_report)
        self._stop = weakref.finalize(self, _end, loop, ended)
        self._stop.atexit = False

    def close(self) -> None:
        """End the editor; the session and the mesh stay as they are."""
        if self._stop is not None:
            self.web.stream.close()
            self._stop()

    remove = close

    def _ipython_display_(self) -> None:
        """Display a picture, which stays in a saved notebook, and the page in its place."""
        imported("IPython.display")
        from IPython.display import display

        display({"text/html": self._html(), "text/plain": repr(self)}, raw=True)
        if self.is_live:
            display(self._widget)

    def _display_(self) -> Any:
        """Return what marimo displays."""
        return self._widget

    def __repr__(self) -> str:
        state = "live" if self.is_live else "closed"
        return f"<NotebookEditor of {self.session.mesh.n_vertices:,} vertices, {state}>"

    def _html(self) -> str:
        if not self.is_live:
            return "<p>This editor is closed. Run the cell again to edit.</p>"
        imported(f"{__package__}.pictures")
        from .pictures import Pictures

        data = base64.b64encode(Pictures(self.web.editor.view).draw()().data).decode()
        template = string.Template(_TEMPLATE.read_text(encoding="utf-8"))
        return template.substitute(picture=self._picture, data=data)


def edit_in_notebook(given: Any, session: Session, *, name: str, keys: KeyChoice) -> NotebookEditor:
    """Return the editor of *session*, served.

    Raises
    ------
    MissingDependencyError
        If trame is not installed.
    """
    editor = NotebookEditor(given, _web_editor()(session, name=name, keys=keys))
    editor.start()
    return editor


def add_to_notebook(
    plotter: Any, session: Session, *, path: Path | None, name: str, keys: KeyChoice
) -> DeformEditor:
    """Add an editor to *plotter*, whose `show` then shows the page of its first editor.

    Raises
    ------
    MissingDependencyError
        If trame is not installed.
    """
    if "show" in vars(plotter):
        editor = add_editor(plotter, session, keys=keys)
        if path is not None:
            editor.path = path
        return editor
    web = _web_editor()(session, plotter=plotter, name=name, keys=keys)
    shown = NotebookEditor(session, web)
    plotter.segdeform.added.append(shown)
    plotter.show = _Show(plotter, shown)
    return web.editor


class _Show:
    """Replaces the `show` of a plotter: pyvista's own pages send no keys and no timers."""

    def __init__(self, plotter: Any, shown: NotebookEditor) -> None:
        self._plotter, self._shown = plotter, shown
        self._show = plotter.show

    def __call__(
        self,
        *arguments: Any,
        jupyter_backend: str | None = None,
        return_viewer: bool = False,
        **keywords: Any,
    ) -> Any:
        imported("IPython.display")
        from IPython.display import display

        if (jupyter_backend or _backend(self._plotter.theme)).lower() not in _LIVE:
            keywords.update(jupyter_backend=jupyter_backend, return_viewer=return_viewer)
            return self._show(*arguments, **keywords)
        keywords.update(jupyter_backend="none", interactive=False, auto_close=False)
        result = self._show(*arguments, **keywords)
        self._shown.start()
        if return_viewer:
            return self._shown
        display(self._shown)
        return result


def _backend(theme: Any) -> str:
    """Return which of pyvista's backends shows plotters with this *theme*."""
    return str(theme.jupyter_backend or _LIVE[0]).lower()


def _web_editor() -> type[WebEditor]:
    """Return the class `WebEditor`."""
    try:
        from . import WebEditor
    except MissingDependencyError as error:
        raise MissingDependencyError(
            f"{error}, or for notebooks 'vtk-segdeform[jupyter]'"
        ) from None
    return WebEditor


def _tunnel_of() -> Any:
    """Return `widget.tunnel_of`."""
    try:
        return imported(f"{__package__}.widget").tunnel_of
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"The editor in a notebook needs {error.name}: pip install 'vtk-segdeform[jupyter]'"
        ) from None


def _end(loop: asyncio.AbstractEventLoop, ended: asyncio.Event) -> None:
    """End a server, from any thread."""
    if not loop.is_closed():
        loop.call_soon_threadsafe(ended.set)


def _report(serving: asyncio.Task[None]) -> None:
    if not serving.cancelled() and (error := serving.exception()) is not None:
        _log.error("the editor in a notebook has ended: %s", error)
