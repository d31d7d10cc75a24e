"""What a finish is given: the pose of the cages, and which vertices are held; see `finish`.

Components without fixed or handle vertices that follow others are not finished: they move by what
the finish has moved their carriers, and along their normals onto their own volumes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..finish import Finish, Finisher
from ..geometry import Carrying
from ..progress import Progress
from ..solver import VolumeConstraint, moved_along, steps_to_volume
from .constraints import Constraints
from .path import Path
from .stiffness import rigid_places
from .symmetry import Mirror

VOLUME_MET = 1e-9
"""Relative error of a volume, at most; a finish with a larger error is not used."""
_STAYS = 0.1  # weight of `locality` from which a finish moves nothing: at 1.15 times the reach


def finish_of(
    path: Path, pose: FloatArray, start: FloatArray, progress: Progress | None = None
) -> Finish:
    """Return the *pose* (n, 3) of the cages on *path*, finished from *start* (n, 3).

    Its vertices are those of *start*, mirrored if there is a mirror, if exact handles and exact
    volumes exclude each other.
    """
    constraints, problem = path.constraints, path.constraints.problem
    mirror = constraints.mirror
    if mirror is not None:
        is_start, pose = start is pose, _symmetric(path, mirror, pose)
        start = pose if is_start else start
    frame, preserved = problem.frame, constraints.preserved.constraints
    held = np.zeros(len(pose), dtype=bool)
    held[constraints.fixed] = held[constraints.handle] = True
    pulled = constraints.pulled
    inside = [not each.is_vertex for each in pulled.points]
    held[constraints.handle[pulled.targets[inside]]] = False
    places = np.array(problem.rest_pose.vertices)
    places[constraints.fixed] = frame.about_origin(constraints.fixed_at)
    places[constraints.handle] = frame.about_origin(frame.outward(path.targets))
    for guide in constraints.guides:
        free = ~held[guide.vertices]
        places[guide.vertices[free]] = guide.track(pose[guide.vertices])[0][free]
        held[guide.vertices] = True
    _place_rigid_parts(path, places, held, pose)
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
    active = set(path.active_volumes)
    while True:
        volumes = [preserved[k] for k in sorted(active)]
        finisher = Finisher(
            problem.rest_pose,
            problem.cell_energy,
            held,
            volumes,
            problem.cage_weights,
            progress,
            avoid_contact=constraints.contact is not None,
        )
        found = finisher.run(pose, places[held], progress, start=start)
        if mirror is not None:
            found = finisher.made(found, partial(_mean_with_image, path, mirror))
        if is_carried.any() and found.vertices is not start:
            followed = _followed(constraints.carrying, volumes, pose, found.vertices)
            found = replace(found, vertices=followed)
        off = preserved.missed(found.vertices)
        missed = set(np.flatnonzero(off > VOLUME_MET).tolist()) - active
        if not missed:
            break
        active |= missed
    # Without enough free vertices exact handles and exact volumes exclude each other.
    return replace(found, vertices=start) if (off > VOLUME_MET).any() else found


def _mean_with_image(path: Path, mirror: Mirror, x: FloatArray) -> FloatArray:
    """Return the mean of the mesh *x* (n, 3) and its mirror image."""
    rest = path.constraints.problem.rest_pose.vertices
    return rest + mirror.symmetric(x - rest)


def _symmetric(path: Path, mirror: Mirror, pose: FloatArray) -> FloatArray:
    """Return the mean of a *pose* (n, 3) and its mirror image, moved onto the volumes."""
    preserved = path.constraints.preserved.constraints
    active = [preserved[k] for k in path.active_volumes]
    x = _mean_with_image(path, mirror, pose)
    if not active:
        return x
    outward = [mirror.symmetric(each.gradient(x)) for each in active]
    paths = np.hstack([x, *(each / np.abs(each).max() for each in outward)])
    return moved_along(paths, steps_to_volume(active, paths))


def _place_rigid_parts(path: Path, places: FloatArray, held: BoolArray, pose: FloatArray) -> None:
    """Hold rigid parts where they are nearest to the *pose* (n, 3), and to their held vertices."""
    constraints, problem = path.constraints, path.constraints.problem
    stiff, rest = problem.inputs.stiffness, problem.rest_pose.vertices
    slides = np.zeros(len(pose), dtype=bool)
    for guide in constraints.guides:
        slides[guide.vertices] = True
    slides[constraints.fixed] = slides[constraints.handle] = False
    for ids in () if stiff is None else stiff.rigid:
        firm, on_tracks = held[ids] & ~slides[ids], partial(_on_tracks, constraints, ids, slides)
        moved = rigid_places(rest[ids], pose[ids], firm, places[ids], on_tracks=on_tracks)
        places[ids[~firm]] = moved[~firm]
        held[ids] = True


def _followed(
    carrying: Carrying, volumes: Sequence[VolumeConstraint], pose: FloatArray, x: FloatArray
) -> FloatArray:
    """Return the finished mesh *x* (n, 3) with the followers moved along from the *pose*."""
    moved, stays = pose + carrying.carried(x - pose), ~carrying.is_carried
    own = [each for each in volumes if not stays[each.faces[each.faces < len(x)]].all()]
    landed = on_volumes(moved, own, np.flatnonzero(stays), carrying.evened) if own else moved
    return np.where(stays[:, None], x, landed)


def on_volumes(
    x: FloatArray,
    constraints: Sequence[VolumeConstraint],
    stays: IntArray,
    evened: Callable[[FloatArray], FloatArray] | None = None,
) -> FloatArray:
    """Return *x* (n, 3) moved along its normals onto the volumes, but for the vertices *stays*.

    If *evened* is given, the normals are those that it returns for them.
    """
    centre = x.mean(axis=0)
    moved, directions = x - centre, []
    for constraint in constraints:
        normals = constraint.gradient(moved)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals /= np.where(lengths > 0.0, lengths, 1.0)
        normals[stays] = 0.0
        directions.append(evened(normals) if evened else normals)
    paths = np.hstack([moved, *directions])
    return np.asarray(moved_along(paths, steps_to_volume(constraints, paths)) + centre)


def _on_tracks(
    constraints: Constraints, ids: IntArray, slides: BoolArray, x: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where *x* (k, 3) of the vertices *ids* is nearest to their tracks, and the normals.

    They are projections (k, 3, 3), 0 for vertices that are not among *slides* (n,).
    """
    at, normals = np.zeros((len(slides), 3)), np.zeros((len(slides), 3, 3))
    at[ids] = x
    for guide in constraints.guides:
        at[guide.vertices], normals[guide.vertices] = guide.track(at[guide.vertices])
    return at[ids], np.where(slides[ids, None, None], normals[ids], 0.0)


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
    """Move corners that stay at *places* (n, 3) so that pulled points are at their targets.

    A point in a rigid part has no such corners, and goes with the part.
    """
    pulled, frame = path.constraints.pulled, path.constraints.problem.frame
    goals = frame.outward(path.targets[pulled.targets] + pulled.levers)
    for point, goal in zip(pulled.points, frame.about_origin(goals), strict=True):
        corners, shares = np.array(point.corners), np.array(point.shares)
        free = stays[corners]
        if not point.is_vertex and free.any():
            places[corners[free]] += (goal - point.at(places)) / shares[free].sum()
