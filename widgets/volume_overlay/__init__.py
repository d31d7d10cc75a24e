"""The widget that shows local volume change in colours.

The files, in reading order:

    volume_overlay    `VolumeOverlay`
    diverging         a diverging colour scale
    legend            the scale and its labels
    region_volumes    volume change of each region
"""

from .legend import brief, precise, signed
from .region_volumes import RegionVolumes
from .volume_overlay import VolumeOverlay

__all__ = [
    "RegionVolumes",
    "VolumeOverlay",
    "brief",
    "precise",
    "signed",
]
