"""The widget that paints regions, fixed vertices and handles.

The files, in reading order:

    region_selector    `RegionSelector`
    strokes            brush, lasso, rectangle and connected part
    paint_target       the region, fixed vertices or handle to which a stroke adds vertices
    region_colours     the colours of regions, fixed vertices and handles on the mesh
    region_outlines    their outlines and numbers
    brush_ring         the radius of the brush as a ring on the surface
    outline            the outline of a lasso or a rectangle
"""

from .brush_ring import BrushRing
from .region_colours import RegionColours
from .region_outlines import RegionOutlines
from .region_selector import Paint, RegionSelector, Tool

__all__ = [
    "BrushRing",
    "Paint",
    "RegionColours",
    "RegionOutlines",
    "RegionSelector",
    "Tool",
]
