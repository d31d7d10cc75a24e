"""What a session needs before its surface can be pulled: regions, cages, and their binding."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..arrays import IntArray
from ..cages import Cage, fit_cages, require_cage_vertices, suggested_size
from ..deformer import Deformer, changing_components, checked_goals
from ..errors import RegionError
from ..mesh import Mesh
from ..progress import Progress, part
from ..regions import Regions, segment
from .bindings import Stiffened
from .poses import Poses
from .state import Options, State

# Of the progress of a preparation, when it has regions and when it has cages.  Of the time it is a
# quarter and a half for 5,000 vertices, and a tenth and a fifth for 300,000.
_SEGMENTED, _FITTED = 0.15, 0.3


class Preparation(NamedTuple):
    """What a session needs before its surface can be pulled; made by `Session.preparation`."""

    regions: Regions
    cages: tuple[Cage, ...]
    deformer: Deformer
    """Bound to them, with the same stiffness all over."""
    stiffened: Stiffened | None = None
    """The same with the stiffness of the session, if it has one."""


def preparation(poses: Poses, state: State, progress: Progress | None = None) -> Preparation:
    """Return the regions and cages that *state* lacks, bound."""
    mesh, regions = poses.mesh, state.regions
    if regions is None:
        first = part(progress, 0.0, _SEGMENTED)
        regions = segment(mesh, None, progress=first, **following(mesh, state))
    state = replace(state, regions=regions)
    cages = state.cages or fitted(mesh, state, part(progress, _SEGMENTED, _FITTED))
    own, state = poses.bindings.snapshot(), replace(state, cages=cages)
    own.bind(state, part(progress, _FITTED, 1.0))
    _ = mesh.adjacency, poses.lids(state)  # the first frame needs them
    return Preparation(regions, cages, own.bound(state), own.stiffened(state))


def following(mesh: Mesh, state: State) -> dict[str, Any]:
    """Return the arguments of `segment` for what follows what in *state*."""
    options = state.options
    changed = changing_components(mesh, options.lids, checked_goals(dict(options.volumes)))
    return {"attach": dict(options.attach), "held": held_firmly(state), "apart": changed}


def held_firmly(state: State) -> IntArray:
    """Return the fixed vertices and those of handles that were not made by pulls and pins, (k,)."""
    own = [ids for name, ids in state.handles.items() if name not in state.pulls and len(ids) > 1]
    return np.concatenate([state.fixed, *own])


def adopt(poses: Poses, options: Options, preparation: Preparation) -> None:
    """Let *poses* use what is bound in a *preparation* that was made with *options*."""
    regions, cages, deformer, stiffened = preparation
    poses.bindings.adopt(State(regions, cages, options=options), deformer, stiffened)


def fits(mesh: Mesh, state: State, preparation: Preparation) -> bool:
    """Return whether *state* has no other regions and cages than *preparation*."""
    regions, cages, deformer, _ = preparation
    has_others = state.regions not in (None, regions) or state.cages not in ((), cages)
    return deformer.mesh is mesh and not has_others


def prepared(preparation: Preparation, state: State) -> State:
    """Return *state* with the regions and cages of *preparation*, if it has none yet."""
    if state.regions not in (None, preparation.regions) or state.cages:
        return state
    return replace(state, regions=preparation.regions, cages=preparation.cages)


def sized(state: State, n_cage_vertices: int | None) -> State:
    """Return *state* with the option *n_cage_vertices*, if it is given."""
    if n_cage_vertices is None:
        return state
    return replace(state, options=replace(state.options, n_cage_vertices=n_cage_vertices))


def fitted(mesh: Mesh, state: State, progress: Progress | None = None) -> tuple[Cage, ...]:
    """Return cages around the regions of *state*, by its options.

    RegionError if it has no regions.
    """
    regions, options = state.regions, state.options
    if regions is None:
        raise RegionError("there are no regions to fit cages to; segment or paint them first")
    wanted = options.n_cage_vertices
    size = suggested_size(regions) if wanted == Options().n_cage_vertices else wanted
    require_cage_vertices(size, regions.n_regions, "n_cage_vertices")
    return fit_cages(mesh, regions, size, offset=options.offset, progress=progress)
