"""The subspace of the cages: mesh vertices as a linear function of cage vertices, x = W~ p.

The files, in reading order:

    subspace      `Subspace`: the block matrix of figure 6 of the paper
    products      products with W~ and its transpose
    low_rank      W~ of a large mesh in two narrow factors
    passengers    points that are carried along by a deformation
    device        the map on a GPU
    gpu           the GPU library in use
"""

from .device import DeviceError, DeviceSurface
from .gpu import gpu_arrays
from .low_rank import Patches
from .passengers import Passengers, board
from .subspace import Subspace, bind

__all__ = [
    "DeviceError",
    "DeviceSurface",
    "Passengers",
    "Patches",
    "Subspace",
    "bind",
    "board",
    "gpu_arrays",
]
