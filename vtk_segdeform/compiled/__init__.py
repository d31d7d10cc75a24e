"""The inner loops in compiled form, by numba; each does what a twin in numpy does, to rounding.

    volumes         `volume.signed_volume`, `volume.volume_along_path`, `volume.volume_gradient`
    products        `blocks.add_product`, `blocks.adjoint_product`, `blocks.Groups`
    patch_products  `patches.Patches`
    coordinates     `mean_value.mean_value_coordinates`
    normals         `normals.VertexNormals`
    rotations       `rotations.closest_rotations`
    triangles       `curvature.Factor`

They let go of the interpreter and call no threads of their own; `threads.in_parallel` runs several
at a time.  Their arguments are positional, as numba wants it, and outputs come in as arrays.
"""

from .coordinates import weights
from .normals import ring_normals, rings
from .patch_products import put_patches
from .products import add_adjoint, add_groups_adjoint, add_product, put_groups
from .rotations import rotations
from .triangles import solve_factored
from .volumes import volume_along_sums, volume_gradient, volume_sums

__all__ = [
    "add_adjoint",
    "add_groups_adjoint",
    "add_product",
    "put_groups",
    "put_patches",
    "ring_normals",
    "rings",
    "rotations",
    "solve_factored",
    "volume_along_sums",
    "volume_gradient",
    "volume_sums",
    "weights",
]
