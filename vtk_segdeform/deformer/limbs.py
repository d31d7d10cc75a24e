"""Limbs: the parts of a body that bend at a joint, found from a grabbed point.

With the distance f from q, the point farthest from the grabbed one p, the limbs of p are the sets

    C(t) = the connected part of {f > t} with p in it,    t < f(p)

which are the same for the crown and the chin of a head.  The border of C(t) is a front across the
limb.  With the extent L = max_C(t) f - t, its length is constant along a limb and at most
proportional to L on a flat or rounded surface.  Where a limb ends in a body it grows faster.  Among
the fronts that grow by a factor of 1.75 until 1.5 L, the joint is the last one that is about as
narrow, relative to L, as the narrowest.

A limb may have branches, such as fingers, which C(t) gains as a whole.  With the largest minimum of
f along a path from p to x, which is that along the maximum spanning tree, C(t) = {x: m(x) > t}.

A limb bends along its length, or with a hinge at its joint.  Added to the shape energy is

    min_R  c(h) sum_s a_s |y_s - R y_s^0|^2 / sum_s a_s,    y_s = x_s - mean x,    c(h) = 10 e h^3

over the samples s of the limb, with their areas a_s and their positions x_s^0 at the press.  Only
turning it as a whole, by one rotation R, costs nothing; so it is stiffer than the surface beyond
its joint, and keeps the bends that it had.  e is the scale of the shape energy.  With h = 0.5 and
1, a neck turned by 60 degrees kept its shape to within 0.4 % and 0.1 % of its length, without a
hinge to within 5 %.  Solves took no more steps; with ten times the largest c, a quarter more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ..arrays import BoolArray, FloatArray, IntArray
from ..energy import Energy, with_rotating_rows
from ..freezing import Frozen
from ..mesh import Mesh, SurfacePoint

_WIDENS, _AHEAD = 1.75, 0.5  # growth of a front until 1.5 L where a limb ends; 1.5 on a disc
_NARROW = 1.25  # times the narrowest front
_STEP, _ACROSS = 0.5, 2.0  # mean edges: between fronts, and the width of one
_SHORTEST = 1e-12  # the mesh has size 1
_STIFFEST, _GRADED = 10.0, 3.0  # c(1) / e, and the exponent of h


@dataclass(frozen=True, eq=False, repr=False)
class Limb(Frozen):
    """A part of the surface that bends at a joint, on which a point is grabbed.

    Lengths are in the mesh's unit, along the surface at rest.
    """

    depth: float
    """From the grabbed point to the joint."""
    length: float
    """From the joint to the tip of the limb."""
    share: FloatArray
    """1 on the limb, falling to 0 beyond its joint: of each vertex, (n,)."""

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole body, which has no joint."""
        return self.depth == math.inf

    def contains(self, point: SurfacePoint) -> bool:
        """Return whether *point* is on the limb rather than beyond its joint."""
        return bool(self.share[point.vertex] > 0.5)

    def axis(self, mesh: Mesh, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the centre of the joint and the direction of the limb, (3,) each.

        Of *mesh* in the pose *x* (n, 3); the direction has length 1 and leads away from the body.
        Not of the whole body.
        """
        joint, limb = (
            weights @ x / weights.sum()
            for weights in (
                mesh.vertex_areas * self.share * (1.0 - self.share),
                mesh.vertex_areas * self.share,
            )
        )
        return joint, (limb - joint) / max(float(np.linalg.norm(limb - joint)), _SHORTEST)


class Joint(NamedTuple):
    """Where a limb ends."""

    depth: float
    length: float


@dataclass(frozen=True, eq=False)
class Levels:
    """The levels of f and m at the points of a graph; see above."""

    f: FloatArray  # (s,)
    inner: FloatArray  # (s,): m; -inf on other components
    start: float  # f(p)

    @classmethod
    def of(cls, graph: sparse.csr_array, p: int) -> Levels:
        """Return the levels for the point *p* of a *graph* (s, s) with the lengths of its edges."""
        (away,) = csgraph.dijkstra(graph, directed=False, indices=[p])
        q = int(np.where(np.isfinite(away), away, -1.0).argmax())
        (f,) = csgraph.dijkstra(graph, directed=False, indices=[q])
        i, j = graph.nonzero()
        lower = np.minimum(f[i], f[j])
        costs = np.where(np.isfinite(lower), 2.0 * away[q] + 1.0 - lower, 0.0)
        tree = csgraph.minimum_spanning_tree(sparse.csr_array((costs, (i, j)), graph.shape))
        order, before = csgraph.breadth_first_order(tree, p, directed=False)
        inner = np.full(len(f), -np.inf).tolist()
        inner[p] = f[p]
        for x, last in zip(order[1:].tolist(), before[order[1:]].tolist(), strict=True):
            inner[x] = min(inner[last], f[x])
        return cls(f, np.array(inner), float(f[p]))

    @property
    def up(self) -> FloatArray:
        """How far up another limb than that of p each point is, (s,): f - m."""
        return self.f - self.inner

    def within(self, depth: float) -> BoolArray:
        """Return the points of the limb whose joint has this *depth*, (s,)."""
        return np.asarray(self.inner > self.start - depth)

    def joints(self, points: FloatArray, faces: IntArray, edge: float) -> list[Joint]:
        """Return where the limbs end, the smallest first.

        *points* (s, 3) are joined by *faces* (f, 3), with edges of the mean length *edge*.
        """
        f, inner = self.f, self.inner
        faces = faces[np.isfinite(inner[faces[:, 0]])]
        level, a, b, c = f[faces], *points[faces.T]
        low, high = level.min(axis=1), level.max(axis=1)
        top = faces[np.arange(len(faces)), level.argmax(axis=1)]
        ends = np.maximum(np.minimum(high, inner[top]), low)
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        levels = np.arange(self.start - 0.5 * _ACROSS * edge, edge, -_STEP * edge)
        fronts = _lengths(levels, low, ends, areas / np.maximum(high - low, _SHORTEST), edge)
        order = np.argsort(-inner)
        count = np.searchsorted(-inner[order], -levels)
        extents = np.maximum.accumulate(f[order])[np.maximum(count - 1, 0)] - levels
        ahead = np.triu(levels >= (levels - _AHEAD * extents)[:, None])
        widest = np.where(ahead, fronts, 0.0).max(axis=1, initial=0.0)
        fast, found = widest > _WIDENS * fronts, []
        for first in np.flatnonzero(fast & ~np.insert(fast[:-1], 0, False)):
            last = first + int(np.append(~fast[first:], True).argmax())
            widths = fronts[first:last] / extents[first:last]
            k = first + int(np.flatnonzero(widths <= _NARROW * widths.min())[-1])
            found.append(Joint(float(self.start - levels[k]), float(extents[k])))
        return found


def _lengths(
    levels: FloatArray, low: FloatArray, ends: FloatArray, rates: FloatArray, edge: float
) -> FloatArray:
    """Return the lengths of fronts at *levels* (k,): areas of strips, over their width.

    A face has fronts from *low* to *ends* with its *rates*, the area for a step of the level.
    """
    where = np.concatenate([low, ends])
    order = np.argsort(where)
    slope = np.cumsum(np.concatenate([rates, -rates])[order])
    where = where[order]
    area = np.concatenate([[0.0], np.cumsum(slope[:-1] * np.diff(where))])
    half = 0.5 * _ACROSS * edge
    upper, lower = (np.interp(levels + side, where, area) for side in (half, -half))
    return np.asarray(np.maximum(upper - lower, 0.0) / (2.0 * half))  # 0: rounding of areas


def with_hinge(
    energy: Energy, rows: FloatArray, areas: FloatArray, *, p: FloatArray, hinge: float
) -> Energy:
    """Return *energy* with a limb that is the stiffer, the larger *hinge* is, 0 to 1.

    Its samples have the *rows* (s, m) of W~ and *areas* (s,), and keep their shape with cages *p*
    (m, 3).
    """
    shares = areas / areas.sum()
    rows = rows - shares @ rows
    strength = _STIFFEST * energy.scale * hinge**_GRADED
    return with_rotating_rows(energy, rows, np.asarray(rows @ p), strength * shares)
