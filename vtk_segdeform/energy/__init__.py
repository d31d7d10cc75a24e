"""The shape energy of a deformation as a function of the cage vertices: detail and stretch.

The files, in reading order:

    energy               `shape_energy`, eqs. (1), (10) and (20)
    operators            its operators on the mesh
    cubature             a weighted sample of vertices in place of all
    rotation_clusters    one local rotation for several vertices
    hessian              the exact Hessian, local rotations included
    cage_stiffness       regularisation where the mesh does not determine the cages
    grams                products with the subspace
"""

from .cage_stiffness import with_cage_stiffness
from .energy import Energy, shape_energy
from .grams import grams
from .hessian import Factor, curved_factor, factored
from .operators import surface_operators
from .rotation_clusters import join_rotations

__all__ = [
    "Energy",
    "Factor",
    "curved_factor",
    "factored",
    "grams",
    "join_rotations",
    "shape_energy",
    "surface_operators",
    "with_cage_stiffness",
]
