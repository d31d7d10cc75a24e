"""The widget that shows the local volume change in colours.

The files, in reading order:

    volume_overlay    `VolumeOverlay`
    diverging         the diverging colour scale
    legend            the colour bar and the lines of text
    region_volumes    the volume change of regions and bodies
"""

from .legend import brief, in_tenths, percent, signed
from .region_volumes import RegionVolumes
from .volume_overlay import VolumeOverlay

__all__ = [
    "RegionVolumes",
    "VolumeOverlay",
    "brief",
    "in_tenths",
    "percent",
    "signed",
]
