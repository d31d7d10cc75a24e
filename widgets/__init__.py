"""Interactive pieces over a plain VTK renderer or a pyvista plotter.

    from vtk_segdeform.widgets import DeformEditor

    editor = DeformEditor(plotter, mesh)          # or ((renderer, interactor), session)
    editor.On()

`RegionSelector` paints regions, fixed vertices and handles, `CageDisplay` shows cages and lets
their vertices be dragged, `HandleDragger` moves and turns handles, `VolumeOverlay` shows where
the body swells; `DeformEditor` is the four over one `Session`, with modes and keys.  Each works
alone as well.  `Recorder` and `replay` keep what hands do, `film` what a session does.

Widgets turn events into our words and ask a session; they never compute.
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
