"""The widget that moves and rotates handles.

The files, in reading order:

    handle_dragger    `HandleDragger`
    handle_motion     pointer position to rigid motion
    live_solve        solving between events
    handle_marks      the vertices of handles as dots
    gizmo             arrows, squares, rings and a ball
    gizmo_shapes gizmo_solids gizmo_label
                      its parts
"""

from .handle_dragger import HandleDragger

__all__ = [
    "HandleDragger",
]
