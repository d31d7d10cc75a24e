"""The parts of the panel with the options for fitting cages and for deforming."""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtWidgets

from ..editor import (
    DeformEditor,
    finishing_after_drags,
    fitting_with,
    setting,
    setting_colour_range,
    toggle_cages,
    toggle_overlay,
)
from ..volume_overlay import percent
from .controls import check_box, choice_box, column, form, key_button, number_box, put, row, slider

_MOST = 100_000
_EACH, _MOST_DETAIL = 12, 800  # cage vertices: fewest for each region, and most of the slider
_LIDS = {"Auto": None, "Under lids": True, "Off": False}


class CagesPart(QtWidgets.QGroupBox):
    """Options for fitting cages.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Cages")
        self._editor = editor
        self.total = number_box(
            QtWidgets.QSpinBox(), "Total vertices of all cages (used at next fit)"
        )
        self.total.setRange(8, _MOST)
        self.total.setSingleStep(10)
        self.total.valueChanged.connect(lambda n: editor.do(setting(n_cage_vertices=n)))
        self.detail = slider(_EACH, _MOST_DETAIL, "Detail of cages: release to refit them")
        self.detail.setPageStep(50)
        self.detail.valueChanged.connect(lambda n: editor.do(fitting_with(n)))
        self.offset = number_box(
            QtWidgets.QDoubleSpinBox(), "Cage offset from the surface (used at next fit)"
        )
        self.offset.setSpecialValueText("Auto")
        self.offset.valueChanged.connect(lambda x: editor.do(setting(offset=x or None)))
        self.fit = key_button(editor, "fit_cages", "Fit cages")
        self.shown = check_box(
            "Show cages in all modes", "Show cages outside mode 2 as well", "show_cages"
        )
        self.shown.clicked.connect(lambda: editor.do(toggle_cages))
        fields = form(
            ("Detail", self.detail), ("Total cage vertices", self.total), ("Offset", self.offset)
        )
        column(self, fields, self.fit, self.shown)

    def refresh(self) -> None:
        """Show the current options."""
        session, widgets = self._editor.session, self._editor.widgets
        options, diagonal = session.options, session.mesh.diagonal
        _fit(self.offset, 0.2 * diagonal)
        put(self.total, options.n_cage_vertices)
        self.detail.setEnabled(session.regions is not None)
        if not self._editor.controller.is_busy:
            fitted = sum(cage.n_vertices for cage in session.cages)
            total = fitted or options.n_cage_vertices
            # The default follows the number of regions, and other numbers are met only nearly.
            is_other = fitted not in (0, options.n_cage_vertices)
            suffix = f" ({fitted} fitted)" if is_other else ""
            if suffix != self.total.suffix():  # otherwise a number being typed would be lost
                self.total.setSuffix(suffix)
            quiet = QtCore.QSignalBlocker(self.detail)
            self.detail.setMinimum(_EACH * max(1, widgets.n_regions))
            quiet.unblock()
            put(self.detail, total)
        put(self.offset, options.offset or 0.0)
        self.fit.setText("Refit cages" if session.cages else "Fit cages")
        self.fit.setEnabled(session.regions is not None)
        self.shown.setEnabled(bool(session.cages))
        put(self.shown, widgets.cages_wanted)


class DeformPart(QtWidgets.QGroupBox):
    """Options for deforming, and the volume change.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Deform")
        self._editor = editor
        self.volume = QtWidgets.QLabel()
        self.volume.setToolTip("Relative volume change of the whole mesh")
        self.overlay = check_box(
            "Show local volume change",
            "Colour the mesh by its local volume change",
            "show_volume_change",
        )
        self.overlay.clicked.connect(lambda: editor.do(toggle_overlay))
        self.range = number_box(
            QtWidgets.QDoubleSpinBox(), "Local volume change at the ends of the colour scale"
        )
        self.range.setRange(0.0, 1000.0)
        self.range.setDecimals(1)
        self.range.setSingleStep(5.0)
        self.range.setSpecialValueText("Auto")
        self.range.setPrefix("± ")
        self.range.setSuffix(" %")
        self.range.valueChanged.connect(lambda x: editor.do(setting_colour_range(0.01 * x or None)))
        self.preserve = check_box(
            "Preserve volume", "Preserve the enclosed volume exactly", "preserve_volume"
        )
        self.preserve.clicked.connect(lambda on: editor.do(setting(preserve_volume=on)))
        self.per_region = check_box("Per region", "Preserve the volume of each region as well")
        self.per_region.clicked.connect(lambda on: editor.do(setting(preserve_region_volumes=on)))
        self.lids = choice_box(
            list(_LIDS), "How the volume of open parts is preserved: Auto is under lids unless flat"
        )
        self.lids.activated.connect(lambda row: editor.do(setting(lids=list(_LIDS.values())[row])))
        self.stretch = number_box(
            QtWidgets.QDoubleSpinBox(),
            "Weight of the stretch energy relative to the detail energy; 0 is the paper's energy",
        )
        self.stretch.setRange(0.0, 1e6)
        self.stretch.valueChanged.connect(lambda x: editor.do(setting(stretch=x)))
        self.clusters = number_box(
            QtWidgets.QSpinBox(), "Rotation clusters: fewer is faster, less accurate"
        )
        self.clusters.setRange(0, _MOST)
        self.clusters.setSingleStep(50)
        self.clusters.setSpecialValueText("One per vertex")
        self.clusters.valueChanged.connect(lambda n: editor.do(setting(rotation_groups=n or None)))
        self.contact = check_box(
            "Avoid contact", "Keep parts of the surface from crossing each other"
        )
        self.contact.clicked.connect(lambda on: editor.do(setting(avoid_contact=on)))
        self.finishes = check_box(
            "Finish on the mesh", "After each drag, reduce the distortion of the mesh itself"
        )
        self.finishes.clicked.connect(lambda on: editor.do(finishing_after_drags(on)))
        self.finish = key_button(editor, "finish", "Finish pose")
        self.reset = key_button(editor, "reset_pose")
        column(
            self,
            form(("Volume change", self.volume)),
            row(self.preserve, self.per_region),
            self.overlay,
            form(
                ("Open parts", self.lids),
                ("Colour range", self.range),
                ("Stretch resistance", self.stretch),
                ("Rotation clusters", self.clusters),
            ),
            row(self.contact, self.finishes),
            row(self.finish, self.reset),
        )

    def refresh(self) -> None:
        """Show the current options and the volume change."""
        session, widgets = self._editor.session, self._editor.widgets
        options = session.options
        has_volume = session.has_volume
        self.volume.setText(
            percent(session.volume_change) if has_volume else "No volume to preserve"
        )
        put(self.preserve, options.preserve_volume and has_volume)
        put(self.per_region, options.preserve_region_volumes and has_volume)
        for box in (self.preserve, self.per_region):
            box.setEnabled(has_volume)
        put(self.lids, list(_LIDS.values()).index(options.lids))
        self.lids.setEnabled(not session.mesh.is_closed)
        put(self.overlay, widgets.overlay_wanted)
        put(self.range, 100.0 * (widgets.overlay.wanted_range or 0.0))
        self.range.setEnabled(widgets.overlay_wanted)
        put(self.stretch, options.stretch)
        put(self.clusters, options.rotation_groups or 0)
        put(self.contact, options.avoid_contact)
        put(self.finishes, self._editor.controller.finishing.is_wanted)
        self.finish.setEnabled(session.can_finish)
        self.reset.setEnabled(session.state.pose is not None)


def _fit(box: Any, largest: float) -> None:
    """Set the range of *box* to 0..*largest*, with suitable steps and digits."""
    if box.maximum() == largest:
        return
    digits = 0
    while largest * 10.0**digits < 200.0 and digits < 12:
        digits += 1
    box.blockSignals(True)
    box.setDecimals(digits)
    box.setRange(0.0, round(largest, digits))
    box.setSingleStep(10.0**-digits)
    box.blockSignals(False)
