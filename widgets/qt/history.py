"""The history in the panel: a list of all states that previews them and jumps to them.

The row under the pointer, or that of the arrow keys, is shown in the view; a click or Enter jumps
there.  Leaving the list, or Escape, shows the current state again, whose row is bold.
"""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor, jumping_to, position_of, preview, states_of
from .controls import column, shortcut

Qt = QtCore.Qt
_LEAST = 2  # rows


class HistoryPart(QtWidgets.QWidget):
    """A button that folds the list of states.

    Parameters
    ----------
    editor : DeformEditor
        The editor whose history is shown.

    Attributes
    ----------
    fold : QToolButton
        Shows the list while it is down, as it is at first.
    list : QListWidget
        One row for each state, the oldest first.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__()
        self._editor = editor
        self._shown: tuple[tuple[str, ...], int] = (), -1
        self._is_previewing = False
        self.fold = QtWidgets.QToolButton()
        self.fold.setText("History")
        self.fold.setToolTip("Show or hide the history")
        self.fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.fold.setAutoRaise(True)
        self.fold.setCheckable(True)
        self.fold.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.list = QtWidgets.QListWidget()
        self.list.setAccessibleName("History")
        self.list.setUniformItemSizes(True)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setVerticalScrollMode(QtWidgets.QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setTabKeyNavigation(False)
        self.list.setFocusPolicy(Qt.FocusPolicy.TabFocus)  # the view keeps its keys after a click
        self.list.setMouseTracking(True)
        self.list.itemEntered.connect(self._hover)
        self.list.currentRowChanged.connect(self._preview)
        self.list.itemClicked.connect(lambda item: self._jump(self.list.row(item)))
        for enter in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            shortcut(enter, self.list, lambda: self._jump(self.list.currentRow()), alone=True)
        self.list.installEventFilter(self)
        column(self, self.fold, self.list)
        self.layout().setContentsMargins(0, 0, 0, 0)
        self.fold.toggled.connect(self._unfold)
        self.fold.setChecked(True)

    def refresh(self) -> None:
        """Show the current history, unless the list is folded."""
        if not self.fold.isChecked() or self._editor.is_busy:
            return
        controller = self._editor.controller
        now = states_of(controller), position_of(controller)
        if now != self._shown:
            self._show(*now)
        elif self._is_previewing and self._editor.widgets.surface.instead is None:
            self._return()  # an action in the view has ended the preview

    def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
        """End the preview when the pointer or the focus leaves the list."""
        kinds = QtCore.QEvent.Type
        if event.type() in (kinds.Leave, kinds.FocusOut, kinds.Hide):
            self._return()
        return bool(super().eventFilter(watched, event))

    def changeEvent(self, event: Any) -> None:  # noqa: N802
        """Redraw the rows after a change of palette or font."""
        super().changeEvent(event)
        if event.type() in (QtCore.QEvent.Type.PaletteChange, QtCore.QEvent.Type.FontChange):
            self._shown = (), -1
            self.refresh()

    @property
    def _row_height(self) -> int:
        return int(1.4 * self.fontMetrics().height())

    def _show(self, names: tuple[str, ...], position: int) -> None:
        """Show the states with their *names*, the one at *position* as the current one."""
        quiet = QtCore.QSignalBlocker(self.list)
        while self.list.count() > len(names):
            self.list.takeItem(self.list.count() - 1)
        while self.list.count() < len(names):
            self.list.addItem("")
        groups, role = QtGui.QPalette.ColorGroup, QtGui.QPalette.ColorRole.Text
        for row, name in enumerate(names):
            item = self.list.item(row)
            font = QtGui.QFont(self.font())
            font.setBold(row == position)
            group = groups.Disabled if row > position else groups.Active
            item.setText(name)
            item.setSizeHint(QtCore.QSize(0, self._row_height))
            item.setFont(font)
            item.setForeground(self.palette().color(group, role))
        self._shown, self._is_previewing = (names, position), False
        self.list.setCurrentRow(position)
        self.list.scrollToItem(self.list.item(position))
        quiet.unblock()

    def _hover(self, item: Any) -> None:
        """Make the row under the pointer the current one, without scrolling."""
        if not QtWidgets.QApplication.mouseButtons():
            self.list.setAutoScroll(False)
            self.list.setCurrentItem(item)
            self.list.setAutoScroll(True)

    def _preview(self, row: int) -> None:
        preview(self._editor.controller, row if row >= 0 else None)
        self._is_previewing = self._editor.widgets.surface.instead is not None

    def _return(self) -> None:
        """Show the current state again, and make its row the current one."""
        quiet = QtCore.QSignalBlocker(self.list)
        self.list.setCurrentRow(self._shown[1])
        quiet.unblock()
        if self._is_previewing:
            self._is_previewing = False
            preview(self._editor.controller, None)

    def _jump(self, row: int) -> None:
        if row >= 0:
            self._editor.do(jumping_to(row))
            self.refresh()

    def _unfold(self, down: bool) -> None:
        self.fold.setArrowType(Qt.ArrowType.DownArrow if down else Qt.ArrowType.RightArrow)
        self.list.setVisible(down)
        self.list.setMinimumHeight(_LEAST * self._row_height + 2 * self.list.frameWidth())
        policies = QtWidgets.QSizePolicy.Policy
        self.setSizePolicy(policies.Preferred, policies.Expanding if down else policies.Fixed)
        self.refresh()
