"""The volume that a mesh encloses, with its lids if it is open, and what of it is preserved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import sizes
from ..arrays import BoolArray, FloatArray, IntArray
from ..checks import shown
from ..errors import ConstraintError
from ..geometry import Lids, lids_of
from ..mesh import Mesh
from ..solver import (
    Bodies,
    ScaledSurface,
    Together,
    VolumeConstraint,
    Volumes,
    area_of,
    centroid_of,
    total_volume,
    volumes_by_label,
    with_same_points,
)
from .growth import grown_cages
from .problem import Problem
from .symmetry import Mirror
from .volume_goals import OTHER_MEASURE, VolumeGoal, consistent, with_goal

_NONE = np.zeros(0, dtype=np.int64)
_OVERLAP = 0.5  # share of a part that is its own mirror image, from which it is one part
_MIXING = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
_NO_GOALS: Mapping[str, VolumeGoal | None] = MappingProxyType({})
_NO_PARTS: Mapping[str, BoolArray] = MappingProxyType({})


class Preserved(NamedTuple):
    """The volumes to preserve; the same for all handles on the same bodies."""

    constraints: Together
    """On the mesh."""
    volumes: Volumes
    """On the surface of the steps."""
    scaled: ScaledSurface | None
    """If poses are scaled to their exact volume."""
    problem: Problem
    """With the shape that has these volumes; see `growth`."""
    rest_cages: FloatArray
    """(m, 3): its cages."""
    part: BoolArray | None
    """The vertices around volumes that are set, a mask (n,), if the surface beyond them stays."""


@dataclass(frozen=True, eq=False)
class EnclosedVolume:
    """The volume of a problem's mesh under some lids; made by `EnclosedVolume.under`."""

    problem: Problem
    lids: Lids
    total: VolumeConstraint
    _named: dict[str, VolumeConstraint] = field(default_factory=dict, repr=False)
    _known: dict[tuple[object, ...], Preserved] = field(default_factory=dict, repr=False)

    @classmethod
    def under(cls, problem: Problem, lids: bool | None) -> EnclosedVolume:
        """Return the volume under the *lids* of `Deformer`."""
        found = lids_of(problem.rest_pose, lids)
        return cls(problem, found, total_volume(problem.rest_pose, found))

    def preserved(
        self,
        handle: IntArray,
        *,
        whole: bool,
        by_region: bool,
        goals: Mapping[str, VolumeGoal | None] = _NO_GOALS,
        parts: Mapping[str, BoolArray] = _NO_PARTS,
        mirror: Mirror | None = None,
    ) -> Preserved:
        """Return the volumes to preserve: of the *whole*, body by body, or *by_region*.

        Small bodies have one of their own if vertices of the *handle* (k,) move them.  *goals*
        take precedence; those of *parts* are of the faces around these vertices.  With a *mirror*,
        the mirror images of parts and regions have the same goals.
        """
        if mirror is not None:
            goals, parts = self._mirrored(goals, parts, mirror)
        by_region = self.total.has_volume and by_region
        whole = self.total.has_volume and whole and not by_region
        count = len(self.bodies.volumes) if whole else 0
        named = [k for k in range(count) if f"body {k}" in goals]
        numbers = self.bodies.numbers(handle, named) if whole else _NONE
        key: tuple[object, ...] = numbers.tobytes() if whole else by_region, ()
        if goals:
            key = key[0], tuple(goals.items()), *(mask.tobytes() for mask in parts.values())
        if (found := self._known.get(key)) is not None:
            return found
        problem = self.problem
        preserved = self.regions if by_region else ()
        if whole:
            preserved = self.bodies.constraints(numbers)
        if goals:
            preserved = self._with_goals(preserved, goals, parts)
        coarse, scaled = problem.binding.coarse_volume, None
        volumes = coarse.volumes(preserved, problem.rest.vertices, problem.frame.size)
        is_large = problem.mesh.n_vertices > sizes.SCALED_VOLUME and coarse.cells is not None
        of_component = self.bodies.of_component if whole and is_large else _NONE
        if len(of_component) and of_component.min() >= 0 and not goals:
            body = numbers[of_component][problem.mesh.components]
            rest = problem.rest_pose.vertices
            scaled = ScaledSurface.of(problem.subspace, rest, preserved, body)
        cages = problem.rest_cages
        exact, part = Together(preserved), self._changed(goals, parts)
        if goals and (grown := grown_cages(problem, volumes, exact, part)) is not cages:
            problem, cages = problem.grown(grown), grown
        found = Preserved(exact, volumes, scaled, problem, cages, part)
        for old in [old for old in self._known if goals and old[1]]:
            del self._known[old]  # one set of goals is enough
        self._known[key] = found
        return found

    def _with_goals(
        self,
        kept: tuple[VolumeConstraint, ...],
        goals: Mapping[str, VolumeGoal | None],
        parts: Mapping[str, BoolArray],
    ) -> tuple[VolumeConstraint, ...]:
        """Return the constraints of *goals*, and those *kept* that go with them."""
        kept = () if "whole" in goals else kept
        given = [self.named(name, parts) for name in goals]
        every = with_same_points([*given, *kept])
        around, kept = every[: len(given)], every[len(given) :]
        keys = [_keys_of(each.faces) for each in around if each.is_cubic]
        kept = tuple(
            each
            for each, own in zip(kept, (_keys_of(each.faces) for each in kept), strict=True)
            if not any(np.isin(own, key).all() for key in keys)
        )
        wanted = [
            with_goal(each, name, goal)
            for each, (name, goal) in zip(around, goals.items(), strict=True)
            if goal is not None
        ]
        if not wanted and not kept:
            return ()
        gaining = [each for each in wanted if self._part(each.name, parts) is not None]
        kept = _with_gains(kept, [each for each in gaining if not each.bound])
        return consistent(wanted, kept, self.problem.rest_pose.vertices)

    def _mirrored(
        self,
        goals: Mapping[str, VolumeGoal | None],
        parts: Mapping[str, BoolArray],
        mirror: Mirror,
    ) -> tuple[Mapping[str, VolumeGoal | None], Mapping[str, BoolArray]]:
        """Return *goals* and *parts*, and those of mirror images that overlap the parts little."""
        goals, parts = dict(goals), dict(parts)
        for name, goal in list(goals.items()):
            if (mask := self._part(name, parts)) is None:
                continue
            image = np.zeros_like(mask)
            image[mirror.mates[mask]] = True
            if np.count_nonzero(image & mask) < _OVERLAP * np.count_nonzero(mask):
                parts[f"{name}, mirrored"] = image
                goals[f"{name}, mirrored"] = goal
        return goals, parts

    def _part(self, name: str, parts: Mapping[str, BoolArray]) -> BoolArray | None:
        """Return the vertices of the part or region called *name*, a mask (n,)."""
        kind, number = _split(name)
        labels = self.problem.regions.labels
        return parts.get(name, labels == number if kind == "region" else None)

    def _changed(
        self, goals: Mapping[str, VolumeGoal | None], parts: Mapping[str, BoolArray]
    ) -> BoolArray | None:
        """Return the vertices of the *parts* and regions whose volumes *goals* set, a mask (n,).

        None if there are none, or if bounds or other goals determine the volume of the rest.
        """
        found = np.zeros(self.problem.mesh.n_vertices, dtype=bool)
        for name, goal in goals.items():
            if goal is None:
                continue
            part = self._part(name, parts)
            if part is None or goal.bound:
                return None
            if goal.share != 1.0:
                found |= part
        return found if found.any() else None

    def named(self, name: str, parts: Mapping[str, BoolArray] = _NO_PARTS) -> VolumeConstraint:
        """Return the volume called *name* at rest; see `volume_names`.

        Raises
        ------
        ConstraintError
            If there is none.
        """
        if name not in parts and (other := OTHER_MEASURE.fullmatch(name)):
            return replace(self._other(other[1], other[2] or "whole", parts), name=name)
        kind, number = _split(name)
        found: VolumeConstraint | None = None
        if name in parts:
            by_label = volumes_by_label(
                self.problem.rest_pose, parts[name].astype(np.int64), self.lids
            )
            found = by_label.get(1)
        elif name == "whole":
            found = self.total
        elif kind in ("cavity", "wall") and name == kind and len(self.bodies.cavities) == 1:
            (cavity,) = self.bodies.cavities
            found = self.bodies.component(cavity) if kind == "cavity" else self._wall(cavity)
        elif number is not None:
            found = self._numbered(kind, number)
        if name in parts and (found is None or not found.target):
            raise ConstraintError(f"the part {name!r} encloses no volume under a lid")
        if found is None or not found.target:
            known = ", ".join([*self.volume_names, *parts])
            raise ConstraintError(
                f"there is no volume {shown(name)}; there are {known or 'none'}. Define others as "
                "parts of the surface"
            )
        if found.target < 0.0:
            found = replace(found, faces=found.faces[:, [0, 2, 1]], target=-found.target)
        return replace(found, name=name)

    def _other(self, kind: str, of: str, parts: Mapping[str, BoolArray]) -> VolumeConstraint:
        """Return the area, or a coordinate of the centroid, of what encloses a volume."""
        rest = self.problem.rest_pose
        if kind == "area" and of == "whole":
            return area_of(rest.vertices, rest.faces)
        body = self.named(of, parts)
        if kind == "area":  # without lids
            return area_of(rest.vertices, body.faces[(body.faces < rest.n_vertices).all(axis=1)])
        axis, origin = "xyz".index(kind[-1]), self.problem.frame.origin
        diagonal = self.problem.mesh.diagonal
        return centroid_of(body, rest.vertices, axis, diagonal=diagonal, origin=float(origin[axis]))

    def _wall(self, cavity: int) -> VolumeConstraint:
        """Return the volume of the body around a *cavity*."""
        return self.bodies.body(int(self.bodies.of_component[cavity]))

    def _numbered(self, kind: str, number: int) -> VolumeConstraint | None:
        bodies = self.bodies
        if kind == "body" and number < len(bodies.volumes):
            return bodies.body(number)
        if kind == "component" and number < len(bodies.of_component):
            return bodies.component(number)
        if kind == "cavity" and number < len(bodies.cavities):
            return bodies.component(int(bodies.cavities[number]))
        if kind == "region":
            return self._by_region.get(number)
        return None

    @cached_property
    def volume_names(self) -> tuple[str, ...]:
        """The names of volumes of the mesh.

        "whole"; "body 0", "body 1" ..., if there are several; of hollow bodies "cavity 0" ..., or
        "cavity" and "wall" if there is one only; and "region 0" ... of the regions that enclose
        some.  "component 0" ... are the shells of `Mesh.components`.
        """
        bodies, found = self.bodies, ["whole"] if self.total.has_volume else []
        several = np.flatnonzero(bodies.volumes > 0.0)
        found += [f"body {k}" for k in several] if len(several) > 1 else []
        cavities = len(bodies.cavities)
        found += ["cavity", "wall"] if cavities == 1 else [f"cavity {k}" for k in range(cavities)]
        shells = np.flatnonzero(self.lids.encloses)
        found += [f"component {k}" for k in shells] if len(shells) > 1 else []
        return (*found, *(f"region {k}" for k in self._by_region))

    def volumes(self, x: FloatArray, parts: Mapping[str, BoolArray]) -> dict[str, float]:
        """Return all volumes by name, at the vertices *x* (n, 3)."""
        return {name: self.volume(name, x, parts)[0] for name in (*self.volume_names, *parts)}

    def volume(
        self, name: str, x: FloatArray, parts: Mapping[str, BoolArray]
    ) -> tuple[float, float]:
        """Return a volume at the vertices *x* (n, 3), and (V - V0) / V0."""
        found = self._named.get(name)
        if found is None or name in parts or OTHER_MEASURE.fullmatch(name):
            found = self._named[name] = self.named(name, parts)
        return found.target + found.violation(x), found.relative(x)

    def changes_of_regions(self, x: FloatArray) -> FloatArray:
        """Return the relative change of the volume of each region in the pose *x* (n, 3)."""
        return np.array([each.relative(x) for each in self.regions])

    @cached_property
    def regions(self) -> tuple[VolumeConstraint, ...]:
        """The volume of each region."""
        return tuple(self._by_region.values())

    @cached_property
    def _by_region(self) -> dict[int, VolumeConstraint]:
        return volumes_by_label(self.problem.rest_pose, self.problem.regions.labels, self.lids)

    @cached_property
    def bodies(self) -> Bodies:
        """The bodies of the mesh."""
        return Bodies(self.problem.rest_pose, self.total, self.lids)


