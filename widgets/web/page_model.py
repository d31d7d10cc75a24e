"""What the page shows, as JSON, and the one way in which it uses the editor.

The models are those of `widgets.panel`, which Qt draws as well.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

from vtk_segdeform.errors import ArgumentError

from .. import panel
from ..editor import DeformEditor
from ..panel import Field
from ..scene import Pointer
from .touch import for_fingers

_PERIOD = 0.1  # seconds between two refreshes, at least
_UNSHARED = frozenset({"act", "acts", "action", "while_busy"})
# Keys of the page itself, after those of the editor in its help.
_OWN_KEYS = (
    "Page",
    (("Ctrl+O", "Open a file"), ("Ctrl+S", "Download the session"), ("F6", "Toolbar, settings")),
)

_log = logging.getLogger(__name__)


class PageModel:
    """Keeps the state of a page as the editor is.

    Parameters
    ----------
    editor : DeformEditor
        The editor.
    state : trame_server.state.State
        The state of the page; only what differs is sent.
    names : mapping of str to str
        Files of the server, by the names that the page shows instead.
    """

    def __init__(self, editor: DeformEditor, state: Any, names: dict[str, str]) -> None:
        self._editor, self._state, self._names = editor, state, names
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_due = False
        self._place: tuple[float, float] | None = None  # of the open menu, as shares of the view
        editor.controller.show_menu = self._open_menu
        self.refresh()
        self.stop: Callable[[], None] = editor.controller.messages.on_change(self.changed)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Follow the editor in *loop*."""
        self._loop = loop

    def changed(self) -> None:
        """Refresh the page soon."""
        if self._loop is not None and not self._is_due:
            self._is_due = True
            self._loop.call_later(_PERIOD, self._flush)

    def _flush(self) -> None:
        self._is_due = False
        self.refresh()
        self._state.flush()

    def refresh(self) -> None:
        """Show the editor as it is."""
        editor, keys, name = self._editor, self._editor.keys, self.name
        status = panel.status(editor)
        self._show("status", status)
        self._show("touch_words", for_fingers(status.words))
        self._show("toolbar", panel.toolbar(editor))
        self._show("sections", panel.sections(editor))
        self._show("history", panel.history(editor))
        entries = () if self._place is None or editor.is_busy else panel.menu(editor)
        self._show("menu", entries)
        self._state["menu_place"] = self._place
        is_modified = editor.controller.is_modified
        stem = name.rpartition(".")[0] or name
        self._state["document"] = {"name": name, "stem": stem, "modified": is_modified}
        self._state["trame__title"] = f"{name} · segdeform"
        self._state["uses_tab"] = keys.binding_of("tab", editor.mode) is not None
        self._state["help"] = {"keys": keys["help"].keys, "sections": [*keys.sections(), _OWN_KEYS]}

    def press(self, name: object, value: object = None) -> None:
        """Use a control; see `panel.press`.

        "hint" runs the action of a word of the hint, and "menu" closes the menu of a right click.
        """
        editor = self._editor
        self._place = None  # any use of the page closes the menu
        with editor.view.guarded(), editor.view.drawing_once():
            try:
                if name == "menu":
                    pass
                elif name == "hint":
                    words = panel.status(editor).words
                    if value in {word.action for word in words if word.action}:
                        editor.run(str(value))
                else:
                    panel.press(editor, name, value)  # type: ignore[arg-type]
            except ArgumentError as fault:
                _log.info("a page pressed %r: %s", name, fault)
                editor.controller.messages.report_error(fault)
                editor.controller.refresh()
        self.changed()

    def _open_menu(self, pointer: Pointer) -> None:
        width, height = self._editor.view.renderer.GetSize()
        self._place = pointer.x / width, 1.0 - pointer.y / height
        self.changed()

    @property
    def name(self) -> str:
        """The name of the document, as the page shows it."""
        return self._names.get(str(self._editor.path), self._editor.path.name)

    def _show(self, key: str, model: Any) -> None:
        keys = self._editor.keys
        self._state[key] = self._public(_plain(model, lambda field: panel.tooltip(field, keys)))

    def _public(self, value: Any) -> Any:
        """Return *value* with the names that the page shows for files of the server."""
        if isinstance(value, str):
            for path, name in self._names.items():
                value = value.replace(path, name)
            return value
        if isinstance(value, list):
            return [self._public(each) for each in value]
        if isinstance(value, dict):
            return {key: self._public(each) for key, each in value.items()}
        return value


def _plain(model: Any, tip: Callable[[Field], str] | None = None) -> Any:
    """Return a model as lists, dicts, texts and numbers, without anything that is not visible."""
    if isinstance(model, tuple | list):
        return [_plain(each, tip) for each in model if getattr(each, "visible", True)]
    if not is_dataclass(model):
        return model
    names = [each.name for each in fields(model) if each.name not in _UNSHARED]
    if not isinstance(model, Field):
        names = [each.name for each in fields(model) if each.name != "acts"]
    made = {name: _plain(getattr(model, name), tip) for name in names}
    if isinstance(model, Field) and tip is not None:
        made["tip"] = tip(model)
    return made
