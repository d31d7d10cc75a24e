"""The mesh: closed, oriented triangle surfaces, and what can be wrong with them.

The files, in reading order:

    mesh             `Mesh`, checked and immutable
    faults           search for everything that keeps triangles from being a closed surface
    report           the faults found, counted and in words
    topology         edges, fans, shells and borders
    manifold         faults of connectivity
    intersections    pairs of triangles that cross or touch
    shells           orientation of closed shells
    inside           winding number and distance to a surface
    columns          inside or outside for many points at once
    quality          angles of triangles
    counting         sorting and grouping in linear time
"""

from .columns import count_up, inside_nodes, inside_points
from .faults import HOPELESS, as_soup, find_faults
from .inside import distance_to_surface, winding_number
from .intersections import flat_faces, intersections_of, self_intersections
from .manifold import components, connectivity_faults, counted, face_edges
from .mesh import Mesh, require_mesh
from .quality import corner_angles, least_angle, normals
from .report import MeshReport
from .shells import wrong_way_round
from .topology import (
    Sides,
    connected,
    edge_keys,
    first_equal_row,
    first_of_group,
    following,
    repeats_vertex,
)

__all__ = [
    "HOPELESS",
    "Mesh",
    "MeshReport",
    "Sides",
    "as_soup",
    "components",
    "connected",
    "connectivity_faults",
    "corner_angles",
    "count_up",
    "counted",
    "distance_to_surface",
    "edge_keys",
    "face_edges",
    "find_faults",
    "first_equal_row",
    "first_of_group",
    "flat_faces",
    "following",
    "inside_nodes",
    "inside_points",
    "intersections_of",
    "least_angle",
    "normals",
    "repeats_vertex",
    "require_mesh",
    "self_intersections",
    "winding_number",
    "wrong_way_round",
]
