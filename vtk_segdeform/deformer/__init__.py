"""The whole method bound to one mesh.

The files, in reading order:

    deformer         `Deformer`: targets in, `Solution` out
    deform           `deform`: the whole method in one call
    binding          what is computed once for a mesh, its regions and its cages
    binding_cache    bindings kept on disk
"""

from .deform import deform
from .deformer import Deformer

__all__ = [
    "Deformer",
    "deform",
]
