"""The window of the desktop program: a page to start from, or `DeformWidget` over one document.

    window = Window()
    window.show()
    window.begin(Path("horse.ply"))

Files are read in another thread.  What was open stays until the next one is there, so that a
file that cannot be read costs nothing; unsaved work is kept by `Keeper` all the while.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from vtk_segdeform.session import Session

from ..editor import DeformEditor
from ..qt import DeformWidget
from .asking import ask_file, choose_work, tell_failure
from .autosave import Autosaves, Slot
from .documents import Document, Opened, from_file, from_slot, the_cactus
from .drops import Drops
from .keeper import INTERVAL, Keeper, stops_of
from .menus import Menus, lead_panel
from .opening import Opening, Request
from .pages import Pages
from .recent import Recent
from .saving import may_be_given_up

_SIZE = 1200, 800


class Window(QtWidgets.QMainWindow):
    """One document at a time, or none yet.

    Parameters
    ----------
    settings : QSettings, optional
        Where recent files are kept; the user's unless given.
    autosaves : Autosaves, optional
        Where unsaved work is kept; in the user's folder unless given.
    interval : float
        Seconds that a crash may cost.

    Attributes
    ----------
    document : Document
        Where what is open came from.
    editor_widget : DeformWidget or None
        What it is edited in.
    keeper, autosaves, recent : Keeper, Autosaves, Recent
        Unsaved work, where it is kept, and the files that were open last.
    mesh_state : object
        The state of the session of which the mesh is saved.
    """

    def __init__(
        self,
        settings: Any = None,
        autosaves: Autosaves | None = None,
        *,
        interval: float = INTERVAL,
    ) -> None:
        super().__init__()
        self.recent = Recent(settings or QtCore.QSettings("vtk_segdeform", "segdeform"))
        self.autosaves = autosaves or Autosaves()
        self.keeper = Keeper(self.autosaves, self, interval=interval)
        self.keeper.failed.connect(self._say)
        self.document = Document("")
        self.mesh_state: object = None
        self.editor_widget: Any = None
        self._opening: Opening | None = None
        self._stops = stops_of(self)
        self.pages = Pages()
        self.pages.start.open_wanted.connect(self.ask_and_open)
        self.pages.start.cactus_wanted.connect(self.open_cactus)
        self.pages.start.chosen.connect(self.open)
        self.pages.waiting.cancelled.connect(self._stop_opening)
        self.setCentralWidget(self.pages)
        self.menus = Menus(self)
        drops = Drops(self)
        drops.held.connect(self.pages.start.target.light_up)
        drops.dropped.connect(self.open)
        self.resize(*_SIZE)
        self._show_page()

    # What is open.

    @property
    def has_mesh(self) -> bool:
        """Whether something is open."""
        return self.editor_widget is not None

    @property
    def editor(self) -> DeformEditor:
        """The editor of what is open."""
        editor: DeformEditor = self.editor_widget.editor
        return editor

    @property
    def session(self) -> Session:
        """The session of what is open."""
        return self.editor.session

    @property
    def is_behind(self) -> bool:
        """Whether something would be lost if the window were closed now."""
        return self.has_mesh and self.editor.desk.file.is_behind(self.session)

    def keep_in_mind(self, document: Document) -> None:
        """Go on with the same session under what *document* tells of its files."""
        self.document = document
        self.keeper.about = document.about
        self._heard()

    # Opening.

    def begin(self, path: Path | None = None) -> None:
        """Offer what a crash has left; if it is not taken, open *path*."""
        if not self.recover() and path is not None:
            self.open(path)

    def ask_and_open(self) -> None:
        """Ask for a file and open it."""
        before = self.recent.paths[:1]
        path = ask_file(self, before[0].parent if before else Path.cwd())
        if path is not None:
            self.open(path)

    def open(self, path: Path) -> None:
        """Open a mesh or a session, once what is open may go."""
        path = path.absolute()
        self._open(Request(path.name, from_file(path), path))

    def open_cactus(self) -> None:
        """Open something to try things on."""
        self._open(Request("the cactus", the_cactus))

    def recover(self) -> bool:
        """Offer what crashed programs have left; tell whether some of it is taken."""
        slot = choose_work(self, self.autosaves)
        if slot is None:
            return False
        if not self._open(Request(slot.about.name, from_slot(slot), slot=slot)):
            slot.release()
        return True

    def clear_recent(self) -> None:
        """Forget which files were open."""
        self.recent.clear()
        self._show_page()

    def _open(self, request: Request) -> bool:
        """Begin to read; tell whether what is open may go for it."""
        if not may_be_given_up(self):
            return False
        self._stop_opening()
        self.pages.waiting.begin(request.name)
        self._opening = Opening(request, self)
        self._opening.got_on.connect(self.pages.waiting.show_progress)
        self._opening.opened.connect(self._opened)
        self._opening.failed.connect(self._failed)
        self._show_page()
        return True

    def _opened(self, request: Request, opened: Opened) -> None:
        self._end_opening()
        self.keeper.forget()
        self._close_document()
        self.pages.delete_views()
        self.document, session = opened
        self.mesh_state = None
        widget = self.editor_widget = DeformWidget(session, self)
        widget.editor.desk.file = self.document.file(session, is_unsaved=bool(request.slot))
        lead_panel(self)
        self._stops.append(widget.editor.desk.voice.on_word(self._heard))
        widget.session_changed.connect(lambda _: self._mind())
        self._mind(request.slot)
        self.pages.addWidget(widget)
        if request.path is not None:
            self.recent.add(request.path)
        self._show_page()
        widget.setFocus()
        if request.slot is not None:
            self._say("recovered; it is still to be saved")

    def _failed(self, request: Request, text: str) -> None:
        self._stop_opening()
        if request.path is not None and not os.path.exists(request.path):
            self.recent.drop(request.path)
        self._show_page()
        tell_failure(self, f"{request.name} could not be opened", text)

    def _stop_opening(self) -> None:
        if self._opening is not None:
            self._opening.cancel()
        self._end_opening()

    def _end_opening(self) -> None:
        opening, self._opening = self._opening, None
        if opening is not None:
            opening.deleteLater()
            self._show_page()

    def _mind(self, slot: Slot | None = None) -> None:
        self.keeper.mind(self.session, self.document.about, lambda: self.is_behind, slot=slot)

    def _close_document(self) -> None:
        widget, self.editor_widget = self.editor_widget, None
        if widget is not None:
            self._stops.pop()()
            widget.close()

    # What is shown.

    def _show_page(self) -> None:
        pages = self.pages
        here = self.editor_widget or pages.start
        if here is pages.start:
            pages.start.show_recent(self.recent.paths)
        pages.setCurrentWidget(here if self._opening is None else pages.waiting)
        self.menus.refresh()
        self._heard()

    def _heard(self) -> None:
        """Show what the title is to say, and forget what is saved."""
        name = self.document.name if self.has_mesh else ""
        is_behind = self.is_behind
        self.setWindowTitle(f"{name}[*] - segdeform" if name else "segdeform")
        self.setWindowModified(is_behind)
        if self.has_mesh and not is_behind:
            self.keeper.keep()

    def _say(self, text: str) -> None:
        self.editor.desk.say(text)

    def closeEvent(self, event: Any) -> None:  # noqa: N802
        """Close once what is open may go; what is kept of it goes with it."""
        if not may_be_given_up(self):
            event.ignore()
            return
        self._stop_opening()
        self.keeper.close()
        self._close_document()
        super().closeEvent(event)
