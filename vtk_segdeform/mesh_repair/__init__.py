"""Repair of faulty meshes, one step at a time, each reported.

The files, in reading order:

    repair          `repair`: triangles in, a closed mesh and a list of the steps taken out
    repair_steps    the steps
    splitting       separating surfaces that touch in a vertex or along an edge
    holes           closing holes with lids
    hole_borders    border loops of holes
    lids            triangulation of a loop, by dynamic programming or ear clipping
    lid_refining    interior vertices of lids
    cracks          replacing flat lids by splitting the adjacent face
"""

from .lids import triangulate_long_loop
from .repair import Repair, repair

__all__ = [
    "Repair",
    "repair",
    "triangulate_long_loop",
]
