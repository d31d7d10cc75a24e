"""The mesh: oriented triangle surfaces, closed or with borders, and the search for their faults.

The files, in reading order:

    mesh             `Mesh`, checked and immutable
    faults           search for the faults of a mesh
    report           kinds of faults, counted and described
    topology         half-edges, fans and shells
    edges            numbers, lists and components of edges
    loops            boundaries as loops of vertices
    orientation      which faces of any triangles to flip
    soup             a mesh from any triangles, and the map between both
    welding          points at the same position on borders become one vertex
    shells           orientation of closed shells
    surface_point    a point of a face, which moves with it
    inside           winding numbers, points inside a surface, distance to it
    near_faces       pairs of triangles that may do so: a tree of boxes
    intersections    pairs of triangles that cross or touch
    triangles        angles and normals of triangles
    selection        points selected by a text such as ``z>80%``
    grouping         connected components, equal rows and ragged ranges in linear time
"""

from .edges import components, edge_keys, face_edges, next_half_edge, repeats_vertex
from .faults import UNREPAIRABLE, as_soup, connectivity_faults, find_faults
from .grouping import (
    connected,
    first_equal_row,
    first_of_group,
    ragged_arange,
    row_hashes,
    two_sides,
)
from .inside import distance_to_surface, inside_nodes, inside_points, winding_number
from .intersections import (
    Crossings,
    intersections_of,
    new_crossings,
    self_intersections,
)
from .mesh import Mesh, conversion_of, require_mesh
from .report import Kind, MeshReport, counted
from .selection import Role, parse_selection
from .shells import misoriented_shells
from .soup import Soup, Workaround, mesh_of
from .surface_point import SurfacePoint, nearest_on_triangles
from .topology import HalfEdges
from .triangles import corner_angles, cross_rows, flat_faces, least_angle, normals

__all__ = [
    "UNREPAIRABLE",
    "Crossings",
    "HalfEdges",
    "Kind",
    "Mesh",
    "MeshReport",
    "Role",
    "Soup",
    "SurfacePoint",
    "Workaround",
    "as_soup",
    "components",
    "connected",
    "connectivity_faults",
    "conversion_of",
    "corner_angles",
    "counted",
    "cross_rows",
    "distance_to_surface",
    "edge_keys",
    "face_edges",
    "find_faults",
    "first_equal_row",
    "first_of_group",
    "flat_faces",
    "inside_nodes",
    "inside_points",
    "intersections_of",
    "least_angle",
    "mesh_of",
    "misoriented_shells",
    "nearest_on_triangles",
    "new_crossings",
    "next_half_edge",
    "normals",
    "parse_selection",
    "ragged_arange",
    "repeats_vertex",
    "require_mesh",
    "row_hashes",
    "self_intersections",
    "two_sides",
    "winding_number",
]
