"""Keeps a fault of PySide6 6.12.0 from ending the program.

Python before 3.12 counts the references to None.  There, each call of a method of Qt that returns
nothing takes away one that is not its own; a drag does so some hundred times a second.  When none
is left Python aborts: "deallocating None".  So some are added in time, which costs nothing.
"""

from __future__ import annotations

import ctypes
import sys
from typing import Any

from qtpy import QtCore

LEAST = 100_000
_PERIOD = 5000  # milliseconds; in that time far fewer are lost


def add_references(least: int = LEAST) -> None:
    """See to it that there are at least so many references to None, where they are counted."""
    if sys.version_info < (3, 12):
        for _ in range(least - sys.getrefcount(None)):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(None))


def look_after_none(parent: Any) -> Any:
    """Return a timer that does so now and then, as long as *parent* lives."""
    add_references()
    timer = QtCore.QTimer(parent)
    timer.timeout.connect(lambda: add_references())
    timer.start(_PERIOD)
    return timer
