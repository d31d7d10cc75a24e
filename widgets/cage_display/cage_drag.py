"""The gesture that drags a cage vertex in the view plane; the mesh follows."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.session import Session

from ..scene import Gesture, Phase, Pointer, Projection

CageVertex = tuple[int, int]
"""A region, and a vertex of its cage."""


def drag_vertex(
    projection: Projection, session: Session, cage_vertex: CageVertex, press: Pointer
) -> Gesture:
    """Move a cage vertex until the release, which records one undo step.

    Parameters
    ----------
    projection : Projection
        The camera may move during the drag.
    session : Session
        The session to edit.  If the gesture is cancelled or a move fails, its state is as before
        the press.
    cage_vertex : (region, vertex)
        The vertex to drag.
    press : Pointer
        The vertex keeps its offset from the pointer.
    """
    session.commit()  # keeps an unfinished drag from elsewhere out of our undo step
    region, vertex = cage_vertex
    start = session.cage_vertices[region]
    position = start[vertex : vertex + 1]
    offset = projection.to_display(position)[0, :2] - press.position
    committed = False
    try:
        while (pointer := (yield)).phase is Phase.MOVE:
            depth = projection.to_display(position)[0, 2]
            target = np.array([[*(pointer.position + offset), depth]])
            moved = start.copy()
            moved[vertex] = projection.to_world(target)[0]
            session.move_cage(region, moved)
        if pointer.phase is Phase.RELEASE:
            session.commit()
            committed = True
    finally:
        if not committed:
            session.revert()
