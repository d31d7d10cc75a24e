"""The widget that moves and rotates handles.

The files, in reading order:

    handle_dragger    `HandleDragger`
    handle_motion     from pointer positions to a rigid motion
    number_entry      a number typed during a drag
    live_solve        solving within the time of an event, refining between events
    handle_marks      the vertices of handles as dots
    locked_bodies     which bodies do not move
    gizmo             the gizmo: arrows, squares, rings and a ball
    gizmo_shapes      the lines of its parts
    gizmo_solids      its parts as solids
    gizmo_label       its labels
"""

from .gizmo import AXIS_COLOURS, Gizmo
from .gizmo_shapes import FREE, LIMB, TURN, Kind, Part
from .handle_dragger import HandleDragger
from .handle_motion import Grip, Motion, axes_along, next_constraint, step_of
from .live_solve import STEPS, LiveSolve
from .locked_bodies import locked_components
from .number_entry import NumberEntry

__all__ = [
    "AXIS_COLOURS",
    "FREE",
    "LIMB",
    "STEPS",
    "TURN",
    "Gizmo",
    "Grip",
    "HandleDragger",
    "Kind",
    "LiveSolve",
    "Motion",
    "NumberEntry",
    "Part",
    "axes_along",
    "locked_components",
    "next_constraint",
    "step_of",
]
