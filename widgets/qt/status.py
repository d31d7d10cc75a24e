"""The status: the last result or error, the next step, and background work.

Words of the next step that name a key are links that run its action.  While the status is visible,
the view does not draw the same text as its status line.
"""

from __future__ import annotations

import html
import re
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor, Keys, Mode, key_cap
from .controls import doing, push_button, sentence

_LINES = 2
_BAR_LETTERS = 18  # width of the progress bar


class StatusPart(QtWidgets.QWidget):
    """The last message with the next step, a progress bar and a Cancel button.

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
        self.words.setTextFormat(QtCore.Qt.TextFormat.RichText)
        flags = QtCore.Qt.TextInteractionFlag
        self.words.setTextInteractionFlags(
            flags.TextSelectableByMouse | flags.LinksAccessibleByMouse
        )
        self.words.setFocusPolicy(QtCore.Qt.FocusPolicy.NoFocus)
        self.words.linkActivated.connect(self._press)
        self.bar = QtWidgets.QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setFixedWidth(_BAR_LETTERS * self.fontMetrics().averageCharWidth())
        self.cancel = doing(
            editor, push_button("Cancel", "Cancel; nothing is changed", "cancel"), "cancel"
        )
        message, job = QtWidgets.QHBoxLayout(), QtWidgets.QHBoxLayout()
        message.addWidget(self.sign)
        message.addWidget(self.words, 1)
        job.addWidget(self.bar)
        job.addWidget(self.cancel)
        self._layout = QtWidgets.QBoxLayout(QtWidgets.QBoxLayout.Direction.TopToBottom, self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.addLayout(message, 1)
        self._layout.addLayout(job)
        self.words.setMinimumHeight(_LINES * self.fontMetrics().lineSpacing())

    def lie_down(self) -> None:
        """Lay out all parts in one row, for the lower edge of a window."""
        self._layout.setDirection(QtWidgets.QBoxLayout.Direction.LeftToRight)
        self._layout.setContentsMargins(8, 3, 8, 3)
        self.setFixedHeight(self.minimumSizeHint().height())  # the size of the view stays

    def refresh(self) -> None:
        """Show the current message and progress."""
        messages, busy = self._editor.controller.messages, self._editor.is_busy
        if busy:
            text = _escaped(sentence(messages.text))
        elif messages.error:
            text = _escaped(sentence(messages.error))
        else:
            mode = self._editor.mode
            ink = self.palette().color(QtGui.QPalette.ColorRole.WindowText).name()
            step = self._editor.controller.hint
            note = "" if messages.last_note in step else _escaped(sentence(messages.last_note))
            text = " · ".join(filter(None, (note, with_links(step, self._editor.keys, mode, ink))))
        labels = [] if busy else self._editor.controller.recordings.labels
        text = " · ".join([*(f"<b>{_escaped(label)}</b>" for label in labels), text])
        if self.words.text() != text:
            self.words.setText(text)
            self.words.setToolTip(text)  # which may be too long for its place
        self.sign.setVisible(bool(messages.error) and not busy)
        is_running = messages.fraction is not None
        self.bar.setVisible(is_running)
        self.cancel.setVisible(is_running)
        if is_running:
            self.bar.setValue(round(1000.0 * (messages.fraction or 0.0)))

    def showEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Take the text over from the view."""
        super().showEvent(event)
        self._editor.controller.messages.show_line(False)

    def hideEvent(self, event: Any) -> None:  # noqa: N802
        """Leave the text to the view."""
        super().hideEvent(event)
        if self._editor.GetEnabled():
            self._editor.controller.messages.show_line(True)

    def _press(self, key: str) -> None:
        binding = self._editor.keys.binding_of(key, self._editor.mode)
        if binding is not None:
            self._editor.run(binding.name)


def with_links(text: str, keys: Keys, mode: Mode, ink: str) -> str:
    """Return the rich text of a hint, in which keys that work in *mode* are links, in *ink*."""
    working = [b for b in keys.bindings if b.name and mode in b.modes and b.keys]
    names = {key_cap(b.keys[0]): b.keys[0] for b in working}
    names = {html.escape(cap, quote=False): key for cap, key in names.items()}
    # A key after "Press", "or" or "Next:", or before ":" or "to", as hints name it.
    caps = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    pattern = rf"((?:Press|or|Next:) |\(|· |, |\. )({caps})(?=[ :,.)]|$)"

    def link(found: re.Match[str]) -> str:
        before, cap = found.groups()
        return f'{before}<a href="{names[cap]}" style="color: {ink}">{cap}</a>'

    return re.sub(pattern, link, _escaped(text))


def _escaped(text: str) -> str:
    return html.escape(text, quote=False)
