"""The history in the panel: a list of all states that previews them and jumps to them.

The row under the pointer, or that of the arrow keys, is shown in the view; a click or Enter jumps
there.  Leaving the list, or Escape, shows the current state again, whose row is bold.
"""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor
from ..panel import Entry, history
from .controls import Press, column, shortcut

Qt = QtCore.Qt
_LEAST = 2  # rows


class HistoryPart(QtWidgets.QWidget):
    """A button that folds the list of states.

    Parameters
    ----------
    editor : DeformEditor
        The editor whose history is shown.
    press : callable
        ``press(name, value)``, called to preview a state and to jump to it.

    Attributes
    ----------
    fold : QToolButton
        Shows the list while it is down, as it is at first.
    list : QListWidget
        One row for each state, the oldest first.
    """

    def __init__(self, editor: DeformEditor, press: Press) -> None:
        super().__init__()
        self._editor, self._press = editor, press
        self._shown: tuple[Entry, ...] = ()
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
        now = history(self._editor)
        if now != self._shown:
            self._show(now)
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
            self._shown = ()
            self.refresh()

    def resizeEvent(self, event: Any) -> None:  # noqa: N802
        """Keep the current row in sight."""
        super().resizeEvent(event)
        self.list.scrollToItem(self.list.item(self._position))

    @property
    def _row_height(self) -> int:
        return int(1.4 * self.fontMetrics().height())

    @property
    def _position(self) -> int:
        """The row of the current state."""
        return next((row for row, entry in enumerate(self._shown) if entry.is_current), -1)

    def _show(self, entries: tuple[Entry, ...]) -> None:
        quiet = QtCore.QSignalBlocker(self.list)
        while self.list.count() > len(entries):
            self.list.takeItem(self.list.count() - 1)
        while self.list.count() < len(entries):
            self.list.addItem("")
        groups, role = QtGui.QPalette.ColorGroup, QtGui.QPalette.ColorRole.Text
        for row, entry in enumerate(entries):
            item = self.list.item(row)
            font = QtGui.QFont(self.font())
            font.setBold(entry.is_current)
            group = groups.Disabled if entry.is_undone else groups.Active
            item.setText(entry.name)
            item.setSizeHint(QtCore.QSize(0, self._row_height))
            item.setFont(font)
            item.setForeground(self.palette().color(group, role))
        self._shown, self._is_previewing = entries, False
        self.list.setCurrentRow(self._position)
        self.list.scrollToItem(self.list.item(self._position))
        quiet.unblock()

    def _hover(self, item: Any) -> None:
        """Make the row under the pointer the current one, without scrolling."""
        if not QtWidgets.QApplication.mouseButtons():
            self.list.setAutoScroll(False)
            self.list.setCurrentItem(item)
            self.list.setAutoScroll(True)

    def _preview(self, row: int) -> None:
        self._press("history.preview", row if row >= 0 else None)
        self._is_previewing = self._editor.widgets.surface.instead is not None

    def _return(self) -> None:
        """Show the current state again, and make its row the current one."""
        quiet = QtCore.QSignalBlocker(self.list)
        self.list.setCurrentRow(self._position)
        quiet.unblock()
        if self._is_previewing:
            self._is_previewing = False
            self._press("history.preview")

    def _jump(self, row: int) -> None:
        if row >= 0:
            self._press("history", row)
            self.refresh()

    def _unfold(self, down: bool) -> None:
        self.fold.setArrowType(Qt.ArrowType.DownArrow if down else Qt.ArrowType.RightArrow)
        self.list.setVisible(down)
        self.list.setMinimumHeight(_LEAST * self._row_height + 2 * self.list.frameWidth())
        policies = QtWidgets.QSizePolicy.Policy
        self.setSizePolicy(policies.Preferred, policies.Expanding if down else policies.Fixed)
        self.refresh()
