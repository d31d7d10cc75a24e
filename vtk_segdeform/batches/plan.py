"""The plan of a batch, meshes times poses, checked and resolved to vertices of each mesh.

    {"meshes": ["limbs/*.ply"],
     "poses": [{"fixed": "z<10%", "handles": [{"select": "z>90%", "rotate": "y,45"}]},
               {"vertex": [0, 0, 1], "to": [0.2, 0, 1]},
               {"volumes": {"whole": "+10%"}},
               {"random": 20, "seed": 7}],
     "refine": false}

A pose has handles, a pull (a vertex) or a number of random poses; see `batch` for all keys.
"""

from __future__ import annotations

import glob
import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arrays import FloatArray, IntArray, as_ids, is_number, is_whole, plain
from ..checks import as_flag, as_path, require_sequence, shown
from ..deformer import Slide
from ..errors import ArgumentError, ConstraintError
from ..files import read_regular
from ..geometry import moved_handles
from ..importing import imported
from ..mesh import Mesh, Role, parse_selection
from ..version import __version__
from .remote import copied, is_url, read_json
from .remote import found as found_at

_SHAPE = {"volumes", "stiffness", "slides", "symmetry"}
_KEYS = {
    "random": {"random", "seed", "degrees"},
    "vertex": {"vertex", "to", "radius", "pins", "locality", "limb", "hinge"} | _SHAPE,
    "handle": {"fixed", "handles", "handle", "targets"} | _SHAPE,
}
_MOST = 1_000_000  # random poses of an entry
_HANDLE = {"select", "matrix", "rotate", "pivot", "translate"}
_SLIDE = {"select", "along", "direction"}
DEGREES = 60.0
"""Largest angle by which a random pose bends a limb, by default."""


class Settings(NamedTuple):
    """The options that all poses of a batch share; see `batch`."""

    n_regions: int | None = None
    n_cage_vertices: int | None = None
    refine: bool = False
    avoid_contact: bool = False
    goals: tuple[tuple[str, Any], ...] = ()
    """All goals for volumes, by name, for the regions."""
    seconds: float = 120.0
    memory: float = 4.0


@dataclass(frozen=True, eq=False)
class Plan:
    """Meshes as they were given, poses with random ones counted, and what they share."""

    meshes: tuple[Any, ...]
    poses: tuple[Mapping[str, Any], ...]
    settings: Settings
    block: int

    @classmethod
    def of(cls, plan: Mapping[str, Any] | str | os.PathLike[str]) -> Plan:
        """Return the checked plan of a mapping or of a JSON file; see `batch`."""
        folder: Path | str = Path()
        if is_url(plan):
            folder, plan = str(plan).rpartition("/")[0], _checked(read_json(str(plan)), str(plan))
        elif not isinstance(plan, Mapping):
            path = as_path(plan, "plan")
            folder, plan = path.parent, _read(path)
        known = {"meshes", "poses", "block", *Settings._fields} - {"goals"}
        _require_known(plan, known, "plan")
        for name in ("meshes", "poses"):
            require_sequence(plan.get(name), f"plan[{name!r}]")
        meshes = [each for given in plan["meshes"] for each in _expanded(given, folder)]
        poses = [one for k, pose in enumerate(plan["poses"]) for one in _counted(pose, k)]
        if not (meshes and poses):
            raise ArgumentError("plan must have at least one mesh and one pose")
        goals = {name: goal for pose in poses for name, goal in _goals(pose).items()}
        settings = Settings(
            n_regions=_whole(plan, "n_regions", 1, None),
            n_cage_vertices=_whole(plan, "n_cage_vertices", 4, None),
            refine=as_flag(plan.get("refine", False), "plan['refine']"),
            avoid_contact=as_flag(plan.get("avoid_contact", False), "plan['avoid_contact']"),
            goals=tuple(sorted(goals.items())),
            seconds=_positive(plan, "seconds", Settings().seconds),
            memory=_positive(plan, "memory", Settings().memory),
        )
        return cls(tuple(meshes), tuple(poses), settings, _whole(plan, "block", 1, 10) or 1)

    def mesh_key(self, mesh: Mesh) -> str:
        """Return a hash of a mesh and of all that its regions and cages depend on."""
        shared = (*self.settings[:2], self.settings.goals)
        return digest(__version__, shared, mesh.vertices, mesh.faces)

    def pose_key(self, mesh_key: str, values: Mapping[str, Any]) -> str:
        """Return a hash of a resolved pose of a mesh and of all that its vertices depend on."""
        return digest(mesh_key, self.settings.refine, self.settings.avoid_contact, values)


