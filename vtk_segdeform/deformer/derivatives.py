"""Derivatives of a converged pose, by targets, volumes and stiffness.

The cages p of a solve are a minimum (`solver.stationary`), and the mesh is x = W~ q, with

    q = p                          if its volumes are those of the steps
    q = p + sum_k t_k Z_k(p)       if these are of a coarse surface: t from g(W~ q) = 0
    q = p                          if it was scaled; the minimum then keeps the volumes of x itself

Each is differentiated as it is computed, the third up to the last scaling (below 3e-5).  Targets
enter F linearly.  A volume, or the stiffness, changes the shape to keep, or the energy: the
derivatives of F at the pose along it, which need no further solve, are central differences.  The
gradient by the stiffness of every vertex is computed in reverse, `energy.by_stiffness`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, is_number, plain
from ..checks import all_of, shown
from ..energy import Contraction, turning
from ..errors import ArgumentError
from ..solver import (
    CentroidConstraint,
    Curvature,
    Solution,
    SolverOptions,
    StationaryPoint,
    Status,
    VolumeConstraint,
    Volumes,
    half_gradient,
    off_volumes,
    rows_of,
    violations,
)
from .constraints import Constraints, HoldOptions
from .enclosed_volume import EnclosedVolume
from .path import Path
from .stiffness import FactorSlopes, Stiffness
from .volume_goals import VolumeGoal

_STEP = 1e-5  # of a parameter, relative: differences of F, which is smooth, are exact to 1e-9


class Gradient(NamedTuple):
    """The gradient of a function of a pose; see `Deformer.vjp`."""

    targets: FloatArray
    """(k, 3), by the targets."""
    volumes: Mapping[str, float]
    """By the goals of volumes that were asked for."""
    stiffness: FloatArray = np.empty(0)
    """(n,), by the stiffness of every vertex, if it was asked for."""


class _Change(NamedTuple):
    """How a parameter changes what determines a pose, at the pose."""

    slope: FloatArray  # dF, (m, 3)
    off: FloatArray  # dg of the steps, (c,)
    moved: FloatArray  # of q at the same p and t, (m, 3)
    off_mesh: FloatArray  # dg of the mesh, (c,)


@dataclass(frozen=True, eq=False)
class Linearised:
    """The pose of a path, to first order; made by `Linearised.of`."""

    path: Path
    enclosed: EnclosedVolume
    options: HoldOptions

    @classmethod
    def of(
        cls, solution: Solution, path: Path, enclosed: EnclosedVolume, options: HoldOptions
    ) -> Linearised:
        """Return the pose of *path*, which is that of *solution*.

        Raises
        ------
        ArgumentError
            If it has no derivatives; see `Deformer.jvp`.
        """
        contact = path.constraints.contact
        if solution.is_finished:
            raise ArgumentError("a finished solution has no derivatives: pass that of the solve")
        if any(each.along == "surface" for each in options.slides):
            raise ArgumentError("there are no derivatives with slides along a surface")
        if contact is not None and contact.is_active(path.end):
            raise ArgumentError("there are no derivatives while contact is avoided: parts touch")
        found = Status.CONVERGED, Status.MISSED, Status.RIGID_MISSED, Status.CROSSED
        if solution.status not in found:
            raise ArgumentError(f"solution must be converged; it is {solution.status}")
        return cls(path, enclosed, options)

    def motion(
        self,
        targets: FloatArray | None,
        *,
        volumes: Mapping[str, float],
        stiffness: ArrayLike | None,
        now: FloatArray | None,
    ) -> FloatArray:
        """Return `Deformer.jvp`; *now* (n,) is the present stiffness."""
        found = np.zeros(self.path.constraints.problem.mesh.vertices.shape)
        if targets is not None:
            found += self._moved(self._of_targets(targets))
        if not isinstance(volumes, Mapping) or not all(map(is_number, volumes.values())):
            raise ArgumentError(f"volumes must be changes by names; got {shown(volumes)}")
        for name, change in volumes.items():
            unit, at = self._with_volume(name)
            found += change / unit * self._moved(self._of_parameter(at))
        if stiffness is not None:
            found += self._moved(self._of_parameter(self._with_stiffness(stiffness, now)))
        return found

    def gradient(
        self,
        cotangent: FloatArray,
        *,
        volumes: Sequence[str],
        stiffness: bool,
        now: FloatArray | None,
    ) -> Gradient:
        """Return `Deformer.vjp` for *cotangent* (n, 3); *now* (n,) is the present stiffness."""
        v, mu, c, nu = self._loads(cotangent)

        def slope(at: Callable[[float], Constraints]) -> float:
            change = self._of_parameter(at)
            found = -float(np.vdot(v, change.slope) + mu @ change.off)
            if self._is_moved:
                found += float(np.vdot(c, change.moved) - nu @ change.off_mesh)
            return found

        along = {}
        for name in all_of(volumes, str, "volumes"):
            unit, at = self._with_volume(name)
            along[name] = slope(at) / unit
        stiffer = self._by_stiffness(v, c, now) if stiffness else np.empty(0)
        constraints, positions = self.path.constraints, self.path.solver.positions
        by_places = positions.weights[:, None] * (positions.rows @ v)
        found = constraints.places_of_targets.T @ by_places / constraints.problem.frame.size
        if constraints.mirror is not None:
            found = constraints.mirror.adjoint(constraints.handle, constraints.mates, found)
        return Gradient(np.asarray(found), along, stiffer)

    def _by_stiffness(self, v: FloatArray, c: FloatArray, now: FloatArray | None) -> FloatArray:
        """Return the gradient (n,) by the stiffness *now*, with the loads *v* of F and *c* of q."""
        constraints, p = self.path.constraints, self.path.end
        problem = constraints.problem
        self._refuse_local()
        if constraints.rest_cages is not problem.rest_cages:
            raise ArgumentError(
                "there is no gradient by the stiffness while volumes are set, as the shape to keep "
                "grows with them; use jvp for the derivative along a change of the stiffness"
            )
        ahead, beside = p, v
        slope = half_gradient(self.path.solver, p, constraints.places(self.path.targets))
        total = float(np.vdot(v, slope))
        if self._is_moved:  # q contains H^-1 of rows, and dH^-1 = -H^-1 dH H^-1
            moved = np.einsum("k,kma->ma", self._steps, self._directions)
            ahead, total = np.hstack([p, moved]), total + float(np.vdot(c, moved))
            beside = np.hstack([v, *self.path.solver.directions([c])])
        held = np.concatenate([constraints.handle, constraints.fixed])
        squares = np.zeros(len(p))
        if len(held) and problem.regions.components.shape[1] > 1:
            rows, weights, region = problem.loose_samples(held)
            away = np.hstack([p - constraints.rest_cages, ahead[:, 3:]])
            each = weights * np.einsum("ka,ka->k", rows @ away, rows @ beside)
            for r, own in enumerate(problem.subspace.columns):
                trace = np.trace(problem.energy.quadratic[own, own])
                squares[own] = each[region == r].sum() / trace
        rotations, twists = turning(problem.energy, p, v)
        contraction = Contraction(ahead, beside, squares, rotations, twists, total)
        found = -problem.binding.by_factors(problem.inputs, contraction)
        return self._factor_slopes(now).adjoint(found)

    def _factor_slopes(self, now: FloatArray | None) -> FactorSlopes:
        """Return how the factors of the energy change with the stiffness, which is *now* (n,)."""
        n = self.path.constraints.problem.mesh.n_vertices
        now = np.ones(n) if now is None else np.asarray(now, dtype=np.float64)
        return FactorSlopes.of(now, self.options.mirror)

    @property
    def _volumes(self) -> Volumes:
        """Those of the steps that hold."""
        return self.path.solver.volumes

    def _on_mesh(self, constraints: Constraints) -> list[VolumeConstraint]:
        every = constraints.preserved.constraints
        return [every[k] for k in self.path.active_volumes]

    @cached_property
    def _rows_on_mesh(self) -> FloatArray:
        """The gradients of the volumes of the mesh by q, (c, m, 3)."""
        problem = self.path.constraints.problem
        x = problem.map(self.path.p)
        rows = [
            problem.frame.size * problem.subspace.adjoint(each.gradient(x))
            for each in self._on_mesh(self.path.constraints)
        ]
        return np.reshape(rows, (len(rows), *self.path.p.shape))

    @cached_property
    def _point(self) -> StationaryPoint:
        path = self.path
        is_scaled = path.constraints.preserved.scaled is not None
        exact = self._rows_on_mesh if is_scaled else None
        places = path.constraints.places(path.targets)
        return StationaryPoint.of(path.solver, path.end, places, exact)

    @cached_property
    def _is_moved(self) -> bool:
        """Whether q is another pose than p."""
        preserved, problem = self.path.constraints.preserved, self.path.constraints.problem
        is_coarse = problem.binding.coarse_volume.cells is not None
        return is_coarse and preserved.scaled is None and bool(self._volumes.constraints)

    @cached_property
    def _directions(self) -> FloatArray:
        """Z, (c, m, 3)."""
        return np.array(self.path.solver.directions(self._point.rows))

    @cached_property
    def _steps(self) -> FloatArray:
        """t, (c,)."""
        moved = (self.path.p - self.path.end).ravel()
        columns = self._directions.reshape(len(self._directions), -1).T
        return np.asarray(np.linalg.lstsq(columns, moved, rcond=None)[0])

    @cached_property
    def _turned(self) -> Curvature:
        """sum_k t_k d2g_k."""
        return Curvature.of(self._volumes, self.path.end, self._steps)

    @cached_property
    def _responses(self) -> FloatArray:
        """(G Z)^-1 of the volumes of the mesh, (c, c)."""
        return np.asarray(
            np.linalg.pinv(np.einsum("kma,lma->kl", self._rows_on_mesh, self._directions))
        )

    def _moved(self, change: _Change) -> FloatArray:
        """Return dx (n, 3) of a parameter with this *change*."""
        dp = self._point.moved(-change.slope, -change.off)
        if self._is_moved:
            dp = dp + self._of_directions(dp) + change.moved
            off = change.off_mesh + np.einsum("kma,ma->k", self._rows_on_mesh, dp)
            dp = dp - np.einsum("k,kma->ma", self._responses @ off, self._directions)
        problem = self.path.constraints.problem
        return np.asarray(problem.frame.size * problem.subspace.map(dp))

    def _of_targets(self, tangent: FloatArray) -> _Change:
        """Return how a motion *tangent* (k, 3) of the targets changes what determines the pose."""
        constraints, positions = self.path.constraints, self.path.solver.positions
        rest = constraints.problem.mesh.vertices[constraints.handle[: len(tangent)]]
        moved = constraints.goal(rest + tangent) - constraints.goal(rest)
        places = constraints.places_of_targets @ moved
        slope = -positions.rows.T @ (positions.weights[:, None] * places)
        none = np.zeros(len(self._volumes.constraints))
        return _Change(slope, none, np.zeros_like(slope), none)

    def _of_parameter(self, at: Callable[[float], Constraints]) -> _Change:
        """Return the change by a parameter, for *at* its steps of which the constraints are known.

        *at* is a function of the relative step of the parameter; the change is by the step.
        """
        ahead, back = (self._state(at(sign * _STEP)) for sign in (1.0, -1.0))
        return _Change(*((a - b) / (2.0 * _STEP) for a, b in zip(ahead, back, strict=True)))

    def _with_volume(self, name: str) -> tuple[float, Callable[[float], Constraints]]:
        """Return the unit of a volume, and the constraints as a function of its relative step."""
        held = self._on_mesh(self.path.constraints)
        found = next((each for each in held if each.name == name), None)
        if found is None or found.bound or self._is_local:
            raise ArgumentError(f"there is no volume {shown(name)} that is set; see volumes")
        target = found.target
        unit = target if found.is_cubic else found.size  # centroids may be at 0
        if isinstance(found, CentroidConstraint):
            target += found.origin

        def at(step: float) -> Constraints:
            goals = {**self.options.goals, name: VolumeGoal(None, target + step * unit)}
            return self._held(self.enclosed, replace(self.options, goals=goals))

        return unit, at

    def _with_stiffness(
        self, change: ArrayLike, now: FloatArray | None
    ) -> Callable[[float], Constraints]:
        """Return the constraints as a function of the step along a *change* (n,) of stiffness."""
        problem = self.path.constraints.problem
        n = problem.mesh.n_vertices
        given = plain(change, "stiffness")
        if given.shape != (n,) or given.dtype.kind not in "fiu" or not np.isfinite(given).all():
            raise ArgumentError(f"stiffness must be {n} finite numbers; got {shown(change)}")
        self._refuse_local()
        begin = problem.inputs.stiffness or Stiffness(np.ones(n), ())
        slope = self._factor_slopes(now).along(np.asarray(given, dtype=np.float64))

        def at(step: float) -> Constraints:
            stiffness = replace(begin, factors=begin.factors + step * slope)
            other = self.enclosed.problem.stiffened(stiffness)
            return self._held(EnclosedVolume.under(other, self.options.lids), self.options)

        return at

    def _refuse_local(self) -> None:
        """Raise an ArgumentError if the deformer is local."""
        if self._is_local:
            raise ArgumentError("the stiffness of a local deformer has no derivatives")

    @property
    def _is_local(self) -> bool:
        return self.path.constraints.keeps is not None

    def _held(self, enclosed: EnclosedVolume, options: HoldOptions) -> Constraints:
        """Return the constraints with other volumes or *options*."""
        held = self.path.constraints
        given = held.handle[: held.n_given]
        return Constraints.of(
            enclosed, options, fixed=held.fixed, handle=given, places=held.fixed_at
        )

    def _state(self, other: Constraints) -> _Change:
        """Return F, g, q and g of the mesh of *other* constraints, at p, lambda and t."""
        path, point = self.path, self._point
        begun = Path.begin(other, other.rest_cages, path.targets)
        begun.change_volumes(SolverOptions())  # those of the steps follow from those of the mesh
        volumes = begun.solver.volumes
        rows = rows_of(volumes, path.end)
        slope = half_gradient(other.solver, path.end, other.places(path.targets))
        slope = slope + sum(k * row for k, row in zip(point.multipliers, rows, strict=True))
        q, off_mesh = path.end, np.zeros(len(rows))
        if self._is_moved:
            directions = np.array(other.solver.directions(rows))
            q = path.end + np.einsum("k,kma->ma", self._steps, directions)
            off_mesh = violations(self._on_mesh(other), other.problem.map(path.p))
        return _Change(slope, off_volumes(volumes, path.end), q, off_mesh)

    def _loads(
        self, cotangent: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return v and mu of F and g, and the same of q and of the volumes of the mesh."""
        problem = self.path.constraints.problem
        c = problem.frame.size * problem.subspace.adjoint(cotangent)
        nu = np.zeros(len(self._volumes.constraints))
        if not self._is_moved:
            return *self._point.loads(c), c, nu
        nu = self._responses.T @ np.einsum("kma,ma->k", self._directions, c)
        c = c - np.einsum("k,kma->ma", nu, self._rows_on_mesh)
        (moved,) = self.path.solver.directions([c])
        return *self._point.loads(c + self._turned.times(moved)), c, nu

    def _of_directions(self, dp: FloatArray) -> FloatArray:
        """Return sum_k t_k dZ_k for a motion *dp* (m, 3) of the cages."""
        (found,) = self.path.solver.directions([self._turned.times(dp)])
        return found
