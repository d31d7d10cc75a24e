"""Which bodies are locked: those whose vertices are fixed, but for the ones of handles."""

from __future__ import annotations

import numpy as np

from vtk_segdeform.arrays import BoolArray
from vtk_segdeform.session import Session


def locked_components(session: Session) -> BoolArray:
    """Return which components of the mesh are locked, (c,); a mesh of one component never is."""
    components = session.mesh.components
    locked = np.zeros(int(components.max()) + 1, dtype=bool)
    if len(locked) > 1:
        is_free = np.ones(len(components), dtype=bool)
        is_free[session.fixed] = is_free[session.state.handle] = False
        locked[components[session.fixed]] = True
        locked[components[is_free]] = False
    return locked
