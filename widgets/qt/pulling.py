"""The part of the panel with the settings of a pull, and the volume change."""

from __future__ import annotations

from qtpy import QtCore, QtWidgets

from ..editor import DeformEditor, pulling_with, setting
from ..volume_overlay import percent
from .controls import check_box, column, form, key_button, number_box, put, row, with_key

Qt = QtCore.Qt


class PullPart(QtWidgets.QGroupBox):
    """The settings of a pull, and the volume change.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Pull")
        self._editor = editor
        self.radius = number_box(
            QtWidgets.QDoubleSpinBox(),
            "Radius of the pulled surface, in % of the model's size ([ ] or Shift+wheel)",
        )
        self.radius.setRange(0.5, 100.0)
        self.radius.setDecimals(1)
        self.radius.setSuffix(" %")
        self.radius.valueChanged.connect(self._set_radius)
        self.local = QtWidgets.QSlider(Qt.Orientation.Horizontal)
        self.local.setRange(0, 100)
        self.local.setPageStep(10)
        self.local.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        with_key(
            self.local,
            "How much of the surface stays in place: all of it follows at the left, "
            "only the surface near the pointer at the right",
            "more_local",
        )
        self.local.valueChanged.connect(
            lambda share: editor.do(pulling_with(locality=0.01 * share))
        )
        self.auto = check_box(
            "Auto local",
            "0 between three pins or fixed vertices, otherwise mostly free",
            "auto_locality",
        )
        self.auto.clicked.connect(self._set_auto)
        self.unpin = key_button(editor, "remove_pins")
        self.volume = QtWidgets.QLabel()
        self.volume.setToolTip("Relative volume change of the whole mesh")
        self.preserve = check_box(
            "Preserve volume", "Preserve the enclosed volume exactly", "preserve_volume"
        )
        self.preserve.clicked.connect(lambda on: editor.do(setting(preserve_volume=on)))
        self.reset = key_button(editor, "reset_pose")
        column(
            self,
            form(
                ("Radius", self.radius),
                ("Local", self.local),
                ("Volume change", self.volume),
            ),
            row(self.auto, self.preserve),
            row(self.unpin, self.reset),
        )

    def refresh(self) -> None:
        """Show the current settings and the volume change."""
        session, puller = self._editor.session, self._editor.widgets.puller
        put(self.radius, 100.0 * puller.radius / session.mesh.diagonal)
        is_auto = puller.locality is None
        local = puller.effective_locality
        quiet = QtCore.QSignalBlocker(self.local)
        self.local.setValue(round(100.0 * local))
        quiet.unblock()
        put(self.auto, is_auto)
        self.unpin.setEnabled(bool(puller.marked))
        has_volume = session.has_volume
        self.volume.setText(
            percent(session.volume_change) if has_volume else "No volume to preserve"
        )
        put(self.preserve, session.options.preserve_volume and has_volume)
        self.preserve.setEnabled(has_volume)
        self.reset.setEnabled(session.state.pose is not None)

    def _set_radius(self, share: float) -> None:
        diagonal = self._editor.session.mesh.diagonal
        self._editor.do(pulling_with(radius=0.01 * share * diagonal))

    def _set_auto(self, on: bool) -> None:
        local = None if on else self._editor.widgets.puller.effective_locality
        self._editor.do(pulling_with(locality=local))
