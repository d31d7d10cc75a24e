"""The inner loops in compiled form, by numba; each does what a twin in numpy does, to rounding.

    volumes         `volume.signed_volume`, `volume.volume_along_path`, `volume.volume_gradient`
    products        `subspace.Subspace`
    low_rank        `low_rank.LowRankSubspace`
    mean_value      `mean_value.mean_value_coordinates`
    normals         `normals.VertexNormals`
    rotations       `rotations.closest_rotations`
    factor          `hessian.Factor`

They let go of the interpreter and call no threads of their own; `threads.in_parallel` runs several
at a time.  Their arguments are positional, as numba wants it, and outputs come in as arrays.
"""

from .factor import solve_factored
from .low_rank import map_low_rank
from .mean_value import weights
from .normals import ring_normals, rings
from .products import add_adjoint, add_packed_adjoint, add_product, map_packed
from .rotations import rotations
from .volumes import volume_along_sums, volume_gradient, volume_sums

__all__ = [
    "add_adjoint",
    "add_packed_adjoint",
    "add_product",
    "map_low_rank",
    "map_packed",
    "ring_normals",
    "rings",
    "rotations",
    "solve_factored",
    "volume_along_sums",
    "volume_gradient",
    "volume_sums",
    "weights",
]
