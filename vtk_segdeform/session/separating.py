"""Which components follow others, and which have regions and cages of their own.

Automatic regions are made before there are handles.  Until two components that belong together have
fixed vertices or handles each, one of them may follow the other, whichever has them, in the same
regions and cages.  Then each of them gets regions of its own, and new cages are fitted, in the same
step as the edit.  Pins and pulled points do not count: they move all that lies together.

The same happens where the option *attach* is changed by `attached`, and by `apart` where volumes of
components are changed.  Regions of all others remain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from ..arrays import IntArray
from ..deformer import Goals, changing_components, checked_goals
from ..errors import ArgumentError, SessionError
from ..geometry import carriers, towards
from ..progress import Progress, part
from ..regions import Regions, segment, with_regions_apart
from . import handles, pulls, solving
from .poses import Poses
from .preparing import fitted, held_firmly
from .state import State


def separated(poses: Poses, state: State, progress: Progress | None = None) -> State:
    """Return *state* with regions of their own for the components that must deform by themselves.

    Itself if there are none.  A pose remains, nearly as it is.
    """
    regions = _separated(state)
    return state if regions is None else _with_regions(poses, state, regions, progress)


def with_fixed(
    poses: Poses, state: State, fixed: IntArray, progress: Progress | None = None
) -> State:
    """Return *state* with other *fixed* vertices (f,), where they are now, and `separated`."""
    after = handles.with_fixed(poses.mesh, state, fixed, poses.vertices(state))
    return separated(poses, after, progress)


def attached(
    poses: Poses, state: State, attach: Mapping[int, int | str], progress: Progress | None = None
) -> State:
    """Return *state* with the option *attach*, and with regions and cages by it, if it has any.

    SessionError if *attach* is not for the components of the mesh.  A pose remains, nearly as it
    is.
    """
    options = replace(state.options, attach=attach)  # type: ignore[arg-type]  # kept as pairs
    after, regions, mesh = replace(state, options=options), state.regions, poses.mesh
    own = np.arange(int(mesh.components.max()) + 1)
    before = own if regions is None or regions.carrier is None else regions.carrier
    changed = [k for k, _ in set(options.attach) ^ set(state.options.attach)]
    alone = np.flatnonzero((before == own) & (np.bincount(before, minlength=len(own)) == 1))
    stay = np.setdiff1d(alone, changed)  # also where they lie against others
    roots = np.union1d(mesh.components[held_firmly(state)], stay)
    try:
        carrier = carriers(mesh, dict(options.attach), roots=roots)
    except ArgumentError as fault:
        raise SessionError(str(fault)) from None
    if regions is None or np.array_equal(carrier, before):
        return after
    after = _with_regions(poses, after, _carried(regions, carrier), part(progress, 0.0, 0.9))
    if after.pose is None:
        return after
    return solving.settled(poses, after, part(progress, 0.9, 1.0))


def apart(poses: Poses, state: State, goals: Goals, progress: Progress | None = None) -> State:
    """Return *state* with regions and cages for components whose volumes change by *goals*.

    In the cage of another component they could not change.  They follow it in their own cages.
    Itself if there are none.
    """
    regions, changed = state.regions, separated_by(poses, state, goals)
    if changed is None or regions is None:
        return state
    return _with_regions(poses, state, _carried(regions, *changed), progress)


def with_goals(poses: Poses, state: State, goals: Goals, progress: Progress | None = None) -> State:
    """Return *state* with other *goals* of volumes, `apart`; `solving.settled` has them.

    After a pull nothing moves but what the volumes move.
    """
    state = apart(poses, state, goals, progress)
    state = pulls.kept(state, poses.vertices(state))
    return replace(state, options=replace(state.options, volumes=tuple(goals.items())))


def separated_by(
    poses: Poses, state: State, goals: Goals
) -> tuple[IntArray, IntArray | None] | None:
    """Return the carriers and leaders (c,) of `apart`; None if nothing changes."""
    regions = state.regions
    if regions is None or regions.carrier is None or not regions.is_carried.any():
        return None
    changed = changing_components(poses.mesh, state.options.lids, checked_goals(goals))
    carrier, leader = with_regions_apart(regions.carrier, changed)
    return None if leader is None else (carrier, leader)


def _with_regions(
    poses: Poses, state: State, regions: Regions, progress: Progress | None = None
) -> State:
    """Return *state* with other *regions* and, if it has any, new cages; nearly in its pose."""
    names = state.region_names if regions.n_regions >= len(state.region_names) else ()
    after = replace(state, regions=regions, cages=(), region_names=names)
    if not state.cages:
        return after
    after = replace(after, cages=fitted(poses.mesh, after, part(progress, 0.0, 0.4)))
    if state.pose is None:
        return after
    x, at_rest = poses.vertices(state), after.at_rest()
    state = pulls.kept(state, x)
    assert state.pose is not None
    posed = solving.carried(poses, at_rest, x, part(progress, 0.4, 1.0))
    at_rest = replace(at_rest, fixed_at=state.fixed_at)
    pose = solving.free_form(poses, at_rest, posed)
    targets = MappingProxyType({**pose.targets, **state.pose.targets})
    pose, locality = replace(pose, targets=targets), state.locality
    if locality is not None:
        locality = replace(locality, reach=0.0, depth=0.0, cage_vertices=pose.cage_vertices)
    return replace(at_rest, pose=pose, locality=locality)


def _separated(state: State) -> Regions | None:
    """Return other regions for *state*; None if it needs none."""
    regions = state.regions
    if regions is None or regions.carrier is None:
        return None
    mesh, before = regions.mesh, regions.carrier
    attached = [k for k, other in state.options.attach if not isinstance(other, str)]
    held = np.setdiff1d(mesh.components[held_firmly(state)], attached)
    root = _roots(before)
    several = held[np.bincount(root[held], minlength=len(root))[root[held]] > 1]
    if not (before[several] != several).any():
        return None
    others = np.setdiff1d(root, root[several])
    return _carried(regions, towards(before, np.concatenate([several, others])))


def _carried(regions: Regions, after: IntArray, leader: IntArray | None = None) -> Regions:
    """Return *regions* with carriers *after* (c,); components that lose theirs are segmented.

    Those of *leader* (c,) are added to the leaders.
    """
    mesh, own = regions.mesh, np.arange(len(after))
    before = own if regions.carrier is None else regions.carrier
    stays = ((before == own) & (after == own))[mesh.components]
    rows = [members & stays for members in regions.membership]
    for k in np.flatnonzero((after == own) & (before != own)):
        part, kept = mesh.of_components(own == k)
        for members in segment(part).membership:
            rows.append(np.zeros(mesh.n_vertices, dtype=bool))
            rows[-1][kept[members]] = True
    membership = np.array([members for members in rows if members.any()])
    led = regions.leader
    if leader is not None and led is not None:
        led = np.where(leader != own, leader, led)
    return Regions(mesh, membership, regions.smoothness, after, leader if led is None else led)


def _roots(carrier: IntArray) -> IntArray:
    """Return the component at the root of each tree, (c,)."""
    while (carrier[carrier] != carrier).any():
        carrier = carrier[carrier]
    return carrier
