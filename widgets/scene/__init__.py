"""The base of all widgets.

The files, in reading order:

    view               a renderer with its interactor: callbacks, timers, rendering
    qt_events          the events that a view in Qt omits
    widget             the base class of the widgets
    gestures           press, move and release as one generator
    surface_display    the mesh of a session as an actor
    glide              an animation from one pose to the next
    handle_colours     the colours of the handles of a session
    backdrop           background and light of a window that belongs to the editor
    projection         projection between world and display coordinates
    viewpoint          movements of the camera, named views, framing, the up axis
    navigation         the camera by mouse
    orientation_cube   a cube that shows the directions of the model
    foreground         a renderer that draws over another one
    draft              drawing fast while something moves
    decimated_surface  a large mesh in motion, by fewer vertices
    labels             rectangles and text in display coordinates
    carried_display    the files that a session carries along
    wireframe          edges and vertices of a mesh
    highlights         loops and vertices of a mesh, marked
"""

from .backdrop import set_background, set_lights
from .carried_display import CARRIED_COLOUR, CarriedDisplay
from .decimated_surface import decimated_soon
from .draft import Draft
from .gestures import Gesture, Phase, Pointer
from .glide import Glide
from .handle_colours import handle_colour
from .highlights import Highlights
from .labels import Panel, Text, set_font
from .navigation import Navigation
from .orientation_cube import OrientationCube
from .projection import Projection
from .surface_display import SurfaceDisplay, SurfaceStyle, drawn_triangles, some_triangles
from .view import Stop, View
from .viewpoint import VIEWS, Viewpoint
from .widget import Widget
from .wireframe import Wireframe, cells_of, points_of

__all__ = [
    "CARRIED_COLOUR",
    "VIEWS",
    "CarriedDisplay",
    "Draft",
    "Gesture",
    "Glide",
    "Highlights",
    "Navigation",
    "OrientationCube",
    "Panel",
    "Phase",
    "Pointer",
    "Projection",
    "Stop",
    "SurfaceDisplay",
    "SurfaceStyle",
    "Text",
    "View",
    "Viewpoint",
    "Widget",
    "Wireframe",
    "cells_of",
    "decimated_soon",
    "drawn_triangles",
    "handle_colour",
    "points_of",
    "set_background",
    "set_font",
    "set_lights",
    "some_triangles",
]
