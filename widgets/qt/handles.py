"""The panel's list of what stays and what is dragged."""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtWidgets

from vtk_segdeform.pictures import FIXED, HANDLE

from ..editor import DeformEditor, Mode, choosing_handle, painting, renaming
from ..region_selector import Paint
from .controls import RIGHT, column, key_button, row, swatch, table

Qt = QtCore.Qt
_STAYS = "what stays"
_NEW = "new handle, to be painted"
_TIP = "in mode 3 the one that is chosen is painted, in mode 4 dragged; F2 renames it"


class HandlesPart(QtWidgets.QGroupBox):
    """One row for what is fixed, and one for each handle.

    Parameters
    ----------
    editor : DeformEditor
        Whose.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Handles")
        self._editor = editor
        self._rows: list[tuple[str, int]] = []
        self.list = table(["Name", "Vertices"], _TIP, rows=6)
        self.list.itemSelectionChanged.connect(self._selected)
        self.list.itemChanged.connect(self._edited)
        self.new = key_button(editor, "a", Mode.HANDLES, "New")
        self.remove = key_button(editor, "delete", Mode.HANDLES, "Remove")
        column(self, self.list, row(self.new, self.remove))

    def refresh(self) -> None:
        """Show handles as they are, and which is the one in hand."""
        session, stage, mode = self._editor.session, self._editor.stage, self._editor.mode
        marking = mode is Mode.HANDLES
        rows = [(_STAYS, len(session.fixed))] if marking or len(session.fixed) else []
        rows += [(name, len(vertices)) for name, vertices in session.handles.items()]
        selector = stage.selector
        named = selector.handle if selector.handle in session.handles else None
        if marking and selector.paints is Paint.HANDLE and named is None:
            rows.append((_NEW, 0))
        if rows != self._rows:
            self._show(rows)
        if marking:
            chosen = _STAYS if selector.paints is Paint.FIXED else named or _NEW
        else:
            chosen = stage.dragger.handle or ""
        self._choose(chosen)
        self.new.setVisible(marking)
        self.remove.setEnabled(chosen in session.handles)

    def _show(self, rows: list[tuple[str, int]]) -> None:
        self._rows = rows
        tree, quiet = self.list, QtCore.QSignalBlocker(self.list)
        tree.clear()
        for name, count in rows:
            item = QtWidgets.QTreeWidgetItem([name, f"{count}"])
            item.setIcon(0, swatch(FIXED if name == _STAYS else HANDLE, tree))
            item.setTextAlignment(1, RIGHT)
            if name not in (_STAYS, _NEW):
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable)
            tree.addTopLevelItem(item)
        quiet.unblock()

    def _choose(self, name: str) -> None:
        quiet = QtCore.QSignalBlocker(self.list)
        names = [row_name for row_name, _ in self._rows]
        if name in names:
            self.list.setCurrentItem(self.list.topLevelItem(names.index(name)))
        else:
            self.list.clearSelection()
        quiet.unblock()

    def _selected(self) -> None:
        for item in self.list.selectedItems():
            name = self._rows[self.list.indexOfTopLevelItem(item)][0]
            if name in self._editor.session.handles:
                self._editor.do(choosing_handle(name))
            elif name == _STAYS and self._editor.mode is Mode.HANDLES:
                self._editor.do(painting(Paint.FIXED))

    def _edited(self, item: Any, which: int) -> None:
        name = self._rows[self.list.indexOfTopLevelItem(item)][0]
        if which == 0 and item.text(0) != name:
            self._rows = []  # to be shown anew, also where the name is refused
            self._editor.do(renaming(name, item.text(0).strip()))
