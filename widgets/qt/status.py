"""The status part of the panel: the last result or error, the next step, and background work.

Words of the next step that name a key are links that run its action.
"""

from __future__ import annotations

import html
import re

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor, Keys, Mode, hint, key_cap
from .controls import column, doing, push_button, sentence

_LINES = 2


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
        self.cancel = doing(
            editor, push_button("Cancel", "Cancel it; nothing is changed", "cancel"), "cancel"
        )
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
            mode, keys = self._editor.mode, self._editor.keys
            links = with_links(hint(self._editor.widgets, mode, keys), keys, mode, ink)
            if self.hint.text() != links:
                self.hint.setText(links)
        is_running = messages.fraction is not None
        self.bar.setVisible(is_running)
        self.cancel.setVisible(is_running)
        if is_running:
            self.bar.setValue(round(1000.0 * (messages.fraction or 0.0)))

    def _press(self, key: str) -> None:
        binding = self._editor.keys.binding_of(key, self._editor.mode)
        if binding is not None:
            self._editor.run(binding.name)


def with_links(text: str, keys: Keys, mode: Mode, ink: str) -> str:
    """Return the rich text of a hint, in which keys that work in *mode* are links, in *ink*."""
    names = {key_cap(b.keys[0]): b.keys[0] for b in keys.bindings if mode in b.modes and b.keys}
    names = {html.escape(cap, quote=False): key for cap, key in names.items()}
    # A key after "Press", "or" or "Next:", or before ":" or "to", as hints name it.
    caps = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    pattern = rf"((?:Press|or|Next:) |\(|· |, )({caps})(?=[ :,.)]|$)"

    def link(found: re.Match[str]) -> str:
        before, cap = found.groups()
        return f'{before}<a href="{names[cap]}" style="color: {ink}">{cap}</a>'

    return re.sub(pattern, link, html.escape(text, quote=False))
