"""Inner loops compiled by numba; each agrees with its equivalent in numpy up to rounding.

    volumes         `volume.signed_volume`, `volume.volume_along_path`, `volume.volume_gradient`
    products        `subspace.Subspace`
    interpolated    `interpolated.InterpolatedBlock`
    mean_value      `mean_value.mean_value_coordinates`
    normals         `normals.VertexNormals`
    rotations       `rotations.closest_rotations`, `cell_energy.CellEnergy`
    cells           `cell_energy.CellEnergy`
    factor          `hessian.Factor`, `finish.factor.factored`
    collapses       `simplify.simplify`
    half_edges      `topology.HalfEdges`, `grouping.connected`,
                    `grouping.first_members`, `Mesh.adjacency`
    pairs           `contact.Contact`
    crossings       `near_faces.near_faces`
    beams           `line_of_sight.faces_in_beam`
    shells          `shells.shell_volumes`, `shells.shell_depths`
    triangles       `faults.Search`, `grouping.first_equal_row`, `Mesh.face_areas`,
                    `polygons.cut_into_triangles`
    text            `number_lines.numbers_of`, `number_lines.Lines`, `stl.read_stl`,
                    `ply_tables.tables_of`

They release the GIL and start no threads; `threads.in_parallel` runs several at a time.  Arguments
are positional, as numba requires, and outputs are arrays passed as arguments.
"""

from .beams import faces_in_beam
from .cells import cell_forces, cell_sums, spread_cells
from .collapses import collapse_costs, independent_edges, sorted_edges, valid_collapses
from .crossings import grow_tree, may_meet, touching_boxes
from .factor import solve_factored, solve_sparse
from .half_edges import (
    border_half_edges,
    edge_lengths,
    edge_rows,
    face_sides,
    first_members,
    link,
    link_corners,
    number_trees,
    one_fan_each,
    pair_half_edges,
    same_across,
    used_vertices,
)
from .interpolated import add_interpolated, add_interpolated_adjoint, interpolated_rows
from .mean_value import weights
from .normals import ring_normals, rings
from .pairs import facing_pairs, opposite_pairs
from .products import add_adjoint, add_product
from .rotations import rotations
from .shells import shell_boxes, shell_extremes, shell_sums, shells_around
from .text import (
    corners_of_lines,
    facet_corners,
    numbers_of_lines,
    plain_numbers,
    rows_of_lists,
)
from .triangles import (
    convex_cuts,
    face_areas,
    first_equal_points,
    flat_faces,
    quad_cuts,
    quad_halves,
    wrongly_cut,
)
from .volumes import (
    determinants,
    volume_along_sums,
    volume_gradient,
    volume_sums,
)

__all__ = [
    "add_adjoint",
    "add_interpolated",
    "add_interpolated_adjoint",
    "add_product",
    "border_half_edges",
    "cell_forces",
    "cell_sums",
    "collapse_costs",
    "convex_cuts",
    "corners_of_lines",
    "determinants",
    "edge_lengths",
    "edge_rows",
    "face_areas",
    "face_sides",
    "faces_in_beam",
    "facet_corners",
    "facing_pairs",
    "first_equal_points",
    "first_members",
    "flat_faces",
    "grow_tree",
    "independent_edges",
    "interpolated_rows",
    "link",
    "link_corners",
    "may_meet",
    "number_trees",
    "numbers_of_lines",
    "one_fan_each",
    "opposite_pairs",
    "pair_half_edges",
    "plain_numbers",
    "quad_cuts",
    "quad_halves",
    "ring_normals",
    "rings",
    "rotations",
    "rows_of_lists",
    "same_across",
    "shell_boxes",
    "shell_extremes",
    "shell_sums",
    "shells_around",
    "solve_factored",
    "solve_sparse",
    "sorted_edges",
    "spread_cells",
    "touching_boxes",
    "used_vertices",
    "valid_collapses",
    "volume_along_sums",
    "volume_gradient",
    "volume_sums",
    "weights",
    "wrongly_cut",
]
