"""Finishes of a pose, announced so that a replay can finish the same pose at the same moment.

When an editor finishes a pose in the background depends on the speed of the machine.  It therefore
announces each finish over the interactor; a recorder writes it down, and a replay requests it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vtkmodules.vtkCommonCore import vtkCommand

from ..scene import Stop, View

_FINISHED = vtkCommand.UserEvent + 9707  # numbers unlikely to be in use elsewhere
_REQUESTED = vtkCommand.UserEvent + 9708


def announce_finish(interactor: Any) -> None:
    """Announce that the pose was finished."""
    interactor.InvokeEvent(_FINISHED)


def request_finish(interactor: Any) -> None:
    """Request that the pose is finished at once."""
    interactor.InvokeEvent(_REQUESTED)


def on_finish(view: View, callback: Callable[[], None]) -> Stop:
    """Call *callback* at each announcement, until stopped."""
    return _observe(view, _FINISHED, callback)


def on_finish_request(view: View, callback: Callable[[], None]) -> Stop:
    """Call *callback* at each request, until stopped."""
    return _observe(view, _REQUESTED, callback)


def _observe(view: View, event: int, callback: Callable[[], None]) -> Stop:
    def called(*_: object) -> None:
        with view.guarded():
            callback()

    interactor = view.interactor
    tag = interactor.AddObserver(event, called)
    # During a camera drag the style withholds all events except from passive observers.
    interactor.GetCommand(tag).SetPassiveObserver(True)
    return lambda: interactor.RemoveObserver(tag)
