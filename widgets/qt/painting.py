"""The part of the panel with the painting tools and their settings."""

from __future__ import annotations

import math
from typing import Any

from qtpy import QtWidgets

from ..editor import DeformEditor, Mode, selecting_through, with_radius
from ..region_selector import Tool
from .controls import check_box, choice_button, column, form, key_button, number_box, put, row

_TOOLS = {
    Tool.BRUSH: "brush",
    Tool.LASSO: "lasso",
    Tool.RECTANGLE: "rectangle",
    Tool.COMPONENT: "connected_part",
    Tool.REGION: "whole_region",
}


class PaintingPart(QtWidgets.QGroupBox):
    """Painting tools and their settings.

    Parameters
    ----------
    editor : DeformEditor
        The editor to control.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Paint with")
        self._editor = editor
        self.tools = {
            tool: choice_button(editor, action, editor.keys[action].label)
            for tool, action in _TOOLS.items()
        }
        group = QtWidgets.QButtonGroup(self)
        for button in self.tools.values():
            group.addButton(button)
        self.radius = number_box(
            QtWidgets.QDoubleSpinBox(),
            "Brush radius along the surface, in mesh units ([ ] or Shift+wheel)",
        )
        self.radius.valueChanged.connect(lambda radius: editor.do(with_radius(radius)))
        self.through = check_box(
            "Select through (X-ray)", "Paint hidden vertices as well", "select_through"
        )
        self.through.toggled.connect(lambda through: editor.do(selecting_through(through)))
        self.grow = key_button(editor, "grow", "Grow")
        self.shrink = key_button(editor, "shrink", "Shrink")
        self.all = key_button(editor, "select_all", "All")
        self.invert = key_button(editor, "invert", "Invert")
        tools = list(self.tools.values())
        column(
            self,
            row(*tools[:3]),
            row(*tools[3:]),
            form(("Brush radius", self.radius)),
            self.through,
            row(self.grow, self.shrink, self.all, self.invert),
        )
        self._fit_to: float | None = None

    def refresh(self) -> None:
        """Show the current tool and its settings."""
        selector = self._editor.widgets.selector
        diagonal = self._editor.session.mesh.diagonal
        if diagonal != self._fit_to:
            self._fit_to = diagonal
            _fit(self.radius, diagonal)
        put(self.tools[selector.tool], True)
        self.invert.setVisible(self._editor.mode is Mode.HANDLES)
        put(self.radius, selector.radius)
        put(self.through, selector.through)
        self.radius.setEnabled(selector.tool is Tool.BRUSH)


def _fit(box: Any, diagonal: float) -> None:
    """Set range, steps and digits of *box* for the size of the mesh."""
    box.blockSignals(True)
    box.setDecimals(max(0, 4 - math.floor(math.log10(diagonal))))
    box.setRange(1e-4 * diagonal, 2.0 * diagonal)
    box.setSingleStep(0.01 * diagonal)
    box.blockSignals(False)
