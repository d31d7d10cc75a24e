"""A coarse cage around every region, and coordinates of the mesh with respect to it.

The files, in reading order:

    cage            `Cage`: a closed surface, checked
    fit             `fit_cages`: automatic cages
    region_solid    a region as a solid, by its distance field
    contour         level set of a field on a grid
    simplify        edge collapses
    mean_value      mean value coordinates, eqs. (15) to (19)
"""

from .cage import MOST_CAGE_VERTICES, Cage, cage_faults, winding_number
from .fit import fit_cages
from .mean_value import mean_value_coordinates

__all__ = [
    "MOST_CAGE_VERTICES",
    "Cage",
    "cage_faults",
    "fit_cages",
    "mean_value_coordinates",
    "winding_number",
]
