"""The widget that pulls the surface at any point, and the one that places landmarks on it.

The files, in reading order:

    puller         `Puller`
    waiting        a pull that waits for its session, and the stand-in that follows
    limb_tint      the limb that a pull would move, tinted before the press
    pull_motion    from pointer positions to the motion of the grabbed point
    markers        pins and pulled points as dots
    landmark_marks
                   `LandmarkMarks`: landmarks and their targets, added and dragged
"""

from .landmark_marks import LandmarkMarks
from .puller import LOCKED, Puller

__all__ = [
    "LOCKED",
    "LandmarkMarks",
    "Puller",
]
