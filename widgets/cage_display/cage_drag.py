"""A vertex of a cage follows the pointer in the plane of the view, and the mesh follows it."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.session import Session

from ..scene import Gesture, Phase, Pointer, Sight

Grip = tuple[int, int]
"""A region, and a vertex of its cage."""


def drag_vertex(sight: Sight, session: Session, grip: Grip, press: Pointer) -> Gesture:
    """Move a vertex of a cage until release, which makes one undo step of it.

    Parameters
    ----------
    sight : Sight
        How it is seen; its plane may turn on the way.
    session : Session
        Whose cage.  Where the gesture is cancelled or a move fails, it is as before the press.
    grip : (region, vertex)
        What is held.
    press : Pointer
        Where; the vertex keeps its distance from the pointer.
    """
    session.commit()  # what somebody else has left in hand is not ours to take back
    region, vertex = grip
    start = session.cage_vertices[region]
    held = start[vertex : vertex + 1]
    aside = sight.to_display(held)[0, :2] - press.position
    kept = False
    try:
        while (pointer := (yield)).phase is Phase.MOVE:
            depth = sight.to_display(held)[0, 2]
            moved = start.copy()
            moved[vertex] = sight.to_world(np.array([[*(pointer.position + aside), depth]]))[0]
            session.move_cage(region, moved)
        if pointer.phase is Phase.RELEASE:
            session.commit()
            kept = True
    finally:
        if not kept:
            session.revert()
