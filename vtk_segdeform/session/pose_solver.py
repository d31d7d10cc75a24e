"""Solve for the poses of a session, caching what is expensive to compute.

    regions, cages, options   ->  a bound `Deformer`       takes seconds; the last few are cached
    + fixed, handles          ->  a constrained deformer   milliseconds; the last one is cached
    + targets                 ->  a `Pose`                 warm start if it continues the last pose
    cages, Pose               ->  vertices, x = W~ p       always the same product

The vertices of a pose do not depend on how it was reached: after undo, redo or loading they are
bitwise identical.  A finished pose has its own vertices, as in `finishing`; its cages are solved
for the places of handles and fixed vertices less the shifts in it.

Long because the caches above depend on each other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from types import MappingProxyType

import numpy as np

from .. import sizes
from ..arrays import FloatArray, IntArray, frozen
from ..deformer import Deformer
from ..errors import CageError, ConstraintError
from ..files import cache_folder
from ..geometry import Lids, lids_of, turned_over, volume_gradient
from ..mesh import Mesh, new_crossings
from ..progress import Progress, part, tell
from ..solver import Solution, Status, VolumeConstraint, errors_at, total_volume
from .finishing import Finish, Surfaces, moved_on
from .handles import require_near, targets_at
from .listeners import Change
from .pulling import localised
from .state import Finished, Locality, Pose, State

_MAX_BOUND = 3  # bound deformers in memory: undo of new cages or options needs no new binding
_BIND_SHARE = 0.95  # share of binding in the progress of `prepare`; the rest adds constraints
_VOLUME_TOLERANCE = 1e-9  # relative; a pose with a larger error does not meet a new constraint
_BINDING_OPTIONS = "stretch", "rotation_groups"  # fixed once a deformer is bound
_CONSTRAINT_OPTIONS = (
    "preserve_volume",
    "preserve_region_volumes",
    "lids",
    "avoid_contact",
)  # changed by `Deformer.hold`
_TURNS = 3  # solves in which the offsets of handles in a finished pose turn with them, at most
_LIVE_TURNS = 12  # the same of live solves for the same targets
_MAX_TURNED = 3  # rotations in memory: of the finished pose, the last one and the next
_CARRIED = 4000  # about as many vertices, at most, to which cages are carried
_HELD, _DAMPING = 30.0, 1e-6  # weights of fixed vertices and handles, and of cages at rest
_NO_TARGETS = np.empty((0, 3))


@dataclass(frozen=True, eq=False)
class _Aim:
    """The targets of handles in a finished pose, and the shift that the cages must leave out.

    The shift of a handle rotates with the surface around it, and this rotation depends on the
    shift: repeated solves need not converge, and can alternate between three poses for ever.  So
    after a few solves the mean of their shifts is used (Mann 1953), and finally kept.
    """

    wanted: FloatArray  # (k, 3), the targets
    shift: FloatArray  # (k, 3), subtracted from the targets of the cages
    turns: int = 1

    def turned(self, wanted: FloatArray, shift: FloatArray) -> _Aim:
        """Return the aim of the next solve, with the *shift* that the last pose has."""
        if not np.array_equal(wanted, self.wanted):
            return _Aim(wanted, shift)
        if self.turns >= _LIVE_TURNS:
            return self
        share = 1.0 / max(1, self.turns - _TURNS + 2)
        return _Aim(wanted, self.shift + share * (shift - self.shift), self.turns + 1)


class PoseSolver:
    """Solves for poses of a mesh and evaluates them.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._bound: tuple[tuple[State, Deformer], ...] = ()  # newest first
        self._constrained: tuple[Deformer, State, FloatArray | None, Deformer] | None = None
        self._local: tuple[Deformer, Locality, Deformer] | None = None
        self._pressed: tuple[Locality, FloatArray] | None = None
        self._current: Pose | None = None  # pose of the deformer in use; None if unknown
        self._aim: _Aim | None = None  # of the current pose, if that has reached its targets
        self._used: Deformer | None = None
        self._is_passing = False  # whether the vertices of the pose evaluated last are
        self._evaluated: tuple[Pose, bool | None, FloatArray, Callable[[], float]] | None = None
        self._mapped: tuple[tuple[FloatArray, ...], FloatArray] = (), _NO_TARGETS
        self._turned: tuple[tuple[tuple[FloatArray, ...], FloatArray], ...] = ()
        self._volumes: dict[bool | None, tuple[Lids, VolumeConstraint]] = {}

    def lids(self, state: State) -> Lids:
        """Return the lids of the mesh with the option of *state*."""
        return self._enclosed(state)[0]

    def _enclosed(self, state: State) -> tuple[Lids, VolumeConstraint]:
        """Return the lids and the total volume with the option of *state*."""
        wanted = state.options.lids
        if wanted not in self._volumes:
            lids = lids_of(self._mesh, wanted)
            self._volumes[wanted] = lids, total_volume(self._mesh, lids)
        return self._volumes[wanted]

    def is_bound(self, state: State) -> bool:
        """Return whether a deformer for *state* is bound already."""
        return any(_same_binding(state, other) for other, _ in self._bound)

    def bind(self, state: State, progress: Progress | None = None) -> Deformer:
        """Return a deformer for the regions, cages and options of *state*, without constraints."""
        for other, deformer in self._bound:
            if _same_binding(state, other):
                return deformer
        if state.regions is None or not state.cages:
            raise CageError("there are no cages to deform with; fit or set cages first")
        deformer = Deformer(
            self._mesh,
            state.regions,
            state.cages,
            stretch=state.options.stretch,
            rotation_groups=state.options.rotation_groups,
            cache=cache_folder() if self._mesh.n_vertices >= sizes.CACHED_BINDING else None,
            progress=progress,
        )
        self.adopt(state, deformer)
        return deformer

    def adopt(self, state: State, deformer: Deformer) -> None:
        """Use *deformer*, bound elsewhere, for the regions, cages and options of *state*."""
        own = State(state.regions, state.cages, options=state.options)
        others = [each for each in self._bound if not _same_binding(state, each[0])]
        self._bound = ((own, deformer), *others)[:_MAX_BOUND]

    def prepare(self, state: State, progress: Progress | None = None) -> None:
        """Bind, and constrain the fixed vertices and handles of *state* if there are any."""
        self.bind(state, part(progress, 0.0, _BIND_SHARE))
        if len(state.fixed) or state.handles:
            self._constrain(state)
        tell(progress, 1.0, "ready")

    def settle(self) -> None:
        """Make the vertices of a passing pose those of its cages, W~ p bit for bit."""
        if self._is_passing:
            self._evaluated, self._is_passing = None, False

    def forget(self) -> None:
        """Make the next `solve` start from its pose alone, as after loading."""
        self._current = None

    def vertices(self, state: State, pose: Pose) -> FloatArray:
        """Return the mesh (n, 3) in *pose* of *state*; read-only."""
        return self._evaluate(state, pose)[0]

    def peek(self, state: State, pose: Pose) -> FloatArray | None:
        """Return `vertices` of a pose that may not be the current one; None if that would bind."""
        if pose.finished is not None:
            return pose.finished.vertices
        if not self.is_bound(state):
            return None
        known = self._evaluated
        if known is not None and known[0].is_same_surface(pose):
            return known[2]
        x = self.bind(state).surface(pose.cage_vertices)
        frozen(x)
        return x

    def volume_change(self, state: State, pose: Pose) -> float:
        """Return (V - V0) / V0 of *pose*, signed."""
        return self._evaluate(state, pose)[1]()

    def solve(
        self,
        state: State,
        targets: Mapping[str, FloatArray],
        max_steps: int | None,
        *,
        is_passing: bool = False,
        progress: Progress | None = None,
    ) -> tuple[Pose, Solution]:
        """Solve for *targets* (k, 3) of every handle, starting from the pose of *state*.

        Until `settle` the vertices of a passing pose, one in a drag, of a large mesh are those of
        the solution, so that each frame maps the mesh once.  They differ from W~ p by rounding.

        Raises
        ------
        CageError
            If *state* has no cages, or they do not fit.
        ConstraintError
            If no finite pose is found.
        Cancelled
            If *progress* raised it; then everything is as it was.
        """
        deformer = self._localise(state, self._constrain(state))
        self._start_from(state, deformer)
        current, aim = self._current if self._current is state.pose else None, self._aim
        self._current, self._aim = None, None  # in case the solve fails
        solve = partial(deformer.solve, max_steps=max_steps, progress=progress)
        how = {"is_live": max_steps is not None, "is_passing": is_passing}
        if progress is None:
            return self._solved(state, targets, deformer, aim, solve, **how)
        try:
            with deformer.restoring():
                return self._solved(state, targets, deformer, aim, solve, **how)
        except BaseException:
            self._current, self._aim = current, aim
            raise

    def _solved(
        self,
        state: State,
        targets: Mapping[str, FloatArray],
        deformer: Deformer,
        aim: _Aim | None,
        solve: Callable[[FloatArray], Solution],
        *,
        is_live: bool,
        is_passing: bool,
    ) -> tuple[Pose, Solution]:
        """Return the result of `solve` with a *deformer* in the pose of *state*."""
        before, shift = state.pose, self._shift(state)
        wanted = _stacked(targets)
        for _ in range(1 if shift is None or is_live else _TURNS):
            if shift is None:
                aim, places = None, wanted
            else:
                own = shift[deformer.handle]
                aim = _Aim(wanted, own) if aim is None else aim.turned(wanted, own)
                places = wanted - aim.shift
            solution = solve(places)
            if not np.isfinite(solution.vertices).all():
                raise ConstraintError("no finite pose for these targets; move the handles less")
            cages, finished = solution.cage_vertices, None if before is None else before.finished
            for vertices in cages:
                frozen(vertices)
            if before is not None and all(map(np.array_equal, cages, before.cage_vertices)):
                cages = before.cage_vertices  # so that their vertices are known
            elif before is not None and finished is not None:
                finished = self._moved_on(state, before, finished, cages)
            if shift is None or finished is None:
                break
            # The offset of a handle may have turned with it: then its cages have another target.
            last, shift = shift, finished.shifted(self._surface(state, cages))
            if np.array_equal(shift[deformer.handle], last[deformer.handle]):
                break
        pose = Pose(cages, targets, finished)
        self._current = pose
        self._aim = aim
        is_passing = is_passing and self._mesh.n_vertices > sizes.SCALED_VOLUME
        if is_passing and finished is None and cages is solution.cage_vertices:
            frozen(solution.vertices)
            self._evaluated = pose, state.options.lids, solution.vertices, cache(solution.volume)
            self._is_passing = True
        x, change = self._evaluate(state, pose)
        solution = replace(solution, vertices=x, volume=change)
        if aim is None:
            return pose, solution
        errors = partial(self._errors, state, deformer, wanted, self._beside(state))
        return pose, replace(solution, errors=errors)

    def finish(self, state: State, pose: Pose) -> Finish:
        """Return the finish of *pose* of *state*, for another thread or for this one.

        Raises
        ------
        ConstraintError
            If there are neither handles nor fixed vertices.
        """
        if not (state.handles or len(state.fixed)):
            raise ConstraintError("there are no handles to finish the pose for; add a handle")
        shift = self._shift(state)
        is_shifted = shift is not None and bool(shift[state.fixed].any())
        deformer = self._held(state, state.fixed_at) if is_shifted else self._constrain(state)
        is_further = pose.is_finished and state.locality is None
        if is_further or state.locality is not None:
            x = self.vertices(state, pose)
        else:
            x = self._surface(state, pose.cage_vertices)
        if state.locality is not None:
            at_press = self._known_surface(state, state.locality)
            deformer = localised(deformer, state.locality, at_press)
        wanted, (_, volume) = _stacked(pose.targets), self._enclosed(state)
        beside = self._beside(state)
        rest, faces = self._mesh.vertices, self._mesh.faces
        start = Solution(
            vertices=x,
            cage_vertices=pose.cage_vertices,
            steps=0,
            status=Status.STEP_LIMIT if is_further else Status.CONVERGED,
            merits=(),
            errors=partial(self._errors, state, deformer, wanted, beside),
            volume=partial(volume.relative, x),
            region_volumes=lambda _: np.empty(0),
            crossed=partial(new_crossings, rest=rest, faces=faces),
            folded=partial(turned_over, rest=rest, faces=faces),
            unfinished=self._surface(state, pose.cage_vertices) if is_further else None,
        )
        aims = np.array(wanted)
        if state.locality is not None and beside is not None:  # where the deformer differs
            point = state.locality.point
            own = point.at(at_press) - at_press[point.vertex]
            aims[deformer.handle == point.vertex] += beside - own
        return Finish(deformer.copy(), pose, aims, shift, start)

    def accept(self, before: Pose, after: Pose) -> None:
        """Continue from *after*, which has the same cages as *before* and is finished."""
        if self._current is before:
            self._current = after

    def free_form(self, state: State, cage_vertices: Sequence[FloatArray]) -> Pose:
        """Return the pose with the given *cage_vertices* (m_r, 3), corrected to preserve volume.

        If the options preserve volume, all cages move along the gradients of their own volumes
        until the mesh has its rest volume.  The targets of handles become their positions.

        Raises
        ------
        ConstraintError
            If the correction moves the cages too far away.
        """
        p = tuple(cage_vertices)
        if state.options.preserve_volume or state.options.preserve_region_volumes:
            p = self._restore_volume(state, p)
        for vertices in p:
            frozen(vertices)
        before = state.pose
        finished = None if before is None else before.finished
        if before is not None and finished is not None:
            finished = self._moved_on(state, before, finished, p)
        pose = Pose(p, MappingProxyType({}), finished)
        x, change = self._evaluate(state, pose)
        pose = replace(pose, targets=targets_at(state.handles, x))
        self._evaluated = pose, state.options.lids, x, change  # targets do not change the vertices
        return pose

    def carried(
        self, state: State, x: FloatArray, progress: Progress | None = None
    ) -> tuple[FloatArray, ...]:
        """Return the cage vertices (m_r, 3) of *state* whose mesh is nearest to *x* (n, 3).

        In the sense of least squares over some thousand vertices, of which fixed ones and handles
        count most.  It binds *state*, and may run in another thread, as `bind`.
        """
        deformer = self.bind(state, progress)
        held = np.concatenate([state.fixed, state.handle])
        every = np.arange(self._mesh.n_vertices)
        some = [each[:: max(1, len(each) // _CARRIED)] for each in (every, held)]
        ids, counts = np.concatenate(some), [len(each) for each in some]
        weights = np.repeat([1.0, _HELD], counts)[:, None]
        rows = weights * deformer.subspace.at(ids)
        moved = rows.T @ (weights * (x - self._mesh.vertices)[ids])
        normal = rows.T @ rows
        normal[np.diag_indices_from(normal)] += _DAMPING * np.trace(normal) / len(normal)
        rest = np.concatenate([cage.vertices for cage in state.cages])
        p = rest + np.linalg.solve(normal, moved)
        return tuple(p[columns] for columns in deformer.subspace.columns)

    def _restore_volume(
        self, state: State, cage_vertices: tuple[FloatArray, ...]
    ) -> tuple[FloatArray, ...]:
        _, volume = self._enclosed(state)
        if not volume.has_volume:
            return cage_vertices
        pairs = zip(cage_vertices, state.cages, strict=True)
        outward = np.concatenate([volume_gradient(p, cage.faces) for p, cage in pairs])
        outward /= max(np.abs(outward).max(), np.finfo(float).tiny)
        deformer = self.bind(state)
        path = np.hstack([deformer.surface(cage_vertices), deformer.subspace.map(outward)])
        p = np.concatenate(cage_vertices) + volume.exact_step(path) * outward
        require_near(self._mesh, p, "cage vertices that preserve the volume")
        return tuple(p[columns] for columns in deformer.subspace.columns)

    def _constrain(self, state: State) -> Deformer:
        """Return a deformer with the fixed vertices, handles and volume options of *state*."""
        bound, shift = self.bind(state), self._shift(state)
        fixed_at = state.fixed_at
        if shift is not None and shift[state.fixed].any():
            fixed_at = _less(_fixed_at(self._mesh, state), shift, state.fixed)
        if self._constrained is not None:
            other, constraints, places, deformer = self._constrained
            is_same = places is fixed_at or (
                places is not None and fixed_at is not None and np.array_equal(places, fixed_at)
            )
            if other is bound and is_same and _same_constraints(state, constraints):
                return deformer
        deformer = self._held(state, fixed_at)
        constraints = State(
            fixed=state.fixed,
            handles=state.handles,
            options=state.options,
            fixed_at=state.fixed_at,
        )
        self._constrained = bound, constraints, fixed_at, deformer
        self._current = None
        return deformer

    def _held(self, state: State, fixed_at: FloatArray | None) -> Deformer:
        """Return a deformer with the constraints of *state*, its fixed vertices at *fixed_at*."""
        return self.bind(state).hold(
            fixed=state.fixed,
            handle=state.handle,
            fixed_at=fixed_at,
            preserve_volume=state.options.preserve_volume,
            preserve_region_volumes=state.options.preserve_region_volumes,
            lids=state.options.lids,
            avoid_contact=state.options.avoid_contact,
        )

    def _shift(self, state: State) -> FloatArray | None:
        """Return `Finished.shifted` (n, 3) of the pose; None if it is not finished."""
        pose = state.pose
        if pose is None or pose.finished is None:
            return None
        return pose.finished.shifted(self._surface(state, pose.cage_vertices))

    def _moved_on(
        self, state: State, before: Pose, finished: Finished, cages: tuple[FloatArray, ...]
    ) -> Finished:
        """Return *finished*, of the pose *before*, for other *cages*."""
        own = partial(self._surface, state), partial(self._rotations, state)
        return moved_on(
            finished,
            before.cage_vertices,
            cages,
            Surfaces(self._mesh, *own),
            fixed=state.fixed,
            handle=state.handle,
            constraints=self._constrain(state).preserved_volumes,
        )

    def _rotations(self, state: State, cages: tuple[FloatArray, ...]) -> FloatArray:
        """Return `Deformer.rotations`; the last ones are kept."""
        own = [each for each in self._turned if each[0] is cages]
        own = own or [(cages, self.bind(state).rotations(cages))]
        others = (each for each in self._turned if each[0] is not cages)
        self._turned = (*own, *others)[:_MAX_TURNED]
        return own[0][1]

    def _surface(self, state: State, cage_vertices: tuple[FloatArray, ...]) -> FloatArray:
        """Return W~ p, (n, 3); the last one is kept."""
        if self._mapped[0] is not cage_vertices:
            self._mapped = cage_vertices, self.bind(state).surface(cage_vertices)
        return self._mapped[1]

    def _known_surface(self, state: State, locality: Locality) -> FloatArray:
        """Return W~ p at the press of a pull, (n, 3), which is usually the pose that is shown."""
        known, cages = self._evaluated, locality.cage_vertices
        if known and known[0].cage_vertices is cages and known[0].finished is None:
            return known[2]
        return self._surface(state, cages)

    def _beside(self, state: State) -> FloatArray | None:
        """Return where the pulled point was at the press, from its handle's vertex, (3,).

        On the mesh that was shown.  None if no point of a face is pulled.
        """
        pose, locality = state.pose, state.locality
        if pose is None or locality is None or locality.point.is_vertex:
            return None
        point = locality.point
        if self._pressed is None or self._pressed[0] is not locality:
            if pose.finished is None:
                x = self._known_surface(state, locality)
            elif pose.cage_vertices is locality.cage_vertices:
                x = pose.finished.vertices
            else:
                x = self._moved_on(state, pose, pose.finished, locality.cage_vertices).vertices
            self._pressed = locality, point.at(x) - x[point.vertex]
        return self._pressed[1]

    def _errors(
        self,
        state: State,
        deformer: Deformer,
        wanted: FloatArray,
        beside: FloatArray | None,
        x: FloatArray,
    ) -> tuple[float, ...]:
        """Return `Solution.handle_error` and `fixed_error` of the mesh at *x* (n, 3)."""
        places = np.array(wanted)
        if beside is not None:
            assert state.locality is not None
            point = state.locality.point
            places[deformer.handle == point.vertex] += x[point.vertex] + beside - point.at(x)
        ids, at = (deformer.handle, deformer.fixed), (places, _fixed_at(self._mesh, state))
        return errors_at(ids, at, self._mesh.diagonal, x)

    def _localise(self, state: State, constrained: Deformer) -> Deformer:
        """Return a deformer that keeps what the last pull of *state* does not reach, if any."""
        locality = state.locality
        if locality is None:
            return constrained
        if self._local is not None and self._local[:2] == (constrained, locality):
            return self._local[2]
        deformer = localised(constrained, locality, self._known_surface(state, locality))
        self._local = constrained, locality, deformer
        self._current = None
        return deformer

    def _start_from(self, state: State, deformer: Deformer) -> None:
        """Set *deformer* to the pose of *state*, unless it is there already."""
        pose = state.pose
        if pose is not None and self._current is pose and self._used is deformer:
            return
        self._used, self._aim = deformer, None
        deformer.reset()
        # Every step of the solver meets the constraints, so its starting pose must do so too.
        if pose is not None and self._meets_constraints(state, pose, deformer):
            places = _less(_stacked(pose.targets), self._shift(state), deformer.handle)
            deformer.resume(pose.cage_vertices, places)

    def _meets_constraints(self, state: State, pose: Pose, deformer: Deformer) -> bool:
        is_plain = pose.finished is None
        x = self.vertices(state, pose) if is_plain else self._surface(state, pose.cage_vertices)
        return all(abs(v.relative(x)) <= _VOLUME_TOLERANCE for v in deformer.preserved_volumes)

    def _evaluate(self, state: State, pose: Pose) -> tuple[FloatArray, Callable[[], float]]:
        """Return x = W~ p, or the finished mesh, and a function that returns its volume change."""
        lids, before = state.options.lids, self._evaluated
        same = before is not None and before[0].is_same_surface(pose)
        if before is None or not same or before[1] is not lids:
            own = None if pose.finished is None else pose.finished.vertices
            x = before[2] if before and same else own
            x = self.bind(state).surface(pose.cage_vertices) if x is None else x
            frozen(x)
            _, volume = self._enclosed(state)
            before = self._evaluated = pose, lids, x, cache(partial(volume.relative, x))
            self._is_passing = False
        return before[2:]


def _stacked(targets: Mapping[str, FloatArray]) -> FloatArray:
    return np.concatenate([_NO_TARGETS, *targets.values()])


def _less(points: FloatArray, shift: FloatArray | None, ids: IntArray) -> FloatArray:
    """Return *points* (k, 3) of the vertices *ids* (k,), less their *shift* if there is any."""
    return points if shift is None else points - shift[ids]


def _fixed_at(mesh: Mesh, state: State) -> FloatArray:
    return mesh.vertices[state.fixed] if state.fixed_at is None else state.fixed_at


def _same_binding(a: State, b: State) -> bool:
    """Return whether both have the same bound deformer."""
    same = all(getattr(a.options, name) == getattr(b.options, name) for name in _BINDING_OPTIONS)
    return a.regions is b.regions and a.cages == b.cages and same


def _same_constraints(a: State, b: State) -> bool:
    """Return whether both have the same fixed vertices, handles and volume options."""
    names = _CONSTRAINT_OPTIONS
    same = all(getattr(a.options, name) == getattr(b.options, name) for name in names)
    return same and not a.changes(b) & Change.CONSTRAINTS
