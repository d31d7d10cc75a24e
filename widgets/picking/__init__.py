"""Picking: the point of the mesh under the pointer, and the visible vertices.

The files, in reading order:

    picking             rays from the pointer, vertices within a radius, visible vertices
    visibility          which vertices the mesh itself hides
    surface_distance    distance along the surface
"""

from .picking import Hit, Picker
from .visibility import may_overlap

__all__ = [
    "Hit",
    "Picker",
    "may_overlap",
]
