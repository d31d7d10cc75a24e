"""Everything that is beside the view: a head, what belongs to the mode, and a foot.

    DeformPanel(editor)

It hears whenever the editor says something, which it does after every change of the session, the
mode, a tool or a job; and then shows, a moment later and all at once, what has changed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qtpy import QtCore, QtWidgets

from vtk_segdeform.session import Change

from ..editor import DeformEditor, Mode, binding_of
from .controls import shortcut
from .foot import Foot
from .handles import HandlesPart
from .log import LogPart
from .modes import Head
from .options import CagesPart, DeformPart
from .painting import PaintingPart
from .regions import RegionsPart

Qt = QtCore.Qt
_PATIENCE = 30  # milliseconds; moves of a drag come faster
_WIDTH = 40  # letters
_KEYS = {"Ctrl+Z": "ctrl+z", "Ctrl+Y": "ctrl+y", "Ctrl+Shift+Z": "ctrl+y", "Escape": "escape"}


class DeformPanel(QtWidgets.QWidget):
    """A panel over an editor; goes dim when the editor is removed.

    Parameters
    ----------
    editor : DeformEditor
        What it shows, and what it does things with.
    parent : QWidget, optional
        As ever in Qt.
    """

    deformed = QtCore.Signal()
    """The pose is another one; at every move of a drag."""
    regions_changed = QtCore.Signal()
    """`Session.regions` are others, or called otherwise."""
    session_changed = QtCore.Signal(object)
    """Another session was opened: this one."""
    error = QtCore.Signal(str)
    """Something went wrong, in words."""

    def __init__(self, editor: DeformEditor, parent: Any = None) -> None:
        super().__init__(parent)
        self.editor = editor
        self.head, self.foot, self.log = Head(editor), Foot(editor), LogPart(editor)
        self.painting, self.regions = PaintingPart(editor), RegionsPart(editor)
        self.handles = HandlesPart(editor)
        self.cages, self.deform = CagesPart(editor), DeformPart(editor)
        self._parts: dict[Any, set[Mode]] = {
            self.handles: {Mode.HANDLES, Mode.DEFORM},
            self.cages: {Mode.CAGES},
            self.deform: {Mode.DEFORM},
            self.regions: {Mode.REGIONS, Mode.CAGES, Mode.DEFORM},
            self.painting: {Mode.REGIONS, Mode.HANDLES},
        }
        self._build()
        self._patience = QtCore.QTimer(self)
        self._patience.setSingleShot(True)
        self._patience.setInterval(_PATIENCE)
        self._patience.timeout.connect(self.refresh)
        self._stops: list[Callable[[], None]] = [
            editor.desk.voice.on_word(self._heard),
            editor.view.on_failure(lambda _: self.error.emit(editor.desk.voice.fault)),
        ]
        self._stop_session: list[Callable[[], None]] = []
        self._follow()
        # When Qt has deleted what is drawn here, nobody is to speak to it any more.
        self.destroyed.connect(_ender(self._stops, self._stop_session))
        self.refresh()

    def refresh(self) -> None:
        """Show how things are now."""
        editor, busy = self.editor, self.editor.is_busy
        self.setEnabled(editor.GetEnabled())
        self._inside.setEnabled(not busy)
        self.head.refresh()
        self.foot.refresh()
        self.log.refresh()
        if busy:  # the session is the job's
            return
        for part, modes in self._parts.items():
            part.setVisible(editor.mode in modes)
            if editor.mode in modes:
                part.refresh()
        if editor.stage.dragger.is_refining:  # which may end without another word
            self._patience.start()

    def stop(self) -> None:
        """Hear of nothing any more, for good."""
        _ender(self._stops, self._stop_session)()
        self._patience.stop()
        self.setEnabled(False)

    def _build(self) -> None:
        self._inside = QtWidgets.QWidget()
        inside = QtWidgets.QVBoxLayout(self._inside)
        inside.setContentsMargins(0, 0, 0, 0)
        for part in self._parts:
            inside.addWidget(part)
        inside.addStretch(1)
        area = QtWidgets.QScrollArea()
        area.setWidget(self._inside)
        area.setWidgetResizable(True)
        area.setFrameShape(QtWidgets.QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(self.head)
        layout.addWidget(area, 1)
        layout.addWidget(self.foot)
        layout.addWidget(self.log)
        self.setMinimumWidth(_WIDTH * self.fontMetrics().averageCharWidth())
        for keys, key in _KEYS.items():
            self._add_shortcut(keys, key)

    def _add_shortcut(self, keys: str, key: str) -> None:
        binding = binding_of(key, Mode.REGIONS)
        if binding is None or binding.action is None:
            raise ValueError(f"{key!r} is no key of every mode")
        action, while_busy = binding.action, binding.while_busy
        shortcut(keys, self, lambda: self.editor.do(action, while_busy=while_busy))

    # What is heard.

    def _heard(self) -> None:
        if self.editor.session is not self._session:
            self._follow()
            self.session_changed.emit(self._session)
        if not self._patience.isActive():
            self._patience.start()

    def _follow(self) -> None:
        """Listen to the session of now, and to nothing else."""
        self._session, selector = self.editor.session, self.editor.stage.selector
        for stop in self._stop_session:
            stop()
        tag = selector.AddObserver("ModifiedEvent", lambda *_: self._heard())
        self._stop_session[:] = [
            self._session.on_change(self._changed),
            lambda: selector.RemoveObserver(tag),
        ]

    def _changed(self, change: Change) -> None:
        if change & Change.POSE:
            self.deformed.emit()
        if change & (Change.REGIONS | Change.NAMES):
            self.regions_changed.emit()


def _ender(*lists: list[Callable[[], None]]) -> Callable[..., None]:
    """Return a callable that stops all that is in *lists* when it is called."""

    def end(*_: object) -> None:
        for stops in lists:
            while stops:
                stops.pop()()

    return end
