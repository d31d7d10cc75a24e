"""The foot of the panel: what was done or went wrong, and how far a job is."""

from __future__ import annotations

from qtpy import QtCore, QtWidgets

from ..editor import DeformEditor, Mode
from .controls import column, key_button, sentence

_LINES = 3


class Foot(QtWidgets.QWidget):
    """A few words, a bar and a button that cancels.

    Parameters
    ----------
    editor : DeformEditor
        Whose.
    """

    def __init__(self, editor: DeformEditor) -> None:
        super().__init__()
        self._editor = editor
        self.sign = QtWidgets.QLabel()
        size = self.fontMetrics().height() + 4
        icon = self.style().standardIcon(QtWidgets.QStyle.StandardPixmap.SP_MessageBoxWarning)
        self.sign.setPixmap(icon.pixmap(size, size))
        self.words = QtWidgets.QLabel()
        self.words.setWordWrap(True)
        self.words.setAlignment(QtCore.Qt.AlignmentFlag.AlignTop)
        self.words.setMinimumHeight(_LINES * self.fontMetrics().lineSpacing())
        self.words.setTextInteractionFlags(QtCore.Qt.TextInteractionFlag.TextSelectableByMouse)
        self.bar = QtWidgets.QProgressBar()
        self.bar.setRange(0, 1000)
        self.cancel = key_button(editor, "escape", Mode.REGIONS, "Cancel")
        self.cancel.setToolTip("Stop what is being done; nothing is then changed (Esc)")
        for each in (self.bar, self.cancel):
            policy = each.sizePolicy()
            policy.setRetainSizeWhenHidden(True)  # else all would jump when a job begins
            each.setSizePolicy(policy)
        said, job = QtWidgets.QHBoxLayout(), QtWidgets.QHBoxLayout()
        said.addWidget(self.sign, 0, QtCore.Qt.AlignmentFlag.AlignTop)
        said.addWidget(self.words, 1)
        job.addWidget(self.bar, 3)
        job.addWidget(self.cancel, 1)
        column(self, said, job)
        self.layout().setContentsMargins(0, 0, 0, 0)

    def refresh(self) -> None:
        """Show what is said now."""
        voice, busy = self._editor.desk.voice, self._editor.is_busy
        # What to do next is said in the view, where the eyes are.
        text = sentence(voice.text if busy else voice.fault or voice.noted)
        if self.words.text() != text:
            self.words.setText(text)
        self.sign.setVisible(bool(voice.fault) and not busy)
        self.bar.setVisible(busy)
        self.cancel.setVisible(busy)
        if busy:
            self.bar.setValue(round(1000.0 * (voice.fraction or 0.0)))
