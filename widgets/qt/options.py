"""The panel's parts for cages and for deforming: how they are fitted, and poses solved for."""

from __future__ import annotations

from typing import Any

from qtpy import QtWidgets

from ..editor import DeformEditor, Mode, ranging, setting, toggle_cages, toggle_overlay
from ..volume_overlay import percent
from .controls import check_box, column, form, key_button, number_box, put, row

_MOST = 100_000


class CagesPart(QtWidgets.QGroupBox):
    """How cages are fitted.

    Parameters
    ----------
    editor : DeformEditor
        Whose.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Cages")
        self._editor = editor
        self.total = number_box(
            QtWidgets.QSpinBox(), "vertices of all cages together, the next time they are fitted"
        )
        self.total.setRange(8, _MOST)
        self.total.setSingleStep(10)
        self.total.valueChanged.connect(lambda n: editor.do(setting(n_cage_vertices=n)))
        self.offset = number_box(
            QtWidgets.QDoubleSpinBox(), "how far cages stay from the skin, the next time"
        )
        self.offset.setSpecialValueText("by itself")
        self.offset.valueChanged.connect(lambda x: editor.do(setting(offset=x or None)))
        self.fit = key_button(editor, "f", Mode.CAGES, "Fit cages")
        self.shown = check_box("show them in every mode", "show cages outside mode 2 as well (C)")
        self.shown.clicked.connect(lambda: editor.do(toggle_cages))
        fields = form(("Vertices in all", self.total), ("Offset", self.offset))
        column(self, fields, self.fit, self.shown)

    def refresh(self) -> None:
        """Show the options as they are."""
        session, stage = self._editor.session, self._editor.stage
        options, diagonal = session.options, session.mesh.diagonal
        _fit(self.offset, 0.2 * diagonal)
        put(self.total, options.n_cage_vertices)
        put(self.offset, options.offset or 0.0)
        self.fit.setText("Fit cages anew" if session.cages else "Fit cages")
        self.fit.setEnabled(session.regions is not None)
        self.shown.setEnabled(bool(session.cages))
        put(self.shown, stage.cages_wanted)


class DeformPart(QtWidgets.QGroupBox):
    """How poses are solved for, and what becomes of the volume.

    Parameters
    ----------
    editor : DeformEditor
        Whose.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Deform")
        self._editor = editor
        self.volume = QtWidgets.QLabel()
        self.volume.setToolTip("(V - V0) / V0 of the whole mesh")
        self.overlay = check_box("colour what swells", "show the local volume change (O)")
        self.overlay.clicked.connect(lambda: editor.do(toggle_overlay))
        self.range = number_box(
            QtWidgets.QDoubleSpinBox(), "the local volume change that the last colours stand for"
        )
        self.range.setRange(0.0, 1000.0)
        self.range.setDecimals(1)
        self.range.setSingleStep(5.0)
        self.range.setSpecialValueText("by itself")
        self.range.setPrefix("± ")
        self.range.setSuffix(" %")
        self.range.valueChanged.connect(lambda x: editor.do(ranging(0.01 * x or None)))
        self.hold = check_box("hold the volume", "keep the enclosed volume exactly (P)")
        self.hold.clicked.connect(lambda on: editor.do(setting(preserve_volume=on)))
        self.hold_each = check_box("of every region", "keep the volume of each region as well")
        self.hold_each.clicked.connect(lambda on: editor.do(setting(preserve_region_volumes=on)))
        self.stretch = number_box(
            QtWidgets.QDoubleSpinBox(),
            "strength of the stretch term beside the detail term; 0 is the paper's energy",
        )
        self.stretch.setRange(0.0, 1e6)
        self.stretch.valueChanged.connect(lambda x: editor.do(setting(stretch=x)))
        self.groups = number_box(
            QtWidgets.QSpinBox(), "by how many rotations the detail turns; fewer are faster"
        )
        self.groups.setRange(0, _MOST)
        self.groups.setSingleStep(50)
        self.groups.setSpecialValueText("one per vertex")
        self.groups.valueChanged.connect(lambda n: editor.do(setting(rotation_groups=n or None)))
        self.rest = key_button(editor, "0", Mode.DEFORM, "Back to rest")
        column(
            self,
            form(("Volume change", self.volume)),
            row(self.hold, self.hold_each),
            self.overlay,
            form(
                ("Colours end at", self.range),
                ("Stretch", self.stretch),
                ("Rotation groups", self.groups),
            ),
            self.rest,
        )

    def refresh(self) -> None:
        """Show the options as they are, and the volume."""
        session, stage = self._editor.session, self._editor.stage
        options = session.options
        self.volume.setText(percent(session.volume_change))
        put(self.hold, options.preserve_volume)
        put(self.hold_each, options.preserve_region_volumes)
        put(self.overlay, stage.overlay_wanted)
        put(self.range, 100.0 * (stage.overlay.wanted_range or 0.0))
        self.range.setEnabled(stage.overlay_wanted)
        put(self.stretch, options.stretch)
        put(self.groups, options.rotation_groups or 0)
        self.rest.setEnabled(session.state.pose is not None)


def _fit(box: Any, largest: float) -> None:
    """Give *box* a range from 0 up, and steps and digits that suit it."""
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
