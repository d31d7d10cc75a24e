"""Interactive widgets for a plain VTK renderer or a pyvista plotter.

    from vtk_segdeform.widgets import DeformEditor

    editor = DeformEditor(plotter, mesh)          # or ((renderer, interactor), session)
    editor.On()

`RegionSelector` paints regions, fixed vertices and handles; `CageDisplay` shows cages and drags
their vertices; `HandleDragger` moves and rotates handles; `VolumeOverlay` shows the local volume
change.  Each of them works alone; `DeformEditor` combines all four over one `Session`, with modes
and keys.  `film` makes a video of a session.

Widgets translate events into calls of a session; they compute nothing themselves.

Every name is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING as _TYPE_CHECKING

from vtk_segdeform.importing import imported as _imported

if _TYPE_CHECKING:
    from .cage_display import CageDisplay
    from .editor import DeformEditor, Mode
    from .films import film
    from .handle_dragger import HandleDragger
    from .region_selector import Paint, RegionSelector, Tool
    from .scene import SurfaceDisplay, View
    from .volume_overlay import VolumeOverlay

_MODULE_OF = {
    "CageDisplay": "cage_display",
    "DeformEditor": "editor",
    "HandleDragger": "handle_dragger",
    "Mode": "editor",
    "Paint": "region_selector",
    "RegionSelector": "region_selector",
    "SurfaceDisplay": "scene",
    "Tool": "region_selector",
    "View": "scene",
    "VolumeOverlay": "volume_overlay",
    "film": "films",
}

__all__ = [
    "CageDisplay",
    "DeformEditor",
    "HandleDragger",
    "Mode",
    "Paint",
    "RegionSelector",
    "SurfaceDisplay",
    "Tool",
    "View",
    "VolumeOverlay",
    "film",
]


def __getattr__(name: str) -> object:
    if name in _MODULE_OF:
        value = getattr(_imported(f"{__name__}.{_MODULE_OF[name]}"), name)
        globals()[name] = value  # found without this function from now on
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
