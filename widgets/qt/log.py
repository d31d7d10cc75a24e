"""The history in the panel: drags and jobs, folded at first."""

from __future__ import annotations

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor, Entry
from .controls import column, push_button, shortcut

Qt = QtCore.Qt
_LINES = 8


class LogPart(QtWidgets.QWidget):
    """A button that unfolds the list of drags and jobs.

    Parameters
    ----------
    editor : DeformEditor
        The editor whose log is shown.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__()
        self._editor = editor
        self._shown: list[Entry] = []
        self.fold = QtWidgets.QToolButton()
        self.fold.setText("History")
        self.fold.setToolTip("Drags and jobs: how long they took and how they ended")
        self.fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.fold.setAutoRaise(True)
        self.fold.setCheckable(True)
        self.fold.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.fold.toggled.connect(self._unfold)
        self.copy = push_button("Copy", "Copy the selected entries, or all (Ctrl+C)")
        self.copy.clicked.connect(self._copy)
        self.clear = push_button("Clear", "Clear this list; undo is not affected")
        self.clear.clicked.connect(self._clear)
        self.list = QtWidgets.QListWidget()
        self.list.setToolTip(self.fold.toolTip())
        self.list.setSelectionMode(QtWidgets.QAbstractItemView.SelectionMode.ExtendedSelection)
        self.list.setWordWrap(True)
        self.list.setAlternatingRowColors(True)
        self.list.setResizeMode(QtWidgets.QListView.ResizeMode.Adjust)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setVerticalScrollMode(QtWidgets.QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setTabKeyNavigation(False)
        self.list.setFixedHeight(_LINES * self.fontMetrics().lineSpacing())
        shortcut(QtGui.QKeySequence.StandardKey.Copy, self.list, self._copy, alone=True)
        top = QtWidgets.QHBoxLayout()
        top.addWidget(self.fold)
        top.addStretch(1)
        top.addWidget(self.copy)
        top.addWidget(self.clear)
        column(self, top, self.list)
        self.layout().setContentsMargins(0, 0, 0, 0)
        self._unfold(False)

    def refresh(self) -> None:
        """Show new entries, unless the list is folded."""
        if self.fold.isChecked():
            self._show(list(self._editor.controller.log.entries))

    def _show(self, entries: list[Entry]) -> None:
        bar = self.list.verticalScrollBar()
        at_end = bar.value() == bar.maximum()
        first = entries[0].number if entries else None
        while self._shown and (first is None or self._shown[0].number < first):
            self._shown.pop(0)
            self.list.takeItem(0)
        for k, entry in enumerate(entries):
            if k >= len(self._shown):
                self.list.addItem(entry.text)
            elif entry != self._shown[k]:
                self.list.item(k).setText(entry.text)
        self._shown = entries
        for button in (self.copy, self.clear):
            button.setEnabled(bool(entries))
        if at_end:
            self.list.scrollToBottom()

    def _unfold(self, down: bool) -> None:
        self.fold.setArrowType(Qt.ArrowType.DownArrow if down else Qt.ArrowType.RightArrow)
        for each in (self.list, self.copy, self.clear):
            each.setVisible(down)
        self.refresh()

    def _copy(self) -> None:
        rows = sorted(index.row() for index in self.list.selectedIndexes())
        entries = [self._shown[row] for row in rows] or self._shown
        QtGui.QGuiApplication.clipboard().setText("\n\n".join(entry.text for entry in entries))

    def _clear(self) -> None:
        self._editor.controller.log.clear()
        self.refresh()
