"""Sample meshes made from code.

The files, in reading order:

    shapes       `cactus`, `dinosaur` and other closed meshes
    implicit     a mesh of an implicit surface, with a given number of vertices
    remeshing    splitting, flipping and relaxing triangles
"""

from .shapes import bar, cactus, dinosaur, sphere, torus

__all__ = [
    "bar",
    "cactus",
    "dinosaur",
    "sphere",
    "torus",
]
