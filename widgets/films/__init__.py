"""Films of deformations, of histories and of turntables.

The files, in reading order:

    film            `film` and `Film`
    film_files      GIF, MP4 and PNG files
    off_screen      a session in an off-screen window
"""

from .film import Film, film
from .film_files import require_film
from .off_screen import off_screen

__all__ = ["Film", "film", "off_screen", "require_film"]
