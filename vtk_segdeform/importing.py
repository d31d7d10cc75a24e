"""Imports at first use, which Ctrl+C cannot leave half done.

A signal handler that raises an exception ends an import at any point.  Modules that have been
loaded by then stay, and libraries such as NumPy, SciPy, VTK and numba cannot be imported again on
top of them: until the end of the process every call fails.  Python runs signal handlers in the main
thread only, so another thread imports while the main thread waits.  Ctrl+C still takes effect at
once, by whatever handler the application has, and the import is completed nevertheless.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from importlib import import_module
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")

_imported: set[str] = set()


def imported(name: str) -> ModuleType:
    """Return the module of this absolute *name*, imported to its end even if interrupted."""
    if name not in _imported:
        completed(lambda: import_module(name))
        _imported.add(name)
    return import_module(name)


def completed(work: Callable[[], T]) -> T:
    """Return ``work()``, which is completed even if a signal handler raises an exception."""
    if threading.current_thread() is not threading.main_thread() or _is_importing():
        return work()
    return in_thread(work).result()


def in_thread(work: Callable[[], T], *, daemon: bool = False) -> Future[T]:
    """Start ``work()`` in a new thread and return its future result."""
    result: Future[T] = Future()

    def run() -> None:
        try:
            result.set_result(work())
        except BaseException as fault:  # noqa: BLE001 - raised again by the caller's thread
            result.set_exception(fault)

    threading.Thread(target=run, name="segdeform", daemon=daemon).start()
    return result


def _is_importing() -> bool:
    """Tell whether this thread is executing a module, whose lock others would wait for forever."""
    frame = sys._getframe()
    while frame := frame.f_back:  # type: ignore[assignment]
        code = frame.f_code
        if code.co_name == "_load_unlocked" and code.co_filename.endswith("_bootstrap>"):
            return True
    return False
