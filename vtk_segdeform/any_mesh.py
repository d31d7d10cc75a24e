"""`deform`, `pull` and `segment` of whatever holds a surface, or an inside.

    solution = pull("horse.ply", vertex, to)     a path, or what any library calls a mesh
    solution.mesh                                the same, deformed
    solution.volume_change, solution.status      the numbers

Vertices are numbered as in what is given, also where several of its points are one vertex of the
mesh that is deformed, at a seam.
"""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import (
    TYPE_CHECKING,
    Any,
    Concatenate,
    Generic,
    ParamSpec,
    Protocol,
    TypeAlias,
    TypeVar,
    overload,
)

import numpy as np
from numpy.typing import ArrayLike

from . import deformer, regions
from .arrays import FloatArray, IntArray, as_ids, is_whole, plain
from .checks import all_of
from .deformer import Slide
from .errors import ConstraintError
from .importing import imported
from .mesh import Mesh
from .progress import Progress, part
from .regions import Regions
from .solver import Solution

if TYPE_CHECKING:
    import pyvista as pv

    from .inside import VolumeMesh, VolumePose
    from .io import Surface


class LikeTrimesh(Protocol):
    """A ``trimesh.Trimesh``."""

    @property
    def vertex_attributes(self) -> Any:
        """Arrays of its vertices."""

    @property
    def face_attributes(self) -> Any:
        """Arrays of its faces."""


class LikeMeshio(Protocol):
    """A ``meshio.Mesh``."""

    @property
    def cell_sets(self) -> Any:
        """Its named groups of cells."""


_P = ParamSpec("_P")
_M = TypeVar("_M")
_Same = TypeVar(
    "_Same", bound="Mesh | pv.PolyData | pv.UnstructuredGrid | LikeTrimesh | LikeMeshio"
)
AsPolyData: TypeAlias = "str | os.PathLike[str] | Surface | pv.MultiBlock"
_NAMES = ("__name__", "__qualname__", "__doc__", "__annotations__")  # pickles need our own module
Pair: TypeAlias = tuple[ArrayLike, ArrayLike]
AnyMesh: TypeAlias = (
    "Mesh | pv.PolyData | pv.UnstructuredGrid | LikeTrimesh | LikeMeshio | AsPolyData | Pair"
)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Deformed(Solution, Generic[_M]):
    """A `Solution`, and what was given, in its pose."""

    mesh: _M
    """What was given, deformed: of the same type, with the same arrays, in the same order.  It is a
    PolyData if a path, a `Surface`, a grid of surface cells or a MultiBlock was given; of a path of
    a volume mesh it is a grid, or of .msh and .mesh a ``meshio.Mesh``."""
    inside: VolumePose | None = None
    """Of a volume mesh, how good its cells are; some may be inverted."""


class _Solves(Protocol[_P]):
    @overload
    def __call__(
        self, mesh: AsPolyData, *args: _P.args, **kwargs: _P.kwargs
    ) -> Deformed[pv.PolyData]: ...
    @overload
    def __call__(
        self, mesh: Pair, *args: _P.args, **kwargs: _P.kwargs
    ) -> Deformed[tuple[FloatArray, IntArray]]: ...
    @overload
    def __call__(self, mesh: _Same, *args: _P.args, **kwargs: _P.kwargs) -> Deformed[_Same]: ...


class _Segments(Protocol[_P]):
    def __call__(
        self,
        mesh: AnyMesh,
        *args: _P.args,
        **kwargs: _P.kwargs,
    ) -> Regions: ...


_FOLLOWS = 0.8  # of the progress bar, where the surface is solved


def _called(
    function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> tuple[Any, Callable[[FloatArray], tuple[Any, VolumePose | None]]]:
    """Return the result of *function* for any mesh, and what gives that mesh other vertices."""
    arguments = inspect.signature(function).bind(*args, **kwargs).arguments
    mesh = arguments.pop("mesh")
    if isinstance(mesh, Mesh):
        return function(mesh, **arguments), lambda vertices: (mesh.with_vertices(vertices), None)
    imported("vtk_segdeform.inside")  # imports pyvista
    from .inside import volume_of
    from .io import of_its_kind, surface_of

    volume = volume_of(mesh)
    if volume is None:
        surface = surface_of(mesh)
        result = function(surface.mesh, **_by_vertices(surface, arguments))
        return result, lambda vertices: (of_its_kind(mesh, surface.moved(vertices)), None)
    progress = arguments.get("progress")
    if progress is not None:
        arguments["progress"] = part(progress, 0.0, _FOLLOWS)
    result = function(volume.surface.mesh, **_by_vertices(volume.surface, arguments))
    return result, functools.partial(_with_inside, volume, part(progress, _FOLLOWS, 1.0))


def _with_inside(
    volume: VolumeMesh, progress: Progress | None, vertices: FloatArray
) -> tuple[Any, VolumePose]:
    pose = volume.pose(vertices, progress=progress)
    return volume.moved(pose), pose


def _solving(function: Callable[Concatenate[Mesh, _P], Solution]) -> _Solves[_P]:
    @functools.wraps(function, _NAMES)
    def solve(*args: Any, **kwargs: Any) -> Deformed[Any]:
        solution, moved = _called(function, args, kwargs)
        values = {each.name: getattr(solution, each.name) for each in fields(solution)}
        mesh, inside = moved(solution.vertices)
        return Deformed(**values, mesh=mesh, inside=inside)

    return solve


def _segmenting(function: Callable[Concatenate[Mesh, _P], Regions]) -> _Segments[_P]:
    @functools.wraps(function, _NAMES)
    def segment(*args: Any, **kwargs: Any) -> Regions:
        found: Regions = _called(function, args, kwargs)[0]
        return found

    return segment


def _by_vertices(surface: Surface, arguments: dict[str, Any]) -> dict[str, Any]:
    """Return *arguments* about given points as those about vertices of the mesh."""
    found = dict(arguments)
    n = surface.given.n_points

    def vertices(points: ArrayLike, name: str) -> IntArray:
        return surface.vertices_at(as_ids(points, n, name))

    for name in {"fixed", "pins", "held"} & found.keys():
        found[name] = vertices(found[name], name)
    if {"handle", "targets"} <= found.keys():
        handle = as_ids(found["handle"], n, "handle")
        found["handle"], found["targets"] = surface.targets_at(handle, found["targets"])
        if "through" in found:
            found["through"] = [surface.targets_at(handle, x)[1] for x in found["through"]]
    elif "handle" in found:
        found["handle"] = vertices(found["handle"], "handle")
    if "vertex" in found and is_whole(found["vertex"], 0, n - 1):
        found["vertex"] = _vertex(surface, int(found["vertex"]))
    if found.get("stiffness") is not None:
        stiffness = plain(found["stiffness"], "stiffness")
        if stiffness.shape != (n,):
            raise ConstraintError(f"stiffness must have shape ({n},); got {stiffness.shape}")
        found["stiffness"] = surface.at_vertices(stiffness)
    if isinstance(found.get("parts"), Mapping):
        found["parts"] = {name: vertices(each, "parts") for name, each in found["parts"].items()}
    if "slides" in found:
        found["slides"] = tuple(
            replace(each, vertices=vertices(each.vertices, "vertices of a slide"))
            for each in all_of(found["slides"], Slide, "slides")
        )
    return found


def _vertex(surface: Surface, point: int) -> int:
    if np.isin(point, surface.loose):
        raise ConstraintError(f"vertex must be a point of a face; point {point} is in none")
    return int(surface.vertex_of[point])


deform = _solving(deformer.deform)
pull = _solving(deformer.pull)
segment = _segmenting(regions.segment)
