"""The widget that shows cages and lets their vertices be dragged.

The files, in reading order:

    cage_display      `CageDisplay`
    cage_drag         dragging a cage vertex
    vertex_picking    the cage vertex under the pointer
"""

from .cage_display import CageDisplay

__all__ = [
    "CageDisplay",
]
