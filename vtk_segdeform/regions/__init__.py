"""Overlapping regions of a mesh, painted or found automatically (section 2.2 of the paper).

The files, in reading order:

    regions         `Regions`: membership and blend weights
    blending        blend weights in the overlaps, eqs. (3) and (4)
    segmentation    `segment`: automatic regions
    limbs           limbs, and the curves along which they are cut off
    slices          parts of equal area where there are no limbs
    coarse          the coarse surface on which cuts are searched
    borders         smoothing of the borders between parts on the mesh
"""

from .blending import blend_weights
from .borders import within_rings
from .regions import (
    CageSurface,
    Regions,
    cage_distance_weights,
    require_region,
    require_regions,
    usual_overlap,
)
from .segmentation import segment, with_regions_apart

__all__ = [
    "CageSurface",
    "Regions",
    "blend_weights",
    "cage_distance_weights",
    "require_region",
    "require_regions",
    "segment",
    "usual_overlap",
    "with_regions_apart",
    "within_rings",
]
