"""The finish of a pose on the mesh itself: every vertex is an unknown, and the cages are its start.

The files, in reading order:

    cell_energy    the stretch energy over all vertices, and the rotations that it is fitted to
    volume_band    how far the body may be compressed and expanded
    folds          triangles that a pose turned over
    gradients      of the triangles of a patch, and the pose that has given ones
    unfolding      opens folds where they are
    creases        smooths creases in which a pose crosses itself
    untangling     separates parts that cross
    factor         the factored Laplacian of the free vertices
    finisher       the iteration: fixed vertices, handles and volumes exact
"""

from .cell_energy import CellEnergy
from .finisher import Finish, Finisher, Unbalanced
from .folds import Folds

__all__ = ["CellEnergy", "Finish", "Finisher", "Folds", "Unbalanced"]
