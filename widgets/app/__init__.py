"""The desktop program: a window around `DeformWidget`, with files and autosave."""

from .none_count import look_after_none
from .window import Window

__all__ = ["Window", "look_after_none"]
