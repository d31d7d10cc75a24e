"""How many steps of the solver each event is given, told aloud so that a replay gives as many.

That number depends on how fast the machine is, and with it the pose in which a drag ends.  So
whoever solves says, over the interactor, how many steps it is about to allow; a recorder writes
that down, and a replay orders the same numbers before it sends the event again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from vtkmodules.util.vtkConstants import VTK_INT
from vtkmodules.vtkCommonCore import vtkCommand

from .view import Stop

_ALLOWED = vtkCommand.UserEvent + 9701  # numbers that nobody else is likely to use
_ORDERED = vtkCommand.UserEvent + 9702
_FORGET = 0


def order_steps(interactor: Any, steps: tuple[int, ...]) -> None:
    """Have the next solves be given so many *steps*, one number each; then their own again."""
    for number in (_FORGET, *steps):
        interactor.InvokeEvent(_ORDERED, number)


def on_steps(interactor: Any, called: Callable[[int], None]) -> Stop:
    """Call ``called(steps)`` at the beginning of every solve, until stopped."""
    return _listen(interactor, _ALLOWED, called)


class Pace:
    """Says how many steps a solve is given.

    Parameters
    ----------
    interactor : vtkRenderWindowInteractor
        Over which it is told and ordered.
    """

    def __init__(self, interactor: Any) -> None:
        self._interactor = interactor
        self._orders: deque[int] = deque()
        self._stops = [
            _listen(interactor, _ORDERED, self._ordered),
            _listen(interactor, _ALLOWED, self._spent),
        ]

    def steps(self, own: int) -> int:
        """Return what is ordered, or else *own*; and tell it."""
        steps = self._orders[0] if self._orders else own
        self._interactor.InvokeEvent(_ALLOWED, steps)
        return steps

    def stop(self) -> None:
        """Take no more orders."""
        for stop in self._stops:
            stop()

    def _ordered(self, steps: int) -> None:
        if steps == _FORGET:
            self._orders.clear()
        else:
            self._orders.append(steps)

    def _spent(self, _: int) -> None:
        if self._orders:  # also when another one solves: an order is for whoever comes first
            self._orders.popleft()


def _listen(interactor: Any, event: int, called: Callable[[int], None]) -> Stop:
    def heard(_: Any, __: str, number: int) -> None:
        called(number)

    heard.CallDataType = VTK_INT  # type: ignore[attr-defined]
    tag = interactor.AddObserver(event, heard)
    # A camera style that drags keeps all events from others, but not from passive ones.
    interactor.GetCommand(tag).SetPassiveObserver(True)
    return lambda: interactor.RemoveObserver(tag)
