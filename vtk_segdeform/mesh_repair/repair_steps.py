"""The steps of a repair: each takes a draft of the mesh, and returns a better one and a sentence.

A step that finds nothing to do returns its draft and ""; several sentences are on separate lines.
The steps from `split` on require edges without faults; where a faulty edge remains, they leave the
mesh unchanged, and the report says why.
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
    Sides,
    connected,
    edge_keys,
    first_equal_row,
    first_of_group,
    repeats_vertex,
    wrong_way_round,
)
from .cracks import close_cracks
from .hole_borders import border_loops
from .holes import close_holes
from .splitting import split_fans


@dataclass(frozen=True)
class Draft:
    """A mesh under repair; the maps give the original of each vertex and face, -1 for a new one.

    *mix* (n, o) has the weights of the o original vertices at each vertex, *turned* (m,) says
    which faces were flipped.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_map: IntArray
    face_map: IntArray
    mix: sparse.csr_array
    turned: BoolArray

    @classmethod
    def of(cls, vertices: FloatArray, faces: IntArray) -> Draft:
        """Return the draft of a mesh before any repair."""
        n = len(vertices)
        mix = sparse.eye_array(n, format="csr")
        turned = np.zeros(len(faces), dtype=bool)
        return cls(vertices, faces, np.arange(n), np.arange(len(faces)), mix, turned)

    @cached_property
    def sides(self) -> Sides:
        """The sides of the faces, by edge."""
        return Sides(self.faces, len(self.vertices))

    def keep_faces(self, keep: BoolArray) -> Draft:
        """Return the draft with only these faces (m,), in their order."""
        return replace(
            self,
            faces=self.faces[keep],
            face_map=self.face_map[keep],
            turned=self.turned[keep],
        )

    def keep_vertices(self, keep: BoolArray) -> Draft:
        """Return the draft with only these vertices (n,), which no face may need otherwise."""
        number = np.cumsum(keep) - 1
        return replace(
            self,
            vertices=self.vertices[keep],
            faces=number[self.faces],
            vertex_map=self.vertex_map[keep],
            mix=self.mix[np.flatnonzero(keep)],
        )

    def turn(self, which: BoolArray) -> Draft:
        """Return the draft with these faces (m,) turned round; their first vertex stays first."""
        faces = np.where(which[:, None], self.faces[:, [0, 2, 1]], self.faces)
        return replace(self, faces=faces, turned=self.turned ^ which)


def drop_non_finite(draft: Draft) -> tuple[Draft, str]:
    """Drop vertices without a place, and the faces on them."""
    finite: BoolArray = np.logical_and.reduce(np.isfinite(draft.vertices), axis=1)
    keep: BoolArray = np.logical_and.reduce(finite[draft.faces], axis=1)
    if finite.all():
        return draft, ""
    vertices, faces = _n(~finite, "vertex", "vertices"), _n(~keep, "face")
    sentence = f"drop {vertices} with NaN or infinite coordinates and {faces} there"
    return draft.keep_faces(keep).keep_vertices(finite), sentence


def drop_degenerate(draft: Draft) -> tuple[Draft, str]:
    """Drop faces that name a vertex twice."""
    bad = repeats_vertex(draft.faces)
    return draft.keep_faces(~bad), f"drop {_n(bad, 'degenerate face')}" if bad.any() else ""


def weld(draft: Draft, distance: float) -> tuple[Draft, str]:
    """Make vertices one that lie within *distance*, where that closes open edges."""
    sides, n = draft.sides, len(draft.vertices)
    tail, head = sides.tail[sides.open], sides.head[sides.open]
    place = _places(draft.vertices, np.union1d(tail, head), distance)
    keys = edge_keys(place[tail], place[head], n)
    _, edge, count = np.unique(keys, return_inverse=True, return_counts=True)
    closes = np.flatnonzero((count[edge] % 2 == 0) & (place[tail] != place[head]))
    closes = closes[np.argsort(edge[closes], kind="stable")]
    forward = place[tail[closes]] < place[head[closes]]
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
    closed = len(sides.open) - len(welded.sides.open)
    sentence = f"weld {_n(gone, 'duplicate vertex', 'duplicate vertices')}"
    sentence += f", which closes {_n(range(closed), 'open edge')}"
    return welded, sentence + (f" and drops {_n(collapsed, 'face')}" if collapsed.any() else "")


