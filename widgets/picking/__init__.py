"""From the pointer to the mesh.

The files, in reading order:

    picking             what is under the pointer
    visibility          which vertices are visible
    surface_distance    distance along the surface
"""

from .picking import Hit, Picker
from .visibility import touching

__all__ = [
    "Hit",
    "Picker",
    "touching",
]
