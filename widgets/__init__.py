"""Interactive widgets over a plain VTK renderer, a pyvista plotter or a Qt view.

    from vtk_segdeform.widgets import DeformEditor

    editor = DeformEditor(plotter, mesh)          # or ((renderer, interactor), session)
    editor.On()

`RegionSelector` paints regions, fixed vertices and handles.  `CageDisplay` shows cages and lets
their vertices be dragged.  `HandleDragger` moves and rotates handles.  `VolumeOverlay` shows the
local volume change in colours.  `DeformEditor` combines the four over one `Session`, with modes and
keys; each widget also works alone.  `Recorder` and `replay` record and repeat user input, and
`film` writes the deformation of a session as a film.

Widgets translate input events into calls of a `Session` and display its state; the session does the
computing.
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
