"""The panel's part for painting: with which tool, how large, and how far it reaches."""

from __future__ import annotations

import math
from typing import Any

from qtpy import QtWidgets

from ..editor import DeformEditor, Mode, reaching, with_radius
from ..region_selector import Tool
from .controls import check_box, choice_button, column, form, key_button, number_box, put, row

_TOOLS = {
    Tool.BRUSH: ("b", "Brush"),
    Tool.LASSO: ("l", "Lasso"),
    Tool.RECTANGLE: ("t", "Rectangle"),
    Tool.COMPONENT: ("k", "Component"),
}


class PaintingPart(QtWidgets.QGroupBox):
    """Tools and their settings.

    Parameters
    ----------
    editor : DeformEditor
        Whose.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__("Paint with")
        self._editor = editor
        mode = Mode.REGIONS  # and in mode 3 the keys are the same
        self.tools = {
            tool: choice_button(editor, key, mode, text) for tool, (key, text) in _TOOLS.items()
        }
        group = QtWidgets.QButtonGroup(self)
        for button in self.tools.values():
            group.addButton(button)
        self.radius = number_box(
            QtWidgets.QDoubleSpinBox(),
            "how far the brush reaches along the surface, in the mesh's unit ([ ] or the wheel)",
        )
        self.radius.valueChanged.connect(lambda radius: editor.do(with_radius(radius)))
        self.through = check_box("through the body", "paint what is hidden, too (V)")
        self.through.toggled.connect(lambda through: editor.do(reaching(through)))
        self.grow = key_button(editor, "plus", mode, "Grow")
        self.shrink = key_button(editor, "minus", mode, "Shrink")
        tools = list(self.tools.values())
        column(
            self,
            row(*tools[:2]),
            row(*tools[2:]),
            form(("Brush radius", self.radius)),
            self.through,
            row(self.grow, self.shrink),
        )
        self._fit_to: float | None = None

    def refresh(self) -> None:
        """Show the tool and its settings."""
        selector = self._editor.stage.selector
        diagonal = self._editor.session.mesh.diagonal
        if diagonal != self._fit_to:
            self._fit_to = diagonal
            _fit(self.radius, diagonal)
        put(self.tools[selector.tool], True)
        put(self.radius, selector.radius)
        put(self.through, selector.through)
        self.radius.setEnabled(selector.tool is Tool.BRUSH)


def _fit(box: Any, diagonal: float) -> None:
    """Give *box* range, steps and digits that suit a mesh of this size."""
    box.blockSignals(True)
    box.setDecimals(max(0, 4 - math.floor(math.log10(diagonal))))
    box.setRange(1e-4 * diagonal, 2.0 * diagonal)
    box.setSingleStep(0.01 * diagonal)
    box.blockSignals(False)
