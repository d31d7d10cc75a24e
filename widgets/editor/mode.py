"""The four modes of the editor."""

from __future__ import annotations

import enum


class Mode(enum.Enum):
    """The current action of the mouse on the mesh."""

    REGIONS = 1
    """Paint regions."""
    CAGES = 2
    """Drag cage vertices."""
    HANDLES = 3
    """Paint fixed vertices and handles."""
    DEFORM = 4
    """Move and rotate handles."""
