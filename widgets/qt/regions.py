"""The panel's list of regions: colour, name, cage, and what became of the volume."""

from __future__ import annotations

from typing import Any, NamedTuple

from qtpy import QtCore, QtWidgets

from vtk_segdeform.pictures import COLOURS

from ..editor import (
    DeformEditor,
    Mode,
    choosing_region,
    merging,
    naming_region,
    showing_cage,
    split_region,
)
from ..volume_overlay import RegionVolumes, percent
from .controls import RIGHT, column, key_button, push_button, row, swatch, table

Qt = QtCore.Qt
_NAME, _CAGE, _VOLUME = 0, 1, 2
_TIP = "the one that is chosen is painted; a tick shows its cage; F2 renames it"


class _Row(NamedTuple):
    region: int
    name: str
    cage: str
    visible: bool | None
    volume: str


class RegionsPart(QtWidgets.QGroupBox):
    """One row for each region.

    Parameters
    ----------
    editor : DeformEditor
        Whose.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Regions")
        self._editor = editor
        self._rows: list[_Row] = []
        self._volumes = RegionVolumes(editor.session)
        self._of = editor.session
        self.list = table(["Region", "Cage", "Volume"], _TIP, rows=7)
        self.list.setSelectionMode(QtWidgets.QAbstractItemView.SelectionMode.ExtendedSelection)
        self.list.itemSelectionChanged.connect(self._selected)
        self.list.itemChanged.connect(self._edited)
        self.find = key_button(editor, "g", Mode.REGIONS, "Find regions")
        self.new = key_button(editor, "a", Mode.REGIONS, "New")
        self.merge = push_button("Merge", "make one of those that are chosen in the list")
        self.merge.clicked.connect(lambda: editor.do(merging(self.chosen)))
        self.split = push_button("Split", "cut the one that is chosen in two", "x")
        self.split.clicked.connect(lambda: editor.do(split_region))
        column(self, self.find, self.list, row(self.new, self.merge, self.split))

    @property
    def chosen(self) -> list[int]:
        """The regions that are chosen in the list."""
        return sorted(self.list.indexOfTopLevelItem(item) for item in self.list.selectedItems())

    def refresh(self) -> None:
        """Show the regions as they are."""
        editor = self._editor
        if editor.session is not self._of:
            self._of, self._volumes = editor.session, RegionVolumes(editor.session)
        rows, painting = self._wanted(), editor.mode is Mode.REGIONS
        if rows != self._rows:
            self._show(rows)
        self._choose(editor.stage.selector.region)
        for button in (self.find, self.new, self.merge, self.split):
            button.setVisible(painting)
        there = [region for region in self.chosen if region < editor.stage.n_regions]
        self.merge.setEnabled(len(there) > 1)
        self.split.setEnabled(len(there) == 1)

    def _wanted(self) -> list[_Row]:
        editor, stage = self._editor, self._editor.stage
        volumes = dict(self._volumes.changes())
        if stage.n_regions == 1:
            volumes = {0: editor.session.volume_change}
        cages = editor.session.cages
        rows = [
            _Row(
                region,
                editor.session.region_name(region),
                f"{cages[region].n_vertices} vertices" if cages else "none yet",
                stage.cages.is_visible(region) if cages else None,
                percent(volumes[region]) if region in volumes else "",
            )
            for region in range(stage.n_regions)
        ]
        new = stage.selector.region
        if editor.mode is Mode.REGIONS and new >= stage.n_regions:
            rows.append(
                _Row(new, f"{editor.session.region_name(new)}, to be painted", "", None, "")
            )
        return rows

    def _show(self, rows: list[_Row]) -> None:
        self._rows = rows
        tree, quiet = self.list, QtCore.QSignalBlocker(self.list)
        while tree.topLevelItemCount() > len(rows):
            tree.takeTopLevelItem(len(rows))
        while tree.topLevelItemCount() < len(rows):
            tree.addTopLevelItem(QtWidgets.QTreeWidgetItem())
        for k, each in enumerate(rows):
            item = tree.topLevelItem(k)
            item.setText(_NAME, each.name)
            item.setToolTip(_NAME, f"{each.name} (F2 renames it)")  # there may be no room for it
            there = each.region < self._editor.stage.n_regions
            editable = Qt.ItemFlag.ItemIsEditable
            item.setFlags(item.flags() | editable if there else item.flags() & ~editable)
            item.setIcon(_NAME, swatch(COLOURS[each.region % len(COLOURS)], tree))
            item.setText(_CAGE, each.cage)
            item.setText(_VOLUME, each.volume)
            item.setTextAlignment(_VOLUME, RIGHT)
            if each.visible is None:
                item.setData(_CAGE, Qt.ItemDataRole.CheckStateRole, None)
            else:
                ticks = Qt.CheckState
                item.setCheckState(_CAGE, ticks.Checked if each.visible else ticks.Unchecked)
        quiet.unblock()

    def _choose(self, region: int) -> None:
        """Choose the row of *region*, unless it is one of those that are chosen."""
        wanted = [k for k, each in enumerate(self._rows) if each.region == region]
        if wanted and wanted[0] not in self.chosen:
            quiet = QtCore.QSignalBlocker(self.list)
            self.list.setCurrentItem(self.list.topLevelItem(wanted[0]))
            quiet.unblock()
            self.list.viewport().update()

    def _selected(self) -> None:
        chosen = [self._rows[k].region for k in self.chosen]
        if chosen and self._editor.stage.selector.region not in chosen:
            self._editor.do(choosing_region(chosen[0]))
        self.refresh()

    def _edited(self, item: Any, which: int) -> None:
        row = self._rows[self.list.indexOfTopLevelItem(item)]
        if which == _CAGE:
            shown = item.checkState(_CAGE) == Qt.CheckState.Checked
            self._editor.do(showing_cage(row.region, shown))
        elif which == _NAME and item.text(_NAME) != row.name:
            self._rows = []  # to be shown anew, also where the name is refused
            self._editor.do(naming_region(row.region, item.text(_NAME)))
