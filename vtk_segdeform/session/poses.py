"""Everything that is computed from states: one cache, by its frozen inputs.

    regions, cages, options of binding       ->  a bound `Deformer`; takes seconds
    + fixed vertices, handles, volumes       ->  a constrained deformer; milliseconds
    + locality of a pull                     ->  a local one
    + pose                                   ->  `Path`, from where the next solve continues
    regions, cages of a pose                 ->  W~ p, always the same product

Nothing in it is ever changed: a solve continues with a copy of a deformer, so one that fails or is
cancelled leaves everything as it was.

The vertices of a pose do not depend on how it was reached: after undo, redo or loading they are
bitwise identical.  Only the frames of a drag of a large mesh show those of the solution, which
differ from W~ p by rounding, so that each frame maps the mesh once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, as_points, frozen
from ..deformer import Deformer, Mirror
from ..freezing import Memo
from ..geometry import Lids, lids_of
from ..mesh import Mesh
from ..progress import Progress, part, tell
from ..solver import Solution, VolumeConstraint, total_volume
from ..subspace import blend_at
from . import pulls
from .bindings import Bindings
from .handles import stacked
from .state import Cages, Pose, State

_KEPT = 3  # rotations and surfaces of the last poses
_MOST_CARRIED = 16  # files whose points stay bound
# The options that are not those of `Deformer.hold`: of cages, regions and the binding.
_NOT_HELD = {
    "n_cage_vertices", "offset", "attach", "stretch", "rotation_groups", "symmetry",
}  # fmt: skip
VOLUME_TOLERANCE = 1e-9  # relative; a pose with a larger error does not meet a new constraint


class Shown(NamedTuple):
    """The mesh in a pose."""

    vertices: FloatArray
    """(n, 3) float, read-only."""
    volume_change: Callable[[], float]
    """Returns (V - V0) / V0, signed."""


@dataclass(frozen=True, eq=False)
class Aim:
    """The targets of handles in a finished pose, and the shift that the cages must leave out.

    The shift of a handle rotates with the surface around it, and this rotation depends on the
    shift: repeated solves need not converge, and can alternate between three poses for ever.  So
    after a few solves the mean of their shifts is used (Mann 1953), and finally kept.
    """

    wanted: FloatArray  # (k, 3), the targets
    shift: FloatArray  # (k, 3), subtracted from the targets of the cages
    turns: int = 1

    TURNS = 3  # solves in which the shifts turn with the surface, at most
    LIVE_TURNS = 12  # the same of live solves for the same targets

    def turned(self, wanted: FloatArray, shift: FloatArray) -> Aim:
        """Return the aim of the next solve, with the *shift* that the last pose has."""
        if not np.array_equal(wanted, self.wanted):
            return Aim(wanted, shift)
        if self.turns >= self.LIVE_TURNS:
            return self
        share = 1.0 / max(1, self.turns - self.TURNS + 2)
        return Aim(wanted, self.shift + share * (shift - self.shift), self.turns + 1)


class Path(NamedTuple):
    """From where a solve continues."""

    held: Deformer
    """With the constraints, in any pose."""
    deformer: Deformer
    """The same in the pose, with what the last solve has learned; solve with copies of it."""
    aim: Aim | None = None
    """Of a pose dragged on from a finished one, after its solve."""


class Poses:
    """The surfaces and deformers of the states of one mesh; cached.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.bindings = Bindings(mesh)
        self.memo = Memo()

    # Deformers.

    def prepare(self, state: State, progress: Progress | None = None) -> None:
        """Bind, and constrain the fixed vertices and handles of *state* if there are any."""
        self.bindings.bind(state, part(progress, 0.0, 0.95))
        if len(state.fixed) or state.handles:
            self.constrained(state)
        tell(progress, 1.0, "ready")

    def constrained(self, state: State) -> Deformer:
        """Return a deformer with the fixed vertices, handles and volumes of *state*, at rest."""
        places, shift = state.fixed_at, self.shift(state)
        key: object = places
        if shift is not None and shift[state.fixed].any():
            places = self.fixed_places(state) - shift[state.fixed]
            key = places.tobytes()  # as it is a new array each time
        held = tuple(state.handles.values())
        inputs = self.bindings.bind(state), state.fixed, key, held, *_volumes(state).values()
        return self.memo.get("held", inputs, partial(self.held, state, places))

    def held(self, state: State, fixed_at: FloatArray | None) -> Deformer:
        """Return a deformer with the constraints of *state*, its fixed vertices at *fixed_at*."""
        return self.bindings.bind(state).hold(
            fixed=state.fixed, handle=state.handle, fixed_at=fixed_at, **_volumes(state)
        )

    def path(self, state: State) -> Path:
        """Return the path to the pose of *state*, by resuming the pose if it is not known."""
        held, pose = self._local(state), state.pose
        known: Path | None = self.memo.find("path", (held, pose))
        if known is not None:
            return known
        deformer = held.copy()
        deformer.reset()
        if pose is not None:
            places, shift = stacked(pose.targets), self.shift(state)
            places = places if shift is None else places - shift[held.handle]
            deformer.resume(pose.cage_vertices, places)
        return Path(held, deformer)

    def keep_path(self, pose: Pose, path: Path) -> None:
        """Let the next solve from *pose* with the same constraints continue with *path*."""
        self.memo.keep("path", (path.held, pose), path)

    def continue_from(self, pose: Pose, state: State) -> None:
        """Let the next solve from *pose*, which has the cages of *state*, continue as from that."""
        path: Path | None = self.memo.find("path", (self._local(state), state.pose))
        if path is not None:
            self.keep_path(pose, path)

    def solution(self, state: State) -> Solution | None:
        """Return the solver's result for the pose of *state*; None if another one came since."""
        found: Solution | None = self.memo.find("solution", (state.pose,))
        return found

    def keep_solution(self, pose: Pose, solution: Solution) -> None:
        """Keep the *solution* of a pose until that of the next one."""
        self.memo.keep("solution", (pose,), solution)

    def _local(self, state: State) -> Deformer:
        """Return `constrained`, local if the pose comes from a pull."""
        held, locality = self.constrained(state), state.locality
        if locality is None:
            return held

        def local() -> Deformer:
            return pulls.localised(held, locality, self.surface(state, locality.cage_vertices))

        return self.memo.get("local", (held, locality), local)

    # Surfaces.

    def shown(self, state: State, *, live: bool = False) -> Shown:
        """Return the mesh in the pose of *state*; if *live*, as in the frames of a drag."""
        pose = state.pose
        if pose is None:
            return Shown(self.mesh.vertices, float)
        inputs = pose.cage_vertices, pose.finished, state.regions, state.cages, state.options.lids
        known: Shown | None = self.memo.find("live", inputs) if live else None
        return known or self.memo.get("shown", inputs, lambda: self._measured(state, pose))

    def keep_live(self, state: State, shown: Shown) -> None:
        """Let the frames of a drag show the pose of *state* like this; of a pose not finished."""
        pose = state.pose
        assert pose is not None
        inputs = pose.cage_vertices, None, state.regions, state.cages, state.options.lids
        self.memo.keep("live", inputs, shown)

    def _measured(self, state: State, pose: Pose) -> Shown:
        own = pose.finished
        x = self.surface(state, pose.cage_vertices) if own is None else own.vertices
        _, volume = self.enclosed(state)
        return Shown(x, cache(partial(volume.relative, x)))

    def vertices(self, state: State, *, live: bool = False) -> FloatArray:
        """Return the vertices (n, 3) of `shown`, read-only."""
        return self.shown(state, live=live).vertices

    def peek(self, state: State) -> FloatArray | None:
        """Return `vertices` of a state that is not shown; None if its cages are not bound."""
        pose = state.pose
        if pose is None:
            return self.mesh.vertices
        if pose.finished is not None:
            return pose.finished.vertices
        if not self.bindings.is_bound(state):
            return None
        inputs = state.regions, state.cages, pose.cage_vertices
        known: FloatArray | None = self.memo.find("surface", inputs)
        return self._mapped(state, pose.cage_vertices) if known is None else known

    def surface(self, state: State, cages: Cages) -> FloatArray:
        """Return W~ p, (n, 3) float, read-only; *cages* are p."""
        mapped = partial(self._mapped, state, cages)
        return self.memo.get("surface", (state.regions, state.cages, cages), mapped, _KEPT)

    def _mapped(self, state: State, cages: Cages) -> FloatArray:
        return frozen(self._bound_to(state, cages).surface(cages))

    def _bound_to(self, state: State, cages: Cages) -> Deformer:
        """Return a deformer with the W~ of *cages*: those of the pose keep that of their solve."""
        pose = state.pose
        if pose is None or cages is not pose.cage_vertices or pose.on(state.stiffness) is pose:
            return self.bindings.bind(state)
        return self.bindings.bind(replace(state, stiffness=pose.stiffness))

    def rotations(self, state: State, cages: Cages) -> FloatArray:
        """Return `Deformer.rotations`, (n, 3, 3) float."""
        rotations = partial(self.bindings.bind(state).rotations, cages)
        return self.memo.get("rotations", (state.regions, cages), rotations, _KEPT)

    def shift(self, state: State) -> FloatArray | None:
        """Return `Finished.shifted` (n, 3) of the pose; None if it is not finished."""
        pose = state.pose
        if pose is None or pose.finished is None:
            return None
        return pose.finished.shifted(self.surface(state, pose.cage_vertices))

    def fixed_places(self, state: State) -> FloatArray:
        """Return where the fixed vertices stay, (f, 3)."""
        return self.mesh.vertices[state.fixed] if state.fixed_at is None else state.fixed_at

    def carry(self, state: State, points: ArrayLike) -> FloatArray:
        """Return *points* (k, 3), given at rest, moved along with the mesh to the pose."""
        points = as_points(points, "points")
        if state.pose is None:
            return points
        bound = self._bound_to(state, state.cage_vertices).passengers(points)
        return bound.moved(state.cage_vertices) + self._off_cages(state, points)

    def carry_often(self, state: State, points: FloatArray, *, live: bool) -> FloatArray:
        """Return `carry` in little time, if it was called with this array before.

        If *live*, as in the frames of a drag: how far a finished mesh is from that of its cages,
        which a drag hardly changes, is as in the last call that was not.
        """
        known = self.memo.find("off cages", (points,)) if live else None
        off: float | FloatArray = self._off_cages(state, points) if known is None else known
        self.memo.keep("off cages", (points,), off, _MOST_CARRIED)
        if state.pose is None:
            return points
        deformer = self._bound_to(state, state.cage_vertices)
        bound = partial(deformer.passengers, points)
        passengers = self.memo.get("passengers", (deformer, points), bound, _MOST_CARRIED)
        return np.asarray(passengers.moved(state.cage_vertices) + off)

    def _off_cages(self, state: State, points: FloatArray) -> float | FloatArray:
        """Return how far the mesh is from that of its cages, near *points* (k, 3): (k, 3), or 0."""
        pose = state.pose
        if pose is None or pose.finished is None:
            return 0.0
        off = pose.finished.vertices - self.surface(state, pose.cage_vertices)
        return blend_at(self.mesh.vertices, off.T, points).T

    def mirror(self, state: State) -> Mirror | None:
        """Return the plane of symmetry with the option of *state*, if there is one."""
        symmetry = state.options.symmetry
        if symmetry is None:
            return None
        return self.memo.get("mirror", (symmetry,), lambda: Mirror.of(self.mesh, symmetry))

    # Volumes.

    def lids(self, state: State) -> Lids:
        """Return the lids of the mesh with the option of *state*."""
        return self.enclosed(state)[0]

    def enclosed(self, state: State) -> tuple[Lids, VolumeConstraint]:
        """Return the lids and the total volume with the option of *state*."""
        wanted = state.options.lids

        def enclosed() -> tuple[Lids, VolumeConstraint]:
            lids = lids_of(self.mesh, wanted)
            return lids, total_volume(self.mesh, lids)

        return self.memo.get("enclosed", (wanted,), enclosed, most=3)  # None, True, False


def _volumes(state: State) -> dict[str, Any]:
    """Return the options of *state* for `Deformer.hold`."""
    given = {name: value for name, value in vars(state.options).items() if name not in _NOT_HELD}
    return {
        **given,
        "volumes": dict(state.options.volumes),
        "slides": state.slides,
    }
