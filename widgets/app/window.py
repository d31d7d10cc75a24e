"""The window of the desktop program: a start page, or a `DeformWidget` for one document.

    window = Window()
    window.show()
    window.begin(Path("horse.ply"))

Files are read in another thread.  The current document stays open until the next one has been
read, so an unreadable file loses nothing.  `Autosaver` saves unsaved work meanwhile.
"""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from vtk_segdeform.kernels import load_early
from vtk_segdeform.session import Session

from ..editor import (
    INTERVAL,
    Autosaver,
    Autosaves,
    DeformEditor,
    Kind,
    Queue,
    Task,
)
from ..qt import DeformWidget, menu_keys, stopper
from ..scene import Stop
from .dialogs import ask_file, ask_repair_instead, choose_work, show_error
from .documents import (
    Document,
    Opened,
    Request,
    Unopenable,
    from_file,
    from_slot,
    opening_error,
    sample_model,
)
from .menus import Menus, connect_panel
from .pages import Pages
from .qt_ticker import QtTicker
from .recent import Recent
from .repairing import ask_repair, ask_repair_of
from .saving import may_discard
from .stored_keys import read_keys, write_keys

_SIZE = 1200, 800
_PAUSE = 300  # milliseconds from the start page to the loading of the compiled kernels


class Window(QtWidgets.QMainWindow):
    """The main window, with one document at a time or none.

    Parameters
    ----------
    settings : QSettings, optional
        Where recent files are stored; by default the user's settings.
    autosaves : Autosaves, optional
        Where unsaved work is stored; by default the user's folder.
    interval : float
        Longest part of an ongoing drag that a crash may lose, in seconds.

    Attributes
    ----------
    editor_widget : DeformWidget or None
        The widget that edits it.
    keys : Keys
        The user's keys.
    autosaver : Autosaver or None
        The autosave of the document.
    autosaves, recent : Autosaves, Recent
        The folder of autosaves, and the recently opened files.
    mesh_state : object
        The state of the session when its mesh was last saved.
    """

    def __init__(
        self,
        settings: Any = None,
        autosaves: Autosaves | None = None,
        *,
        interval: float = INTERVAL,
    ) -> None:
        super().__init__()
        self._settings = settings or QtCore.QSettings("vtk_segdeform", "segdeform")
        self.recent = Recent(self._settings)
        self.keys, self._fault_of_keys = read_keys(self._settings)
        self.autosaves = autosaves or Autosaves()
        self.autosaver: Autosaver | None = None
        self._interval = interval
        self._documents: dict[Session, Document] = {}  # of the sessions in the history
        self.mesh_state: object = None
        self.editor_widget: Any = None
        self._request: Request | None = None  # that is being opened
        self._queue = Queue(QtTicker(self), self._show_progress)
        self._stops: list[Stop] = []  # end when Qt deletes the window, too
        self.destroyed.connect(stopper(self._stops))
        self.pages = Pages()
        self.pages.start.open_wanted.connect(self.ask_and_open)
        self.pages.start.sample_wanted.connect(self.open_sample)
        self.pages.start.chosen.connect(self.open)
        self.pages.waiting.cancelled.connect(self._cancel_opening)
        self.setCentralWidget(self.pages)
        self.menus = Menus(self)
        self.setAcceptDrops(True)  # of its children none does
        self.resize(*_SIZE)
        self._show_page()

    # The open document.

    @property
    def has_mesh(self) -> bool:
        """Whether a document is open."""
        return self.editor_widget is not None

    @property
    def editor(self) -> DeformEditor:
        """The editor of the document."""
        editor: DeformEditor = self.editor_widget.editor
        return editor

    @property
    def session(self) -> Session:
        """The session of the document."""
        return self.editor.session

    @property
    def is_modified(self) -> bool:
        """Whether the document has unsaved changes."""
        return self.has_mesh and self.editor.controller.is_modified

    @property
    def document(self) -> Document:
        """The open document."""
        return self._documents.get(self.session) or Document(self.editor.path.stem)

    def set_document(self, document: Document) -> None:
        """Change the files of the open document; the session is unchanged."""
        self._documents[self.session] = document
        self._update_title()

    # Opening.

    def begin(self, path: Path | None = None) -> None:
        """Offer to recover autosaved work; open *path*, if it is given, unless that is accepted."""
        is_recovered = self.recover()
        if path is None:
            QtCore.QTimer.singleShot(_PAUSE, self, self._load_kernels)
        elif not is_recovered:
            self.open(path)

    def ask_and_open(self) -> None:
        """Ask for a file and open it."""
        before = self.recent.paths[:1]
        path = ask_file(self, before[0].parent if before else Path.cwd())
        if path is not None:
            self.open(path)

    def open(self, path: Path) -> None:
        """Open a mesh or a session, unless the user keeps the current document."""
        path = path.absolute()
        self._open(Request(path.name, from_file(path), path))

    def open_sample(self) -> None:
        """Open the sample model."""
        self._open(Request("sample model", sample_model))

    def repair(self) -> None:
        """Show what a repair would do; open the result as a new document if the user accepts."""
        repaired = ask_repair(self)
        if repaired is not None:
            document, session = repaired
            self._documents[session] = document
            file = document.file(session, is_new=True)
            self.editor.do(lambda controller: controller.open_repaired(session, file))

    def _load_kernels(self) -> None:
        """Load the compiled kernels while the start page is shown, so that files open faster."""
        if not self.has_mesh and self._request is None:
            load_early()

    def recover(self) -> bool:
        """Offer to recover autosaved work; return whether the user accepts."""
        slot = choose_work(self, self.autosaves)
        if slot is None:
            return False
        if not self._open(Request(slot.about.name, from_slot(slot), slot=slot, is_new=True)):
            slot.release()
        return True

    def _keep_keys(self) -> None:
        """Store the keys that were assigned in the dialog."""
        self.keys = self.editor.keys
        write_keys(self._settings, self.keys)

    def clear_recent(self) -> None:
        """Clear the list of recent files."""
        self.recent.clear()
        self._show_page()

    def _open(self, request: Request) -> bool:
        """Start reading; return False if the user keeps the current document."""
        if not may_discard(self):
            return False
        self._cancel_opening()
        self.pages.waiting.begin(request.name)
        self._request = request
        task = Task(
            kind=Kind.DOCUMENT,
            begin=lambda: request.reader,
            done=lambda opened: self._opened(request, opened),
            failed=lambda error: self._failed(request, error),
        )
        self._queue.add(task)
        self._show_page()
        return True

    def _show_progress(self) -> None:
        if (task := self._queue.task(Kind.DOCUMENT)) is not None:
            self.pages.waiting.show_progress(task.fraction, task.text)

    def _opened(self, request: Request, opened: Opened) -> None:
        self._request = None
        self._close_document()
        self.pages.delete_views()
        document, session = opened
        self._documents, self.mesh_state = {session: document}, None
        widget = self.editor_widget = DeformWidget(session, self)
        widget.editor.controller.file = document.file(session, is_new=request.is_new)
        widget.editor.show_cube = True
        widget.editor.keys = self.keys
        widget.taken_keys = lambda: menu_keys(self.menuBar())
        widget.keys_changed.connect(self._keep_keys)
        own = document.session_path or document.source
        if (path := request.slot.path if request.slot else own) is not None:
            widget.editor.controller.restore_view(path)
        connect_panel(self)
        widget.editor.controller.notices.offer(
            "Repair ...",
            partial(QtCore.QTimer.singleShot, 0, self, self.repair),  # after the press
            lambda session: not session.mesh.is_two_manifold,  # a closed one with seams needs none
        )
        widget.editor.controller.refresh()  # and with it the history in the panel
        self._stops.append(widget.editor.controller.messages.on_change(self._update_title))
        self.autosaver = Autosaver(
            widget.editor.controller,
            self.autosaves,
            lambda: self.document.about,
            slot=request.slot,
            interval=self._interval,
        )
        self.pages.addWidget(widget)
        if request.path is not None:
            self.recent.add(request.path)
        self._show_page()
        widget.setFocus()
        if request.slot is not None:
            self._say("Recovered (unsaved)")
        elif self._fault_of_keys:
            self._say(self._fault_of_keys)
            self._fault_of_keys = ""

    def _failed(self, request: Request, error: BaseException) -> None:
        self._cancel_opening()
        path = request.path
        if path is not None and not os.path.exists(path):
            self.recent.drop(path)
        self._show_page()
        title, text = f"Could not open {request.name}", opening_error(error)
        if path is None or not isinstance(error, Unopenable):
            show_error(self, title, text)
        elif ask_repair_instead(self, title, text):
            repaired = ask_repair_of(self, path, error)
            if repaired is not None:
                self._open(Request(repaired[0].name, lambda _: repaired, is_new=True))

    def _cancel_opening(self) -> None:
        """Cancel; the thread stops at its next progress report and is not waited for."""
        self._queue.cancel(Kind.DOCUMENT)
        request, self._request = self._request, None
        if request is not None:
            if request.slot is not None:
                request.slot.release()
            self._show_page()

    def _close_document(self) -> None:
        """Close the editor, and delete the autosave."""
        widget, self.editor_widget = self.editor_widget, None
        if self.autosaver is not None:
            self.autosaver.discard()
            self.autosaver = None
        while self._stops:
            self._stops.pop()()
        if widget is not None:
            widget.close()

    # Display.

    def _show_page(self) -> None:
        pages = self.pages
        here = self.editor_widget or pages.start
        if here is pages.start:
            pages.start.show_recent(self.recent.paths)
        pages.setCurrentWidget(here if self._request is None else pages.waiting)
        self.menus.refresh()
        self._update_title()

    def _update_title(self) -> None:
        """Show the name and the unsaved mark."""
        name = self.document.name if self.has_mesh else ""
        self.setWindowTitle(f"{name}[*] - segdeform" if name else "segdeform")
        self.setWindowModified(self.is_modified)

    def _say(self, text: str) -> None:
        self.editor.controller.say(text)

    def dragEnterEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Accept local files."""
        if _dropped(event):
            event.acceptProposedAction()
            self.pages.start.target.highlight(True)

    def dragLeaveEvent(self, event: Any) -> None:  # noqa: N802
        """Show that no file is dropped."""
        super().dragLeaveEvent(event)
        self.pages.start.target.highlight(False)

    def dropEvent(self, event: Any) -> None:  # noqa: N802
        """Open the first file, once the drop has been accepted."""
        event.acceptProposedAction()
        self.pages.start.target.highlight(False)
        path = _dropped(event)[0]
        QtCore.QTimer.singleShot(0, self, lambda: self.open(path))

    def closeEvent(self, event: Any) -> None:  # noqa: N802
        """Close the window and delete the autosave, unless the user keeps the document."""
        if not may_discard(self):
            event.ignore()
            return
        self._cancel_opening()
        self._close_document()
        super().closeEvent(event)


def _dropped(event: Any) -> list[Path]:
    """Return the local files of an event of drag and drop."""
    urls = event.mimeData().urls()
    return [Path(url.toLocalFile()) for url in urls if url.isLocalFile()]
