"""The widget that paints regions, fixed vertices and handles.

The files, in reading order:

    region_selector    `RegionSelector`
    strokes            brush, lasso, box and other tools
    roles              what a stroke makes of the selected vertices
    region_colours     their colours on the mesh
    brush_ring         the ring of the brush on the surface
    outline            the outline of a lasso or box
"""

from .region_colours import RegionColours
from .region_selector import Paint, RegionSelector, Tool

__all__ = [
    "Paint",
    "RegionColours",
    "RegionSelector",
    "Tool",
]
