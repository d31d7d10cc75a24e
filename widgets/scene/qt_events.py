"""Qt events that pyvistaqt does not pass on to VTK; imported for views in Qt only.

These are the Alt key, the keypad, whose digits would arrive as those of the main row, Ctrl+I, which
would arrive as Tab, and the modifiers and the position of the wheel.
"""

from __future__ import annotations

import contextlib
from typing import Any

from qtpy import QtCore

_Kind = QtCore.QEvent.Type
_MODIFIERS = QtCore.Qt.KeyboardModifier
_MOUSE = (_Kind.MouseButtonPress, _Kind.MouseButtonRelease, _Kind.MouseButtonDblClick,
          _Kind.MouseMove)  # fmt: skip
_KEYS = QtCore.Qt.Key
# With Num Lock off the keypad sends these keys.
_KEYPAD = {_KEYS.Key_Insert: "KP_0", _KEYS.Key_End: "KP_1", _KEYS.Key_PageDown: "KP_3",
           _KEYS.Key_Clear: "KP_5", _KEYS.Key_Home: "KP_7"}  # fmt: skip
_KEYPAD |= {getattr(_KEYS, f"Key_{digit}"): f"KP_{digit}" for digit in range(10)}


class EventFilter(QtCore.QObject):
    """Completes the events of a view until `remove`."""

    def __init__(self, plotter: Any) -> None:
        super().__init__(plotter)
        self._plotter = plotter
        plotter.installEventFilter(self)

    def remove(self) -> None:
        """Leave the events as they are."""
        with contextlib.suppress(RuntimeError):  # Qt has deleted the widget, with this filter
            self._plotter.removeEventFilter(self)
            self.deleteLater()

    def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
        """Tell VTK; return True for a key that VTK has received then."""
        kind = event.type()
        if kind not in (*_MOUSE, _Kind.Wheel, _Kind.KeyPress, _Kind.KeyRelease):
            return False
        wrapper = getattr(self._plotter, "iren", None)
        interactor = None if wrapper is None else wrapper.interactor
        if interactor is None:
            return False
        held = event.modifiers()
        interactor.SetAltKey(bool(held & _MODIFIERS.AltModifier))
        shift, control = (
            bool(held & each) for each in (_MODIFIERS.ShiftModifier, _MODIFIERS.ControlModifier)
        )
        if kind == _Kind.Wheel:
            scale, place = watched.devicePixelRatioF(), event.position()
            x, y = place.x() * scale, (watched.height() - place.y() - 1) * scale
            interactor.SetEventInformation(round(x), round(y), control, shift, chr(0), 0, None)
        elif kind in (_Kind.KeyPress, _Kind.KeyRelease):
            name = _KEYPAD.get(event.key()) if held & _MODIFIERS.KeypadModifier else None
            if control and event.key() == _KEYS.Key_I:
                name = "i"
            if name is not None:
                x, y = interactor.GetEventPosition()
                interactor.SetEventInformation(x, y, control, shift, chr(0), 0, name)
                if kind == _Kind.KeyPress:
                    interactor.KeyPressEvent()
                    interactor.CharEvent()
                else:
                    interactor.KeyReleaseEvent()
                return True
        return False
