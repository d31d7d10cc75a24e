"""Picking: the point of the mesh under the pointer, and the visible vertices.

The files, in reading order:

    picking             rays from the pointer, vertices within a radius, visible vertices
    line_of_sight       where a line meets the surface
    visibility          which vertices the mesh itself hides
    surface_distance    distance along the surface
    surface_ring        the ring around a point
"""

from .picking import Hit, Picker, is_seen

__all__ = [
    "Hit",
    "Picker",
    "is_seen",
]
