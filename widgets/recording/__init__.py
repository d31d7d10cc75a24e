"""Recordings of input events, and films of deformations.

The files, in reading order:

    recording       `Recorder` and `replay`
    transcript      the lines of a recording
    reading         reading and checking a recording
    parsing         parsing the numbers in a line
    limits          limits of a replay
    confinement     the folder a replay may access, and its keys
    finishes        finishes of a pose in the background
    film            `film` and `Film`
    film_files      GIF, MP4 and PNG files
    off_screen      a session in an off-screen window
"""

from .confinement import confined_path, recorded_keys
from .film import Film, film
from .film_files import require_film
from .finishes import announce_finish, on_finish_request
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
    "announce_finish",
    "confined_path",
    "film",
    "on_finish_request",
    "read_recording",
    "recorded_keys",
    "replay",
    "require_film",
]
