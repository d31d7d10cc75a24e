"""The widget that shows cages and moves their vertices.

The files, in reading order:

    cage_display     `CageDisplay`
    cage_drag        dragging a cage vertex
    reach            which vertex is under the pointer
    rejected_cage    display of a cage that was refused
"""

from .cage_display import CageDisplay

__all__ = [
    "CageDisplay",
]
