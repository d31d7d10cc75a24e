"""The status part of the panel: the last result or error, the next step, and background work.

Words of the next step that name a key are links that run its action.
"""

from __future__ import annotations

import html
import re

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor, Mode, binding_of, hint
from .controls import column, key_button, sentence

_LINES = 2
# A key after "Press", "or" or "Next:", or before ":" or "to", as hints name it.
_KEY = re.compile(r"((?:Press|or|Next:) |\(|· |, )([0-9A-Z])(?=[ :,.)]|$)")


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
        self.hint = QtWidgets.QLabel()
        self.hint.setWordWrap(True)
        self.hint.setTextFormat(QtCore.Qt.TextFormat.RichText)
        self.hint.setFocusPolicy(QtCore.Qt.FocusPolicy.NoFocus)
        self.hint.linkActivated.connect(self._press)
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
        column(self, message, self.hint, job)
        self.layout().setContentsMargins(0, 0, 0, 0)

    def refresh(self) -> None:
        """Show the current message and progress."""
        messages, busy = self._editor.controller.messages, self._editor.is_busy
        text = sentence(messages.text if busy else messages.error or messages.last_note)
        if self.words.text() != text:
            self.words.setText(text)
        self.sign.setVisible(bool(messages.error) and not busy)
        if not busy:
            ink = self.palette().color(QtGui.QPalette.ColorRole.WindowText).name()
            mode = self._editor.mode
            links = with_links(hint(self._editor.widgets, mode), mode, ink)
            if self.hint.text() != links:
                self.hint.setText(links)
        is_running = messages.fraction is not None
        self.bar.setVisible(is_running)
        self.cancel.setVisible(is_running)
        if is_running:
            self.bar.setValue(round(1000.0 * (messages.fraction or 0.0)))

    def _press(self, key: str) -> None:
        binding = binding_of(key, self._editor.mode)
        if binding is not None and binding.action is not None:
            self._editor.do(binding.action, while_busy=binding.while_busy)


def with_links(text: str, mode: Mode, ink: str) -> str:
    """Return the rich text of a hint, in which keys that work in *mode* are links, in *ink*."""

    def link(found: re.Match[str]) -> str:
        before, key = found.groups()
        if binding_of(key.lower(), mode) is None:
            return f"{before}{key}"
        return f'{before}<a href="{key.lower()}" style="color: {ink}">{key}</a>'

    return _KEY.sub(link, html.escape(text, quote=False))
