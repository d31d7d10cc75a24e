"""The subspace of the cages: mesh vertices as a linear function of cage vertices, x = W~ p.

The files, in reading order:

    interpolated  the rows of a large mesh, interpolated on a grid
    subspace      `Subspace`: the block matrix of figure 6 of the paper, and its products
    affine_parts  parts that move affinely
    passengers    other points that a deformation moves
    gpu           the passes over a whole mesh on a GPU
"""

from .affine_parts import AffineParts
from .gpu import GPUError, GPUSurface, gpu_arrays
from .interpolated import InterpolatedBlock
from .passengers import Passengers, bind_passengers, blend_at
from .subspace import NUMBERS_PER_FACE, Subspace, cage_subspace, row_pieces

__all__ = [
    "NUMBERS_PER_FACE",
    "AffineParts",
    "GPUError",
    "GPUSurface",
    "InterpolatedBlock",
    "Passengers",
    "Subspace",
    "bind_passengers",
    "blend_at",
    "cage_subspace",
    "gpu_arrays",
    "row_pieces",
]
