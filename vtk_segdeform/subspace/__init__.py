"""The subspace of the cages: mesh vertices as a linear function of cage vertices, x = W~ p.

The files, in reading order:

    interpolated  the rows of a large mesh, interpolated on a grid
    subspace      `Subspace`: the block matrix of figure 6 of the paper, and its products
    passengers    other points that a deformation moves
    gpu           the passes over a whole mesh on a GPU
"""

from .gpu import GPUError, GPUSurface, gpu_arrays
from .interpolated import InterpolatedBlock
from .passengers import Passengers, bind_passengers
from .subspace import NUMBERS_PER_FACE, Subspace, cage_subspace

__all__ = [
    "NUMBERS_PER_FACE",
    "GPUError",
    "GPUSurface",
    "InterpolatedBlock",
    "Passengers",
    "Subspace",
    "bind_passengers",
    "cage_subspace",
    "gpu_arrays",
]
