"""The number of solver steps per event, announced so that a replay can use the same numbers.

The number depends on the speed of the machine, and the pose at the end of a drag depends on the
number.  Before each solve the solving widget therefore announces its number over the interactor.
A recorder writes it down, and a replay prescribes the same numbers before it sends the event.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from vtkmodules.util.vtkConstants import VTK_INT
from vtkmodules.vtkCommonCore import vtkCommand

from .view import Stop

_ANNOUNCED = vtkCommand.UserEvent + 9701  # numbers unlikely to be in use elsewhere
_PRESCRIBED = vtkCommand.UserEvent + 9702
_CLEAR = 0


def prescribe_steps(interactor: Any, steps: tuple[int, ...]) -> None:
    """Give the next solves these numbers of *steps*, one each; later solves choose their own."""
    for number in (_CLEAR, *steps):
        interactor.InvokeEvent(_PRESCRIBED, number)


def observe_steps(interactor: Any, callback: Callable[[int], None]) -> Stop:
    """Call ``callback(steps)`` at the beginning of every solve, until stopped."""
    return _observe(interactor, _ANNOUNCED, callback)


class StepBudget:
    """Chooses and announces the number of steps of each solve.

    Parameters
    ----------
    interactor : vtkRenderWindowInteractor
        Carries the announcements and the prescriptions.
    """

    def __init__(self, interactor: Any) -> None:
        self._interactor = interactor
        self._prescribed: deque[int] = deque()
        self._stops = [
            _observe(interactor, _PRESCRIBED, self._on_prescribed),
            _observe(interactor, _ANNOUNCED, self._on_announced),
        ]

    def steps(self, default: int) -> int:
        """Return the prescribed number of steps, or else *default*, and announce it."""
        steps = self._prescribed[0] if self._prescribed else default
        self._interactor.InvokeEvent(_ANNOUNCED, steps)
        return steps

    def stop(self) -> None:
        """Ignore all further prescriptions."""
        for stop in self._stops:
            stop()

    def _on_prescribed(self, steps: int) -> None:
        if steps == _CLEAR:
            self._prescribed.clear()
        else:
            self._prescribed.append(steps)

    def _on_announced(self, _: int) -> None:
        if self._prescribed:  # also for a solve of another widget: the first solve consumes it
            self._prescribed.popleft()


def _observe(interactor: Any, event: int, callback: Callable[[int], None]) -> Stop:
    def called(_: Any, __: str, number: int) -> None:
        callback(number)

    called.CallDataType = VTK_INT  # type: ignore[attr-defined]
    tag = interactor.AddObserver(event, called)
    # During a camera drag the style withholds all events except from passive observers.
    interactor.GetCommand(tag).SetPassiveObserver(True)
    return lambda: interactor.RemoveObserver(tag)
