"""Inner loops compiled by numba; each agrees with its equivalent in numpy up to rounding.

    volumes         `volume.signed_volumes`, `volume.volume_along_path`, `volume.volume_gradient`,
                    `volume.volume_slopes_along`, `exact_volume.moved_along`, `other_measures`
    products        `subspace.Subspace`
    interpolated    `interpolated.InterpolatedBlock`
    mean_value      `mean_value.mean_value_coordinates`
    normals         `normals.VertexNormals`
    rotations       `rotations.closest_rotations`, `cell_energy.CellEnergy`
    cells           `cell_energy.CellEnergy`
    corners         `untangling.inner_points`
    factor          `hessian.Factor`, `finish.factor.factored`
    collapses       `simplify.simplify`
    half_edges      `topology.HalfEdges`, `grouping.connected`, `grouping.first_equal_row`
    pairs           `contact.Contact`
    crossings       `near_faces.near_faces`
    triangles       `surface_point.nearest_on_triangles`
    shells          `shells.shell_volumes`, `shells.shell_depths`

They release the GIL and start no threads; `threads.in_parallel` runs several at a time.  Arguments
are positional, as numba requires, and outputs are arrays passed as arguments.
"""

from .cells import cell_forces, cell_sums, spread_cells
from .collapses import collapse_costs, independent_edges, sorted_edges, valid_collapses
from .corners import add_corner_forces, add_corner_products, corner_terms
from .crossings import grow_tree, may_meet, touching_boxes
from .factor import add_upper, solve_factored, solve_sparse
from .half_edges import (
    border_half_edges,
    first_equal_points,
    link,
    number_trees,
    one_fan_each,
    pair_half_edges,
)
from .interpolated import add_interpolated, add_interpolated_adjoint, interpolated_rows
from .mean_value import weights
from .normals import ring_normals, rings
from .pairs import facing_pairs, opposite_pairs
from .products import add_adjoint, add_product
from .rotations import rotations
from .shells import shell_extremes, shell_sums, shells_around
from .triangles import nearest_on_triangles
from .volumes import (
    area_gradient,
    area_slopes,
    determinants,
    moment_gradient,
    moment_slopes,
    move_along,
    volume_along_sums,
    volume_gradient,
    volume_slopes,
    volume_sums,
)

__all__ = [
    "add_adjoint",
    "add_corner_forces",
    "add_corner_products",
    "add_interpolated",
    "add_interpolated_adjoint",
    "add_product",
    "add_upper",
    "area_gradient",
    "area_slopes",
    "border_half_edges",
    "cell_forces",
    "cell_sums",
    "collapse_costs",
    "corner_terms",
    "determinants",
    "facing_pairs",
    "first_equal_points",
    "grow_tree",
    "independent_edges",
    "interpolated_rows",
    "link",
    "may_meet",
    "moment_gradient",
    "moment_slopes",
    "move_along",
    "nearest_on_triangles",
    "number_trees",
    "one_fan_each",
    "opposite_pairs",
    "pair_half_edges",
    "ring_normals",
    "rings",
    "rotations",
    "shell_extremes",
    "shell_sums",
    "shells_around",
    "solve_factored",
    "solve_sparse",
    "sorted_edges",
    "spread_cells",
    "touching_boxes",
    "valid_collapses",
    "volume_along_sums",
    "volume_gradient",
    "volume_slopes",
    "volume_sums",
    "weights",
]