class Given:
    """A mesh of a plan as it was given: its name, its mesh, and its poses by vertices."""

    def __init__(self, given: Any, number: int) -> None:
        self.name = f"mesh {number}"
        self._surface: Any = None
        if isinstance(given, Mesh):
            self.mesh = given
            return
        if isinstance(given, str | os.PathLike):
            self.name = os.fspath(given)
        imported("vtk_segdeform.io")  # imports pyvista
        from ..io import surface_of

        with copied(given) if is_url(given) else nullcontext(given) as near:
            self._surface = surface_of(near)
        self.mesh = self._surface.mesh

    def resolved(self, pose: Mapping[str, Any]) -> dict[str, Any]:
        """Return *pose* with numbers of vertices instead of selections, and targets of handles.

        Raises
        ------
        ConstraintError
            If it selects nothing, or vertices that are not there.
        """
        found = dict(pose)
        for name in {"fixed", "pins"} & pose.keys():
            found[name] = self._vertices(pose[name], "fixed")
        if "handles" in pose:
            found["handle"], path = moved_handles(
                found.pop("handles"),
                lambda text: self._vertices(text, "handle"),
                self.mesh.vertices,
                found.get("fixed", np.zeros(0, dtype=np.int64)),
            )
            found["targets"] = path
        elif "handle" in pose:
            ids, targets = self._ids(pose["handle"], "handle"), plain(pose["targets"], "targets")
            if self._surface is not None:
                ids, targets = self._surface.targets_at(ids, targets)
            found["handle"], found["targets"] = ids, [targets]
        if self._surface is not None and is_whole(pose.get("vertex"), 0):
            found["vertex"] = int(self._vertices([int(pose["vertex"])], "handle")[0])
        if pose.get("stiffness") is not None:
            found["stiffness"] = self._stiffness(pose["stiffness"])
        if "slides" in pose:
            found["slides"] = [self._slide(each) for each in pose["slides"]]
        return found

    def _stiffness(self, given: Any) -> FloatArray:
        """Return the stiffness (n,) of the vertices, given for points or by selections."""
        if not isinstance(given, Mapping):
            own = plain(given, "stiffness")
            if self._surface is None:
                return own
            count = self._surface.given.n_points
            if own.shape != (count,):
                raise ConstraintError(f"stiffness must have shape ({count},); got {own.shape}")
            return np.asarray(self._surface.at_vertices(own))
        found = np.ones(self.mesh.n_vertices)
        for selection, times in given.items():
            found[self._vertices(selection, "handle")] = times
        return found

    def _slide(self, given: Any) -> tuple[IntArray, str, Any]:
        """Return the vertices of a slide, and the other arguments of `Slide`."""
        if isinstance(given, Slide):
            return self._vertices(given.vertices, "handle"), given.along, given.direction
        kind = {"select": given} if isinstance(given, str) else given
        vertices = self._vertices(kind["select"], "handle")
        return vertices, kind.get("along", "plane"), kind.get("direction")

    def _vertices(self, selection: Any, role: Role) -> IntArray:
        ids = self._ids(selection, role)
        return ids if self._surface is None else np.asarray(self._surface.vertices_at(ids))

    def _ids(self, selection: Any, role: Role) -> IntArray:
        """Return the given points (k,) that a text selects, or that are numbers or a mask."""
        points, arrays = self.mesh.vertices, None
        if self._surface is not None:
            points = self._surface.at_points(points)
            arrays = self._surface.given.point_data
        if isinstance(selection, str):
            return parse_selection(selection, points, point_arrays=arrays, role=role)
        return as_ids(selection, len(points), role)


def digest(*parts: Any) -> str:
    """Return 32 hexadecimal digits that are equal exactly for equal numbers, texts and arrays."""
    seen = hashlib.blake2b(digest_size=16)
    for piece in _pieces(parts):
        seen.update(piece)
    return seen.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    if isinstance(value, Mapping):
        yield from _pieces(sorted(value.items()))
    elif isinstance(value, list | tuple):
        yield f"({len(value)}".encode()
        for each in value:
            yield from _pieces(each)
    elif isinstance(value, np.ndarray):
        yield repr((value.shape, value.dtype.str)).encode()
        yield np.ascontiguousarray(value).tobytes()
    else:
        yield f"{type(value).__name__}{value!r}".encode()


def _read(path: Path) -> Mapping[str, Any]:
    try:
        found = json.loads(read_regular(path))
    except ValueError as fault:  # no JSON, or no text
        raise ArgumentError(f"plan {path} is no JSON: {fault}") from None
    return _checked(found, path)


def _checked(found: Any, path: Path | str) -> Mapping[str, Any]:
    if not isinstance(found, dict):
        raise ArgumentError(f"plan {path} must have meshes and poses; got {shown(found)}")
    return found


