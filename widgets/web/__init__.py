"""The editor in a browser.

The files, in reading order:

    web_editor  `WebEditor`: an off-screen view, a trame server and a page
    stream      input in, pictures out, in one order
    page_drawing
                what the page draws itself during a drag
    inputs key_names timers pictures
                the parts of that: events, keys, timers, JPEG
    protocol answers
                the messages between page and stream, and answers to calls that fail
    page_model  what the page shows, and the one way in which it uses the editor
    touch       hints for fingers
    transfer    uploads and downloads
    access      a page behind a secret path
    serving     ``segdeform serve``: one editor in one process
    notebook    the editor in the output of a cell, run by the kernel
    widget tunnel whole_page
                the parts of that: what is displayed, its messages, its page as one document
    page/       the page: view.js, panel.js, page.js, page.html, page.css; in a notebook also
                widget.js around it and tunnel.js in it
    drawing/    the body drawn by the page, from the cages alone

It needs ``pip install 'vtk-segdeform[web]'``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.importing import imported

if TYPE_CHECKING:
    from .notebook import add_to_notebook, edit_in_notebook, shows_in_notebook
    from .serving import serve_until_stopped
    from .web_editor import WebEditor

__all__ = [
    "WebEditor",
    "add_to_notebook",
    "edit_in_notebook",
    "serve_until_stopped",
    "shows_in_notebook",
]
_FILES = {"WebEditor": "web_editor", "serve_until_stopped": "serving"}


def __getattr__(name: str) -> Any:
    """Import a name when it is first used: trame is optional."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(imported(f"{__name__}.{_FILES.get(name, 'notebook')}"), name)
    except ModuleNotFoundError as fault:
        if (fault.name or "").startswith("vtk_segdeform"):
            raise
        raise MissingDependencyError(
            f"The editor in a browser needs {fault.name}: pip install 'vtk-segdeform[web]'"
        ) from None
