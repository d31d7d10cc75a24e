"""What all widgets are built on.

The files, in reading order:

    view               a renderer and its interactor, wherever they come from
    widget             the base class of the widgets
    gestures           press, move, release as one generator
    surface_display    the mesh of a session as an actor
    sight              projection between world and display
    front              a renderer in front of another
    labels             rectangles and text in display coordinates
    wires              a triangle mesh as wires and points
    pace               solver steps per event
"""

from .gestures import Gesture, Phase, Pointer
from .labels import Panel, Words
from .pace import Pace, on_steps, order_steps
from .sight import Sight
from .surface_display import SurfaceDisplay
from .view import Stop, View
from .widget import Widget
from .wires import Wires

__all__ = [
    "Gesture",
    "Pace",
    "Panel",
    "Phase",
    "Pointer",
    "Sight",
    "Stop",
    "SurfaceDisplay",
    "View",
    "Widget",
    "Wires",
    "Words",
    "on_steps",
    "order_steps",
]