def weld_corners(draft: Draft, distance: float) -> tuple[Draft, str]:
    """Weld border vertices within *distance* of each other where holes touch at a corner only.

    Otherwise two holes would count as one whose border passes the corner twice.  Where edges would
    be merged, too, nothing is welded: that is left to `weld`.
    """
    sides, n = draft.sides, len(draft.vertices)
    border = np.union1d(sides.tail[sides.open], sides.head[sides.open])
    number = _places(draft.vertices, border, distance)
    edge = sides.order[sides.first]
    tail, head = sides.tail[edge], sides.head[edge]
    while (gone := number != np.arange(n)).any():
        moved = np.isin(np.arange(n), number[gone])[number]
        near = moved[tail] | moved[head]
        one, other = number[tail[near]], number[head[near]]
        _, which, count = np.unique(
            edge_keys(one, other, n), return_inverse=True, return_counts=True
        )
        clash = (count[which] > 1) | (one == other)
        if not clash.any():
            break
        held = np.isin(number, np.append(one[clash], other[clash]))
        number = np.where(held, np.arange(n), number)
    if not gone.any():
        return draft, ""
    welded = replace(draft, faces=number[draft.faces]).keep_vertices(~gone)
    return welded, f"weld {_n(gone, 'vertex', 'vertices')} where holes touch"


