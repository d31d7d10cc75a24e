"""The part of the panel with the regions: colour, name, cage and volume change."""

from __future__ import annotations

from typing import Any, NamedTuple

from qtpy import QtCore, QtWidgets

from vtk_segdeform.pictures import of_region

from ..editor import (
    DeformEditor,
    Mode,
    choosing_regions,
    merging,
    naming_region,
    segmenting,
    showing_cage,
    split_region,
)
from ..volume_overlay import RegionVolumes, in_tenths
from .controls import RIGHT, column, form, key_button, push_button, put, row, slider, swatch, table

Qt = QtCore.Qt
_NAME, _CAGE, _VOLUME = 0, 1, 2
_MOST = 20  # regions of a segmentation
_TIP = "The selected region is painted in mode 1. Tick: show its cage. F2: rename"


class _Row(NamedTuple):
    region: int
    name: str
    cage: str
    visible: bool | None
    volume: str


class RegionsPart(QtWidgets.QGroupBox):
    """A list with a row for each region.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Regions")
        self._editor = editor
        self._rows: list[_Row] = []
        self._volumes = RegionVolumes(editor.session)
        self._session = editor.session
        self.list = table(["Region", "Cage", "Volume"], _TIP, rows=7)
        self.list.setSelectionMode(QtWidgets.QAbstractItemView.SelectionMode.ExtendedSelection)
        self.list.itemSelectionChanged.connect(self._selection_changed)
        self.list.itemChanged.connect(self._item_edited)
        self.segment = key_button(editor, "segment")
        self.count = slider(1, _MOST, "Number of regions: release to segment again")
        self.count.valueChanged.connect(lambda n: editor.do(segmenting(n)))
        self._count = QtWidgets.QWidget()
        column(self._count, form(("Number", self.count)))
        self._count.layout().setContentsMargins(0, 0, 0, 0)
        self.new = key_button(editor, "new_region", "New")
        self.merge = push_button("Merge", "Merge the selected regions")
        self.merge.clicked.connect(lambda: editor.do(merging(self.selected)))
        self.split = push_button("Split", "Split the selected region", "split_region")
        self.split.clicked.connect(lambda: editor.do(split_region))
        column(self, self.segment, self._count, self.list, row(self.new, self.merge, self.split))

    @property
    def selected(self) -> list[int]:
        """The regions selected in the list."""
        return sorted(self.list.indexOfTopLevelItem(item) for item in self.list.selectedItems())

    def refresh(self) -> None:
        """Show the current regions."""
        editor = self._editor
        if editor.session is not self._session:
            self._session, self._volumes = editor.session, RegionVolumes(editor.session)
        rows, painting = self._current_rows(), editor.mode is Mode.REGIONS
        if rows != self._rows:
            self._show(rows)
        self._select(editor.widgets.selector.region)
        for control in (self.segment, self._count, self.new, self.merge, self.split):
            control.setVisible(painting)
        if not editor.controller.is_busy:
            put(self.count, max(1, editor.widgets.n_regions))
        existing = [region for region in self.selected if region < editor.widgets.n_regions]
        self.merge.setEnabled(len(existing) > 1)
        self.split.setEnabled(len(existing) == 1)

    def _current_rows(self) -> list[_Row]:
        editor, widgets = self._editor, self._editor.widgets
        volumes = dict(self._volumes.changes())
        if widgets.n_regions == 1 and editor.session.has_volume:
            volumes = {0: editor.session.volume_change}
        cages = editor.session.cages
        rows = [
            _Row(
                region,
                editor.session.region_name(region),
                str(cages[region].n_vertices) if cages else "None",
                widgets.cages.is_visible(region) if cages else None,
                in_tenths(volumes[region]) if region in volumes else "",
            )
            for region in range(widgets.n_regions)
        ]
        new = widgets.selector.region
        if editor.mode is Mode.REGIONS and new >= widgets.n_regions:
            rows.append(_Row(new, f"{editor.session.region_name(new)} (new)", "", None, ""))
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
            item.setToolTip(_NAME, f"{each.name} (F2 to rename)")  # the name may be elided
            exists = each.region < self._editor.widgets.n_regions
            editable = Qt.ItemFlag.ItemIsEditable
            item.setFlags(item.flags() | editable if exists else item.flags() & ~editable)
            item.setIcon(_NAME, swatch(of_region(each.region), tree))
            item.setText(_CAGE, each.cage)
            item.setToolTip(_CAGE, "Number of cage vertices. Tick: show the cage")
            item.setText(_VOLUME, each.volume)
            item.setTextAlignment(_VOLUME, RIGHT)
            if each.visible is None:
                item.setData(_CAGE, Qt.ItemDataRole.CheckStateRole, None)
            else:
                ticks = Qt.CheckState
                item.setCheckState(_CAGE, ticks.Checked if each.visible else ticks.Unchecked)
        quiet.unblock()

    def _select(self, region: int) -> None:
        """Select the row of *region*, unless it is selected already."""
        wanted = [k for k, each in enumerate(self._rows) if each.region == region]
        if wanted and wanted[0] not in self.selected:
            quiet = QtCore.QSignalBlocker(self.list)
            self.list.setCurrentItem(self.list.topLevelItem(wanted[0]))
            quiet.unblock()
            self.list.viewport().update()

    def _selection_changed(self) -> None:
        regions = [self._rows[k].region for k in self.selected]
        if regions and self._editor.widgets.selector.region not in regions:
            self._editor.do(choosing_regions(regions))
        self.refresh()

    def _item_edited(self, item: Any, which: int) -> None:
        row = self._rows[self.list.indexOfTopLevelItem(item)]
        if which == _CAGE:
            shown = item.checkState(_CAGE) == Qt.CheckState.Checked
            self._editor.do(showing_cage(row.region, shown))
        elif which == _NAME and item.text(_NAME) != row.name:
            self._rows = []  # refresh the row even if the name is refused
            self._editor.do(naming_region(row.region, item.text(_NAME)))
