"""The volume that a mesh encloses, with its lids if it is open, and what of it is preserved."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..geometry import Lids, lids_of
from ..solver import (
    Bodies,
    ScaledSurface,
    VolumeConstraint,
    Volumes,
    region_volumes,
    total_volume,
)
from .problem import Problem

_NONE = np.zeros(0, dtype=np.int64)


class Preserved(NamedTuple):
    """The volumes to preserve; the same for all handles on the same bodies."""

    constraints: tuple[VolumeConstraint, ...]
    """On the mesh."""
    volumes: Volumes
    """On the surface of the steps."""
    scaled: ScaledSurface | None
    """If poses are scaled to their exact volume."""


@dataclass(frozen=True, eq=False)
class EnclosedVolume:
    """The volume of a problem's mesh under some lids; made by `EnclosedVolume.under`."""

    problem: Problem
    lids: Lids
    total: VolumeConstraint
    _known: dict[bytes | bool, Preserved] = field(default_factory=dict, repr=False)

    @classmethod
    def under(cls, problem: Problem, lids: bool | None) -> EnclosedVolume:
        """Return the volume under the *lids* of `Deformer`."""
        found = lids_of(problem.rest_pose, lids)
        return cls(problem, found, total_volume(problem.rest_pose, found))

    def preserved(self, handle: IntArray, *, whole: bool, by_region: bool) -> Preserved:
        """Return the volumes to preserve: of the *whole*, body by body, or *by_region*.

        Small bodies have one of their own if vertices of the *handle* (k,) move them.
        """
        by_region = self.total.has_volume and by_region
        whole = self.total.has_volume and whole and not by_region
        numbers = self._bodies.numbers(handle) if whole else _NONE
        key = numbers.tobytes() if whole else by_region
        if (found := self._known.get(key)) is None:
            problem = self.problem
            preserved = self.regions if by_region else ()
            if whole:
                preserved = self._bodies.constraints(numbers)
            coarse, scaled = problem.binding.coarse_volume, None
            volumes = coarse.volumes(preserved, problem.rest.vertices)
            is_large = problem.mesh.n_vertices > sizes.SCALED_VOLUME and coarse.cells is not None
            if whole and is_large:
                body, rest = numbers[problem.mesh.components], problem.rest_pose.vertices
                scaled = ScaledSurface.of(problem.subspace, rest, preserved, body)
            found = self._known[key] = Preserved(preserved, volumes, scaled)
        return found

    def changes_of_regions(self, x: FloatArray) -> FloatArray:
        """Return the relative change of the volume of each region in the pose *x* (n, 3)."""
        return np.array([each.relative(x) for each in self.regions])

    @cached_property
    def regions(self) -> tuple[VolumeConstraint, ...]:
        """The volume of each region."""
        return region_volumes(self.problem.rest_pose, self.problem.regions.labels, self.lids)

    @cached_property
    def _bodies(self) -> Bodies:
        return Bodies(self.problem.rest_pose, self.total, self.lids)
