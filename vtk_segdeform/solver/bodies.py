"""The bodies of a mesh, each with a volume of its own.

A *body* is a connected component, or, if it has inner walls, each of its chambers
(`geometry.chambers`), with the cavities in it.  The paper has one constraint for the whole mesh;
with several bodies one could then grow while the others shrink.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import BoolArray, FloatArray, IntArray
from ..freezing import Frozen
from ..geometry import Lids, corner_and_edges, outer_components, signed_volume
from ..kernels import in_parallel
from ..mesh import Mesh, inside_points
from .volume_constraints import VolumeConstraint

_MOST_BODIES = 6  # with a constraint of their own, the largest ones: each takes a few solves a step
_LEAST_BODY = 1e-4  # relative to the largest: too small for one of its own
_PIECE = 1 << 15  # faces processed together


@dataclass(frozen=True, eq=False, repr=False)
class Bodies(Frozen):
    """The b bodies of a mesh, and the constraints that preserve the volume of each.

    Parameters
    ----------
    mesh : Mesh
        n vertices, c components.
    whole : VolumeConstraint
        The total volume.
    lids : Lids
        Of the mesh.
    """

    mesh: Mesh
    whole: VolumeConstraint
    lids: Lids

    def numbers(self, moved: IntArray, named: Sequence[int] = ()) -> IntArray:
        """Return the constraint of each body, (b,) int.

        Chambers and the bodies *named* have one of their own, and at most six others: first those
        with vertices among *moved* (k,), then the largest.  The rest share one, and very small ones
        that of the largest.
        """
        count = len(self.volumes)
        sizes = np.abs(self.volumes)
        if np.count_nonzero(sizes) < 2:
            return np.zeros(count, dtype=np.int64)
        is_moved, is_own = np.zeros((2, count), dtype=bool)
        is_moved[self.of_component[self.mesh.components[moved]].clip(0)] = True
        is_own[count - len(self.lids.chambers.inside) :] = True
        is_own[list(named)] = True
        least = _LEAST_BODY * sizes.max()
        others = np.lexsort((-sizes, ~is_moved))
        others = others[~is_own[others]][:_MOST_BODIES]
        is_own[others[sizes[others] >= least]] = True
        alone = np.flatnonzero(is_own)
        alone = alone[np.argsort(-sizes[alone], kind="stable")]
        number = np.full(count, len(alone))
        number[alone] = np.arange(len(alone))
        if sizes[number == len(alone)].sum() < least:
            number[number == len(alone)] = 0
        return number

    def constraints(self, numbers: IntArray) -> tuple[VolumeConstraint, ...]:
        """Return the constraints for the `numbers` of bodies; they add up to the whole."""
        if not numbers.any():
            return (self.whole,) if self.whole.has_volume else ()
        return tuple(self._around(numbers == k) for k in range(int(numbers.max()) + 1))

    def body(self, k: int) -> VolumeConstraint:
        """Return the constraint of the body *k*."""
        return self._around(np.arange(len(self.volumes)) == k)

    def component(self, k: int) -> VolumeConstraint:
        """Return that of the shell of component *k*; the volume of a cavity is negative."""
        return self._enclosed_by(self.whole.faces[self._component == k])

    @property
    def of_component(self) -> IntArray:
        """(c,) int: the body of each component; -1 if it has chambers: they are the last bodies."""
        return self._numbered[0]

    @cached_property
    def volumes(self) -> FloatArray:
        """(b,) float: the signed volumes of the bodies."""
        own, count = self._numbered
        points = self.whole.extended(self.mesh.vertices)
        inside = [signed_volume(points, each) for each in self.lids.chambers.inside]
        every = np.concatenate([self._component_volumes[own >= 0], inside])
        numbers = np.concatenate([own[own >= 0], count + np.arange(len(inside))])
        return np.asarray(np.bincount(numbers, every), dtype=np.float64)

    @cached_property
    def _numbered(self) -> tuple[IntArray, int]:
        """`of_component`, and the number of bodies that are no chambers."""
        with_chambers, bodies = self.lids.with_chambers(self.mesh), self._outer.copy()
        bodies[with_chambers] = -1
        cavities = np.setdiff1d(np.flatnonzero(np.isin(self._outer, with_chambers)), with_chambers)
        around = {int(k): self._chamber_around(k) for k in cavities}
        for k, chamber in around.items():
            bodies[k] = k if chamber is None else -1
        plain = np.unique(bodies[bodies >= 0])
        own = np.where(bodies >= 0, np.searchsorted(plain, bodies), -1)
        for k, chamber in around.items():
            own[k] = own[k] if chamber is None else len(plain) + chamber
        return own, len(plain)

    def _chamber_around(self, component: int) -> int | None:
        """Return the number of the chamber around a *component*; None if it is in none."""
        points = self.whole.extended(self.mesh.vertices)
        one = points[np.flatnonzero(self.mesh.components == component)[:1]]
        chambers = enumerate(self.lids.chambers.inside)
        return next((k for k, each in chambers if inside_points(one, points, each).all()), None)

    @property
    def cavities(self) -> IntArray:
        """(k,) int: the components that are cavities."""
        return np.flatnonzero(self._outer != np.arange(len(self._outer)))

    def _around(self, which: BoolArray) -> VolumeConstraint:
        """Return the constraint of the bodies *which* (b,) together."""
        own, chambers = self.of_component, self.lids.chambers.inside
        plain = (own >= 0) & which[own]
        faces = [self.whole.faces[plain[self._component]]]
        first = len(which) - len(chambers)
        faces += [each for k, each in enumerate(chambers, first) if which[k]]
        return self._enclosed_by(np.concatenate(faces, dtype=faces[0].dtype))

    def _enclosed_by(self, faces: IntArray) -> VolumeConstraint:
        free = replace(self.whole, faces=faces, target=0.0)
        return replace(free, target=free.violation(self.mesh.vertices))

    @cached_property
    def _component(self) -> IntArray:
        """The component of each face of the whole, (m,) int."""
        each = np.concatenate([self.mesh.components, self.lids.component])
        return each[self.whole.faces[:, 0]]

    @cached_property
    def _component_volumes(self) -> FloatArray:
        """The signed volume of each component, (c,)."""
        points, faces = self.whole.extended(self.mesh.vertices), self.whole.faces
        determinants = np.empty(len(faces))

        def work(start: int, stop: int) -> None:
            a, e, f = corner_and_edges(points, faces[start:stop])
            determinants[start:stop] = np.einsum("ij,ij->i", a - points[0], np.cross(e, f))

        in_parallel(work, len(faces), _PIECE)
        sums = np.bincount(self._component, determinants, len(self.lids.encloses))
        return np.asarray(sums / 6.0, dtype=np.float64)

    @cached_property
    def _outer(self) -> IntArray:
        """The component around each cavity, and of other components their own number, (c,) int."""
        volumes = self._component_volumes
        return outer_components(self.mesh.vertices, self.mesh.components, volumes)
