"""Recordings of input events, and films of deformations.

The files, in reading order:

    recording       `Recorder` and `replay`
    transcript      the lines of a recording
    reading         parsing a recording
    words           parsing numbers
    limits          limits of a replay
    confinement     files a replay may touch
    film            `film` and `Film`
    film_files      GIF, MP4 and PNG files
    off_screen      a session in a window that is never shown
"""

from .confinement import place_of
from .film import Film, film
from .film_files import require_film
from .limits import Clock, ReplayLimits
from .off_screen import OffScreen
from .reading import read_recording
from .recording import Recorder, replay
from .transcript import Input

__all__ = [
    "Clock",
    "Film",
    "Input",
    "OffScreen",
    "Recorder",
    "ReplayLimits",
    "film",
    "place_of",
    "read_recording",
    "replay",
    "require_film",
]
