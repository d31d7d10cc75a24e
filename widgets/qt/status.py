"""The status part of the panel: the last result or error, and the progress of background work."""

from __future__ import annotations

from qtpy import QtCore, QtWidgets

from ..editor import DeformEditor, Mode
from .controls import column, key_button, sentence

_LINES = 3


class StatusPart(QtWidgets.QWidget):
    """The last message, a progress bar and a Cancel button.

    Parameters
    ----------
    editor : DeformEditor
        The editor whose status is shown.
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
        self.cancel.setToolTip("Cancel it; nothing is changed (Esc)")
        for each in (self.bar, self.cancel):
            policy = each.sizePolicy()
            policy.setRetainSizeWhenHidden(True)  # keep the layout when a job starts
            each.setSizePolicy(policy)
        message, job = QtWidgets.QHBoxLayout(), QtWidgets.QHBoxLayout()
        message.addWidget(self.sign, 0, QtCore.Qt.AlignmentFlag.AlignTop)
        message.addWidget(self.words, 1)
        job.addWidget(self.bar, 3)
        job.addWidget(self.cancel, 1)
        column(self, message, job)
        self.layout().setContentsMargins(0, 0, 0, 0)

    def refresh(self) -> None:
        """Show the current message and progress."""
        messages, busy = self._editor.controller.messages, self._editor.is_busy
        # The hint for the next step is shown in the view only.
        text = sentence(messages.text if busy else messages.error or messages.last_note)
        if self.words.text() != text:
            self.words.setText(text)
        self.sign.setVisible(bool(messages.error) and not busy)
        is_running = messages.fraction is not None
        self.bar.setVisible(is_running)
        self.cancel.setVisible(is_running)
        if is_running:
            self.bar.setValue(round(1000.0 * (messages.fraction or 0.0)))
