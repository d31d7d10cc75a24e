"""The modes of the editor."""

from __future__ import annotations

import enum


class Mode(enum.Enum):
    """The current action of the mouse on the mesh."""

    PULL = 0
    """Pull the surface at any point."""
    REGIONS = 1
    """Paint regions."""
    CAGES = 2
    """Drag cage vertices."""
    HANDLES = 3
    """Paint fixed vertices and handles."""
    DEFORM = 4
    """Move and rotate handles."""
