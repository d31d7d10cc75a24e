"""The base of all widgets.

The files, in reading order:

    view               a renderer with its interactor: callbacks, timers, rendering
    widget             the base class of the widgets
    gestures           press, move and release as one generator
    surface_display    the mesh of a session as an actor
    projection         projection between world and display coordinates
    foreground         a renderer that draws over another one
    draft              drawing without anti-aliasing while something moves
    labels             rectangles and text in display coordinates
    wireframe          edges and vertices of a mesh
    highlights         loops and vertices of a mesh, marked
    step_budget        solver steps per event, recorded and replayed
"""

from .draft import Draft
from .gestures import Gesture, Phase, Pointer
from .highlights import Highlights
from .labels import Panel, Text
from .projection import Projection
from .step_budget import StepBudget, observe_steps, prescribe_steps
from .surface_display import SurfaceDisplay
from .view import Stop, View
from .widget import Widget
from .wireframe import Wireframe

__all__ = [
    "Draft",
    "Gesture",
    "Highlights",
    "Panel",
    "Phase",
    "Pointer",
    "Projection",
    "StepBudget",
    "Stop",
    "SurfaceDisplay",
    "Text",
    "View",
    "Widget",
    "Wireframe",
    "observe_steps",
    "prescribe_steps",
]
