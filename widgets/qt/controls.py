"""Buttons, fields and layouts of the panel.

Colours and sizes are those of Qt's palette and font, which covers dark palettes and high-resolution
screens.  Buttons take the focus by Tab only, so that the view still receives keys after a click.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from ..editor import DeformEditor
from ..panel import press, use_file
from .icons import SIZE

Qt = QtCore.Qt
_GAP = 6
_DARK = 128  # lightness of a field, 0 to 255, below which its palette is dark


Press = Callable[..., object]
"""Uses a control by its name, perhaps with a value or a file; see `panel.press`, `use_file`."""


def using(editor: DeformEditor) -> Press:
    """Return the function that uses controls of *editor*; its errors are shown in the status."""

    def use(name: str, value: Any = None) -> None:
        with editor.view.guarded():
            paths = value if isinstance(value, list) else [value]
            if paths and isinstance(paths[0], Path):
                use_file(editor, name, *paths)
            else:
                press(editor, name, value)
            editor.controller.refresh()  # and with it the panel, even if nothing was done

    return use


def push_button(text: str) -> Any:
    """Return a button with a text."""
    button = QtWidgets.QPushButton(text)
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    button.setMinimumWidth(1)  # the row determines its width, not the text
    button.setSizePolicy(_policy("Preferred"), _policy("Fixed"))
    button.setAutoDefault(True)  # Enter presses it, outside dialogs too
    return button


def tool_button(text: str) -> Any:
    """Return a flat button for an icon and *text*."""
    button = QtWidgets.QToolButton()
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


def folding_button(text: str, folded: Any) -> Any:
    """Return a button with an arrow that shows the widget *folded* while it is down."""
    button = tool_button(text)
    button.setToolTip("Show or hide these options")
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
    button.setCheckable(True)

    def fold(down: bool) -> None:
        button.setArrowType(Qt.ArrowType.DownArrow if down else Qt.ArrowType.RightArrow)
        folded.setVisible(down)

    fold(False)
    button.toggled.connect(fold)
    return button


class _WheelFilter(QtCore.QObject):
    """Lets the wheel scroll the panel over a field, unless the field has the focus."""

    def eventFilter(self, field: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
        """Pass the wheel on to whatever is behind an unfocused *field*."""
        if event.type() != QtCore.QEvent.Type.Wheel or field.hasFocus():
            return False
        event.ignore()
        return True


def without_wheel(field: Any) -> Any:
    """Return *field*, whose value the wheel changes only while it has the focus."""
    field.installEventFilter(_WheelFilter(field))
    return field


def number_box(box: Any) -> Any:
    """Return a spin box that reports a typed number only when it is entered."""
    without_wheel(box).setFocusPolicy(Qt.FocusPolicy.StrongFocus)  # Tab or a click, no wheel
    box.setKeyboardTracking(False)
    box.setMinimumWidth(box.fontMetrics().averageCharWidth() * 12)
    return box


class Slider(QtWidgets.QSlider):
    """A slider whose value is shown by `figure`, a label beside it.

    Parameters
    ----------
    on_release : bool
        Whether the value changes only at the release; `figure` shows it during the drag as well.
    """

    def __init__(self, *, on_release: bool) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self.figure, self.unit = QtWidgets.QLabel(), ""
        self.figure.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        without_wheel(self).setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setTracking(not on_release)
        self.sliderMoved.connect(self._show)

    def set_unit(self, unit: str) -> None:
        """Show *unit* after the value, and make room for the largest value."""
        self.unit = unit
        widest = self.figure.fontMetrics().horizontalAdvance(self._text(self.maximum()))
        self.figure.setMinimumWidth(widest)
        self._show(self.sliderPosition())

    def sliderChange(self, change: Any) -> None:  # noqa: N802 - Qt's name
        """Show the value, also if its signals are blocked."""
        super().sliderChange(change)
        self._show(self.sliderPosition())

    def setVisible(self, visible: bool) -> None:  # noqa: N802
        """Show or hide the slider with its figure."""
        super().setVisible(visible)
        self.figure.setVisible(visible)

    def _show(self, value: int) -> None:
        self.figure.setText(self._text(value))

    def _text(self, value: int) -> str:
        return f"{value} {self.unit}".strip()


def check_box(text: str, tip: str = "") -> Any:
    """Return a check box with a tooltip."""
    box = _CheckBox(text)
    box.setToolTip(tip)
    box.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return box


def choice_box(choices: list[str]) -> Any:
    """Return a combo box."""
    box = without_wheel(QtWidgets.QComboBox())
    box.addItems(choices)
    box.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    return box


def with_figure(bar: Slider) -> Any:
    """Return a layout with a slider and its value beside it."""
    layout = QtWidgets.QHBoxLayout()
    layout.setSpacing(_GAP)
    layout.addWidget(bar, 1)
    layout.addWidget(bar.figure)
    return layout


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


def stopper(*lists: list[Callable[[], None]]) -> Callable[..., None]:
    """Return a function that calls and removes all callbacks in *lists*."""

    def stop_all(*_: object) -> None:
        for stops in lists:
            while stops:
                stops.pop()()

    return stop_all


class _CheckBox(QtWidgets.QCheckBox):
    def paintEvent(self, event: Any) -> None:  # noqa: N802 - Qt's name
        """Draw the box with a visible frame."""
        super().paintEvent(event)
        how = QtWidgets.QStyleOptionButton()
        self.initStyleOption(how)
        kind = QtWidgets.QStyle.SubElement.SE_CheckBoxIndicator
        painter = QtGui.QPainter(self)
        box_frame(painter, self.style().subElementRect(kind, how, self), self.palette())
        painter.end()


def box_frame(painter: Any, box: Any, palette: Any) -> None:
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
    policies = Qt.FocusPolicy  # in a group Tab selects the one that is down, arrows its neighbours
    is_reached = down or button.group() is None
    button.setFocusPolicy(policies.TabFocus if is_reached else policies.NoFocus)


def _policy(name: str) -> Any:
    return getattr(QtWidgets.QSizePolicy.Policy, name)
