"""The dialog before a repair: the surface before and after, and what each step would do.

Every change of the settings starts the repair again, in another thread.  A repair that is no longer
wanted stops at its next progress report.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from qtpy import QtCore, QtWidgets

from vtk_segdeform.io import Surface, repair_surface, to_polydata
from vtk_segdeform.mesh import Mesh, counted
from vtk_segdeform.mesh_repair import Repair
from vtk_segdeform.progress import Progress, part

from ..editor import Kind, Queue, Task, error_text
from ..qt import check_box, shortcut
from .qt_ticker import QtTicker
from .repair_preview import Preview

_REST = 0.3  # seconds between a change of the settings and the repair
_MOST_EDGES, _USUAL_EDGES = 1_000_000, 100
_DELETE = QtCore.QEvent.Type.DeferredDelete


class RepairDialog(QtWidgets.QDialog):
    """Show what a repair would do; call `release` after it was closed.

    Parameters
    ----------
    given : pyvista.PolyData
        The surface; not changed.
    mesh : Mesh
        The mesh of it, or of its valid faces; its borders are outlined.
    camera : vtkCamera or None
        Where to look from at first.
    parent : QWidget
        The window of the document.
    has_pose : bool
        Whether the document is posed, which the repaired copy will not be.

    Attributes
    ----------
    repaired : Surface or None
        The result, once it has been computed.
    """

    def __init__(
        self, given: Any, mesh: Mesh, camera: Any, parent: Any, *, has_pose: bool = False
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Repair and open")
        self.repaired: Surface | None = None
        self._given = given
        self._queue = Queue(QtTicker(self), self._show_progress)
        shown = given if np.isfinite(given.points).all() else to_polydata(mesh)
        self.preview = Preview(shown, mesh, camera, self)
        self.before, self.after = (QtWidgets.QRadioButton(text) for text in ("Before", "After"))
        self.before.setChecked(True)
        self.after.setEnabled(False)
        self.after.toggled.connect(self.preview.show_after)
        self.fill = check_box("Close holes up to", "Close holes with at most so many edges")
        self.fill.setChecked(True)
        self.edges = QtWidgets.QSpinBox()
        self.edges.setRange(3, _MOST_EDGES)
        self.edges.setValue(_USUAL_EDGES)
        self.edges.setSuffix(" edges")
        self.distance = QtWidgets.QDoubleSpinBox()
        self.distance.setDecimals(6)
        self.distance.setRange(0.0, 0.1 * mesh.diagonal)
        self.distance.setSingleStep(1e-4 * mesh.diagonal)
        self.distance.setSpecialValueText("Equal points only")
        self.distance.setToolTip("Largest distance of border points that are joined, in its unit")
        self.steps = QtWidgets.QListWidget()
        self.steps.setWordWrap(True)
        self.steps.setSelectionMode(QtWidgets.QAbstractItemView.SelectionMode.NoSelection)
        self.bar, self.stage = QtWidgets.QProgressBar(), QtWidgets.QLabel()
        self.bar.setTextVisible(False)
        for each in (self.bar, self.stage):
            policy = each.sizePolicy()
            policy.setRetainSizeWhenHidden(True)
            each.setSizePolicy(policy)
        self.stage.setWordWrap(True)
        self.advice = QtWidgets.QLabel(
            "The repaired surface is not deformed. Undo returns to the current pose."
        )
        self.advice.setWordWrap(True)
        self.advice.setVisible(has_pose)
        roles = QtWidgets.QDialogButtonBox.ButtonRole
        buttons = QtWidgets.QDialogButtonBox()
        self.accepting = buttons.addButton("Open repaired", roles.AcceptRole)
        self.cancelling = buttons.addButton("Cancel", roles.RejectRole)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        shortcut("Esc", self, self.reject)  # the preview keeps its keys
        for key in ("Return", "Enter"):
            shortcut(key, self, self._press_button)
        self._lay_out(buttons)
        self.fill.toggled.connect(self.edges.setEnabled)
        for signal in (self.fill.toggled, self.edges.valueChanged, self.distance.valueChanged):
            signal.connect(lambda *_: self._repair(_REST))
        self._repair(0.0)

    @property
    def is_computing(self) -> bool:
        """Whether a repair is being computed, or will be in a moment."""
        return self._queue.task(Kind.DOCUMENT) is not None

    def release(self) -> None:
        """Cancel a repair that is still running, and delete the dialog with its view."""
        self._queue.stop()
        self.preview.close()
        self.setParent(None)
        self.deleteLater()
        QtCore.QCoreApplication.sendPostedEvents(self, getattr(_DELETE, "value", _DELETE))

    def _press_button(self) -> None:
        (self.cancelling if self.cancelling.hasFocus() else self.accepting).click()

    def _lay_out(self, buttons: Any) -> None:
        choice = QtWidgets.QHBoxLayout()
        for each in (self.before, self.after):
            choice.addWidget(each)
        choice.addStretch(1)
        settings = QtWidgets.QFormLayout()
        settings.addRow(self.fill, self.edges)
        settings.addRow("Weld points within", self.distance)
        side = QtWidgets.QVBoxLayout()
        side.addLayout(settings)
        side.addWidget(QtWidgets.QLabel("Steps"))
        side.addWidget(self.steps, 1)
        side.addWidget(self.stage)
        side.addWidget(self.bar)
        side.addWidget(self.advice)
        side.addWidget(buttons)
        view = QtWidgets.QVBoxLayout()
        view.addWidget(self.preview.plotter, 1)
        view.addLayout(choice)
        layout = QtWidgets.QHBoxLayout(self)
        layout.addLayout(view, 3)
        layout.addLayout(side, 2)
        self.resize(860, 520)

    # The repair.

    def _repair(self, rest: float) -> None:
        """Repair with the present settings, instead of earlier ones, after *rest* seconds."""
        self._queue.cancel(Kind.DOCUMENT)
        self._show_busy()
        given, weld = self._given, self.distance.value()
        largest = self.edges.value() if self.fill.isChecked() else 0

        def work(progress: Progress) -> tuple[Surface, Repair]:
            repaired, done = repair_surface(
                given, weld_distance=weld, largest_hole=largest, progress=part(progress, 0.0, 0.9)
            )
            progress(0.9, "Checking mesh")
            return Surface(repaired), done

        task = Task(
            kind=Kind.DOCUMENT,
            begin=lambda: work,
            done=lambda result: self._show(*result),
            failed=self._fail,
            rest=rest,
        )
        self._queue.add(task)

    def _show_busy(self) -> None:
        self.repaired = None
        self._set_progress(0.0, "")
        for each in (self.bar, self.stage):
            each.show()
        self.accepting.setEnabled(False)

    def _show_progress(self) -> None:
        if (task := self._queue.task(Kind.DOCUMENT)) is not None:
            self._set_progress(task.fraction, task.text)

    def _set_progress(self, fraction: float, text: str) -> None:
        self.bar.setRange(0, 1000 if fraction else 0)  # an unknown fraction shows a busy bar
        self.bar.setValue(round(1000.0 * fraction))
        self.stage.setText(text)

    def _end(self) -> None:
        for each in (self.bar, self.stage):
            each.hide()
        self.steps.clear()

    def _show(self, repaired: Surface, done: Repair) -> None:
        self._end()
        self.repaired = repaired
        self.steps.addItems([f"{step[:1].upper()}{step[1:]}" for step in done.steps])
        if not done.steps:
            self.steps.addItem("Nothing to repair with these settings")
        if done.open_holes:
            self.steps.addItem(_remaining(done.open_holes))
        self.accepting.setEnabled(bool(done.steps))
        self.accepting.setDefault(bool(done.steps))
        self.preview.set_result(done)
        self.after.setEnabled(True)
        if done.steps:
            self.after.setChecked(True)

    def _fail(self, error: BaseException) -> None:
        self._end()
        self.steps.addItem(error_text(error))
        self.before.setChecked(True)
        self.after.setEnabled(False)


def _remaining(holes: tuple[int, ...]) -> str:
    """Say which holes are left, and up to which limit all of them would be closed.

    >>> _remaining((120, 300))
    '2 holes remain open; the largest one has 300 edges'
    """
    return f"{counted(len(holes), 'hole remains', 'holes remain')} open; " + (
        f"the largest one has {max(holes)} edges" if len(holes) > 1 else f"it has {holes[0]} edges"
    )
