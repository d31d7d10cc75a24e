"""The widget that joins a `Tunnel` to a notebook: anywidget shows it in all their front ends."""

from __future__ import annotations

import weakref
from pathlib import Path
from typing import Any

import anywidget
import traitlets

from .tunnel import Tunnel
from .web_editor import WebEditor


class EditorWidget(anywidget.AnyWidget):
    """The pages of one editor; displayed several times, as many pages.

    ipywidgets keeps every widget, so this one has only a weak reference to the tunnel.
    """

    _esm = Path(__file__).with_name("page") / "widget.js"
    picture = traitlets.Unicode().tag(sync=True)  # class of the pictures that a page replaces

    def __repr__(self) -> str:
        return "The page of the editor is here while its kernel runs."


def tunnel_of(editor: WebEditor, picture: str) -> tuple[Tunnel, EditorWidget]:
    """Return the tunnel of an *editor*, and the widget that shows its pages."""
    widget = EditorWidget(picture=picture)
    tunnel = Tunnel(editor, widget.send)
    known = weakref.ref(tunnel)

    def receive(_: object, content: Any, buffers: Any) -> None:
        if (tunnel := known()) is None:
            widget.send({"kind": "ended", "page": content["page"]})
        else:
            tunnel.receive(content, buffers)

    widget.on_msg(receive)
    return tunnel, widget
