"""Buttons, fields and layouts of the panel.

Colours and sizes are those of Qt's palette and font, which covers dark palettes and high-resolution
screens.  Buttons take the focus by Tab only, so that the view still receives keys after a click.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor, Keys, key_cap
from .icons import SIZE

Qt = QtCore.Qt
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_GAP = 6
_NAME_LETTERS = 15  # of the first column of a table, with its icon
_DARK = 128  # lightness of a field, 0 to 255, below which its palette is dark
_TIP, _ACTION = "plain tip", "action"  # properties of widgets


def key_button(editor: DeformEditor, action: str, text: str = "") -> Any:
    """Return a button for an *action* of the table of keys, with its label or *text*."""
    label = editor.keys[action].label
    return doing(editor, push_button(text or label, label, action), action)


def choice_button(editor: DeformEditor, action: str, text: str) -> Any:
    """Return a `key_button` that stays down and is then highlighted."""
    return highlighted(key_button(editor, action, text))


def with_key(widget: Any, tip: str, action: str) -> Any:
    """Return *widget* with a tooltip, which `name_keys` completes by the key of *action*."""
    widget.setToolTip(tip)
    widget.setProperty(_TIP, tip)
    widget.setProperty(_ACTION, action)
    return widget


def name_keys(parent: Any, keys: Keys) -> None:
    """Name the keys of actions in the tooltips of *parent*, after `with_key`."""
    for widget in parent.findChildren(QtWidgets.QWidget):
        action = widget.property(_ACTION)
        if action:
            caps = " ".join(key_cap(key) for key in keys[action].keys[:1])
            tip = widget.property(_TIP)
            widget.setToolTip(f"{tip} ({caps})" if caps else tip)


def push_button(text: str, tip: str, action: str = "") -> Any:
    """Return a button with a tooltip that also names the key of *action*."""
    button = with_key(QtWidgets.QPushButton(text), tip, action)
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    button.setMinimumWidth(1)  # the row determines its width, not the text
    button.setSizePolicy(_policy("Preferred"), _policy("Fixed"))
    button.setAutoDefault(True)  # Enter presses it, outside dialogs too
    return button


def tool_button(text: str, tip: str, action: str = "") -> Any:
    """Return a flat button for an icon and *text*, with the tooltip of a `push_button`."""
    button = with_key(QtWidgets.QToolButton(), tip, action)
    button.setText(text)
    button.setAutoRaise(True)
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    button.setIconSize(QtCore.QSize(SIZE, SIZE))
    for enter in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
        shortcut(enter, button, button.click, alone=True)
    return button


def highlighted(button: Any) -> Any:
    """Return *button*, made to stay down, and then highlighted."""
    button.setCheckable(True)
    button.toggled.connect(lambda down: _highlight(button, down))
    return button


def doing(editor: DeformEditor, button: Any, action: str) -> Any:
    """Return *button*, which runs an *action* of the table of keys when it is clicked."""
    button.clicked.connect(lambda: editor.run(action))
    return button


def number_box(box: Any, tip: str) -> Any:
    """Return a spin box that reports a typed number only when it is entered."""
    box.setKeyboardTracking(False)
    box.setToolTip(tip)
    box.setMinimumWidth(box.fontMetrics().averageCharWidth() * 12)
    return box


def slider(least: int, most: int, tip: str) -> Any:
    """Return a slider that reports its value when it is released, and shows it meanwhile."""
    bar = QtWidgets.QSlider(Qt.Orientation.Horizontal)
    bar.setRange(least, most)
    bar.setTracking(False)
    bar.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    bar.setToolTip(tip)
    bar.sliderMoved.connect(
        lambda value: QtWidgets.QToolTip.showText(QtGui.QCursor.pos(), str(value), bar)
    )
    return bar


def check_box(text: str, tip: str, action: str = "") -> Any:
    """Return a check box with a tooltip that also names the key of *action*."""
    box = with_key(_CheckBox(text), tip, action)
    box.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return box


def choice_box(choices: list[str], tip: str) -> Any:
    """Return a combo box with a tooltip."""
    box = QtWidgets.QComboBox()
    box.addItems(choices)
    box.setToolTip(tip)
    box.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return box


def table(columns: list[str], tip: str, rows: int) -> Any:
    """Return an empty table, *rows* rows high or at least half of that, its last columns narrow.

    Editable items are renamed in the first column, by a double click there or by F2.
    """
    tree = _Table()
    tree.setHeaderLabels(columns)
    tree.setRootIsDecorated(False)
    tree.setUniformRowHeights(True)
    tree.setAllColumnsShowFocus(True)
    tree.setToolTip(tip)
    tree.setTabKeyNavigation(False)  # Tab leaves the table
    tree.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    header = tree.header()
    header.setStretchLastSection(False)
    header.setSectionsMovable(False)
    modes = QtWidgets.QHeaderView.ResizeMode
    for column in range(len(columns)):
        header.setSectionResizeMode(column, modes.ResizeToContents if column else modes.Stretch)
        tree.headerItem().setTextAlignment(column, RIGHT if column else _LEFT)
    widths = sum(header.sectionSizeHint(k) for k in range(1, len(columns)))
    letters = _NAME_LETTERS * tree.fontMetrics().averageCharWidth()
    bar = tree.verticalScrollBar().sizeHint().width() + 2 * tree.frameWidth()
    tree.setMinimumWidth(letters + widths + bar)  # names are legible beside a scroll bar
    height = 1.3 * tree.fontMetrics().height()  # of a row
    tree.setMinimumHeight(round((0.5 * rows + 1.5) * height))
    tree.setMaximumHeight(round((rows + 1.5) * height))
    return tree


def row(*widgets: Any) -> Any:
    """Return a layout with *widgets* side by side, all of the same width."""
    layout = QtWidgets.QHBoxLayout()
    layout.setSpacing(_GAP)
    for widget in widgets:
        layout.addWidget(widget, 1)
    return layout


def column(parent: Any, *pieces: Any) -> None:
    """Stack widgets and layouts in *parent*."""
    layout = QtWidgets.QVBoxLayout(parent)
    layout.setSpacing(_GAP)
    for piece in pieces:
        if isinstance(piece, QtWidgets.QLayout):
            layout.addLayout(piece)
        else:
            layout.addWidget(piece)


def form(*rows: tuple[str, Any]) -> Any:
    """Return a layout of labelled fields."""
    layout = QtWidgets.QFormLayout()
    layout.setSpacing(_GAP)
    layout.setFieldGrowthPolicy(QtWidgets.QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
    for name, field in rows:
        layout.addRow(name, field)
        layout.labelForField(field).setToolTip(field.toolTip())
    return layout


def shortcut(keys: Any, parent: Any, do: Callable[[], object], *, alone: bool = False) -> Any:
    """Call *do* for *keys* if *parent* or, unless *alone*, one of its children has the focus."""
    # Qt 5 has it in QtWidgets, Qt 6 in QtGui.
    shortcut_class = getattr(QtWidgets, "QShortcut", None) or QtGui.QShortcut
    contexts = Qt.ShortcutContext
    key = shortcut_class(QtGui.QKeySequence(keys), parent)
    key.setContext(contexts.WidgetShortcut if alone else contexts.WidgetWithChildrenShortcut)
    key.activated.connect(lambda: do())
    return key


def put(widget: Any, value: Any) -> None:
    """Show *value* in a button, check box, combo box, spin box or slider; emit no signals."""
    if isinstance(widget, QtWidgets.QPushButton | QtWidgets.QToolButton):
        widget.setChecked(value)  # only clicks trigger its action
        return
    quiet = QtCore.QSignalBlocker(widget)
    if isinstance(widget, QtWidgets.QCheckBox):
        widget.setChecked(value)
    elif isinstance(widget, QtWidgets.QComboBox):
        widget.setCurrentIndex(value)
    elif isinstance(widget, QtWidgets.QSlider):
        if not widget.isSliderDown():
            widget.setValue(value)
    elif not widget.hasFocus() or not widget.lineEdit().isModified():  # else the user types
        widget.setValue(value)
    quiet.unblock()


def swatch(colour: NDArray[np.uint8], widget: Any) -> Any:
    """Return an icon of a colour (3,), 0 to 255, at the resolution of *widget*."""
    size, ratio = widget.fontMetrics().height(), widget.devicePixelRatioF()
    picture = QtGui.QPixmap(round(size * ratio), round(size * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QtGui.QPainter(picture)
    painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
    painter.setBrush(QtGui.QColor(*colour.tolist()))
    painter.setPen(QtGui.QPen(widget.palette().color(QtGui.QPalette.ColorRole.Text), 1.0))
    painter.drawRoundedRect(QtCore.QRectF(1.0, 1.0, size - 2.0, size - 2.0), 3.0, 3.0)
    painter.end()
    icon = QtGui.QIcon(picture)
    icon.addPixmap(picture, QtGui.QIcon.Mode.Selected)  # otherwise tinted
    return icon


def sentence(text: str) -> str:
    """Return *text* with a capital first letter."""
    return text[:1].upper() + text[1:]


class _CheckBox(QtWidgets.QCheckBox):
    def paintEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Draw the box with a visible frame."""
        super().paintEvent(event)
        how = QtWidgets.QStyleOptionButton()
        self.initStyleOption(how)
        kind = QtWidgets.QStyle.SubElement.SE_CheckBoxIndicator
        painter = QtGui.QPainter(self)
        _frame(painter, self.style().subElementRect(kind, how, self), self.palette())
        painter.end()


