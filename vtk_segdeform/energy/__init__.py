"""The shape energy of a deformation as a function of the cage vertices: detail and stretch.

The files, in reading order:

    energy               `shape_energy`, eqs. (1), (10) and (20), and the stiffness of the cages
    operators            its operators on the mesh and in the subspace
    cubature             a weighted sample of vertices in place of all
    interior             rotations inside the body
    hessian              the exact Hessian, local rotations included, and its factor
    by_stiffness         the gradient by the stiffness of every vertex
"""

from .by_stiffness import Contraction
from .energy import (
    Energy,
    sampled_operators,
    shape_energy,
    with_cage_stiffness,
    with_rotating_rows,
)
from .hessian import Factor, full_factor, quadratic_factor, rotation_term, turning
from .interior import Interior, InteriorSamples, grown_gradients, interior_weights, with_interior
from .operators import reduced_operators, surface_operators

__all__ = [
    "Contraction",
    "Energy",
    "Factor",
    "Interior",
    "InteriorSamples",
    "full_factor",
    "grown_gradients",
    "interior_weights",
    "quadratic_factor",
    "reduced_operators",
    "rotation_term",
    "sampled_operators",
    "shape_energy",
    "surface_operators",
    "turning",
    "with_cage_stiffness",
    "with_interior",
    "with_rotating_rows",
]
