"""Slides: vertices that move along a plane, a line or their own surface at rest, but not off it.

The base of a print stays on its plate while the statue is pulled; a bearing stays on its axis.  The
cages keep them there by a term of the objective (`solver.sliding`), to about 1e-4 of the diagonal;
a finish places them on it exactly, where they are nearest to the pose of the cages.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from ..arrays import FloatArray, IntArray, as_ids, plain
from ..checks import require, shown
from ..errors import ConstraintError
from ..freezing import Frozen
from ..geometry import VertexNormals
from ..mesh import Mesh, nearest_on_triangles, ragged_arange
from ..solver import Track
from .symmetry import Mirror

_MOST_POINTS = 500  # vertices of one slide in the objective
_NEIGHBOURS = 3  # vertices whose triangles are searched for the nearest point of a surface


@dataclass(frozen=True, eq=False, repr=False)
class Slide(Frozen):
    """Vertices that slide.

    Parameters
    ----------
    vertices : (k,) int or (n,) bool
        Of the mesh.
    along : str
        "plane" or "line": each vertex in a plane, or along a line, through where it is at rest, all
        parallel; "surface": along the surface at rest.
    direction : (3,) float, optional
        The normal of the planes, or the direction of the lines; by default those of the plane, or
        the line, that is nearest to the vertices.
    """

    vertices: ArrayLike
    along: str = "plane"
    direction: ArrayLike | None = None

    KINDS: ClassVar[tuple[str, ...]] = ("plane", "line", "surface")


class Guide(NamedTuple):
    """A checked slide, or some of its vertices."""

    vertices: IntArray
    """(k,)."""
    track: Track
    """Of these, in their order."""


def checked_slides(mesh: Mesh, slides: Any) -> tuple[Slide, ...]:
    """Return *slides* with their vertices as numbers; ConstraintError if they are none."""
    if slides is None:
        return ()
    try:
        every = iter(slides)  # not a list: the first that is none ends it
    except TypeError:  # numbers, and arrays without dimensions, which claim to be iterable
        raise ConstraintError(f"slides must be a sequence of Slide; got {shown(slides)}") from None
    found = []
    for each in every:
        slide = require(each, Slide, "slides")
        if not isinstance(slide.along, str) or slide.along not in Slide.KINDS:
            kinds = f"{', '.join(Slide.KINDS[:-1])} or {Slide.KINDS[-1]}"
            raise ConstraintError(f"a slide must be along a {kinds}; got {shown(slide.along)}")
        try:
            ids = as_ids(slide.vertices, mesh.n_vertices, "vertices of a slide")
        except ValueError as fault:
            raise ConstraintError(str(fault)) from None
        direction = None
        if slide.direction is not None:
            given = plain(slide.direction, "the direction of a slide")
            is_vector = given.shape == (3,) and given.dtype.kind in "fiu"
            if not is_vector or not 0.0 < np.linalg.norm(given) < np.inf:
                raise ConstraintError(
                    f"the direction of a slide must be a vector (3,), not zero; "
                    f"got {shown(slide.direction)}"
                )
            direction = given.astype(np.float64).tolist()
        if len(ids):
            found.append(Slide(ids, slide.along, direction))
    return tuple(found)


def with_mirrored(slides: Sequence[Slide], mesh: Mesh, mirror: Mirror) -> tuple[Slide, ...]:
    """Return checked *slides* and their mirror images, of vertices that do not slide yet."""
    found = list(slides)
    for each in slides:
        taken = np.concatenate([np.asarray(other.vertices) for other in found])
        own = np.asarray(each.vertices)
        mates = mirror.with_mates(own, taken)[0][len(own) :]
        if len(mates):
            direction = mirror.reflected(_direction(each, mesh)[None])[0]
            found.append(Slide(mates, each.along, direction.tolist()))
    return tuple(found)


def guides(slides: Iterable[Slide], mesh: Mesh, *, few: bool = False) -> tuple[Guide, ...]:
    """Return checked *slides* along tracks of *mesh* at rest; of some hundred vertices if *few*."""
    found = []
    for each in slides:
        ids = np.asarray(each.vertices)
        some = ids[:: 1 + len(ids) // _MOST_POINTS] if few else ids
        found.append(Guide(some, _track(each, mesh, some)))
    return tuple(found)


def _track(slide: Slide, mesh: Mesh, some: IntArray) -> Track:
    if slide.along == "surface":
        return SurfaceTrack(mesh)
    direction = _direction(slide, mesh)
    along = np.outer(direction, direction)
    return _Flat(mesh.vertices[some], along if slide.along == "plane" else np.eye(3) - along)


def _direction(slide: Slide, mesh: Mesh) -> FloatArray:
    """Return the unit normal of the planes, or the direction of the lines, (3,)."""
    if slide.direction is not None:
        direction = np.asarray(slide.direction)
        return np.asarray(direction / np.linalg.norm(direction))
    points = mesh.vertices[np.asarray(slide.vertices)]
    points = points - points.mean(axis=0)
    axes = np.linalg.eigh(points.T @ points)[1].T  # shortest first
    return np.asarray(axes[2] if slide.along == "line" else axes[0])


@dataclass(frozen=True, eq=False)
class _Flat:
    """Parallel planes or lines through points: their normals are the same everywhere."""

    points: FloatArray  # (k, 3)
    normal: FloatArray  # N, (3, 3)

    def __call__(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return x - (x - self.points) @ self.normal, np.broadcast_to(self.normal, (len(x), 3, 3))


class SurfaceTrack:
    """A triangle mesh; its normals are interpolated between vertices, so that they have no jumps.

    With those of faces, solves went back and forth between the planes of neighbouring faces.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._corners = mesh.vertices[mesh.faces]
        self._normals = VertexNormals(mesh).of(mesh.vertices)[mesh.faces]
        self._tree = cKDTree(mesh.vertices)
        order = np.argsort(mesh.faces.ravel(), kind="stable")
        self._faces_at = order // 3
        self._counts = np.bincount(mesh.faces.ravel(), minlength=mesh.n_vertices)
        self._starts = np.cumsum(self._counts) - self._counts

    def __call__(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest points of *x* (k, 3), and the projectors on the normals there."""
        faces, shares = self.nearest(x)
        nearest = np.einsum("kc,kcj->kj", shares, self._corners[faces])
        normals = np.einsum("kc,kcj->kj", shares, self._normals[faces])
        normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
        return nearest, normals[:, :, None] * normals[:, None]

    def nearest(self, x: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the faces (k,) nearest to *x* (k, 3), and the shares (k, 3) of their corners."""
        near = self._tree.query(x, k=_NEIGHBOURS)[1].ravel()  # a mesh has three vertices at least
        each, k = ragged_arange(self._counts[near])
        faces, point = self._faces_at[self._starts[near][each] + k], each // _NEIGHBOURS
        shares, away = nearest_on_triangles(self._corners[faces], x[point])
        least = np.minimum.reduceat(away, np.flatnonzero(np.diff(point, prepend=-1)))
        best = np.flatnonzero(away == least[point])
        best = best[np.diff(point[best], prepend=-1) != 0]
        return faces[best], shares[best]
