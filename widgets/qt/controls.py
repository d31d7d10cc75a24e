"""Buttons that do what keys do, and the few other pieces that the parts of the panel are made of.

Colours and sizes are those of Qt's palette and font, so that dark palettes and large pixels need
no care; a button takes the focus by Tab only, so that keys go on to the view after a click.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor, Mode, binding_of, key_cap

Qt = QtCore.Qt
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_GAP = 6


def key_button(editor: DeformEditor, key: str, mode: Mode, text: str = "") -> Any:
    """Return a button that does what *key* does in *mode*; named as there, or *text*."""
    binding = binding_of(key, mode)
    if binding is None or binding.action is None:
        raise ValueError(f"{key!r} is no key of {mode}")
    action, while_busy = binding.action, binding.while_busy
    button = push_button(text or binding.label.capitalize(), binding.label, key)
    button.clicked.connect(lambda: editor.do(action, while_busy=while_busy))
    return button


def choice_button(editor: DeformEditor, key: str, mode: Mode, text: str) -> Any:
    """Return such a button that can stay down, and is then plain to see."""
    button = key_button(editor, key, mode, text)
    button.setCheckable(True)
    button.toggled.connect(lambda down: _light_up(button, down))
    return button


def push_button(text: str, tip: str, key: str = "") -> Any:
    """Return a button with a tooltip, of the *key* too that does the same."""
    button = QtWidgets.QPushButton(text)
    button.setToolTip(sentence(f"{tip} ({key_cap(key)})" if key else tip))
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    button.setMinimumWidth(1)  # the row shares its width out, not the texts
    button.setSizePolicy(_policy("Preferred"), _policy("Fixed"))
    return button


def number_box(box: Any, tip: str) -> Any:
    """Return a spin box that reports what was typed only when it is entered."""
    box.setKeyboardTracking(False)
    box.setToolTip(sentence(tip))
    box.setMinimumWidth(box.fontMetrics().averageCharWidth() * 12)
    return box


def check_box(text: str, tip: str) -> Any:
    """Return a check box with a tooltip."""
    box = QtWidgets.QCheckBox(text)
    box.setToolTip(sentence(tip))
    box.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return box


def table(columns: list[str], tip: str, rows: int) -> Any:
    """Return an empty table, at most *rows* rows high, or half of that; last columns narrow.

    Items that may be edited are renamed in the first column, by two clicks there or by F2.
    """
    tree = _Table()
    tree.setHeaderLabels(columns)
    tree.setRootIsDecorated(False)
    tree.setUniformRowHeights(True)
    tree.setAllColumnsShowFocus(True)
    tree.setToolTip(sentence(tip))
    tree.setTabKeyNavigation(False)  # Tab leads on to what comes after the table
    tree.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    header = tree.header()
    header.setStretchLastSection(False)
    header.setSectionsMovable(False)
    modes = QtWidgets.QHeaderView.ResizeMode
    for column in range(len(columns)):
        header.setSectionResizeMode(column, modes.ResizeToContents if column else modes.Stretch)
        tree.headerItem().setTextAlignment(column, RIGHT if column else _LEFT)
    high = 1.3 * tree.fontMetrics().height()  # of a row
    tree.setMinimumHeight(round((0.5 * rows + 1.5) * high))
    tree.setMaximumHeight(round((rows + 1.5) * high))
    return tree


def row(*widgets: Any) -> Any:
    """Return a layout with *widgets* side by side, as wide as one another."""
    layout = QtWidgets.QHBoxLayout()
    layout.setSpacing(_GAP)
    for widget in widgets:
        layout.addWidget(widget, 1)
    return layout


def column(parent: Any, *pieces: Any) -> None:
    """Put widgets and layouts below one another into *parent*."""
    layout = QtWidgets.QVBoxLayout(parent)
    layout.setSpacing(_GAP)
    for piece in pieces:
        if isinstance(piece, QtWidgets.QLayout):
            layout.addLayout(piece)
        else:
            layout.addWidget(piece)


def form(*rows: tuple[str, Any]) -> Any:
    """Return a layout of named fields."""
    layout = QtWidgets.QFormLayout()
    layout.setSpacing(_GAP)
    layout.setFieldGrowthPolicy(QtWidgets.QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
    for name, field in rows:
        layout.addRow(name, field)
        layout.labelForField(field).setToolTip(field.toolTip())
    return layout


def shortcut(keys: Any, parent: Any, do: Callable[[], object], *, alone: bool = False) -> None:
    """Have *keys* do something where *parent* has the focus or, unless *alone*, what is in it."""
    # Qt 5 has it in QtWidgets, Qt 6 in QtGui.
    made = getattr(QtWidgets, "QShortcut", None) or QtGui.QShortcut
    contexts = Qt.ShortcutContext
    key = made(QtGui.QKeySequence(keys), parent)
    key.setContext(contexts.WidgetShortcut if alone else contexts.WidgetWithChildrenShortcut)
    key.activated.connect(do)


def put(widget: Any, value: Any) -> None:
    """Show *value* in a button that stays down, a check box or a spin box, and tell nobody."""
    if isinstance(widget, QtWidgets.QPushButton):
        widget.setChecked(value)  # it does something when clicked only
        return
    quiet = QtCore.QSignalBlocker(widget)
    if isinstance(widget, QtWidgets.QCheckBox):
        widget.setChecked(value)
    elif not widget.hasFocus() or not widget.lineEdit().isModified():  # else somebody types there
        widget.setValue(value)
    quiet.unblock()


def swatch(colour: str, widget: Any) -> Any:
    """Return an icon of a "#RRGGBB", as sharp as the pixels of *widget*."""
    size, ratio = widget.fontMetrics().height(), widget.devicePixelRatioF()
    picture = QtGui.QPixmap(round(size * ratio), round(size * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QtGui.QPainter(picture)
    painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
    painter.setBrush(QtGui.QColor(colour))
    painter.setPen(QtGui.QPen(widget.palette().color(QtGui.QPalette.ColorRole.Text), 1.0))
    painter.drawRoundedRect(QtCore.QRectF(1.0, 1.0, size - 2.0, size - 2.0), 3.0, 3.0)
    painter.end()
    icon = QtGui.QIcon(picture)
    icon.addPixmap(picture, QtGui.QIcon.Mode.Selected)  # else tinted
    return icon


def sentence(text: str) -> str:
    """Begin *text* with a capital."""
    return text[:1].upper() + text[1:]


class _Table(QtWidgets.QTreeWidget):
    def __init__(self) -> None:
        super().__init__()
        triggers = QtWidgets.QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)

    def edit(self, index: Any, *how: Any) -> Any:
        triggers = QtWidgets.QAbstractItemView.EditTrigger
        if how and how[0] == triggers.EditKeyPressed:
            index = index.siblingAtColumn(0)
        elif how and how[0] == triggers.DoubleClicked and index.column():
            return False
        return super().edit(index, *how)


def _light_up(button: Any, down: bool) -> None:
    roles, palette = QtGui.QPalette.ColorRole, QtGui.QPalette()
    if down:
        palette.setColor(roles.Button, palette.color(roles.Highlight))
        palette.setColor(roles.ButtonText, palette.color(roles.HighlightedText))
    button.setPalette(palette)
    policies = Qt.FocusPolicy  # Tab leads to the one that is down, arrows to its neighbours
    button.setFocusPolicy(policies.TabFocus if down else policies.NoFocus)


def _policy(name: str) -> Any:
    return getattr(QtWidgets.QSizePolicy.Policy, name)
