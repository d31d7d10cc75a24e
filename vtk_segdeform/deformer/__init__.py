"""The whole method bound to one mesh.

The files, in reading order:

    deformer         `Deformer`: targets in, `Solution` out
    frame            the coordinates in which a mesh is deformed
    arguments        checks of its arguments
    binding          all that is computed once for a mesh, its regions and its cages
    binding_cache    bindings kept on disk
    deform           `deform`: the whole method in one call
"""

from .arguments import FARTHEST_APART, checked_constraints, checked_targets
from .deform import deform
from .deformer import Deformer

__all__ = [
    "FARTHEST_APART",
    "Deformer",
    "checked_constraints",
    "checked_targets",
    "deform",
]
