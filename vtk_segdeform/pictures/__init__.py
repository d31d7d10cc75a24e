"""Pictures of meshes and deformations, rendered off-screen.

The files, in reading order:

    pictures    regions and cages, before and after, volume change, distortion
    canvas      camera, and panels side by side in a PNG file
    palette     colours of pictures and widgets
"""

from .canvas import (
    add_surface,
    png_of,
    require_offscreen,
    require_picture,
    require_screen,
    view_of,
    write_panels,
)
from .palette import (
    BACKGROUND,
    BODY,
    COLOURS,
    DARK_BACKGROUND,
    FIXED,
    HANDLE,
    INK,
    PAPER,
    ink_on,
    of_handle,
    of_region,
    rgb,
)
from .pictures import (
    draw_mesh,
    picture_before_after,
    picture_distortion,
    picture_landmarks,
    picture_regions_and_cages,
    picture_volume_change,
)

__all__ = [
    "BACKGROUND",
    "BODY",
    "COLOURS",
    "DARK_BACKGROUND",
    "FIXED",
    "HANDLE",
    "INK",
    "PAPER",
    "add_surface",
    "draw_mesh",
    "ink_on",
    "of_handle",
    "of_region",
    "picture_before_after",
    "picture_distortion",
    "picture_landmarks",
    "picture_regions_and_cages",
    "picture_volume_change",
    "png_of",
    "require_offscreen",
    "require_picture",
    "require_screen",
    "rgb",
    "view_of",
    "write_panels",
]
