"""The widget that moves and rotates handles.

The files, in reading order:

    handle_dragger    `HandleDragger`
    handle_motion     from pointer positions to a rigid motion
    live_solve        solving within the time of an event, refining between events
    handle_marks      the vertices of handles as dots
    gizmo             the gizmo: arrows, squares, rings and a ball
    gizmo_shapes      the lines of its parts
    gizmo_solids      its parts as solids
    gizmo_label       its labels
"""

from .gizmo_shapes import FREE, Part
from .handle_dragger import HandleDragger
from .handle_motion import Grip, Motion, next_constraint
from .live_solve import LiveSolve

__all__ = [
    "FREE",
    "Grip",
    "HandleDragger",
    "LiveSolve",
    "Motion",
    "Part",
    "next_constraint",
]
