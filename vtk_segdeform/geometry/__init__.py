"""Geometry of a triangle surface: the quantities a deformation preserves or reports.

The files, in reading order:

    volume          enclosed volume, eqs. (8) and (9)
    differential    mean-curvature normals, eq. (5)
    intrinsic       intrinsic triangulation: the same surface without bad triangles
    rotations       local rotations
    kmeans          clusters of points, and points far from each other
    thinning        subsets of vertices at even distances
    normals         vertex normals for drawing
    distortion      stretch and shear, a number per triangle
    local_volume    volume change below the surface, a number per vertex
"""

from .differential import area_gradients, cotangent_laplacian, mixed_voronoi_areas, with_least_areas
from .distortion import distortion, triangle_distortion
from .intrinsic import IntrinsicTriangulation
from .kmeans import cluster_positions, cluster_within_parts, farthest_points
from .local_volume import LocalVolume, local_volume_change
from .normals import VertexNormals
from .rotations import closest_rotations, rigid_fit
from .thinning import cells, distinct_lengths, faces_between, nearest_of, unique_edges
from .volume import signed_volume, step_to_volume, volume_along, volume_along_path, volume_gradient

__all__ = [
    "IntrinsicTriangulation",
    "LocalVolume",
    "VertexNormals",
    "area_gradients",
    "cells",
    "closest_rotations",
    "cluster_positions",
    "cluster_within_parts",
    "cotangent_laplacian",
    "distinct_lengths",
    "distortion",
    "faces_between",
    "farthest_points",
    "local_volume_change",
    "mixed_voronoi_areas",
    "nearest_of",
    "rigid_fit",
    "signed_volume",
    "step_to_volume",
    "triangle_distortion",
    "unique_edges",
    "volume_along",
    "volume_along_path",
    "volume_gradient",
    "with_least_areas",
]
