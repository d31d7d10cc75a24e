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
from .editing.stage import Mode
from .editor import DeformEditor
from .film import film
from .filming.limits import ReplayLimits
from .handle_dragger import HandleDragger
from .recording import Recorder, replay
from .region_selector import Paint, RegionSelector, Tool
from .surface_display import SurfaceDisplay
from .view import View
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
