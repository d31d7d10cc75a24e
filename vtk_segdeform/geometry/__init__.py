"""Geometry of a triangle surface: quantities that a deformation preserves or reports.

The files, in reading order:

    volume          enclosed volume, eqs. (8) and (9)
    chambers        the parts of space that a surface with inner walls encloses
    lids            lids over the borders of an open mesh, for its volume
    differential    mean-curvature normals, eq. (5)
    intrinsic       intrinsic triangulation: the surface without bad triangles
    rotations       local rotations
    ties            decisions between equals, and principal axes
    kmeans          clusters of points, and points far from each other
    sampling        even samples of the vertices, and their Voronoi cells
    decimation      a mesh with one vertex for each cluster of neighbours
    following       components that follow others
    attached        lines between components that move together
    normals         vertex normals for drawing
    normal_transport   given normals and tangents, carried along by a deformation
    distortion      stretch and shear of each triangle
    turned_over     folds: triangles that a pose turned over
    local_volume    volume change below the surface at each vertex
    motion          motions of handles as texts such as ``z,60``
    up_axis         a guess of the axis that points up
"""

from .attached import component_shares, joints, nearest_pairs
from .chambers import Chambers, chambers_of
from .decimation import decimated
from .differential import (
    area_gradients,
    cotangent_laplacian,
    inner_vertices,
    mixed_voronoi_areas,
    with_least_areas,
)
from .distortion import distortion, triangle_distortion
from .following import (
    FREE,
    SMALL_COMPONENT,
    Attach,
    Carrying,
    carriers,
    checked_attach,
    towards,
)
from .intrinsic import IntrinsicTriangulation
from .kmeans import cluster_positions, cluster_within_parts
from .lids import Lids, lids_of, volume_summary
from .local_volume import LocalVolume, inner_balls, local_volume_change
from .motion import (
    moved_handles,
    parse_rotation,
    parse_vector,
    read_matrix,
    rotation,
    total_legs,
    transform,
)
from .normal_transport import NormalTransport
from .normals import VertexNormals
from .rotations import closest_rotations, rigid_fit
from .sampling import distinct_lengths, faces_between, nearest_source, unique_edges, voronoi_cells
from .ties import principal_axes, tie_breakers
from .turned_over import turned_over
from .up_axis import guess_up_axis
from .volume import (
    Parts,
    area,
    area_gradient,
    area_slopes_along,
    corner_and_edges,
    outer_components,
    signed_volume,
    signed_volumes,
    slopes_of,
    step_to_volume,
    volume_along,
    volume_along_path,
    volume_gradient,
    volume_gradients,
    volume_slopes_along,
)

__all__ = [
    "FREE",
    "SMALL_COMPONENT",
    "Attach",
    "Carrying",
    "Chambers",
    "IntrinsicTriangulation",
    "Lids",
    "LocalVolume",
    "NormalTransport",
    "Parts",
    "VertexNormals",
    "area",
    "area_gradient",
    "area_gradients",
    "area_slopes_along",
    "carriers",
    "chambers_of",
    "checked_attach",
    "closest_rotations",
    "cluster_positions",
    "cluster_within_parts",
    "component_shares",
    "corner_and_edges",
    "cotangent_laplacian",
    "decimated",
    "distinct_lengths",
    "distortion",
    "faces_between",
    "guess_up_axis",
    "inner_balls",
    "inner_vertices",
    "joints",
    "lids_of",
    "local_volume_change",
    "mixed_voronoi_areas",
    "moved_handles",
    "nearest_pairs",
    "nearest_source",
    "outer_components",
    "parse_rotation",
    "parse_vector",
    "principal_axes",
    "read_matrix",
    "rigid_fit",
    "rotation",
    "signed_volume",
    "signed_volumes",
    "slopes_of",
    "step_to_volume",
    "tie_breakers",
    "total_legs",
    "towards",
    "transform",
    "triangle_distortion",
    "turned_over",
    "unique_edges",
    "volume_along",
    "volume_along_path",
    "volume_gradient",
    "volume_gradients",
    "volume_slopes_along",
    "volume_summary",
    "voronoi_cells",
    "with_least_areas",
]
