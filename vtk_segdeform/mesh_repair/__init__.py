"""Repair of faulty meshes, one step at a time, each reported.

The files, in reading order:

    repair          `repair`: triangles in, a `Mesh` and a list of what was done out
    repair_steps    the steps
    holes           closing holes
    hole_borders    border loops
    lids            triangulation of a loop by dynamic programming
    ears            triangulation of a loop by ear clipping
    lid_refining    interior vertices for lids
    cracks          flat lids replaced by splitting the adjacent face
    splitting       surfaces that touch in a vertex or an edge, separated
"""

from .repair import Repair, repair

__all__ = [
    "Repair",
    "repair",
]
