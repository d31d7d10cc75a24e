"""The widget that shows cages and lets their vertices be dragged.

cage_display      `CageDisplay`
"""

from .cage_display import CageDisplay

__all__ = [
    "CageDisplay",
]
