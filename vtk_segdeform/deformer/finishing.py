"""What a finish is given: the pose of the cages, and which vertices are held; see `finish`.

Components without fixed or handle vertices that follow others are not finished: they move by what
the finish has moved their carriers, and along their normals onto their own volumes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..finish import Finish, Finisher
from ..progress import Progress
from ..solver import VolumeConstraint, moved_along, steps_to_volume
from .constraints import Constraints
from .path import Path

_VOLUME_KEPT = 1e-9  # relative; a finish with a larger error is not used
_STAYS = 0.1  # weight of `locality` from which a finish moves nothing: at 1.15 times the reach


def finish_of(
    path: Path, pose: FloatArray, start: FloatArray, progress: Progress | None = None
) -> Finish:
    """Return the *pose* (n, 3) of the cages on *path*, finished from *start* (n, 3).

    Its vertices are those of *start* if exact handles and exact volumes exclude each other.
    """
    constraints, problem = path.constraints, path.constraints.problem
    frame, preserved = problem.frame, constraints.preserved.constraints
    held = np.zeros(len(pose), dtype=bool)
    held[constraints.fixed] = held[constraints.handle] = True
    held[[each.vertex for each in constraints.pulled.points if not each.is_vertex]] = False
    places = np.array(problem.rest_pose.vertices)
    places[constraints.fixed] = frame.about_origin(constraints.fixed_at)
    places[constraints.handle] = frame.about_origin(frame.outward(path.targets))
    if constraints.keeps is not None:
        keeps = np.minimum(np.sqrt(constraints.keeps / _STAYS), 1.0)
        far = problem.samples.smooth_at_vertices(keeps) == 1.0
        stays = (far | _is_near_pulled_points(constraints)) & ~held
        places[stays] = pose[stays]
        held |= stays
        _place_points(path, places, stays)
    is_carried = constraints.carrying.is_carried
    held |= is_carried
    places[is_carried] = pose[is_carried]
    finisher = Finisher(
        problem.rest_pose,
        problem.cell_energy,
        held,
        preserved,
        problem.cage_weights,
        progress,
        avoid_contact=constraints.contact is not None,
    )
    found = finisher.run(pose, places[held], progress, start=start)
    if is_carried.any() and found.vertices is not start:
        found = replace(found, vertices=_followed(constraints, pose, found.vertices))
    # Without enough free vertices exact handles and exact volumes exclude each other.
    off = [abs(each.relative(found.vertices)) for each in preserved]
    return replace(found, vertices=start) if max(off, default=0.0) > _VOLUME_KEPT else found


def _followed(constraints: Constraints, pose: FloatArray, x: FloatArray) -> FloatArray:
    """Return the finished mesh *x* (n, 3) with the followers moved along from the *pose*."""
    carrying = constraints.carrying
    moved = pose + carrying.carried(x - pose)
    volumes = [
        each
        for each in constraints.preserved.constraints
        if carrying.is_carried[each.faces[each.faces < len(x)]].any()
    ]
    stays = ~carrying.is_carried
    landed = on_volumes(moved, volumes, np.flatnonzero(stays)) if volumes else moved
    return np.where(stays[:, None], x, landed)


def on_volumes(
    x: FloatArray, constraints: Sequence[VolumeConstraint], stays: IntArray
) -> FloatArray:
    """Return *x* (n, 3) moved along its normals onto the volumes, but for the vertices *stays*."""
    centre = x.mean(axis=0)
    moved, directions = x - centre, []
    for constraint in constraints:
        normals = constraint.gradient(moved)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals /= np.where(lengths > 0.0, lengths, 1.0)
        normals[stays] = 0.0
        directions.append(normals)
    paths = np.hstack([moved, *directions])
    return np.asarray(moved_along(paths, steps_to_volume(constraints, paths)) + centre)


def _is_near_pulled_points(constraints: Constraints) -> BoolArray:
    """Return which vertices are within the spread of pulled points, or next to these, (n,).

    Triangles resist no bending, so the finish would concentrate the load of a pulled point in a
    crease around it.  The cages distribute it, so their pose is kept here.
    """
    problem, pulled = constraints.problem, constraints.pulled
    x = problem.rest_pose.vertices
    near = np.zeros(len(x), dtype=bool)
    for each in pulled.points:
        near |= np.linalg.norm(x - each.at(x), axis=1) <= pulled.spread
        corners = list(each.corners)
        near[corners] = near[problem.mesh.adjacency[corners].indices] = True
    return near


def _place_points(path: Path, places: FloatArray, stays: BoolArray) -> None:
    """Move corners that stay at *places* (n, 3) so that pulled points are at their targets."""
    pulled, frame = path.constraints.pulled, path.constraints.problem.frame
    goals = frame.outward(path.targets[pulled.targets] + pulled.levers)
    for point, goal in zip(pulled.points, frame.about_origin(goals), strict=True):
        if not point.is_vertex:
            corners, shares = np.array(point.corners), np.array(point.shares)
            free = stays[corners]
            places[corners[free]] += (goal - point.at(places)) / shares[free].sum()
