"""Cages around the regions, and coordinates of the mesh with respect to them.

The files, in reading order:

    cage            `Cage`: a closed surface, checked and immutable
    fit             `fit_cages`: automatic cages
    region_solid    the distance field of a region as a solid
    contour         level set of a field on a grid
    simplify        simplification by edge collapses
    scaling         `scaled_cages`: those of the paper, for comparison
    mean_value      mean value coordinates, eqs. (15) to (19)
"""

from .cage import MOST_CAGE_VERTICES, Cage, cage_faults, require_enclosed
from .fit import fit_cages, require_cage_vertices, suggested_size
from .mean_value import FARTHEST_POINT, mean_value_coordinates
from .scaling import scaled_cages

__all__ = [
    "FARTHEST_POINT",
    "MOST_CAGE_VERTICES",
    "Cage",
    "cage_faults",
    "fit_cages",
    "mean_value_coordinates",
    "require_cage_vertices",
    "require_enclosed",
    "scaled_cages",
    "suggested_size",
]
