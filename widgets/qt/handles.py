"""The part of the panel with the fixed vertices and the handles."""

from __future__ import annotations

from typing import Any, NamedTuple

from qtpy import QtCore, QtWidgets

from vtk_segdeform.pictures import FIXED, rgb

from ..editor import (
    DeformEditor,
    Mode,
    choosing_handle,
    converting,
    hiding_handle,
    locking_handle,
    painting,
    renaming,
    reset_pivot,
    toggle_local_axes,
)
from ..region_selector import Paint
from ..scene import handle_colour
from .controls import RIGHT, check_box, column, key_button, push_button, put, row, swatch, table

Qt = QtCore.Qt
_NAME, _VERTICES, _SHOWN, _LOCKED = range(4)
_TIP = (
    "The selected row is painted in mode 3, a handle is dragged in mode 4. F2: rename. "
    "Hidden and locked handles keep their place and cannot be dragged"
)


class _Row(NamedTuple):
    paints: Paint
    handle: str | None
    """None for fixed vertices and for a new handle."""
    text: str
    n_vertices: int
    shown: bool = True
    locked: bool = False


class HandlesPart(QtWidgets.QGroupBox):
    """A list with a row for the fixed vertices and one for each handle, pin and pulled point.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Handles")
        self._editor = editor
        self._rows: list[_Row] = []
        self.list = table(["Name", "Vertices", "Show", "Lock"], _TIP, rows=6)
        self.list.itemSelectionChanged.connect(self._selection_changed)
        self.list.itemChanged.connect(self._item_edited)
        self.new = key_button(editor, "new_handle", "New")
        self.remove = key_button(editor, "remove_handle", "Remove")
        tip = "A handle can be rotated; a pin or pulled point is a single vertex"
        self.convert = push_button("Make handle", tip, "convert_handle")
        self.convert.clicked.connect(self._convert)
        self.local = check_box("Local axes", "The axes rotate with the handle", "local_axes")
        self.local.clicked.connect(lambda: editor.do(toggle_local_axes))
        tip = "Rotate about the centre of the handle again. Shift+drag on the ball moves the pivot"
        self.pivot = push_button("Reset pivot", tip, "pivot")
        self.pivot.clicked.connect(lambda: editor.do(reset_pivot))
        buttons = row(self.new, self.remove, self.convert)
        column(self, self.list, buttons, row(self.local, self.pivot))

    def refresh(self) -> None:
        """Show the current handles, and which one is selected."""
        session, widgets, mode = self._editor.session, self._editor.widgets, self._editor.mode
        marking, selector = mode is Mode.HANDLES, widgets.selector
        hidden, locked = widgets.dragger.hidden, widgets.dragger.locked
        rows = [
            _Row(Paint.HANDLE, name, name, len(ids), name not in hidden, name in locked)
            for name, ids in session.handles.items()
        ]
        if marking or (len(session.fixed) and mode is not Mode.PULL):
            rows.insert(0, _Row(Paint.FIXED, None, "Fixed", len(session.fixed)))
        painted = selector.handle if selector.handle in session.handles else None
        if marking and selector.paints is Paint.HANDLE and painted is None:
            rows.append(_Row(Paint.HANDLE, None, "New handle (not painted yet)", 0))
        if rows != self._rows:
            self._show(rows)
        paints = selector.paints if marking else Paint.HANDLE
        handle = (None if paints is Paint.FIXED else painted) if marking else widgets.dragger.handle
        self._select(paints, handle)
        self.new.setVisible(marking)
        self.remove.setEnabled(handle in session.handles)
        self.convert.setEnabled(handle in session.handles)
        self.convert.setText("Make handle" if handle in widgets.puller.marked else "Make pin")
        for each in (self.local, self.pivot):
            each.setVisible(mode is Mode.DEFORM)
        put(self.local, widgets.dragger.local)
        self.pivot.setEnabled(handle in session.state.pivots)
        if mode is Mode.PULL:
            self.setVisible(bool(rows))

    def _show(self, rows: list[_Row]) -> None:
        self._rows = rows
        tree, quiet = self.list, QtCore.QSignalBlocker(self.list)
        tree.clear()
        for each in rows:
            item = QtWidgets.QTreeWidgetItem([each.text, f"{each.n_vertices}"])
            colour = rgb(FIXED)
            if each.paints is Paint.HANDLE:
                colour = handle_colour(self._editor.session, each.handle)
            item.setIcon(_NAME, swatch(colour, tree))
            item.setTextAlignment(_VERTICES, RIGHT)
            if each.handle is not None:
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable)
                item.setCheckState(_SHOWN, _tick(each.shown))
                item.setCheckState(_LOCKED, _tick(each.locked))
            tree.addTopLevelItem(item)
        quiet.unblock()

    def _select(self, paints: Paint, handle: str | None) -> None:
        quiet = QtCore.QSignalBlocker(self.list)
        keys = [(each.paints, each.handle) for each in self._rows]
        if (paints, handle) in keys:
            item = self.list.topLevelItem(keys.index((paints, handle)))
            if item is not self.list.currentItem():
                self.list.setCurrentItem(item)
                self.list.scrollToItem(item)
        else:
            self.list.clearSelection()
        quiet.unblock()

    def _selection_changed(self) -> None:
        for item in self.list.selectedItems():
            selected = self._rows[self.list.indexOfTopLevelItem(item)]
            if selected.handle is not None:
                self._editor.do(choosing_handle(selected.handle))
            elif selected.paints is Paint.FIXED and self._editor.mode is Mode.HANDLES:
                self._editor.do(painting(Paint.FIXED))

    def _convert(self) -> None:
        for item in self.list.selectedItems():
            handle = self._rows[self.list.indexOfTopLevelItem(item)].handle
            if handle is not None:
                self._editor.do(converting(handle))

    def _item_edited(self, item: Any, which: int) -> None:
        handle = self._rows[self.list.indexOfTopLevelItem(item)].handle
        if handle is not None and which in (_SHOWN, _LOCKED):
            ticked = item.checkState(which) == Qt.CheckState.Checked
            change = hiding_handle(handle, not ticked) if which == _SHOWN else None
            self._editor.do(change or locking_handle(handle, ticked))
        if which == _NAME and handle is not None and item.text(0) != handle:
            self._rows = []  # refresh the row even if the name is refused
            self._editor.do(renaming(handle, item.text(0).strip()))


def _tick(on: bool) -> Any:
    return Qt.CheckState.Checked if on else Qt.CheckState.Unchecked
