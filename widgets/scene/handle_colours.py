"""The colours of handles: each keeps its own until it is removed, also when it is renamed.

A new handle gets the first colour of the palette that no other handle has.  A session loaded from a
file gives them in the order of its handles.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import IntArray
from vtk_segdeform.pictures import of_handle
from vtk_segdeform.session import Session


class _Known:
    """The vertices and the number of present and removed handles, by name."""

    def __init__(self) -> None:
        self.vertices: dict[str, IntArray] = {}
        self.numbers: dict[str, int] = {}
        self.present: set[str] = set()


_known: WeakKeyDictionary[Session, _Known] = WeakKeyDictionary()


def handle_colour(session: Session, name: str | None) -> NDArray[np.uint8]:
    """Return the colour (3,) of handle *name*; of the next new one if there is no such handle."""
    known, handles = _known.setdefault(session, _Known()), session.handles
    used = {known.numbers[each] for each in known.present & handles.keys()}
    for each in [each for each in handles if each not in known.present]:  # new or back
        renamed = (
            old for old in known.present - handles.keys() if known.vertices[old] is handles[each]
        )
        number = known.numbers.get(next(renamed, each), -1)
        known.numbers[each] = _free(used) if number < 0 or number in used else number
        used.add(known.numbers[each])
    known.vertices.update(handles)
    known.present = set(handles)
    return of_handle(known.numbers[name] if name in known.present else _free(used))


def _free(used: set[int]) -> int:
    return next(number for number in range(len(used) + 1) if number not in used)
