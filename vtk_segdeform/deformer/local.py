"""Constraints that move the surface near a grabbed point only; see `locality`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray
from ..energy import Energy, with_rotating_rows
from ..mesh import SurfacePoint
from ..solver import Anchors, GaussNewton
from .constraints import Constraints, PulledPoints
from .growth import kept_around
from .limbs import with_hinge
from .locality import ANCHOR_WEIGHT, Ring
from .path import Path

_SPIKE, _FAR_PULL = 0.15, 0.3  # edges: higher spikes are resisted, of a pull by 0.3 diagonals
_FIRM = 0.02  # least curvature at the press of a pull under a load, times the scale of the energy
_HELD = 1.0  # the same of a surface that only volumes move; less than 0.2 lets it turn over
_BALANCED = 1e-9  # a load smaller than this, times the same, is rounding


class _HandlePoint(NamedTuple):
    """A point of the surface that the target of a handle vertex moves."""

    place: int  # among those of all sets
    target: int
    point: SurfacePoint


def near_point(
    path: Path,
    point: SurfacePoint,
    *,
    reach: float,
    spread: float,
    follows: float,
    depth: float,
    hinge: float,
) -> Constraints:
    """Return constraints that keep the surface far from *point* where it is on *path*.

    The arguments are those of `Deformer.local`.  The pose is at rest under them.
    """
    constraints, p = path.constraints, path.p
    problem, before = constraints.problem, constraints.solver
    points = [point]
    if constraints.mirror is not None:
        points.append(constraints.mirror.mate_of(problem.mesh, point))
    size, energy, samples = problem.frame.size, problem.energy, problem.samples
    # The finish has some room around the points, also if they are in a small limb.
    near, finished = (
        (points, far / size or np.inf, follows, depth / size)
        for far in (reach, reach and max(reach, 2 * spread))
    )
    ids = np.concatenate([constraints.handle, constraints.fixed])
    quadratic = ANCHOR_WEIGHT * energy.scale * samples.quadratic(*near)
    quadratic += problem.anchors_of_loose_parts(ids)
    if not reach and constraints.preserved.part is not None:
        quadratic += kept_around(problem, constraints.preserved.part)
    anchors = Anchors(quadratic, p, np.zeros_like(p))
    handles = _points_of_handles(constraints, points)
    own_rows = np.array([problem.row_of(each.point) for each in handles])
    own_rows = own_rows.reshape(-1, problem.subspace.n_columns)
    targets = np.array([each.target for each in handles], dtype=np.int64)
    levers = (own_rows - problem.subspace.at(constraints.handle[targets])) @ p
    pulled = PulledPoints(
        places=np.array([each.place for each in handles], dtype=np.int64),
        targets=targets,
        points=tuple(each.point for each in handles),
        levers=levers,
        spread=spread,
    )
    rows = before.positions.rows.copy()
    rows[pulled.places] = own_rows
    if depth and hinge:
        own = samples.within(point, depth / size)  # a mirrored limb does as this one
        energy = with_hinge(energy, samples.rows[own], samples.areas[own], p=p, hinge=hinge)
    local = replace(constraints, pulled=pulled, keeps=samples.weights(*finished))
    solver = replace(before, energy=energy, positions=before.positions.local(rows, anchors))
    solver = replace(solver, energy=_with_rings(local, own_rows, solver))
    load = solver.unbalanced(p, local.places(path.targets))
    is_loaded = float(np.abs(load).max()) > _BALANCED * energy.scale
    firm = _FIRM if reach else _HELD
    steady = solver.steadying(p, firm * energy.scale) if is_loaded or not reach else 0.0
    anchors = Anchors(quadratic + steady * energy.mass, p, load)
    solver = replace(solver, positions=before.positions.local(rows, anchors))
    return replace(local, solver=solver)


def _points_of_handles(
    constraints: Constraints, points: Sequence[SurfacePoint]
) -> list[_HandlePoint]:
    """Return the points that handles of one vertex move, and grabbed *points* alone in a handle.

    They are the grabbed one, and its mate if there is a mirror.
    """
    found, set_of = [], constraints.solver.positions.set_of
    grabbed = {points[0].vertex: points[0]}
    for target, source in enumerate(constraints.mates, constraints.n_given):
        if constraints.handle[source] == points[0].vertex:
            grabbed[int(constraints.handle[target])] = points[1]
    for number, ids in enumerate(constraints.handles):
        places = np.flatnonzero(set_of == number)
        for place, target in zip(places, ids, strict=False):
            vertex = int(constraints.handle[target])
            own = SurfacePoint.at_vertex(vertex)
            if len(places) == len(ids):
                own = grabbed.get(vertex, own)
            if len(ids) == 1 or not own.is_vertex:
                found.append(_HandlePoint(int(place), int(target), own))
    return found


def _with_rings(constraints: Constraints, own_rows: FloatArray, solver: GaussNewton) -> Energy:
    """Return the energy of *solver* with the rings of points that it would pull as spikes.

    *own_rows* (q, m) are those of the points.
    """
    problem, energy = constraints.problem, solver.energy
    held = np.concatenate([constraints.fixed, constraints.handle])
    far = _FAR_PULL * problem.mesh.diagonal / problem.frame.size
    most = ANCHOR_WEIGHT * energy.scale
    for point, row in zip(constraints.pulled.points, own_rows, strict=True):
        ring = Ring.around(problem.mesh, problem.rest.vertices, point)
        if ring is None or np.isin(ring.vertices, held[held != point.vertex]).any():
            continue
        rows = ring.combinations @ problem.subspace.at(ring.vertices)
        (own, both), (_, offset) = solver.compliance(np.stack([row, rows[0]]))
        excess = far / ring.edge * abs(both) / own / _SPIKE - 1.0  # to first order
        if excess > 0.0:
            strength = most * excess / max(excess, most * (offset - both * both / own))
            energy = with_rotating_rows(energy, rows, ring.offsets, strength * ring.weights)
    return energy