def changing_components(
    mesh: Mesh, lids: bool | None, goals: Mapping[str, VolumeGoal | None]
) -> IntArray:
    """Return the components of *mesh* whose own volumes change by *goals*; see `segment`.

    Those of the whole, regions and parts are not theirs alone.
    """
    names = [name for name, goal in goals.items() if goal is not None and goal.share != 1.0]
    names = [name for name in names if _split(name)[0] in ("body", "cavity", "component", "wall")]
    if not names or not mesh.components.any():
        return _NONE
    under = lids_of(mesh, lids)
    bodies, found = Bodies(mesh, total_volume(mesh, under), under), []
    for kind, number in map(_split, names):
        if kind == "body":
            found.append(np.flatnonzero(bodies.of_component == number))
        else:
            each = np.arange(len(bodies.of_component)) if kind == "component" else bodies.cavities
            found.append(each if number is None else each[number : number + 1])
    return np.unique(np.concatenate(found))


def _with_gains(
    kept: tuple[VolumeConstraint, ...], parts: Sequence[VolumeConstraint]
) -> tuple[VolumeConstraint, ...]:
    """Return the volumes *kept*, larger by what *parts* gain that are in them: the rest is kept."""
    if not kept:
        return kept
    gains = np.zeros(len(kept))
    keys = [_keys_of(each.faces) for each in kept]
    for part in parts:
        own = _keys_of(part.faces)
        inside = [np.isin(own, key).mean() > 0.5 for key in keys]
        gains[inside] += part.target - part.target / part.share
    return tuple(
        replace(each, target=each.target + gain, share=1.0 + gain / each.target) if gain else each
        for each, gain in zip(kept, gains.tolist(), strict=True)
    )


def _keys_of(faces: IntArray) -> NDArray[np.uint64]:
    """Return one number for each of *faces* (m, 3), the same for all orders of its corners."""
    corners = np.sort(faces, axis=1).astype(np.uint64)
    return np.asarray(corners @ _MIXING)


def _split(name: str) -> tuple[str, int | None]:
    """Return the kind and the number of a volume: "body", 2 of "body 2"."""
    kind, _, number = name.rpartition(" ")
    return (kind, int(number)) if kind and number.isdecimal() else (name, None)
