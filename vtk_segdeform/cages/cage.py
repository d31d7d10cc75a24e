"""`Cage`: a closed, outward oriented surface without self-intersections.

A cage bounds a solid: every half-edge has one twin, the faces around a vertex form one fan, no two
faces cross, and the enclosed volume is positive.  It may have several components that do not
intersect; a component inside another is a cavity and faces inward.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from ..arrays import BoolArray, FloatArray, IntArray, as_faces, as_points
from ..checks import Described, require
from ..errors import CageError
from ..freezing import Frozen
from ..mesh import (
    components,
    connectivity_faults,
    counted,
    distance_to_surface,
    flat_faces,
    inside_points,
    self_intersections,
    winding_number,
)
from ..regions import Regions

MOST_CAGE_VERTICES = 1600
"""Most vertices of all cages together: the solver factors matrices of three rows per vertex."""

_BOXED_FROM, _BOXES = 20_000, 64  # points from which boxes are tested; along the longest side
_LARGEST_COORDINATE = 1e70  # coordinate, as for a mesh

_known: WeakKeyDictionary[Cage, WeakKeyDictionary[Regions, dict[int, bool]]] = WeakKeyDictionary()


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Cage(Described, Frozen):
    """A closed, outward oriented triangle mesh without self-intersections; immutable.

    Parameters
    ----------
    vertices : (m, 3) float
        In the length unit of the mesh.
    faces : (k, 3) int
        Counter-clockwise seen from outside.

    Raises
    ------
    ValueError
        If an array has the wrong shape or type.
    CageError
        If `cage_faults` finds any; the message lists them.

    Examples
    --------
    >>> corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> cage = Cage(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    >>> cage.contains([[0, 0, 0], [1, 1, 0]])
    array([ True, False])
    """

    vertices: FloatArray
    faces: IntArray

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        points = as_points(vertices, "vertices").copy()
        triangles = as_faces(faces, len(points), "faces").copy()
        faults = cage_faults(points, triangles)
        if faults:
            raise CageError(f"not a valid cage: {'; '.join(faults)}; repair it, or use fit_cages")
        points.flags.writeable = triangles.flags.writeable = False
        object.__setattr__(self, "vertices", points)
        object.__setattr__(self, "faces", triangles)

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        return {"vertices": f"{self.n_vertices:,}", "faces": f"{self.n_faces:,}"}

    @property
    def n_vertices(self) -> int:
        """Number of vertices, m."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles, k."""
        return len(self.faces)

    @property
    def volume(self) -> float:
        """Enclosed volume; positive."""
        return float(_six_volumes(self.vertices, self.faces).sum() / 6.0)

    def contains(self, points: ArrayLike) -> BoolArray:
        """Return which *points* (n, 3) are inside, (n,) bool; on the cage it may be either."""
        x = as_points(points, "points")
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        inside = ((x >= low) & (x <= high)).all(axis=1)
        near = x[inside]
        if len(near) > _BOXED_FROM:
            inside[inside] = _inside_of_many(near, self.vertices, self.faces)
        else:
            inside[inside] = inside_points(near, self.vertices, self.faces)
        return np.asarray(inside)

    def require_encloses(self, points: ArrayLike, name: str) -> None:
        """Raise a CageError if any of *points* (n, 3) are outside; *name* describes them."""
        name = require(name, str, "name")[:100]
        x = as_points(points, name)
        if np.abs(x).max(initial=0.0) > _LARGEST_COORDINATE:
            raise CageError(
                f"{name} are too large to compute with: above {_LARGEST_COORDINATE:.0e}; scale down"
            )
        outside = x[~self.contains(x)]
        if len(outside):
            farthest = distance_to_surface(outside, self.vertices, self.faces).max()
            raise CageError(
                f"{len(outside)} of {len(x)} {name} are outside the cage, "
                f"the farthest by {farthest:.3g}; enlarge the cage"
            )


def encloses_region(cage: Cage, regions: Regions, r: int) -> bool:
    """Return whether *cage* encloses region *r*; a cage and a region are tested only once."""
    known = _known.setdefault(cage, WeakKeyDictionary()).setdefault(regions, {})
    if r not in known:
        known[r] = bool(cage.contains(regions.mesh.vertices[regions.membership[r]]).all())
    return known[r]


def require_enclosed(cage: Cage, regions: Regions, r: int, name: str) -> None:
    """Raise a CageError unless *cage* encloses region *r*, which the message calls *name*."""
    if not encloses_region(cage, regions, r):
        members = regions.mesh.vertices[regions.membership[r]]
        cage.require_encloses(members, f"vertices of {name}")


def _inside_of_many(points: FloatArray, vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Return what `inside_points` does, testing one point in boxes that no face reaches."""
    low = vertices.min(axis=0)
    size = float(np.ptp(vertices, axis=0).max()) / _BOXES
    count = _BOXES + 3

    def boxes(x: FloatArray) -> IntArray:
        at = ((x - low) / size).astype(np.int64) + 1
        return np.asarray((at[:, 0] * count + at[:, 1]) * count + at[:, 2])

    reached = np.zeros((count,) * 3, dtype=bool)
    corners = vertices[faces]
    longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1)
    parts = np.ceil(2.0 * longest / size).astype(np.int64)
    for k in np.unique(parts):  # samples of a face half a box apart
        i, j = np.divmod(np.arange((k + 1) ** 2), k + 1)
        inner = i + j <= k
        share = np.stack([i, j, k - i - j], axis=1)[inner] / k
        for some in np.array_split(corners[parts == k], max(1, len(share) * len(corners) >> 20)):
            reached.ravel()[boxes((share @ some).reshape(-1, 3))] = True
    box = boxes(points)
    is_near = ndimage.binary_dilation(reached, np.ones((3, 3, 3), dtype=bool)).ravel()[box]
    inside = np.empty(len(points), dtype=bool)
    inside[is_near] = inside_points(points[is_near], vertices, faces)
    far = np.flatnonzero(~is_near)
    one = np.zeros(reached.size, dtype=np.int64)
    one[box[far]] = far
    tested = np.flatnonzero(np.bincount(box[far], minlength=reached.size))
    answer = np.zeros(reached.size, dtype=bool)
    answer[tested] = inside_points(points[one[tested]], vertices, faces)
    inside[far] = answer[box[far]]
    return inside


def cage_faults(vertices: ArrayLike, faces: ArrayLike) -> tuple[str, ...]:
    """Return the reasons why a surface is not a valid cage, one sentence each; empty if it is.

    Geometry is only checked if the connectivity has no faults.

    Examples
    --------
    >>> corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> cage_faults(corners, [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    ('it is inside-out, volume -2.67: reverse its faces',)
    """
    points = as_points(vertices, "vertices")
    triangles = as_faces(faces, len(points), "faces")
    if np.abs(points).max(initial=0.0) > _LARGEST_COORDINATE:
        return (f"its coordinates exceed {_LARGEST_COORDINATE:.0e}; scale it down",)
    faults = connectivity_faults(len(points), triangles)
    return tuple(faults or _flat_faults(points, triangles) or _solid_faults(points, triangles))


def _flat_faults(points: FloatArray, faces: IntArray) -> list[str]:
    flat = len(flat_faces(points, faces))
    return [f"{counted(flat, 'face has', 'faces have')} no area"] if flat else []


def _solid_faults(points: FloatArray, faces: IntArray) -> list[str]:
    crossings = len(self_intersections(points, faces))
    if crossings:
        pairs = counted(crossings, "pair of faces crosses", "pairs of faces cross")
        return [f"{pairs} or touch: the cage intersects itself"]
    component = components(len(points), faces)[faces[:, 0]]
    volumes = np.bincount(component, _six_volumes(points, faces)) / 6.0
    if len(volumes) == 1:
        inward = volumes[0] <= 0
        return [f"it is inside-out, volume {volumes[0]:.3g}: reverse its faces"] if inward else []
    faults = []
    for number, volume in enumerate(volumes):
        own = component == number
        seed = points[faces[own][0, :1]]
        depth = round(float(winding_number(seed, points, faces[~own])[0]))
        if (depth, volume > 0) not in ((0, True), (1, False)):
            where = "inside another and faces outward" if depth else "faces inward"
            faults.append(
                f"component {number + 1} of {len(volumes)} {'is ' if depth else ''}{where}"
            )
    return faults


def _six_volumes(points: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = (points - points.mean(axis=0))[faces.T]
    return np.asarray(np.einsum("fj,fj->f", a, np.cross(b, c)))
