"""Lids over the borders of an open mesh, under which it encloses a volume.

The boundary of the faces of a mesh is a sum of loops of directed edges.  Each loop gets a *lid*: a
fan of triangles from its edges to its centre, the mean of its vertices.  Faces and lids together
have no boundary, so their volume (8) does not depend on an origin, and a centre is a linear
function of the mesh: its volume, gradient and cubic along a direction are computed as for a closed
mesh, over the points ``extension @ x``.

Which components of a mesh enclose a volume is decided by their mean winding number.  An oriented
surface S, seen from a point x just inside it, covers the share w(x) of all directions,

    w(x) = 1/2 + q(x) / 2,    q(x) = (1 / 2 pi) integral over S of n . (y - x) / |y - x|^3 dA(y)

with n the unit normal at y.  Let q be the mean of q(x) over S.  It is 1 on a closed surface, from
whose inside nothing else is seen, and close to 1 if the holes are small.  It is 0 on a plane, and
on a sheet however wrinkled: ridges and valleys cancel.  In two dimensions an arc of the angle a has
q = a / 2 pi, so that of a long half pipe is 1/2; above 1 the surface is rolled up.

    component                                   encloses a volume
    closed                                      yes
    open, 0.48 <= abs(q) <= 1.3                 yes: a bottle, a tube, half of a ball
    any other open one                          no: a sheet, a cloth, a shallow cap, a roll
    with inner walls, see `chambers`            if it has a chamber; its walls need no lids
    one-sided, such as a Moebius strip          no
    its volume, with lids, is 0 to rounding     no: a closed shell that is folded flat
    the sum of all volumes is 0 to rounding     no

Along the border of a wall between two bodies three faces meet.  It is part of the boundary, but no
hole, and its lid is not used.  Neither is that of a flap, a sheet along an edge of a body.

The absolute value is taken because an open surface may be turned inside out.

Source
------
The winding number of open surfaces: A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-
outside segmentation using generalized winding numbers", SIGGRAPH 2013.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse

from ..arrays import BoolArray, FloatArray, IntArray
from ..checks import shown
from ..errors import ArgumentError
from ..freezing import Frozen
from ..mesh import HalfEdges, Mesh, edge_keys, ragged_arange, require_mesh
from .chambers import NO_CHAMBERS, NO_VOLUME, Chambers, chambers_of
from .volume import corner_and_edges, signed_volume

_LEAST_WINDING, _MOST_WINDING = 0.48, 1.3  # abs(q) of an open component that encloses a volume
_SEEN_POINTS = 10  # points y for each of them
_SUMMED_FACES = 8  # faces of a component, up to which q is summed over pairs of faces
_INNER_POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6.0  # points x of a face
_known: WeakKeyDictionary[Mesh, dict[bool | None, Lids]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False, repr=False)
class Lids(Frozen):
    """The lids of a mesh with n vertices and k border loops.

    Attributes
    ----------
    faces : (l, 3) int
        Over the n vertices and k centres.
    loop : (l,) int
        The loop of each face.
    extension : (n + k, n) sparse
        From vertices to vertices and centres: rows of the identity, then of means.
    component : (k,) int
        The component of the mesh that each loop bounds.
    of_wall : (k,) bool
        Whether three or more faces meet at every edge of a loop, or it is that of a flap: it is no
        hole.
    encloses : (c,) bool
        Whether each component of the mesh encloses a volume.
    option : bool or None
        As in `lids_of`.
    chambers : Chambers
        Of the components with inner walls, over the n vertices and k centres.
    """

    faces: IntArray
    loop: IntArray
    extension: sparse.csr_array
    component: IntArray
    of_wall: BoolArray
    encloses: BoolArray
    option: bool | None = None
    chambers: Chambers = NO_CHAMBERS

    @property
    def has_volume(self) -> bool:
        """Whether any component encloses a volume."""
        return bool(self.encloses.any())

    @property
    def used(self) -> BoolArray:
        """(k,) bool: the loops whose lids close an enclosed volume."""
        return self.encloses[self.component] & ~self.of_wall

    @property
    def is_open(self) -> BoolArray:
        """(c,) bool: the components of the mesh that have holes."""
        return np.bincount(self.component[~self.of_wall], minlength=len(self.encloses)) > 0

    def summary(self, *, preserved: bool = True) -> str:
        """Return in one line what has a volume, and whether it is *preserved*."""
        is_open, holes, inside = self.is_open, int(self.used.sum()), len(self.chambers.inside)
        if not self.has_volume:
            if not is_open.any() or self.option:
                return "No enclosed volume: nothing to preserve"
            many = int(is_open.sum())
            if self.option is False:
                return "Open surface, lids off: no volume to preserve"
            sheets = _counted(many, "open sheet") if many > 1 else "Open sheet"
            return f"{sheets}: no volume to preserve"
        done = "kept" if preserved else "measured"
        what = [f"{_counted(inside, 'chamber')} with common walls"] if inside > 1 else []
        what += [_counted(holes, "hole")] if holes else []
        volume = f"volume{' of each' if inside > 1 else ''} {done}"
        under = f" under {'a lid' if holes == 1 else 'lids'}" if holes else ""
        parts = [f"{', '.join(what) or 'Closed surface'}: {volume}{under}"]
        without = int((~self.encloses).sum())
        if without:
            are_sheets = is_open[~self.encloses].all()
            name = "open sheet" if are_sheets and self.option is None else "part"
            has = "has" if without == 1 else "have"
            parts.append(f"{_counted(without, name)} {has} no volume")
        return "; ".join(parts)

    def closed(self, mesh: Mesh) -> IntArray:
        """Return the faces of *mesh* and of lids around the enclosed volumes, (m', 3).

        Of chambers, those around all of them.
        """
        if not len(self.component) and self.encloses.all() and not self.chambers.hulls:
            return mesh.faces
        plain = self.encloses.copy()
        plain[self.with_chambers(mesh)] = False
        around = plain[mesh.components[mesh.faces[:, 0]]]
        lids = (self.used & plain[self.component])[self.loop]
        return np.concatenate([mesh.faces[around], self.faces[lids], *self.chambers.hulls])

    def with_chambers(self, mesh: Mesh) -> IntArray:
        """Return the components of *mesh* that have chambers, (h,) int."""
        first = np.array([hull.min() for hull in self.chambers.hulls], dtype=np.int64)
        return np.unique(mesh.components[first])


def lids_of(mesh: Mesh, lids: bool | None = None) -> Lids:
    """Return the lids of *mesh*, and which of its components enclose a volume.

    They are computed once for each mesh and option.

    Parameters
    ----------
    mesh : Mesh
        n vertices.
    lids : bool or None
        True: every open component encloses a volume under its lids.  False: none does.  None:
        those do whose mean winding number says so; see above.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 4]]
    >>> spike = Mesh(corners, [[0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> lids = lids_of(spike)
    >>> lids.encloses, len(lids.faces), (lids.extension @ spike.vertices)[4].round(3)
    (array([ True]), 3, array([0.333, 0.333, 0.   ]))
    >>> lids_of(Mesh(corners[:3], [[0, 1, 2]])).encloses
    array([False])
    """
    require_mesh(mesh)
    if lids is not None and not isinstance(lids, bool | np.bool_):
        raise ArgumentError(f"lids must be True, False or None; got {shown(lids)}")
    known = _known.setdefault(mesh, {})
    if lids not in known:
        known[lids] = _lids_of(mesh, lids)
    return known[lids]


def _lids_of(mesh: Mesh, wanted: bool | None) -> Lids:
    n, k = mesh.n_vertices, len(mesh.borders)
    sizes = np.array([len(loop) for loop in mesh.borders], dtype=np.int64)
    tail = np.concatenate([np.empty(0, np.int64), *mesh.borders])
    head = np.concatenate([np.empty(0, np.int64), *(np.roll(loop, -1) for loop in mesh.borders)])
    loop = np.repeat(np.arange(k), sizes)
    faces = np.stack([head, tail, n + loop], axis=1)
    means = sparse.coo_array((1.0 / sizes[loop], (loop, tail)), (k, n))
    extension = sparse.csr_array(sparse.vstack([sparse.eye_array(n), means]))
    component = mesh.components[[each[0] for each in mesh.borders]].astype(np.int64)
    every = np.ones(int(mesh.components.max()) + 1, dtype=bool)
    of_wall = _walls(mesh, tail, head, loop, k)
    found = Lids(faces, loop, extension, component, of_wall, every, wanted)
    if _may_have_walls(mesh):
        own = np.concatenate([mesh.components, component])
        is_two_sided = ~np.isin(own, mesh.components[mesh.faces[_one_sided(mesh)]])
        closing = faces[~of_wall[loop]] if wanted is not False else faces[:0]
        walls = np.concatenate([mesh.faces, closing])
        walls = walls[is_two_sided[walls[:, 0]]]
        points, centres = extension @ mesh.vertices, n + np.arange(k)
        chambers = chambers_of(points, walls)
        is_flap = np.isin(centres, np.concatenate([faces[:0], *chambers.flat]))
        if is_flap.any():  # both of its sides are in one part of space then
            chambers = chambers_of(points, walls[~np.isin(walls, centres[is_flap]).any(axis=1)])
        found = replace(found, chambers=chambers, of_wall=of_wall | is_flap)
    return replace(found, encloses=_enclosing(mesh, found, wanted))


def _may_have_walls(mesh: Mesh) -> bool:
    """Return whether three or more faces meet at an edge: there are fewer edges than without."""
    return 3 * mesh.n_faces > 2 * len(mesh.edges) - len(mesh.boundary)


def _walls(mesh: Mesh, tail: IntArray, head: IntArray, loop: IntArray, k: int) -> BoolArray:
    """Return which of the *k* loops, of edges from *tail* (b,) to *head*, are borders of walls."""
    at_border = np.zeros(mesh.n_vertices, dtype=bool)
    at_border[tail] = True
    faces = mesh.faces[at_border[mesh.faces].sum(axis=1) > 1]
    keys = edge_keys(faces.ravel(), np.roll(faces, -1, axis=1).ravel(), mesh.n_vertices)
    found, counts = np.unique(keys, return_counts=True)
    meet = counts[np.searchsorted(found, edge_keys(tail, head, mesh.n_vertices))]
    return np.asarray(np.bincount(loop, meet < 3, k) == 0)


def volume_summary(mesh: Mesh, lids: bool | None = None) -> str:
    """Return in one line whether *mesh* has a volume that is preserved, for status lines.

    Parameters
    ----------
    mesh : Mesh
        Closed, or with borders.
    lids : bool or None
        The option of `Deformer`.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 4]]
    >>> volume_summary(Mesh(corners, [[0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    '1 hole: volume kept under a lid'
    >>> volume_summary(Mesh(corners[:3], [[0, 1, 2]]))
    'Open sheet: no volume to preserve'
    """
    return lids_of(mesh, lids).summary()


def mean_winding(points: FloatArray, faces: IntArray, *, most: int = 400) -> float:
    """Return q, the mean over the surface of *points* (n, 3), *faces* (m, 3); see above.

    It is computed from at most 400 points x and 4,000 points y, with a standard error of 0.01; or
    from *most* points x, at least 12, if that is less.  The result is the same every time.
    """
    rng = np.random.default_rng(0)
    corner, e, f = corner_and_edges(points, faces)
    normals = np.cross(e, f)
    twice = np.linalg.norm(normals, axis=1)
    ends = np.cumsum(twice)
    if not ends[-1] > 0.0:
        return 0.0

    def sample(count: int) -> tuple[FloatArray, FloatArray]:
        """Return points, one in each of *count* equal shares of the area, and their normals."""
        place = (np.arange(count) + rng.random(count)) / count * ends[-1]
        own = np.searchsorted(ends, place).clip(max=len(faces) - 1)
        u, v = rng.random((2, count))
        u, v = np.where(u + v > 1.0, [1.0 - u, 1.0 - v], [u, v])
        y = corner[own] + u[:, None] * e[own] + v[:, None] * f[own]
        return y, normals[own] / np.maximum(twice[own, None], np.finfo(float).tiny)

    count = min(int(np.clip(len(faces), 50, 400)), max(most, 12))
    y, n = sample(_SEEN_POINTS * count)
    x, _ = sample(count)
    area = 0.5 * float(ends[-1]) / len(y)
    nearest = 0.3 * np.sqrt(area)  # |y - x| at least, in distances of neighbouring points y
    heights = np.einsum("ij,ij->i", y, n) - x @ n.T
    square = np.square(x)[:, None].sum(axis=2) - 2.0 * x @ y.T + np.square(y).sum(axis=1)
    np.maximum(square, nearest**2, out=square)
    heights /= square * np.sqrt(square)  # a power of 3 would take as long as all the rest
    return float(heights.sum()) * area / (2.0 * np.pi * len(x))


def _winding_of_few(mesh: Mesh, order: IntArray, starts: IntArray, sizes: IntArray) -> FloatArray:
    """Return q of components, (c,); their faces are *order* from *starts* (c,), *sizes* (c,) each.

    All pairs of their faces are summed: one is seen from points of the other.
    """
    owner, k = ragged_arange(sizes**2)
    one, other = np.divmod(k, sizes[owner])
    distinct = one != other
    owner, one, other = owner[distinct], one[distinct], other[distinct]
    corners = mesh.vertices[mesh.faces]
    seen_from, seen = order[starts[owner] + one], corners[order[starts[owner] + other]]
    angle = np.zeros(len(owner))
    for weights in _INNER_POINTS:
        a, b, c = np.moveaxis(seen - (weights @ corners[seen_from])[:, None], 1, 0)
        u, v, w = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        ab, bc, ca = (np.einsum("ix,ix->i", i, j) for i, j in ((a, b), (b, c), (c, a)))
        volume = np.einsum("ix,ix->i", a, np.cross(b, c))
        angle += np.arctan2(volume, u * v * w + ab * w + bc * u + ca * v) / np.pi
    areas = mesh.face_areas
    total = np.bincount(owner, areas[seen_from] * angle / len(_INNER_POINTS), len(sizes))
    each, k = ragged_arange(sizes)
    return np.asarray(total / np.bincount(each, areas[order[starts[each] + k]], len(sizes)))


def _enclosing(mesh: Mesh, lids: Lids, wanted: bool | None) -> BoolArray:
    """Return which components enclose a volume, (c,) bool."""
    count, component = len(lids.encloses), mesh.components[mesh.faces[:, 0]]
    is_open = lids.is_open
    encloses = ~is_open | (wanted is not False)
    encloses[component[_one_sided(mesh)]] = False
    encloses[lids.component[lids.of_wall]] = False
    _, first = np.unique(mesh.components, return_index=True)
    volumes = _volumes(mesh, lids, mesh.vertices[first])
    areas = np.bincount(component, mesh.face_areas, count)
    encloses &= np.abs(volumes) > NO_VOLUME * areas**1.5
    chambered = lids.with_chambers(mesh)
    encloses[chambered], is_open[chambered] = True, False
    asked = np.flatnonzero(encloses & is_open)
    if wanted is None and len(asked):
        sizes = np.bincount(component, minlength=count)
        order = np.argsort(component, kind="stable")
        starts = np.cumsum(sizes) - sizes
        q = np.zeros(count)
        few = sizes[asked] <= _SUMMED_FACES
        q[asked[few]] = _winding_of_few(mesh, order, starts[asked[few]], sizes[asked[few]])
        at_once = np.sqrt(2e8 / (_SEEN_POINTS * max(len(asked), 1)))  # of all pairs of x and y
        for c in asked[~few]:
            used, faces = np.unique(
                mesh.faces[order[starts[c] : starts[c] + sizes[c]]], return_inverse=True
            )
            points = mesh.vertices[used] - mesh.vertices[first[c]]
            q[c] = mean_winding(points, faces.reshape(-1, 3), most=int(at_once))
        encloses[asked] = (np.abs(q[asked]) >= _LEAST_WINDING) & (np.abs(q[asked]) <= _MOST_WINDING)
    if abs(volumes[encloses].sum()) <= NO_VOLUME * areas.sum() ** 1.5:
        encloses[:] = False  # they cancel: no change could be relative to their sum
    return encloses


def _one_sided(mesh: Mesh) -> BoolArray:
    """Return which faces are part of a shell with one side, (m,) bool."""
    # Such a shell has edges whose two faces have the same direction: twice in the boundary.
    keys = np.sort(mesh.boundary @ [mesh.n_vertices, 1])
    if not (keys[1:] == keys[:-1]).any():
        return np.zeros(mesh.n_faces, dtype=bool)
    half_edges = HalfEdges(mesh.faces, mesh.n_vertices)
    return half_edges.one_sided[half_edges.shells]


def _volumes(mesh: Mesh, lids: Lids, origins: FloatArray) -> FloatArray:
    """Return the volume of each component under lids, (c,), with its origin of *origins* (c, 3)."""
    hulls = lids.chambers.hulls
    if mesh.is_closed and len(origins) == 1 and not hulls:
        return np.array([signed_volume(mesh.vertices, mesh.faces)])
    faces = np.concatenate([mesh.faces, lids.faces[~lids.of_wall[lids.loop]]])
    component = np.concatenate([mesh.components, lids.component])
    if hulls:
        has_chambers = np.isin(component, lids.with_chambers(mesh))
        faces = np.concatenate([faces[~has_chambers[faces[:, 0]]], *hulls])
    owner = component[faces[:, 0]]
    a, e, f = corner_and_edges(lids.extension @ mesh.vertices, faces)
    determinants = np.einsum("ij,ij->i", a - origins[owner], np.cross(e, f))
    return np.bincount(owner, determinants, len(origins)) / 6.0


def _counted(count: int, name: str) -> str:
    return f"{count} {name}{'s' * (count != 1)}"
