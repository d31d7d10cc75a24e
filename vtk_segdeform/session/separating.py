"""Components with fixed vertices or handles of their own deform by themselves.

Automatic regions are made before there are handles.  Until two components that belong together have
fixed vertices or handles each, one of them may follow the other, whichever has them, in the same
regions and cages.  Then each of them gets regions of its own, and new cages are fitted, in the same
step as the edit.  Pins and pulled points do not count: they move all that lies together.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from ..arrays import IntArray
from ..geometry import towards
from ..regions import Regions, segment
from . import solving
from .poses import Poses
from .preparing import fitted, held_firmly
from .state import State


def separated(poses: Poses, state: State) -> State:
    """Return *state* with regions of their own for the components that must deform by themselves.

    Itself if there are none.  A pose remains, nearly as it is.
    """
    if (regions := _separated(state)) is None:
        return state
    names = state.region_names if regions.n_regions >= len(state.region_names) else ()
    after = replace(state, regions=regions, cages=(), region_names=names)
    if not state.cages:
        return after
    after = replace(after, cages=fitted(poses.mesh, after))
    if state.pose is None:
        return after
    x, at_rest = poses.vertices(state), after.at_rest()
    posed = solving.carried(poses, at_rest, x)
    at_rest = replace(at_rest, fixed_at=state.fixed_at)
    pose = solving.free_form(poses, at_rest, posed)
    targets = MappingProxyType({**pose.targets, **state.pose.targets})
    return replace(at_rest, pose=replace(pose, targets=targets))


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
    after = towards(before, np.concatenate([several, others]))
    own = np.arange(len(after))
    stays = ((before == own) & (after == own))[mesh.components]
    rows = [members & stays for members in regions.membership]
    for k in np.flatnonzero((after == own) & (before != own)):
        part, kept = mesh.of_components(own == k)
        for members in segment(part).membership:
            rows.append(np.zeros(mesh.n_vertices, dtype=bool))
            rows[-1][kept[members]] = True
    membership = np.array([members for members in rows if members.any()])
    return Regions(mesh, membership, regions.smoothness, after)


def _roots(carrier: IntArray) -> IntArray:
    """Return the component at the root of each tree, (c,)."""
    while (carrier[carrier] != carrier).any():
        carrier = carrier[carrier]
    return carrier
