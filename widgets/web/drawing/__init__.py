"""The body drawn in the page: W~ once, then only the cage vertices of each pose.

The files, in reading order:

    messages    binary messages to the page
    encoding    a mesh and its W~ as a message, and the messages of its poses
    look        camera, light and material of a VTK renderer
    marks       what it draws over the body
    labels      its texts
    stream      which messages a page still needs

``page/surface.js`` receives the messages and draws with WebGL 2.
"""

from pathlib import Path

from .encoding import EncodedSurface, encode_surface, is_drawable
from .labels import label_actors, labels_of
from .look import Look, look_of
from .marks import Mark, marks_of
from .stream import SurfaceStream

SCRIPT = Path(__file__).parents[1] / "page" / "surface.js"
"""The script of the page."""

__all__ = [
    "SCRIPT",
    "EncodedSurface",
    "Look",
    "Mark",
    "SurfaceStream",
    "encode_surface",
    "is_drawable",
    "label_actors",
    "labels_of",
    "look_of",
    "marks_of",
]
