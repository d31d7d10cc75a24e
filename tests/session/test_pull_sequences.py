"""Random pulls, turns and pins, one after the other: no frame leaves all proportion."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import sausage
from solids import rotation

from vtk_segdeform.session.session import Session
from vtk_segdeform.session.state import State

pytestmark = pytest.mark.usefixtures("bound_once")


def one_pull(session: Session, rng: np.random.Generator, near: int) -> int:
    """Pull or turn a vertex, often near the last one, in a few frames; check all of them."""
    x, rest, unit = session.vertices, session.mesh.vertices, session.mesh.diagonal
    away = np.linalg.norm(rest - rest[near], axis=1)
    some = np.flatnonzero(away < rng.choice([0.2, 2.0]) * unit)
    vertex, radius = int(rng.choice(some)), rng.uniform(0.05, 0.4) * unit
    shift = rng.normal(size=3) * rng.choice([0.0, 0.05]) * unit
    angle, axis = np.radians(rng.uniform(10.0, 180.0)) * rng.choice([-1, 0, 1]), rng.normal(size=3)
    options = {"radius": radius, "locality": [None, 0.0, 0.05, 0.2, 1.0][rng.integers(5)]}
    frames = int(rng.choice([1, 4]))
    for share in (*(np.arange(frames) + 1.0) / frames, None):
        part = 1.0 if share is None else share
        turn = np.eye(4)
        turn[:3, :3] = rotation(axis, part * angle)
        turn[:3, 3] = x[vertex] + part * shift - turn[:3, :3] @ x[vertex]
        live = {} if share is None else {"max_steps": 8}
        session.pull(vertex, turn if angle else x[vertex] + part * shift, **options, **live)
        after, targets = session.vertices, session.targets
        aims = [
            np.linalg.norm(targets[k] - x[ids], axis=1).max() for k, ids in session.handles.items()
        ]
        limit = 3.0 * max(aims) + (2.0 * np.sin(0.5 * part * abs(angle)) + 0.005) * unit
        assert np.linalg.norm(after - x, axis=1).max() <= limit
        assert abs(session.volume_change) < 1e-12
        faces = session.mesh.faces
        lengths = [np.linalg.norm(np.diff(p[faces], axis=1), axis=2) for p in (x, after)]
        assert np.quantile(lengths[1] / lengths[0], 0.999) < 10.0
    session.commit()
    return vertex


TOPPLES = pytest.mark.xfail(reason="forces stored in a limb do not turn with it", strict=True)
CAMPAIGN = [
    pytest.param(seed, marks=[pytest.mark.campaign, *([TOPPLES] if seed == 44 else [])])
    for seed in [*range(1, 30), 44]
]


@pytest.mark.parametrize("seed", [0, *CAMPAIGN])
def test_in_random_sequences_no_frame_leaves_all_proportion(seed):
    scene, rng = sausage(2, is_coarse=not seed), np.random.default_rng(seed)
    session = Session(scene.mesh, state=State(scene.regions, scene.cages))
    n = scene.mesh.n_vertices
    near = int(rng.integers(n))
    for _ in range(4 if seed else 2):
        near = one_pull(session, rng, near)
        if rng.random() < 0.3:
            free = np.setdiff1d(np.arange(n), session.state.handle)
            session.handles.pin(int(rng.choice(free)))
        if rng.random() < 0.3:
            session.handles.remove(str(rng.choice(list(session.handles))))
        if rng.random() < 0.2:
            session.undo()