def drop_duplicates(draft: Draft) -> tuple[Draft, str]:
    """Keep one face of those on the same vertices; none of two that wall off body from body."""
    a, b, c = draft.faces.T
    first = first_equal_row(np.sort(draft.faces, axis=1))
    drop = first != np.arange(len(first))
    if not drop.any():
        return draft, ""
    turn = np.where((a < b).astype(int) + (b < c) + (c < a) == 2, 1, -1)
    opposite = np.bincount(first, turn, minlength=len(first)) == 0
    distinct = np.flatnonzero(~drop)
    sides = draft.keep_faces(~drop).sides
    among_others = np.zeros(len(first), dtype=bool)
    among_others[distinct[sides.order[np.repeat(sides.n_sides > 2, sides.n_sides)] // 3]] = True
    wall = (opposite & among_others)[first]
    sentence = f"drop {_n(drop | wall, 'duplicate face')}"
    sentence += f", {np.count_nonzero(wall)} of them inner walls" if wall.any() else ""
    return draft.keep_faces(~(drop | wall)), sentence


def drop_unreferenced(draft: Draft) -> tuple[Draft, str]:
    """Drop vertices in no face."""
    used = np.zeros(len(draft.vertices), dtype=bool)
    used[draft.faces] = True
    if used.all():
        return draft, ""
    sentence = f"drop {_n(~used, 'unreferenced vertex', 'unreferenced vertices')}"
    return draft.keep_vertices(used), sentence


def split(draft: Draft) -> tuple[Draft, str]:
    """Give each fan a vertex of its own; the first fan keeps the old one."""
    faces, copied = split_fans(draft.vertices, draft.sides)
    if not len(copied):
        return draft, ""
    places, edges = _n(np.unique(copied), "vertex", "vertices"), len(draft.sides.crowded)
    also = f" and {_n(draft.sides.crowded, 'edge')}" if edges else ""
    sentence = f"split {places}{also} where surfaces touch, adding {_n(copied, 'copy', 'copies')}"
    return (
        replace(
            draft,
            vertices=np.concatenate([draft.vertices, draft.vertices[copied]]),
            faces=faces,
            vertex_map=np.concatenate([draft.vertex_map, draft.vertex_map[copied]]),
            mix=sparse.vstack([draft.mix, draft.mix[copied]], format="csr"),
        ),
        sentence,
    )


def orient(draft: Draft) -> tuple[Draft, str]:
    """Turn the fewer faces of each shell, so that all its neighbours agree.

    Each face stands twice in a graph, as it is and turned; what agrees is connected.  A shell
    whose two halves are connected has one side only, and stays as it is.
    """
    sides, m = draft.sides, len(draft.faces)
    one, other = sides.pairs.T // 3
    other_way = np.where(sides.turned, other + m, other)
    group = connected(
        2 * m,
        np.concatenate([one, one + m]),
        np.concatenate([other_way, (other_way + m) % (2 * m)]),
    )
    as_is, turned = group[:m], group[m:]
    shell = np.minimum(as_is, turned)
    n_turned = np.bincount(shell, turned == shell, minlength=2 * m)
    n_as_is = np.bincount(shell, as_is == shell, minlength=2 * m)
    turn = ((turned == shell) != (n_turned > n_as_is)[shell]) & (as_is != turned)
    if not turn.any() or len(sides.crowded):
        return draft, ""
    return draft.turn(turn), f"turn {_n(turn, 'face')} round to agree with the neighbours"


def fill(draft: Draft, largest: int) -> tuple[Draft, str]:
    """Close holes of up to *largest* edges, at most with one new vertex each."""
    if len(draft.sides.crowded) or draft.sides.turned.any():
        return draft, ""
    closing = close_holes(draft.vertices, draft.sides, largest)
    sizes, new = closing.sizes, len(closing.vertices)
    if not sizes:
        return draft, ""
    few, many = min(sizes), max(sizes)
    sentence = f"fill {_n(sizes, 'hole')} of {few if few == many else f'{few} to {many}'} edges"
    sentence += f" with {_n(closing.faces, 'triangle')}"
    sentence += f" and {_n(closing.vertices, 'new vertex', 'new vertices')}" if new else ""
    if closing.n_crossing:
        lids = "1 lid crosses" if closing.n_crossing == 1 else f"{closing.n_crossing} lids cross"
        sentence += f"\n{lids} the surface or another lid; no alternative was found"
    rows = np.repeat(np.arange(new), closing.sources.shape[1])
    mix = sparse.coo_array(
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
            turned=np.append(draft.turned, np.zeros(len(closing.faces), dtype=bool)),
            mix=sparse.vstack([draft.mix, mix.tocsr() @ draft.mix], format="csr"),
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
        turned=(draft.turned & ~changed)[order],
    )
    return cut, f"split {_n(changed & ~lids, 'face')} at vertices on an edge, to close cracks"


def holes_beyond(draft: Draft, largest: int) -> tuple[int, ...]:
    """Return the number of edges of each hole that `fill` leaves open only because of its size."""
    if len(draft.sides.crowded) or draft.sides.turned.any():
        return ()
    loops = border_loops(draft.vertices, draft.sides, len(draft.sides.open))
    return tuple(sorted(len(loop) for loop in loops if len(loop) > largest))


def turn_outward(draft: Draft) -> tuple[Draft, str]:
    """Turn closed shells that face the wrong side; those without volume stay as they are."""
    sides = draft.sides
    if len(sides.crowded) or sides.turned.any():
        return draft, ""
    closed = np.ones(len(draft.faces), dtype=bool)
    closed[np.isin(sides.shells, sides.shells[sides.open // 3])] = False
    _, shells = np.unique(sides.shells[closed], return_inverse=True)
    wrong = wrong_way_round(draft.vertices, draft.faces[closed], shells)
    turn = np.zeros(len(draft.faces), dtype=bool)
    turn[closed] = wrong[shells]
    turned = draft.turn(turn)
    wrong &= ~wrong_way_round(turned.vertices, turned.faces[closed], shells)
    if not wrong.any():
        return draft, ""
    turn[closed] = wrong[shells]
    return draft.turn(turn), f"turn {_n(wrong, 'inside-out component')} round ({_n(turn, 'face')})"


def _places(vertices: FloatArray, border: IntArray, distance: float) -> IntArray:
    """Return for each vertex (n,) the first of *border* within *distance*; others for itself."""
    place = np.arange(len(vertices))
    if distance > 0.0:
        pairs = cKDTree(vertices[border]).query_pairs(distance, output_type="ndarray")
        first = first_of_group(connected(len(border), *pairs.T))
    else:
        first = first_equal_row(vertices[border])
    place[border] = border[first]
    return place


def _n(things: Sized, one: str, many: str = "") -> str:
    """Return "1 face", "2 faces": how many things, or how many true ones of a mask."""
    if isinstance(things, np.ndarray) and things.dtype == bool:
        things = np.flatnonzero(things)
    count = len(things)
    return f"{count} {one if count == 1 else many or one + 's'}"
