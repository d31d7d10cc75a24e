"""The whole method bound to one mesh.

The files, in reading order:

    deformer         `Deformer`: targets in, `Solution` out
    problem          the mesh, its cages and its energy, made once
    enclosed_volume  the volume under its lids, and what of it is preserved
    slides           vertices that slide along a plane, a line or a surface
    stiffness        stiff and rigid parts
    symmetry         motions that are mirrored about a plane
    volume_goals     goals for volumes, as texts
    growth           the shape that has the volumes that are set
    constraints      fixed vertices, handles and volumes, made once for a set of them
    path             the last pose, and how the next one is reached from there
    derivatives      derivatives of a pose, by targets, volumes and stiffness
    local            constraints that move the surface near a grabbed point only
    finishing        what a finish is given
    frame            the coordinates in which a mesh is deformed
    arguments        checks of its arguments
    locality         what stays when one point is pulled
    limbs            parts of a body that bend at a joint, and hinges there
    binding          all that is computed once for a mesh, its regions and its cages
    binding_cache    bindings kept on disk
    clamping         regions of their own for fixed parts and rigid handles
    as_printed       the paper as printed, for comparison
    deform           `deform`: the whole method in one call
    pull             `pull`: one point pulled, in one call
    springs          poses that springs pull a body to
"""

from .arguments import (
    FARTHEST_APART,
    LOCALITY,
    SPREAD,
    automatic_locality,
    checked_constraints,
    checked_hinge,
    checked_limb,
    checked_locality,
    checked_place,
    checked_point,
    checked_radius,
    checked_targets,
    checked_vertex,
    fault_of_grab,
    place_text,
)
from .as_printed import PaperDeformer, PaperSolution
from .clamping import clamped
from .deform import deform, finished, solved_along
from .deformer import Deformer
from .derivatives import Gradient
from .enclosed_volume import changing_components
from .finishing import on_volumes
from .limbs import Limb
from .problem import Problem
from .pull import pull
from .slides import Slide, SurfaceTrack, checked_slides
from .springs import SpringBody, SpringPose, regions_and_cages
from .stiffness import Stiffness
from .symmetry import Mirror
from .volume_goals import OTHER_MEASURE, Goals, checked_goals, is_centroid

__all__ = [
    "FARTHEST_APART",
    "LOCALITY",
    "OTHER_MEASURE",
    "SPREAD",
    "Deformer",
    "Goals",
    "Gradient",
    "Limb",
    "Mirror",
    "PaperDeformer",
    "PaperSolution",
    "Problem",
    "Slide",
    "SpringBody",
    "SpringPose",
    "Stiffness",
    "SurfaceTrack",
    "automatic_locality",
    "changing_components",
    "checked_constraints",
    "checked_goals",
    "checked_hinge",
    "checked_limb",
    "checked_locality",
    "checked_place",
    "checked_point",
    "checked_radius",
    "checked_slides",
    "checked_targets",
    "checked_vertex",
    "clamped",
    "deform",
    "fault_of_grab",
    "finished",
    "is_centroid",
    "on_volumes",
    "place_text",
    "pull",
    "regions_and_cages",
    "solved_along",
]
