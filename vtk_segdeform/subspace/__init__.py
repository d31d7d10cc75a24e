"""The subspace of the cages: mesh vertices as a linear function of cage vertices, x = W~ p.

The files, in reading order:

    subspace      `Subspace`: the block matrix of figure 6 of the paper, and its products
    low_rank      W~ of a large mesh in two narrow factors
    passengers    other points that a deformation moves
    gpu           the passes over a whole mesh on a GPU; untested there
"""

from .gpu import GPUError, GPUSurface, gpu_arrays
from .low_rank import LowRankSubspace
from .passengers import Passengers, bind_passengers
from .subspace import Subspace, cage_subspace

__all__ = [
    "GPUError",
    "GPUSurface",
    "LowRankSubspace",
    "Passengers",
    "Subspace",
    "bind_passengers",
    "cage_subspace",
    "gpu_arrays",
]
