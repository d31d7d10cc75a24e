"""Interactive widgets for a plain VTK renderer or a pyvista plotter.

    from vtk_segdeform.widgets import DeformEditor

    editor = DeformEditor(plotter, mesh)          # or ((renderer, interactor), session)
    editor.On()

`RegionSelector` paints regions, fixed vertices and handles; `CageDisplay` shows cages and drags
their vertices; `HandleDragger` moves and rotates handles; `VolumeOverlay` shows the local volume
change.  Each of them works alone; `DeformEditor` combines all four over one `Session`, with modes
and keys.  `Recorder` and `replay` record and repeat the input, `film` makes a video of a session.

Widgets translate events into calls of a session; they compute nothing themselves.
"""

from .cage_display import CageDisplay
from .editor import DeformEditor, Mode
from .handle_dragger import HandleDragger
from .recording import Recorder, ReplayLimits, film, replay
from .region_selector import Paint, RegionSelector, Tool
from .scene import SurfaceDisplay, View
from .volume_overlay import VolumeOverlay

__all__ = [
    "CageDisplay",
    "DeformEditor",
    "HandleDragger",
    "Mode",
    "Paint",
    "Recorder",
    "RegionSelector",
    "ReplayLimits",
    "SurfaceDisplay",
    "Tool",
    "View",
    "VolumeOverlay",
    "film",
    "replay",
]
