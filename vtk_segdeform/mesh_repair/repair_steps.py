"""The steps of a repair: each takes a draft of the mesh and returns a repaired one and a report.

The report has one sentence per line; it is "" if there was nothing to repair.  `orient`, `fill` and
`orient_outward` leave a mesh with non-manifold edges unchanged, the last two also one with
inconsistently oriented edges; the final `MeshReport` lists these edges.
"""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from ..arrays import BoolArray, FloatArray, IntArray
from ..mesh import (
    HalfEdges,
    connected,
    edge_keys,
    first_equal_row,
    first_of_group,
    misoriented_shells,
    repeats_vertex,
)
from ..progress import Progress
from .cracks import close_cracks
from .hole_borders import border_loops
from .holes import close_holes
from .splitting import split_fans


@dataclass(frozen=True)
class Draft:
    """A mesh under repair; the maps give the original of each vertex and face, -1 for a new one.

    *weights* (n, o) are the weights of the o original vertices at each vertex; *flipped* (m,) says
    which faces were flipped.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_map: IntArray
    face_map: IntArray
    weights: sparse.csr_array
    flipped: BoolArray

    @classmethod
    def of(cls, vertices: FloatArray, faces: IntArray) -> Draft:
        """Return the draft of a mesh before any repair."""
        n = len(vertices)
        weights = sparse.eye_array(n, format="csr")
        flipped = np.zeros(len(faces), dtype=bool)
        return cls(vertices, faces, np.arange(n), np.arange(len(faces)), weights, flipped)

    @cached_property
    def half_edges(self) -> HalfEdges:
        """The half-edges of the faces."""
        return HalfEdges(self.faces, len(self.vertices))

    @property
    def is_oriented(self) -> bool:
        """Whether at most two faces meet at every edge, and agree there."""
        return self.half_edges.is_oriented and not len(self.half_edges.crowded)

    def keep_faces(self, keep: BoolArray) -> Draft:
        """Return the draft with only the faces *keep* (m,), in their order."""
        return replace(
            self,
            faces=self.faces[keep],
            face_map=self.face_map[keep],
            flipped=self.flipped[keep],
        )

    def keep_vertices(self, keep: BoolArray) -> Draft:
        """Return the draft with only the vertices *keep* (n,); no face may use the others."""
        number = np.cumsum(keep) - 1
        return replace(
            self,
            vertices=self.vertices[keep],
            faces=number[self.faces],
            vertex_map=self.vertex_map[keep],
            weights=self.weights[np.flatnonzero(keep)],
        )

    def flip(self, which: BoolArray) -> Draft:
        """Return the draft with the faces *which* (m,) flipped; their first vertex stays first."""
        faces = np.where(which[:, None], self.faces[:, [0, 2, 1]], self.faces)
        return replace(self, faces=faces, flipped=self.flipped ^ which)


def remove_non_finite(draft: Draft) -> tuple[Draft, str]:
    """Remove vertices with NaN or infinite coordinates, and their faces."""
    finite: BoolArray = np.logical_and.reduce(np.isfinite(draft.vertices), axis=1)
    keep: BoolArray = np.logical_and.reduce(finite[draft.faces], axis=1)
    if finite.all():
        return draft, ""
    vertices, faces = _n(~finite, "vertex", "vertices"), _n(~keep, "face")
    sentence = f"remove {vertices} with NaN or infinite coordinates and {faces} there"
    return draft.keep_faces(keep).keep_vertices(finite), sentence


def remove_degenerate(draft: Draft) -> tuple[Draft, str]:
    """Remove faces that contain a vertex twice."""
    bad = repeats_vertex(draft.faces)
    return draft.keep_faces(~bad), f"remove {_n(bad, 'degenerate face')}" if bad.any() else ""


def weld(draft: Draft, distance: float) -> tuple[Draft, str]:
    """Weld vertices within *distance* of each other where that closes open edges."""
    half_edges, n = draft.half_edges, len(draft.vertices)
    tail, head = half_edges.tail[half_edges.boundary], half_edges.head[half_edges.boundary]
    target = _weld_targets(draft.vertices, np.union1d(tail, head), distance)
    keys = edge_keys(target[tail], target[head], n)
    _, edge, count = np.unique(keys, return_inverse=True, return_counts=True)
    closes = np.flatnonzero((count[edge] % 2 == 0) & (target[tail] != target[head]))
    closes = closes[np.argsort(edge[closes], kind="stable")]
    forward = target[tail[closes]] < target[head[closes]]
    low = np.where(forward, tail[closes], head[closes])
    high = np.where(forward, head[closes], tail[closes])
    together = np.diff(edge[closes]) == 0
    group = connected(
        n,
        np.concatenate([low[:-1][together], high[:-1][together]]),
        np.concatenate([low[1:][together], high[1:][together]]),
    )
    number = first_of_group(group)
    gone = number != np.arange(n)
    if not gone.any():
        return draft, ""
    welded = replace(draft, faces=number[draft.faces])
    collapsed = repeats_vertex(welded.faces)
    welded = welded.keep_faces(~collapsed).keep_vertices(~gone)
    closed = len(half_edges.boundary) - len(welded.half_edges.boundary)
    sentence = f"weld {_n(gone, 'duplicate vertex', 'duplicate vertices')}"
    sentence += f", which closes {_n(range(closed), 'open edge')}"
    return welded, sentence + (f" and removes {_n(collapsed, 'face')}" if collapsed.any() else "")


def weld_corners(draft: Draft, distance: float) -> tuple[Draft, str]:
    """Weld border vertices within *distance* of each other where holes touch at a corner only.

    Otherwise two holes would count as one whose border passes the corner twice.  Vertices whose
    welding would also merge edges are left to `weld`.
    """
    half_edges, n = draft.half_edges, len(draft.vertices)
    border = np.union1d(half_edges.tail[half_edges.boundary], half_edges.head[half_edges.boundary])
    number = _weld_targets(draft.vertices, border, distance)
    edge = half_edges.order[half_edges.first]
    tail, head = half_edges.tail[edge], half_edges.head[edge]
    while (gone := number != np.arange(n)).any():
        moved = np.isin(np.arange(n), number[gone])[number]
        near = moved[tail] | moved[head]
        one, other = number[tail[near]], number[head[near]]
        _, which, count = np.unique(
            edge_keys(one, other, n), return_inverse=True, return_counts=True
        )
        merged = (count[which] > 1) | (one == other)
        if not merged.any():
            break
        kept = np.isin(number, np.append(one[merged], other[merged]))
        number = np.where(kept, np.arange(n), number)
    if not gone.any():
        return draft, ""
    welded = replace(draft, faces=number[draft.faces]).keep_vertices(~gone)
    return welded, f"weld {_n(gone, 'vertex', 'vertices')} where holes touch"


def remove_duplicates(draft: Draft) -> tuple[Draft, str]:
    """Keep one of the faces on the same vertices, and neither face of a wall between two bodies."""
    a, b, c = draft.faces.T
    first = first_equal_row(np.sort(draft.faces, axis=1))
    repeated = first != np.arange(len(first))
    if not repeated.any():
        return draft, ""
    orientation = np.where((a < b).astype(int) + (b < c) + (c < a) == 2, 1, -1)
    opposite = np.bincount(first, orientation, minlength=len(first)) == 0
    distinct = np.flatnonzero(~repeated)
    half_edges = draft.keep_faces(~repeated).half_edges
    among_others = np.zeros(len(first), dtype=bool)
    crowded = np.repeat(half_edges.counts > 2, half_edges.counts)  # with a third face on their edge
    among_others[distinct[half_edges.order[crowded] // 3]] = True
    wall = (opposite & among_others)[first]
    sentence = f"remove {_n(repeated | wall, 'duplicate face')}"
    sentence += f", {np.count_nonzero(wall)} of them inner walls" if wall.any() else ""
    return draft.keep_faces(~(repeated | wall)), sentence


def remove_unreferenced(draft: Draft) -> tuple[Draft, str]:
    """Remove vertices that are in no face."""
    used = np.zeros(len(draft.vertices), dtype=bool)
    used[draft.faces] = True
    if used.all():
        return draft, ""
    sentence = f"remove {_n(~used, 'unreferenced vertex', 'unreferenced vertices')}"
    return draft.keep_vertices(used), sentence


def split(draft: Draft) -> tuple[Draft, str]:
    """Split vertices so that each has one fan; the first fan keeps the original vertex."""
    faces, copied = split_fans(draft.vertices, draft.half_edges)
    if not len(copied):
        return draft, ""
    edges = draft.half_edges.branching
    sentence = f"split {_n(np.unique(copied), 'vertex', 'vertices')}"
    sentence += f" and {_n(edges, 'edge')}" if len(edges) else ""
    sentence += f" where surfaces touch, adding {_n(copied, 'copy', 'copies')}"
    return (
        replace(
            draft,
            vertices=np.concatenate([draft.vertices, draft.vertices[copied]]),
            faces=faces,
            vertex_map=np.concatenate([draft.vertex_map, draft.vertex_map[copied]]),
            weights=sparse.vstack([draft.weights, draft.weights[copied]], format="csr"),
        ),
        sentence,
    )


def orient(draft: Draft) -> tuple[Draft, str]:
    """Flip the minority of faces in each shell so that all neighbours agree.

    One-sided surfaces remain unchanged.
    """
    half_edges, m = draft.half_edges, len(draft.faces)
    side, other_side, _ = half_edges.sides
    n_other = np.bincount(side, other_side, minlength=2 * m)
    is_minority = n_other > np.bincount(side, minlength=2 * m) - n_other
    flip = other_side != is_minority[side]
    if not flip.any() or len(half_edges.crowded):
        return draft, ""
    return draft.flip(flip), f"flip {_n(flip, 'face')} to agree with the neighbours"


def fill(draft: Draft, largest: int, progress: Progress | None = None) -> tuple[Draft, str]:
    """Fill holes of up to *largest* edges."""
    if not draft.is_oriented:
        return draft, ""
    closing = close_holes(draft.vertices, draft.half_edges, largest, progress)
    sizes, new = closing.sizes, len(closing.vertices)
    if not sizes:
        return draft, ""
    few, many = min(sizes), max(sizes)
    sentence = f"fill {_n(sizes, 'hole')} of {few if few == many else f'{few} to {many}'} edges"
    sentence += f" with {_n(closing.faces, 'triangle')}"
    sentence += f" and {_n(closing.vertices, 'new vertex', 'new vertices')}" if new else ""
    if closing.n_crossing:
        lids = "1 lid crosses" if closing.n_crossing == 1 else f"{closing.n_crossing} lids cross"
        sentence += f"\n{lids} the surface or another lid; no better triangulation was found"
    rows = np.repeat(np.arange(new), closing.sources.shape[1])
    weights = sparse.coo_array(
        (closing.weights.ravel(), (rows, closing.sources.ravel())),
        shape=(new, len(draft.vertices)),
    )
    return (
        replace(
            draft,
            vertices=np.concatenate([draft.vertices, closing.vertices]),
            faces=np.concatenate([draft.faces, closing.faces]),
            vertex_map=np.append(draft.vertex_map, np.full(new, -1)),
            face_map=np.append(draft.face_map, np.full(len(closing.faces), -1)),
            flipped=np.append(draft.flipped, np.zeros(len(closing.faces), dtype=bool)),
            weights=sparse.vstack([draft.weights, weights.tocsr() @ draft.weights], format="csr"),
        ),
        sentence,
    )


def close_flat(draft: Draft) -> tuple[Draft, str]:
    """Replace degenerate lids by splitting the adjacent faces at the vertex on their edge."""
    lids = draft.face_map < 0
    faces, changed = close_cracks(draft.vertices, draft.faces, lids)
    if not changed.any():
        return draft, ""
    order = np.argsort(lids | changed, kind="stable")
    cut = replace(
        draft,
        faces=faces[order],
        face_map=np.where(changed, -1, draft.face_map)[order],
        flipped=(draft.flipped & ~changed)[order],
    )
    return cut, f"split {_n(changed & ~lids, 'face')} at vertices on an edge, to close cracks"


def remaining_holes(draft: Draft, largest: int) -> tuple[int, ...]:
    """Return the number of edges of each hole that `fill` leaves open only because of its size."""
    if not draft.is_oriented:
        return ()
    loops = border_loops(draft.half_edges, len(draft.half_edges.boundary))
    return tuple(sorted(len(loop) for loop in loops if len(loop) > largest))


def orient_outward(draft: Draft) -> tuple[Draft, str]:
    """Flip inside-out closed shells; shells without volume remain unchanged."""
    half_edges = draft.half_edges
    if not draft.is_oriented:
        return draft, ""
    wrong = misoriented_shells(draft.vertices, half_edges)
    flipped = draft.flip(wrong[half_edges.shells])
    wrong &= ~misoriented_shells(flipped.vertices, flipped.half_edges)
    if not wrong.any():
        return draft, ""
    flip = wrong[half_edges.shells]
    return draft.flip(flip), f"flip {_n(wrong, 'inside-out component')} ({_n(flip, 'face')})"


def _weld_targets(vertices: FloatArray, border: IntArray, distance: float) -> IntArray:
    """Return for each vertex the first of *border* within *distance*, else itself, (n,) int."""
    nearest = np.arange(len(vertices))
    if distance > 0.0:
        pairs = cKDTree(vertices[border]).query_pairs(distance, output_type="ndarray")
        first = first_of_group(connected(len(border), *pairs.T))
    else:
        first = first_equal_row(vertices[border])
    nearest[border] = border[first]
    return nearest


def _n(items: Sized, one: str, many: str = "") -> str:
    """Return "1 face" or "2 faces": the number of items, or of true entries of a mask."""
    if isinstance(items, np.ndarray) and items.dtype == bool:
        items = np.flatnonzero(items)
    count = len(items)
    return f"{count} {one if count == 1 else many or one + 's'}"