class _Ticks(QtWidgets.QStyledItemDelegate):
    def paint(self, painter: Any, option: Any, index: Any) -> None:
        """Draw a cell, its box with a visible frame."""
        super().paint(painter, option, index)
        if index.data(Qt.ItemDataRole.CheckStateRole) is not None:
            how, table = QtWidgets.QStyleOptionViewItem(option), self.parent()
            self.initStyleOption(how, index)
            kind = QtWidgets.QStyle.SubElement.SE_ItemViewItemCheckIndicator
            _frame(painter, table.style().subElementRect(kind, how, table), table.palette())


class _Table(QtWidgets.QTreeWidget):
    def __init__(self) -> None:
        super().__init__()
        self.setItemDelegate(_Ticks(self))
        triggers = QtWidgets.QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)

    def resizeEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Keep the selected row in view."""
        super().resizeEvent(event)
        self.scrollTo(self.currentIndex())

    def edit(self, index: Any, *how: Any) -> Any:
        triggers = QtWidgets.QAbstractItemView.EditTrigger
        if how and how[0] == triggers.EditKeyPressed:
            index = index.siblingAtColumn(0)
        elif how and how[0] == triggers.DoubleClicked and index.column():
            return False
        return super().edit(index, *how)


def _frame(painter: Any, box: Any, palette: Any) -> None:
    """Draw the frame of a check box if the palette is dark: Fusion draws it darker still."""
    roles = QtGui.QPalette.ColorRole
    if palette.color(roles.Base).lightness() < _DARK:
        painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
        painter.setPen(QtGui.QPen(palette.color(roles.PlaceholderText), 1.0))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRoundedRect(QtCore.QRectF(box).adjusted(0.5, 0.5, -0.5, -0.5), 2.0, 2.0)


def _highlight(button: Any, down: bool) -> None:
    roles, palette = QtGui.QPalette.ColorRole, QtGui.QPalette()
    if down:
        palette.setColor(roles.Button, palette.color(roles.Highlight))
        palette.setColor(roles.ButtonText, palette.color(roles.HighlightedText))
    button.setPalette(palette)
    if isinstance(button, QtWidgets.QToolButton):
        button.setAutoRaise(not down)  # a flat one would not show its colour
    policies = Qt.FocusPolicy  # Tab selects the one that is down, arrows its neighbours
    button.setFocusPolicy(policies.TabFocus if down else policies.NoFocus)


def _policy(name: str) -> Any:
    return getattr(QtWidgets.QSizePolicy.Policy, name)
