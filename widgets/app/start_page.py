"""The page shown before a document is open: a drop area, two buttons and recent files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

Qt = QtCore.Qt
_WIDTH = 64  # letters


class StartPage(QtWidgets.QWidget):
    """A drop area, two buttons and the recent files.

    Attributes
    ----------
    open, sample : QPushButton
        Ask for a file; open the sample model.
    recent : list of QPushButton
        One button for each file.
    """

    open_wanted = QtCore.Signal()
    """The user wants to choose a file."""
    sample_wanted = QtCore.Signal()
    """The user wants to open the sample model."""
    chosen = QtCore.Signal(object)
    """The user chose a recent file: its Path."""

    def __init__(self) -> None:
        super().__init__()
        self.open, self.sample = _button("Open ..."), _button("Open sample model")
        self.open.setDefault(True)
        self.open.clicked.connect(self.open_wanted)
        self.sample.clicked.connect(self.sample_wanted)
        self.sample.setToolTip("Try the editor on a built-in model")
        self.target = _Target()
        self.recent: list[Any] = []
        self._heading = QtWidgets.QLabel("Recent")
        self._list = QtWidgets.QVBoxLayout()
        self._list.setSpacing(0)
        buttons = QtWidgets.QHBoxLayout()
        buttons.addWidget(self.open)
        buttons.addWidget(self.sample)
        inside = QtWidgets.QWidget()
        inside.setFixedWidth(_WIDTH * self.fontMetrics().averageCharWidth())
        column = QtWidgets.QVBoxLayout(inside)
        column.setSpacing(round(0.8 * self.fontMetrics().height()))
        column.addWidget(self.target)
        column.addLayout(buttons)
        column.addWidget(self._heading)
        column.addLayout(self._list)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addWidget(inside, 0, Qt.AlignmentFlag.AlignCenter)

    def show_recent(self, paths: Sequence[Path]) -> None:
        """List files with their names and folders; missing files are disabled."""
        for button in self.recent:
            self._list.removeWidget(button)
            button.hide()  # it is deleted only after a dialog that is shown next
            button.deleteLater()
        self.recent = [self._recent_button(path) for path in paths]
        for button in self.recent:
            self._list.addWidget(button)
        self._heading.setVisible(bool(self.recent))

    def _recent_button(self, path: Path) -> Any:
        button = QtWidgets.QPushButton()
        button.setFlat(True)
        button.setAutoDefault(True)  # Enter presses it
        button.setEnabled(os.path.isfile(path))
        button.setToolTip(str(path))
        button.setStyleSheet("text-align: left; padding: 4px 2px;")
        metrics, room = self.fontMetrics(), (_WIDTH - 4) * self.fontMetrics().averageCharWidth()
        room -= metrics.horizontalAdvance(f"{path.name}    ")
        folder = metrics.elidedText(home_as_tilde(path.parent), Qt.TextElideMode.ElideMiddle, room)
        button.setText(f"{path.name}    {folder}".replace("&", "&&"))
        button.clicked.connect(lambda: self.chosen.emit(path))
        return button


class _Target(QtWidgets.QLabel):
    """The drop area: a dashed frame, highlighted while a file is dragged over the window."""

    def __init__(self) -> None:
        super().__init__(
            "<p style='font-size: x-large'>Drop a mesh or a session here</p>"
            "<p>ply, obj, off, stl, vtk, vtp, glb ... or .segdeform</p>"
        )
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setMinimumHeight(9 * self.fontMetrics().height())
        self.setAccessibleName("Drop a mesh or a session here")
        self.highlight(False)

    def highlight(self, on: bool) -> None:
        """Highlight the area, or end that."""
        self.is_highlighted = on
        colour = "palette(highlight)" if on else "palette(placeholder-text)"
        fill = "palette(base)" if on else "rgba(128, 128, 128, 8%)"
        self.setStyleSheet(
            f"QLabel {{ border: 2px dashed {colour}; border-radius: 10px; background: {fill}; }}"
        )


def home_as_tilde(folder: Path) -> str:
    """Return a folder with "~" for the home folder."""
    try:
        return f"~/{folder.relative_to(Path.home())}".removesuffix("/.")
    except ValueError:
        return str(folder)


def _button(text: str) -> Any:
    button = QtWidgets.QPushButton(text)
    button.setAutoDefault(True)  # Enter presses it
    button.setMinimumHeight(round(2.2 * button.fontMetrics().height()))
    return button
