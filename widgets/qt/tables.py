"""A table of the panel: rows with a colour, a name, texts and check boxes.

A double click on a name, or F2, renames the row in place.  The keys Left and Right go to its boxes,
which Space checks.
"""

from __future__ import annotations

import base64
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from ..panel import Row, Table
from .controls import Press, box_frame

Qt = QtCore.Qt
_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_MOST_ROWS = 14  # shown without scrolling
_PICTURES = 2.5  # rows with pictures that are seen at least
_PICTURE, _ASPECT = 2.2, 4.0 / 3.0  # height in lines of text, and width by height
_NAME_LETTERS = 15  # of the first column, with its icon


class TableView(QtWidgets.QTreeWidget):
    """The list that shows a `Table`, as high as its rows or at least half of that.

    Parameters
    ----------
    table : Table
        What to show at first.
    press : callable
        ``press(name, value)``, called for what is selected, renamed and checked.
    """

    def __init__(self, table: Table, press: Press) -> None:
        super().__init__()
        self._press, self._table = press, table
        self._rows: tuple[Row, ...] = ()  # as drawn
        self._has_pictures = any(row.picture for row in table.rows)
        self.setItemDelegate(_Ticks(self))
        views = QtWidgets.QAbstractItemView
        self.setEditTriggers(views.EditTrigger.DoubleClicked | views.EditTrigger.EditKeyPressed)
        if table.multiple:
            self.setSelectionMode(views.SelectionMode.ExtendedSelection)
        self.setHeaderLabels([table.title, *(column.title for column in table.columns)])
        self.setRootIsDecorated(False)
        self.setUniformRowHeights(True)
        self.setToolTip(table.tip)
        self.setTabKeyNavigation(False)  # Tab leaves the table
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._set_sizes(table.n_rows)
        self.itemSelectionChanged.connect(self._selection_changed)
        self.itemChanged.connect(self._item_edited)

    def draw(self, table: Table) -> None:
        """Show the rows of *table*, and which of them are selected."""
        self._table = table
        quiet = QtCore.QSignalBlocker(self)
        if table.rows != self._rows:
            self._draw_rows(table.rows)
        wanted = [k for k, row in enumerate(table.rows) if row.selected]
        if wanted != self._selected():
            self._select(wanted)
        quiet.unblock()

    def resizeEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Keep the selected row in view."""
        super().resizeEvent(event)
        self.scrollTo(self.currentIndex())

    def keyPressEvent(self, event: Any) -> None:  # noqa: N802
        """Pass on letters and digits, which would search for a name, and are keys of the editor."""
        step = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}.get(event.key(), 0)
        beside = self.currentIndex().siblingAtColumn(self.currentIndex().column() + step)
        if step and beside.isValid():
            self.setCurrentIndex(beside)
        elif event.text().isprintable() and event.text().strip():
            event.ignore()
        else:
            super().keyPressEvent(event)

    def edit(self, index: Any, *how: Any) -> Any:
        """Edit the name, whichever column is the current one."""
        triggers = QtWidgets.QAbstractItemView.EditTrigger
        if how and how[0] == triggers.EditKeyPressed:
            index = index.siblingAtColumn(0)
        elif how and how[0] == triggers.DoubleClicked and index.column():
            return False
        return super().edit(index, *how)

    def sizeHint(self) -> Any:  # noqa: N802 - Qt's name
        """Return a height for all rows, up to the largest one."""
        hint = super().sizeHint()
        hint.setHeight(self.maximumHeight())
        return hint

    def _set_sizes(self, n_rows: int) -> None:
        header = self.header()
        header.setStretchLastSection(False)
        header.setSectionsMovable(False)
        modes = QtWidgets.QHeaderView.ResizeMode
        for column in range(self.columnCount()):
            header.setSectionResizeMode(column, modes.ResizeToContents if column else modes.Stretch)
            self.headerItem().setTextAlignment(column, _RIGHT if column else _LEFT)
        widths = sum(header.sectionSizeHint(k) for k in range(1, self.columnCount()))
        letters = _NAME_LETTERS * self.fontMetrics().averageCharWidth()
        bar = self.verticalScrollBar().sizeHint().width() + 2 * self.frameWidth()
        self.setMinimumWidth(letters + widths + bar)  # names are legible beside a scroll bar
        self.setMinimumHeight(self._height_of(0.5 * n_rows))
        self._leave_room(n_rows)

    def _leave_room(self, n_rows: int) -> None:
        self.setMaximumHeight(self._height_of(n_rows))

    def _height_of(self, n_rows: float) -> int:
        row = self.iconSize().height() + 4 if self._has_pictures else 0
        line = 1.3 * self.fontMetrics().height()
        return int(1.5 * line + n_rows * max(line, row) + 0.5)

    def _draw_rows(self, rows: tuple[Row, ...]) -> None:
        self._rows, self._has_pictures = rows, any(row.picture for row in rows)
        side = _PICTURE if self._has_pictures else 1.0
        high = round(side * self.fontMetrics().height())
        self.setIconSize(QtCore.QSize(round(_ASPECT * high) if self._has_pictures else high, high))
        if self._has_pictures:
            self.setMinimumHeight(self._height_of(min(len(rows), _PICTURES)))
        self._leave_room(min(max(len(rows), self._table.n_rows), _MOST_ROWS))
        while self.topLevelItemCount() > len(rows):
            self.takeTopLevelItem(len(rows))
        while self.topLevelItemCount() < len(rows):
            self.addTopLevelItem(QtWidgets.QTreeWidgetItem())
        editable, states = Qt.ItemFlag.ItemIsEditable, Qt.CheckState
        for k, row in enumerate(rows):
            item = self.topLevelItem(k)
            item.setText(0, row.label)
            # The name may be elided.
            item.setToolTip(0, f"{row.label} (F2 to rename)" if row.renamable else row.label)
            item.setFlags(item.flags() | editable if row.renamable else item.flags() & ~editable)
            item.setIcon(0, _picture(row.picture) or _swatch(row.colour, self))
            for place, (column, cell) in enumerate(
                zip(self._table.columns, row.cells, strict=True), 1
            ):
                item.setText(place, cell.text)
                item.setToolTip(place, column.tip)
                if cell.checked is None:
                    item.setTextAlignment(place, _RIGHT)
                    item.setData(place, Qt.ItemDataRole.CheckStateRole, None)
                else:
                    item.setTextAlignment(place, _LEFT)
                    item.setCheckState(place, states.Checked if cell.checked else states.Unchecked)

    def _selected(self) -> list[int]:
        return sorted(self.indexOfTopLevelItem(item) for item in self.selectedItems())

    def _select(self, places: list[int]) -> None:
        self.clearSelection()
        if places:
            self.setCurrentItem(self.topLevelItem(places[0]))
            self.scrollToItem(self.topLevelItem(places[0]))
        for place in places[1:]:
            self.topLevelItem(place).setSelected(True)
        self.viewport().update()  # signals are blocked

    def _selection_changed(self) -> None:
        keys = [self._table.rows[k].key for k in self._selected()]
        if keys:
            self._press(f"{self._table.name}.select", keys)

    def _item_edited(self, item: Any, place: int) -> None:
        row = self._table.rows[self.indexOfTopLevelItem(item)]
        self._rows = ()  # draw the row again even if the change is refused
        if not place and item.text(0) != row.label:
            self._press(f"{self._table.name}.rename", (row.key, item.text(0)))
        elif place and row.cells[place - 1].checked is not None:
            is_checked = item.checkState(place) == Qt.CheckState.Checked
            column = self._table.columns[place - 1].name
            self._press(f"{self._table.name}.{column}", (row.key, is_checked))


class _Ticks(QtWidgets.QStyledItemDelegate):
    def paint(self, painter: Any, option: Any, index: Any) -> None:
        """Draw a cell, its box with a visible frame."""
        super().paint(painter, option, index)
        if index.data(Qt.ItemDataRole.CheckStateRole) is not None:
            how, table = QtWidgets.QStyleOptionViewItem(option), self.parent()
            self.initStyleOption(how, index)
            kind = QtWidgets.QStyle.SubElement.SE_ItemViewItemCheckIndicator
            box = table.style().subElementRect(kind, how, table)
            box_frame(painter, box, table.palette())


def _picture(url: str) -> Any:
    """Return an icon of a data URL; None of ""."""
    if not url:
        return None
    picture = QtGui.QPixmap()
    picture.loadFromData(base64.b64decode(url.partition(",")[2]))
    icon = QtGui.QIcon(picture)
    icon.addPixmap(picture, QtGui.QIcon.Mode.Selected)  # otherwise tinted
    return icon


def _swatch(colour: tuple[int, int, int], widget: Any) -> Any:
    """Return an icon of a colour at the resolution of *widget*."""
    size, ratio = widget.fontMetrics().height(), widget.devicePixelRatioF()
    picture = QtGui.QPixmap(round(size * ratio), round(size * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QtGui.QPainter(picture)
    painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
    painter.setBrush(QtGui.QColor(*colour))
    painter.setPen(QtGui.QPen(widget.palette().color(QtGui.QPalette.ColorRole.Text), 1.0))
    painter.drawRoundedRect(QtCore.QRectF(1.0, 1.0, size - 2.0, size - 2.0), 3.0, 3.0)
    painter.end()
    icon = QtGui.QIcon(picture)
    icon.addPixmap(picture, QtGui.QIcon.Mode.Selected)  # otherwise tinted
    return icon