def _expanded(given: Any, folder: Path | str) -> list[Any]:
    """Return the files that a path, a URL or a pattern names, sorted; anything else as it is.

    Names in a plan that is elsewhere are relative to its *folder*.
    """
    if not isinstance(given, str | os.PathLike):
        return [given]
    if is_url(given) or isinstance(folder, str):
        url = str(given) if is_url(given) else f"{folder}/{os.fspath(given)}"
        if urls := found_at(url):
            return urls
        raise ArgumentError(f"plan['meshes'] must name files; there is none called {url}")
    path = folder / as_path(given, "plan['meshes']")
    if path.exists():
        return [path]
    if found := sorted(glob.glob(str(path), recursive=True)):
        return [Path(each) for each in found]
    raise ArgumentError(f"plan['meshes'] must name files; there is none called {path}")


def _counted(pose: Any, number: int) -> Iterator[Mapping[str, Any]]:
    """Yield a checked pose of a plan; of random ones each, by its number."""
    name = f"plan['poses'][{number}]"
    if not isinstance(pose, Mapping):
        raise ArgumentError(f"{name} must be a mapping; got {shown(pose)}")
    kind = next((kind for kind in ("random", "vertex") if kind in pose), "handle")
    _require_known(pose, _KEYS[kind], name)
    for key, other in (("vertex", "to"), ("handle", "targets"), ("targets", "handle")):
        if key in pose and other not in pose:
            raise ConstraintError(f"{name} must have {other!r} together with {key!r}")
    if kind == "random":
        count, seed = pose["random"], pose.get("seed", 0)
        degrees = pose.get("degrees", DEGREES)
        if not (is_whole(count, 1, _MOST) and is_whole(seed, 0) and is_number(degrees, 0.0)):
            raise ArgumentError(
                f"{name} must have 1 to {_MOST:,} random poses, and a seed and degrees of 0 or "
                f"more; got {shown(dict(pose))}"
            )
        for k in range(int(count)):
            yield {"number": k, "seed": int(seed), "degrees": float(degrees)}
        return
    pose = _with_checked_shape(pose, name)
    if kind == "handle":
        handles = pose.get("handles", [])
        require_sequence(handles, f"{name}['handles']")
        for handle in handles:
            if not isinstance(handle, Mapping) or "select" not in handle:
                raise ConstraintError(f"a handle of {name} must have 'select'; got {shown(handle)}")
            _require_known(handle, _HANDLE, f"a handle of {name}")
        if not (handles or "handle" in pose or _goals(pose)):
            raise ConstraintError(f"{name} must have handles, a vertex to pull, or volumes")
    yield pose


def _with_checked_shape(pose: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return *pose* with its stiffness by selections as numbers, if that and slides are valid."""
    stiffness, slides = pose.get("stiffness"), pose.get("slides", [])
    require_sequence(slides, f"{name}['slides']")
    for each in slides:
        if isinstance(each, Mapping) and "select" in each:
            _require_known(each, _SLIDE, f"a slide of {name}")
        elif not isinstance(each, str | Slide):
            raise ConstraintError(f"a slide of {name} must have 'select'; got {shown(each)}")
    if not isinstance(stiffness, Mapping):
        return pose
    found = {}
    for selection, times in stiffness.items():
        try:
            found[selection] = float(times)
        except (TypeError, ValueError):
            found[selection] = math.nan
        if not (isinstance(selection, str) and found[selection] > 0.0):
            raise ConstraintError(
                f"the stiffness of {name} must be selections, each with how many times stiffer "
                f'it is, or "inf"; got {shown(times)} for {shown(selection)}'
            )
    return {**pose, "stiffness": found}


def _goals(pose: Mapping[str, Any]) -> Mapping[str, Any]:
    goals = pose.get("volumes") or {}
    if not isinstance(goals, Mapping) or not all(isinstance(name, str) for name in goals):
        raise ConstraintError(f"volumes must be goals by name; got {shown(goals)}")
    return goals


def _require_known(given: Mapping[str, Any], known: set[str], name: str) -> None:
    if unknown := sorted(str(key) for key in given if key not in known):
        allowed = ", ".join(sorted(known))
        raise ArgumentError(f"{name} has {shown(unknown[0])}; it may have {allowed}")


def _whole(plan: Mapping[str, Any], name: str, least: int, default: int | None) -> int | None:
    value = plan.get(name, default)
    if value is None or is_whole(value, least):
        return None if value is None else int(value)
    raise ArgumentError(f"plan[{name!r}] must be a whole number, {least} or more")


def _positive(plan: Mapping[str, Any], name: str, default: float) -> float:
    value = plan.get(name, default)
    if is_number(value) and value > 0.0:
        return float(value)
    raise ArgumentError(f"plan[{name!r}] must be a positive number; got {shown(value)}")
