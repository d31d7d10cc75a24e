"""The page shown before a document is open: a drop area, two buttons and recent files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

Qt = QtCore.Qt
_WIDTH = 64  # letters
_ROUND = 10.0
_MOST = 6  # recent files; the menu has the rest


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
        self.recent = [self._recent_button(path) for path in paths[:_MOST]]
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


class _Target(QtWidgets.QWidget):
    """The drop area: a dashed frame, highlighted while a file is dragged over the window."""

    def __init__(self) -> None:
        super().__init__()
        self.is_highlighted = False
        self.setMinimumHeight(9 * self.fontMetrics().height())
        self.setAccessibleName("Drop a mesh or a session here")

    def highlight(self, on: bool) -> None:
        """Highlight the area, or end that."""
        self.is_highlighted = on
        self.update()

    def paintEvent(self, event: Any) -> None:  # noqa: N802, ARG002 - Qt's name
        """Draw the frame and the text."""
        roles, palette = QtGui.QPalette.ColorRole, self.palette()
        ink = palette.color(roles.WindowText)
        line = palette.color(roles.Highlight) if self.is_highlighted else QtGui.QColor(ink)
        fill = QtGui.QColor(line)
        line.setAlphaF(1.0 if self.is_highlighted else 0.45)
        fill.setAlphaF(0.15 if self.is_highlighted else 0.03)
        painter = QtGui.QPainter(self)
        painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
        painter.setPen(QtGui.QPen(line, 1.5, Qt.PenStyle.DashLine))
        painter.setBrush(fill)
        frame = QtCore.QRectF(self.rect()).adjusted(1.0, 1.0, -1.0, -1.0)
        painter.drawRoundedRect(frame, _ROUND, _ROUND)
        painter.setPen(ink)
        font, middle = self.font(), frame.center().y()
        small = QtGui.QFont(font)
        font.setPointSizeF(1.5 * font.pointSizeF())
        painter.setFont(font)
        top = Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignBottom
        painter.drawText(_part(frame, frame.top(), middle), top, "Drop a mesh or a session here")
        ink.setAlphaF(0.7)
        painter.setPen(ink)
        painter.setFont(small)
        below = Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop
        kinds = "ply, obj, off, stl, vtk, vtp, glb ... or .segdeform"
        gap = 0.4 * self.fontMetrics().height()
        painter.drawText(_part(frame, middle + gap, frame.bottom()), below, kinds)
        painter.end()


def home_as_tilde(folder: Path) -> str:
    """Return a folder with "~" for the home folder."""
    try:
        return f"~/{folder.relative_to(Path.home())}".removesuffix("/.")
    except ValueError:
        return str(folder)


def _part(frame: Any, top: float, bottom: float) -> Any:
    return QtCore.QRectF(frame.left(), top, frame.width(), bottom - top)


def _button(text: str) -> Any:
    button = QtWidgets.QPushButton(text)
    button.setAutoDefault(True)  # Enter presses it
    button.setMinimumHeight(round(2.2 * button.fontMetrics().height()))
    return button
