"""Constraints that are evaluated together, and as functions of the cages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import FloatArray
from ..geometry import Parts, signed_volumes, volume_gradients, volume_slopes_along
from ..subspace import Subspace
from .volume_constraints import VolumeConstraint

Hessian = tuple[FloatArray, FloatArray | None]


class _Group(NamedTuple):
    """Constraints over the same points."""

    first: VolumeConstraint
    cubic: list[int]  # their numbers
    parts: Parts  # of the cubic ones
    others: list[int]


class Together(tuple[VolumeConstraint, ...]):
    """Constraints that are evaluated together: one pass over the faces of all volumes."""

    @cached_property
    def groups(self) -> list[_Group]:
        """The constraints that share their points."""
        found, left = [], list(range(len(self)))
        while left:
            first = self[left[0]]
            some = [k for k in left if self[k].shares_points(first)]
            left = [k for k in left if k not in some]
            cubic = [k for k in some if self[k].is_cubic]
            parts = self[cubic[0]].parts if len(cubic) == 1 else _parts_of(self, cubic)
            found.append(_Group(first, cubic, parts, [k for k in some if k not in cubic]))
        return found

    @cached_property
    def targets(self) -> FloatArray:
        """(c,)."""
        return np.array([each.target for each in self], dtype=np.float64)

    def relative(self, x: FloatArray) -> FloatArray:
        """Return g(x) / size of all, (c,); 0 if nothing is enclosed."""
        sizes = np.array([each.size for each in self], dtype=np.float64)
        return violations(self, x) / np.where(sizes != 0.0, sizes, np.inf)

    def missed(self, x: FloatArray) -> FloatArray:
        """Return how far all are from their bounds, (c,); 0 within them."""
        off = zip(self, self.relative(x).tolist(), strict=True)
        return np.array([each.missed(by) for each, by in off])

    def __reduce__(self) -> tuple[type[Together], tuple[tuple[VolumeConstraint, ...]]]:
        return Together, (tuple(self),)


def _parts_of(constraints: Sequence[VolumeConstraint], which: Sequence[int]) -> Parts:
    return Parts.of([constraints[k].faces for k in which] or [np.zeros((0, 3), dtype=np.int64)])


def together(constraints: Sequence[VolumeConstraint]) -> Together:
    """Return the *constraints*, to be evaluated together."""
    return constraints if isinstance(constraints, Together) else Together(constraints)


def violations(constraints: Sequence[VolumeConstraint], x: FloatArray) -> FloatArray:
    """Return g(x) of all *constraints*, (c,), in units of volume."""
    every, found = together(constraints), np.empty(len(constraints))
    for group in every.groups:
        points = group.first.extended(x)
        found[group.cubic] = signed_volumes(points, group.parts) if group.cubic else 0.0
        for k in group.others:
            found[k] = every[k].value(points)
    return found - every.targets


def gradients(constraints: Sequence[VolumeConstraint], x: FloatArray) -> list[FloatArray]:
    """Return J_g of all *constraints*, (n, 3) each: the derivative of g by each vertex."""
    every, found = together(constraints), [x] * len(constraints)
    for group in every.groups:
        points, extension = group.first.extended(x), group.first.extension
        slopes = volume_gradients(points, group.parts) if group.cubic else []
        slopes += [every[k].slope(points) for k in group.others]
        for k, slope in zip([*group.cubic, *group.others], slopes, strict=True):
            found[k] = slope if extension is None else extension.T @ slope
    return found


def values_along(
    constraints: Sequence[VolumeConstraint], paths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return g (c,) at *paths* (n, 3 + 3 d), and its derivative along each direction, (c, d)."""
    every, found = together(constraints), np.empty((len(constraints), paths.shape[1] // 3))
    for group in every.groups:
        points = group.first.extended(paths)
        if group.cubic:
            found[group.cubic] = volume_slopes_along(points, group.parts)
        for k in group.others:
            found[k] = every[k].along(points)
    return found[:, 0] - every.targets, found[:, 1:]


@dataclass(frozen=True, eq=False)
class Volumes:
    """Constraints as functions of the cage vertices p, on the surface ``surface.map(p)``.

    *hessian*, if given, is a function of p and the multipliers lambda.  It returns G (3, m, m) with
    sum_k lambda_k d^2 g_k / dp_ia dp_jb = sum_c eps_abc G_cij for volumes, and for centroids the
    rest (3m, 3m), axis by axis, or None.
    """

    surface: Subspace
    constraints: Together = field(default_factory=Together)
    hessian: Callable[[FloatArray, FloatArray], Hessian] | None = None

    def rows(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """Return the rows of G = J_g W~, (m, 3) each, where the surface is *x* (n, 3)."""
        return tuple(self.surface.adjoint(slope) for slope in gradients(self.constraints, x))

    def among(self, which: Sequence[int]) -> Volumes:
        """Return those constraints only whose numbers are *which*, in ascending order."""
        if len(which) == len(self.constraints):
            return self
        chosen = Together(self.constraints[k] for k in which)
        whole, count = self.hessian, len(self.constraints)

        def hessian(p: FloatArray, multipliers: FloatArray) -> Hessian:
            assert whole is not None
            every = np.zeros(count)
            every[list(which)] = multipliers
            return whole(p, every)

        return Volumes(self.surface, chosen, hessian if chosen and whole else None)

    def preserved_at(self, p: FloatArray) -> Volumes:
        """Return the constraints with the volumes at cage vertices *p* (m, 3) as their targets."""
        x = self.surface.map(p)
        now = (replace(each, target=each.target + each.violation(x)) for each in self.constraints)
        return replace(self, constraints=Together(now))
