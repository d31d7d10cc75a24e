"""The finish of a pose on the mesh itself: every vertex is an unknown, near the pose of the cages.

The files, in reading order:

    cell_energy    the stretch energy over all vertices, and the rotations that it is fitted to
    untangling     separates parts of the start that cross
    factor         the factored matrix of the free vertices
    finisher       the iteration: fixed vertices, handles and volumes exact
"""

from .cell_energy import CellEnergy
from .finisher import Finish, Finisher

__all__ = ["CellEnergy", "Finish", "Finisher"]
