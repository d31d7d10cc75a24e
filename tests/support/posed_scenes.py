"""Sessions with a pose, and random poses of their cages, for the tests of drawing in a page."""

from __future__ import annotations

import numpy as np
from scenes import sausage

from vtk_segdeform.session import Session, State


def sausage_session() -> Session:
    """Return a session of two regions with fixed vertices and the handle "end"."""
    scene = sausage()
    session = Session(
        scene.mesh,
        state=State(scene.regions, scene.cages, scene.fixed, {"end": scene.handle}),
    )
    session.bind()
    return session


def random_cages(session: Session, seed: int, size: float = 0.3) -> list[np.ndarray]:
    """Return cage vertices that are moved at random, by up to *size* diagonals along each axis."""
    rng = np.random.default_rng(seed)
    most = size * session.mesh.diagonal
    return [cage.vertices + rng.uniform(-most, most, cage.vertices.shape) for cage in session.cages]
