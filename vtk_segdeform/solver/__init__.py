"""Gauss-Newton on the cage vertices, with volume constraints by Lagrange multipliers.

The files, in reading order:

    newton                  the iteration of both levels, eqs. (11) to (14) and (21)
    gauss_newton            its objective over the cages: E, d, G and H
    volume_constraints      volume of the mesh or of each region, eqs. (8) and (9)
    volumes                 constraints together, and as functions of the cages
    other_measures          areas and centroids
    bodies                  the volume of each body
    position_constraints    fixed vertices and handles, eqs. (6) and (7)
    terms                   further terms of the objective
    anderson                Anderson acceleration
    extrapolation           where a solve starts in a drag
    exact_volume            motion of a pose onto its exact volumes
    coarse_volume           volume of a large mesh from a coarse surface
    sliding                 vertices that stay on a plane, a line or a surface
    mirror_term             symmetry of the cages
    contact                 parts of the surface that push each other apart
    waypoints               intermediate targets for large motions
    solution                `Solution` and `Status`
    stationary              a minimum, to first order in its targets and volumes
"""

from .anderson import Anderson
from .bodies import Bodies
from .coarse_volume import CoarseVolume
from .contact import Contact, ContactSurface
from .exact_volume import (
    ScaledSurface,
    are_met,
    moved_along,
    scale_to_volume,
    steps_to_volume,
)
from .gauss_newton import GaussNewton, SolverOptions, SolverResult
from .mirror_term import MirrorTerm
from .newton import Step, constrained_step, minimise
from .other_measures import CentroidConstraint, area_of, centroid_of
from .position_constraints import (
    Anchors,
    PositionTerm,
    connected_sets,
    errors_at,
    position_term,
)
from .sliding import Sliding, Track
from .solution import CONVERGED, HeldVolumes, Solution, Status
from .stationary import Curvature, StationaryPoint, half_gradient, off_volumes, rows_of
from .terms import Term
from .volume_constraints import (
    VolumeConstraint,
    region_volumes,
    total_volume,
    volumes_by_label,
    with_same_points,
)
from .volumes import Together, Volumes, gradients, violations
from .waypoints import LONGEST_MOVE, waypoints

__all__ = [
    "CONVERGED",
    "LONGEST_MOVE",
    "Anchors",
    "Anderson",
    "Bodies",
    "CentroidConstraint",
    "CoarseVolume",
    "Contact",
    "ContactSurface",
    "Curvature",
    "GaussNewton",
    "HeldVolumes",
    "MirrorTerm",
    "PositionTerm",
    "ScaledSurface",
    "Sliding",
    "Solution",
    "SolverOptions",
    "SolverResult",
    "StationaryPoint",
    "Status",
    "Step",
    "Term",
    "Together",
    "Track",
    "VolumeConstraint",
    "Volumes",
    "are_met",
    "area_of",
    "centroid_of",
    "connected_sets",
    "constrained_step",
    "errors_at",
    "gradients",
    "half_gradient",
    "minimise",
    "moved_along",
    "off_volumes",
    "position_term",
    "region_volumes",
    "rows_of",
    "scale_to_volume",
    "steps_to_volume",
    "total_volume",
    "violations",
    "volumes_by_label",
    "waypoints",
    "with_same_points",
]
