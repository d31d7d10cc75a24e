"""The status: the last result or error, the next step, and background work.

Words of the next step that name a key are links that run its action.  While the status is visible,
the view does not draw the same text as its status line.
"""

from __future__ import annotations

import html
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor
from ..panel import Word, status, tooltip
from .controls import Press, push_button

_LINES = 2
_BAR_LETTERS = 20  # width of the progress bar


class StatusPart(QtWidgets.QWidget):
    """The last message with the next step, a progress bar and a Cancel button.

    Parameters
    ----------
    editor : DeformEditor
        The editor whose status is shown.
    press : callable
        ``press(name)``, called by the Cancel button.
    """

    def __init__(self, editor: DeformEditor, press: Press) -> None:
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
        self.words.linkActivated.connect(editor.run)
        self.bar = QtWidgets.QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setFixedWidth(_BAR_LETTERS * self.fontMetrics().averageCharWidth())
        cancel = status(editor).cancel
        self.cancel = push_button(cancel.label)
        self.cancel.clicked.connect(lambda: press(cancel.name))
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
        now = status(self._editor)
        ink = self.palette().color(QtGui.QPalette.ColorRole.WindowText).name()
        hint = "".join(_linked(word, ink) for word in now.words)
        text = " · ".join(filter(None, (_escaped(now.text), hint)))
        if self.words.text() != text:
            self.words.setText(text)
            self.words.setToolTip(text)  # which may be too long for its place
        self.sign.setVisible(now.is_error)
        for each in (self.bar, self.cancel):
            each.setVisible(now.cancel.visible)
        self.bar.setFormat("%p %" if now.is_busy else f"{now.work} %p %")  # a job is in the words
        self.bar.setValue(round(1000.0 * (now.progress or 0.0)))
        self.cancel.setToolTip(tooltip(now.cancel, self._editor.keys))

    def showEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Take the text over from the view."""
        super().showEvent(event)
        self._editor.controller.messages.show_line(False)

    def hideEvent(self, event: Any) -> None:  # noqa: N802
        """Leave the text to the view."""
        super().hideEvent(event)
        if self._editor.GetEnabled():
            self._editor.controller.messages.show_line(True)


def _linked(word: Word, ink: str) -> str:
    """Return the rich text of a *word*, in *ink*: a link if it has an action."""
    text = _escaped(word.text)
    return f'<a href="{word.action}" style="color: {ink}">{text}</a>' if word.action else text


def _escaped(text: str) -> str:
    return html.escape(text, quote=False)
