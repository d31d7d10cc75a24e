"""From a state to a pose and from a pose to vertices, with what is dear kept for the next time.

    regions, cages, options   ->  a bound `Deformer`      seconds: the last few are kept
    + fixed, handles          ->  the same, holding them  milliseconds: the last one is kept
    + targets                 ->  a `Pose`                warm-started where it is the last pose
    cages, Pose               ->  vertices, x = W~ p      always the same product

The vertices of a pose do not depend on how it was reached: after undo, redo or loading they are
the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial
from types import MappingProxyType

import numpy as np

from ..arrays import FloatArray, frozen
from ..deformer import Deformer
from ..errors import CageError, ConstraintError
from ..files import cache_folder
from ..geometry import signed_volume, volume_gradient
from ..mesh import Mesh
from ..progress import Progress, part, tell
from ..solver import Solution, VolumeConstraint, region_volumes, total_volume
from .handles import require_near, targets_at
from .listeners import Change
from .state import Pose, State

_DEAR = 20_000  # vertices of a mesh whose binding is kept on disk as well
_KEPT = 3  # bound deformers: undo past a change of cages or options, and back, binds nothing anew
_MOST_OF_IT = 0.95  # of what has to be done before a drag; the rest is to take hold
_SAME_VOLUME = 1e-9  # relative: a pose off by more does not meet a constraint it was not made for
_BINDING = "stretch", "rotation_groups"  # options that a bound deformer has for good
_HOLDING = "preserve_volume", "preserve_region_volumes"  # and those that `Deformer.hold` changes
_NO_TARGETS = np.empty((0, 3))


class Posing:
    """Solves for poses of a mesh, and evaluates them.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._bound: tuple[tuple[State, Deformer], ...] = ()  # newest first
        self._holding: tuple[Deformer, State, Deformer] | None = None
        self._at: Pose | None = None  # where the holding deformer is; None if elsewhere
        self._shape: tuple[Pose, FloatArray, Callable[[], float]] | None = None

    @cached_property
    def _rest_volume(self) -> float:
        return signed_volume(self._mesh.vertices, self._mesh.faces)

    @cached_property
    def _total_volume(self) -> VolumeConstraint:
        return total_volume(self._mesh)

    def is_bound(self, state: State) -> bool:
        """Tell whether `bind` has nothing to do."""
        return any(_bind_alike(state, other) for other, _ in self._bound)

    def bind(self, state: State, progress: Progress | None = None) -> Deformer:
        """Return the deformer for the regions, cages and options of *state*; it holds nothing."""
        for other, deformer in self._bound:
            if _bind_alike(state, other):
                return deformer
        if state.regions is None or not state.cages:
            raise CageError("there are no cages to deform with; fit or set cages first")
        deformer = Deformer(
            self._mesh,
            state.regions,
            state.cages,
            stretch=state.options.stretch,
            rotation_groups=state.options.rotation_groups,
            cache=cache_folder() if self._mesh.n_vertices >= _DEAR else None,
            progress=progress,
        )
        own = State(state.regions, state.cages, options=state.options)
        self._bound = ((own, deformer), *self._bound)[:_KEPT]
        return deformer

    def prepare(self, state: State, progress: Progress | None = None) -> None:
        """Bind, and take hold of the fixed vertices and handles of *state* if there are any."""
        self.bind(state, part(progress, 0.0, _MOST_OF_IT))
        if len(state.fixed) or state.handles:
            self._hold(state)
        tell(progress, 1.0, "ready")

    def forget(self) -> None:
        """Let the next `solve` start from its pose alone, as if that had just been loaded."""
        self._at = None

    def vertices(self, state: State, pose: Pose) -> FloatArray:
        """Return the mesh (n, 3) in *pose* of *state*; read-only."""
        return self._evaluated(state, pose)[0]

    def volume_change(self, state: State, pose: Pose) -> float:
        """Return (V - V0) / V0 of *pose*, signed."""
        return self._evaluated(state, pose)[1]()

    def solve(
        self, state: State, targets: Mapping[str, FloatArray], max_steps: int | None
    ) -> tuple[Pose, Solution]:
        """Return the pose, from that of *state* on, for *targets* (k, 3) of every handle.

        Raises
        ------
        CageError
            If *state* has no cages, or they do not fit.
        ConstraintError
            If no finite pose is found.
        """
        deformer = self._hold(state)
        self._take_up(state, deformer)
        self._at = None  # until it has arrived
        solution = deformer.solve(_stacked(targets), max_steps=max_steps)
        if not np.isfinite(solution.vertices).all():
            raise ConstraintError("these targets lead to no finite pose; move handles less far")
        for vertices in solution.cage_vertices:
            frozen(vertices)
        pose = Pose(solution.cage_vertices, targets)
        self._at = pose
        x, change = self._evaluated(state, pose)
        return pose, replace(solution, vertices=x, volume=change)

    def free_form(self, state: State, cage_vertices: Sequence[FloatArray]) -> Pose:
        """Return the pose of *cage_vertices* (m_r, 3), cage by cage, with the volume of rest.

        The cages are blown up or shrunk for it, along the gradients of their own volumes, unless
        the options let the volume go.  Handles are to stay where they then are.

        Raises
        ------
        ConstraintError
            If that takes the cages senselessly far away.
        """
        p = tuple(cage_vertices)
        if state.options.preserve_volume or state.options.preserve_region_volumes:
            p = self._with_volume_of_rest(state, p)
        for vertices in p:
            frozen(vertices)
        pose = Pose(p, MappingProxyType({}))
        x, change = self._evaluated(state, pose)
        pose = replace(pose, targets=targets_at(state.handles, x))
        self._shape = pose, x, change  # the same with targets
        return pose

    def _with_volume_of_rest(
        self, state: State, cage_vertices: tuple[FloatArray, ...]
    ) -> tuple[FloatArray, ...]:
        pairs = zip(cage_vertices, state.cages, strict=True)
        outward = np.concatenate([volume_gradient(p, cage.faces) for p, cage in pairs])
        outward /= max(np.abs(outward).max(), np.finfo(float).tiny)
        deformer = self.bind(state)
        path = np.hstack([deformer.surface(cage_vertices), deformer.subspace.map(outward)])
        p = np.concatenate(cage_vertices) + self._total_volume.exact_step(path) * outward
        require_near(self._mesh, p, "cage vertices that keep the volume")
        return tuple(p[columns] for columns in deformer.subspace.columns)

    def _hold(self, state: State) -> Deformer:
        bound = self.bind(state)
        if self._holding is not None:
            other, held, deformer = self._holding
            if other is bound and _held_alike(state, held):
                return deformer
        deformer = bound.hold(
            fixed=state.fixed,
            handle=state.handle,
            preserve_volume=state.options.preserve_volume,
            preserve_region_volumes=state.options.preserve_region_volumes,
        )
        held = State(fixed=state.fixed, handles=state.handles, options=state.options)
        self._holding = bound, held, deformer
        self._at = None
        return deformer

    def _take_up(self, state: State, deformer: Deformer) -> None:
        """Put *deformer* where *state* is, unless it is there already."""
        pose = state.pose
        if pose is not None and self._at is pose:
            return
        deformer.reset()
        # The solver's every step meets the constraints, so what it starts from has to.
        if pose is not None and self._meets_constraints(state, pose):
            deformer.resume(pose.cage_vertices, _stacked(pose.targets))

    def _meets_constraints(self, state: State, pose: Pose) -> bool:
        x, change = self._evaluated(state, pose)
        if state.options.preserve_region_volumes and state.regions is not None:
            constraints = region_volumes(self._mesh, state.regions.labels)
            return all(abs(c.relative(x)) <= _SAME_VOLUME for c in constraints)
        return not state.options.preserve_volume or abs(change()) <= _SAME_VOLUME

    def _evaluated(self, state: State, pose: Pose) -> tuple[FloatArray, Callable[[], float]]:
        """Return x = W~ p and what measures its volume change, once."""
        if self._shape is None or self._shape[0] is not pose:
            x = self.bind(state).surface(pose.cage_vertices)
            frozen(x)
            self._shape = pose, x, cache(partial(self._volume_change, x))
        return self._shape[1:]

    def _volume_change(self, x: FloatArray) -> float:
        return signed_volume(x, self._mesh.faces) / self._rest_volume - 1.0


def _stacked(targets: Mapping[str, FloatArray]) -> FloatArray:
    return np.concatenate([_NO_TARGETS, *targets.values()])


def _bind_alike(a: State, b: State) -> bool:
    """Tell whether one deformer serves both, whatever vertices and volumes it is to hold."""
    alike = all(getattr(a.options, name) == getattr(b.options, name) for name in _BINDING)
    return a.regions is b.regions and a.cages == b.cages and alike


def _held_alike(a: State, b: State) -> bool:
    """Tell whether the same vertices and volumes are held."""
    alike = all(getattr(a.options, name) == getattr(b.options, name) for name in _HOLDING)
    return alike and not a.changes(b) & Change.CONSTRAINTS
