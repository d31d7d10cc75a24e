"""The zoo: every kind of bad input there is a name for, made from code, and what becomes of it.

A `Creature` is an input; `fault` is what a refusal has to say about it, a regular expression, or
None where it must be answered.  `exhibits` of meshes are pairs of vertices and faces, those of
regions, cages, held vertices and targets belong to one body, `body`, 258 vertices long in x.
"""

# ruff: noqa: E501 - tables, one exhibit a line
from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyvista as pv
from solids import CUBE, OCTAHEDRON, TETRAHEDRON, icosphere, torus

from vtk_segdeform import models

Soup = tuple[Any, Any]


@dataclass(frozen=True)
class Creature:
    """One bad, or odd but good, input."""

    name: str
    make: Callable[[], Any]
    fault: str | None = None
    mended: bool = True  # whether `repair` makes a mesh of it
    is_soup: bool = True  # whether a file could hold it
    but: Mapping[str, str | None] = field(default_factory=dict)  # other faults, by operation


def body() -> Soup:
    """Return an ellipsoid along x, three times as long as thick."""
    vertices, faces = icosphere(3)
    return vertices * [3.0, 1.0, 1.0], faces


def cells(filled: Any, finer: int = 1) -> Soup:
    """Return the surface of the filled cells of a grid, as quadrangles cut in two."""
    filled = np.pad(np.kron(np.asarray(filled, bool), np.ones((finer,) * 3, bool)), 1)
    quads = []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
        for side in (0, 1):
            beyond = np.roll(filled, 1 - 2 * side, axis)
            corner = np.argwhere(filled & ~beyond) + side * np.eye(3, dtype=int)[axis]
            ring = [corner, corner + u, corner + u + v, corner + v]
            quads.append(np.stack(ring if side else ring[::-1], axis=1))
    places, number = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    a, b, c, d = number.reshape(-1, 4).T
    return places / finer, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def joined(*soups: Soup) -> Soup:
    """Return several surfaces as one."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in soups)])
    faces = [f + start for (_, f), start in zip(soups, starts, strict=False)]
    return np.concatenate([v for v, _ in soups]), np.concatenate(faces)


def moved(soup: Soup, scale: Any = 1.0, shift: Any = (0.0, 0.0, 0.0)) -> Soup:
    """Return a surface scaled, then shifted."""
    return np.asarray(soup[0]) * scale + shift, soup[1]


def soup_of(soup: Soup) -> Soup:
    """Return triangles that share no vertex."""
    vertices, faces = soup
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def with_face(soup: Soup, *faces: Any) -> Soup:
    """Return a surface with more faces."""
    return soup[0], np.concatenate([soup[1], np.asarray(faces)])


def flipped(soup: Soup, which: Any = slice(None)) -> Soup:
    """Return a surface, some of its faces turned round."""
    faces = soup[1].copy()
    faces[which] = faces[which][:, ::-1]
    return soup[0], faces


def with_value(value: float) -> Soup:
    """Return the body, one coordinate replaced."""
    vertices, faces = body()
    vertices[100, 1] = value
    return vertices, faces


def split_near(share: float, every: int = 5) -> Soup:
    """Return the body, a vertex put into some faces, at *share* of the way from one corner."""
    vertices, faces = body()
    chosen = faces[::every]
    a, b, c = vertices[chosen.T]
    new = len(vertices) + np.arange(len(chosen))
    i, j, k = chosen.T
    parts = [np.stack(p, 1) for p in ((i, j, new), (j, k, new), (k, i, new))]
    kept = np.delete(faces, np.s_[::every], axis=0)
    return np.concatenate([vertices, a + share * (0.5 * (b + c) - a)]), np.concatenate(
        [kept, *parts]
    )


def uneven() -> Soup:
    """Return the body, its vertices crowded at one end: edges from 1e-6 to 1."""
    vertices, faces = icosphere(3)
    x = 0.5 * (vertices[:, :1] + 1.0)
    return np.hstack([3.0 * x**6, vertices[:, 1:] * x**3]) + [0.0, 0.0, 1.0], faces


def closed_slit() -> Soup:
    """Return a U whose limbs touch face to face: coordinates coincide, vertices do not."""
    filled = np.ones((3, 1, 4), bool)
    filled[1, :, 1:] = False
    vertices, faces = cells(filled, 2)
    x = vertices[:, 0]
    x[x >= 2.5] -= 1.0
    return np.stack([np.where(x > 1.5, 1.5 + (x - 1.5) / 2.0, x), *vertices[:, 1:].T], 1), faces


def moebius(n: int = 12) -> Soup:
    """Return a strip turned over once."""
    a = np.pi * 2 * np.arange(n) / n
    side = np.stack([np.cos(a) * np.cos(a / 2), np.sin(a) * np.cos(a / 2), np.sin(a / 2)], 1) * 0.3
    middle = np.stack([np.cos(a), np.sin(a), 0 * a], 1)
    low, high = np.arange(n), np.arange(n) + n
    after_low, after_high = np.roll(low, -1), np.roll(high, -1)
    after_low[-1], after_high[-1] = n, 0
    faces = [np.stack([low, after_low, after_high], 1), np.stack([low, after_high, high], 1)]
    return np.concatenate([middle - side, middle + side]), np.concatenate(faces)


def klein(n: int = 16, m: int = 10) -> Soup:
    """Return a closed surface without an inside: the figure-8 immersion of Klein's bottle."""
    u, v = (2 * np.pi * k for k in np.meshgrid(np.arange(n) / n, np.arange(m) / m, indexing="ij"))
    r = 2 + np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
    z = np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v)
    vertices = np.stack([r * np.cos(u), r * np.sin(u), z], -1).reshape(-1, 3)

    def number(i: Any, j: Any) -> Any:
        return (i % n) * m + np.where(i >= n, -j, j) % m

    i, j = np.indices((n, m)).reshape(2, -1)
    here, east, north, both = number(i, j), number(i + 1, j), number(i, j + 1), number(i + 1, j + 1)
    return vertices, np.concatenate(
        [np.stack([here, east, both], 1), np.stack([here, both, north], 1)]
    )


def holed_plate() -> Soup:
    """Return a plate with five holes: genus 5."""
    filled = np.ones((11, 3, 1), bool)
    filled[1::2, 1] = False
    return cells(filled, 2)


def pushed_through() -> Soup:
    """Return the body, one vertex pushed out on the other side."""
    vertices, faces = body()
    top = vertices[:, 2].argmax()
    vertices[top, 2] = -1.5
    return vertices, faces


def _corner(*at: tuple[int, int, int]) -> Soup:
    filled = np.zeros((2, 2, 2), bool)
    filled[tuple(np.array(at).T)] = True
    return cells(filled)


BALL = icosphere(2)

SOUND = [
    Creature("tetrahedron", lambda: TETRAHEDRON),
    Creature("octahedron", lambda: OCTAHEDRON),
    Creature("cube of large faces", lambda: CUBE),
    Creature("body", body),
    Creature("float32", lambda: (body()[0].astype(np.float32), body()[1].astype(np.uint16))),
    Creature("integers", lambda: (cells(np.ones((4, 1, 1)))[0].astype(np.int8), cells(np.ones((4, 1, 1)))[1])),
    Creature("lists", lambda: (body()[0].tolist(), body()[1].tolist())),
    Creature("not contiguous", lambda: (np.asfortranarray(body()[0]), body()[1][::-1])),
    Creature("tiny, 1e-9", lambda: moved(body(), 1e-9)),
    Creature("tiny, 1e-60", lambda: moved(body(), 1e-60)),
    Creature("huge, 1e9", lambda: moved(body(), 1e9)),
    Creature("huge, 1e60", lambda: moved(body(), 1e60)),
    Creature("far from the origin, 1e3 sizes", lambda: moved(body(), 1.0, [6e3, -6e3, 6e3])),
    Creature("far from the origin, 1e6 sizes", lambda: moved(body(), 1.0, [6e6, -6e6, 6e6])),
    Creature("two apart", lambda: joined(body(), moved(BALL, 0.7, [5.0, 0, 0]))),
    Creature("two that overlap", lambda: joined(body(), moved(BALL, 0.7, [3.0, 0, 0]))),
    Creature("a body with a cavity", lambda: joined(body(), flipped(moved(BALL, 0.5)))),
    Creature("thirty crumbs", lambda: joined(*(moved(OCTAHEDRON, 0.3, [k, 0, 0]) for k in range(30)))),
    Creature("crossing itself", pushed_through),
    Creature("genus 1", lambda: torus(24, 10)),
    Creature("genus 5", holed_plate),
    Creature("needles, 1e-3", lambda: split_near(1e-3)),
    Creature("needles, 1e-9", lambda: split_near(1e-9)),
    Creature("needles, 1e-15", lambda: split_near(1e-15)),
    Creature("faces without area", lambda: split_near(0.0)),
    Creature("a long prism of slivers", lambda: moved(icosphere(3), [1.0, 1.0, 1e-4])),
    Creature("very uneven sampling", uneven),
    Creature("thin plate, 1 : 1000", lambda: moved(cells(np.ones((12, 8, 1))), [1.0, 1.0, 0.012])),
    Creature("thin plate, 1 : 1e6", lambda: moved(cells(np.ones((12, 8, 1))), [1.0, 1.0, 1.2e-5])),
    Creature("wire, 1 : 300", lambda: moved(cells(np.ones((60, 1, 1)), 1), [5.0, 1.0, 1.0])),
    Creature("ring of wire", lambda: torus(60, 4, 1.0, 0.004)),
    Creature("limbs that touch", closed_slit),
    Creature("coincident vertices", lambda: moved(joined(cells(np.ones((2, 1, 1))), moved(cells(np.ones((2, 1, 1))), 1.0, [2.0, 0, 0])))),
]  # fmt: skip

FAULTY = [
    Creature("empty", lambda: (np.empty((0, 3)), np.empty((0, 3), int)), "empty mesh|no surface", False),
    Creature("no faces", lambda: (body()[0], np.empty((0, 3), int)), "empty mesh|no surface", False),
    Creature("one triangle", lambda: (np.eye(3), np.array([[0, 1, 2]])), "3 open edges", False),
    Creature("a face missing", lambda: (body()[0], body()[1][1:]), "3 open edges.*1 hole"),
    Creature("half of it", lambda: (body()[0], body()[1][::2]), "open edges"),
    Creature("cut in half", lambda: (cells(np.ones((6, 1, 1)))[0], cells(np.ones((6, 1, 1)))[1][:-8]), "open edges"),
    Creature("two cubes at an edge", lambda: _corner((0, 0, 0), (1, 1, 0)), "1 non-manifold edge"),
    Creature("two cubes at a corner", lambda: _corner((0, 0, 0), (1, 1, 1)), "1 non-manifold vertex"),
    Creature("a fin", lambda: with_face(body(), [0, *body()[1][5][:2]]), "non-manifold edge|open edge", False),
    Creature("inside out", lambda: flipped(body()), "1 inside-out component"),
    Creature("half flipped", lambda: flipped(body(), slice(0, 256)), "inconsistently oriented"),
    Creature("one face flipped", lambda: flipped(body(), slice(7, 8)), "3 inconsistently oriented"),
    Creature("one of two inside out", lambda: joined(body(), flipped(moved(BALL, 0.5, [9.0, 0, 0]))), "1 inside-out"),
    Creature("nested and outward", lambda: joined(body(), moved(BALL, 0.5)), "1 inside-out"),
    Creature("triangle soup", lambda: soup_of(body()), "open edges"),
    Creature("duplicate faces", lambda: with_face(body(), *body()[1][:9]), "9 duplicate faces"),
    Creature("degenerate faces", lambda: with_face(body(), [3, 3, 4], [5, 5, 5]), "2 degenerate faces"),
    Creature("a vertex in no face", lambda: (np.vstack([body()[0], [9, 9, 9]]), body()[1]), "1 unreferenced"),
    Creature("NaN", lambda: with_value(np.nan), "1 vertex with NaN"),
    Creature("infinite", lambda: with_value(np.inf), "1 vertex with NaN or infinite"),
    Creature("all NaN", lambda: moved(body(), np.nan), "258 vertices with NaN", False),
    Creature("a number too high", lambda: with_face(body(), [0, 1, 258]), "out of range|use vertices", False),
    Creature("a number below 0", lambda: with_face(body(), [0, 1, -1]), "out of range|use vertices", False),
    Creature("a number of 2^63", lambda: with_face((body()[0], body()[1].astype(np.uint64)), np.array([0, 1, 2**63 + 7], np.uint64)), "out of range|use vertices", False, False),
    Creature("flat", lambda: moved(body(), [1.0, 1.0, 0.0]), "encloses no volume", False),
    Creature("both sides of a triangle", lambda: (np.eye(3), np.array([[0, 1, 2], [0, 2, 1]])), "duplicate face|open edges", False),
    Creature("all in one place", lambda: moved(body(), 0.0), "encloses no volume", False),
    Creature("Moebius' strip", moebius, "open edges", False),
    Creature("Klein's bottle", klein, "inconsistently oriented", False),
    Creature("so far that faces collapse, 1e18", lambda: moved(body(), 1.0, 1e18), "encloses no volume", False),
    Creature("so huge that volumes overflow", lambda: moved(body(), 1e150), "too large|too far", False),
    Creature("so tiny that volumes vanish", lambda: moved(body(), 1e-150), "too small", False),
    Creature("points in a plane", lambda: (body()[0][:, :2], body()[1]), r"vertices must have shape \(n, 3\)", False, False),
    Creature("quadrangles", lambda: (body()[0], np.arange(256).reshape(-1, 4)), "triangles", False, False),
    Creature("numbers with a point", lambda: (body()[0], body()[1] + 0.5), "faces must hold integers", False, False),
    Creature("words", lambda: (body()[0].astype(str), body()[1]), "vertices must hold numbers", False, False),
    Creature("complex numbers", lambda: (body()[0] + 1j, body()[1]), "vertices must hold numbers", False, False),
    Creature("ragged lists", lambda: ([[0, 0, 0], [1, 0]], [[0, 1, 1]]), "rows differ in length", False, False),
    Creature("None", lambda: (None, None), "vertices must", False, False),
]  # fmt: skip

POLYDATA = [
    Creature("quadrangles", lambda: _polydata(4)),
    Creature("polygons", lambda: _polydata(12)),
    Creature("strips", lambda: _strips()),
    Creature("float32 points", lambda: _single(_polydata(4))),
    Creature("with lines and vertices beside", lambda: _polydata(4) + _lines(), "unreferenced|line"),
    Creature("quadrangles, one missing", lambda: _polydata(4).extract_cells(range(1, 40)).extract_surface(algorithm=None), "open edges"),
    Creature("lines only", lambda: _lines(), "no surface|empty mesh"),
    Creature("points only", lambda: pv.PolyData(np.eye(3)), "no surface|empty mesh"),
    Creature("nothing", lambda: pv.PolyData(), "no surface|empty mesh"),
]  # fmt: skip


def _polydata(corners: int) -> pv.PolyData:
    """Return a prism of quadrangles and two caps of so many corners; of quadrangles only, if 4."""
    if corners == 4:
        return pv.Box((0, 4, 0, 1, 0, 1), level=2, quads=True).clean()
    return pv.Cylinder(resolution=corners, height=4.0, capping=True).clean()


def _single(polydata: pv.PolyData) -> pv.PolyData:
    polydata.points = polydata.points.astype(np.float32)
    return polydata


def _strips() -> pv.PolyData:
    return _polydata(4).triangulate().strip()


def _lines() -> pv.PolyData:
    return pv.Line((9.0, 9.0, 9.0), (10.0, 9.0, 9.0), resolution=5)


def _mask(*ids: int) -> Any:
    mask = np.zeros(258, bool)
    mask[list(ids)] = True
    return mask


def _left(limit: float = 0.0) -> Any:
    return body()[0][:, 0] <= limit


REGIONS = [
    Creature("everything", lambda: [np.ones(258, bool)]),
    Creature("everything twice", lambda: np.ones((2, 258), bool)),
    Creature("a single vertex beside everything", lambda: [np.ones(258, bool), _mask(7)]),
    Creature("two halves without overlap", lambda: [_left(), ~_left()]),
    Creature("both ends, and the middle", lambda: [abs(body()[0][:, 0]) > 1.2, abs(body()[0][:, 0]) < 1.8]),
    Creature("vertices at random", lambda: np.random.default_rng(0).random((3, 258)) < [[0.5], [0.5], [2.0]]),
    Creature("chequered, no two neighbours", lambda: [np.arange(258) % 2 == 0, np.arange(258) % 2 == 1]),
    Creature("seven single vertices, and the rest", lambda: [*(_mask(k) for k in range(7)), ~_mask(*range(7))]),
    Creature("one within another", lambda: [np.ones(258, bool), _left(-1.0)]),
    Creature("none", lambda: np.empty((0, 258), bool), "in no region"),
    Creature("an empty one", lambda: [np.ones(258, bool), np.zeros(258, bool)], "1 region has no vertices"),
    Creature("a vertex in none", lambda: [~_mask(5)], "1 vertex is in no region"),
    Creature("of another mesh", lambda: [np.ones(66, bool)], "shape"),
    Creature("numbers for masks", lambda: np.ones((2, 258)), "bool"),
    Creature("words for masks", lambda: [["a"] * 258], "bool"),
    Creature("ragged", lambda: [np.ones(258, bool), np.ones(7, bool)], "bool|differ in length"),
]  # fmt: skip

OVERLAPS = [
    Creature("0", lambda: 0), Creature("1", lambda: 1), Creature("10", lambda: 10),
    Creature("huge, 10000", lambda: 10_000),
    Creature("-1", lambda: -1, "whole number, 0 or more"),
    Creature("2.5", lambda: 2.5, "whole number"),
    Creature("NaN", lambda: np.nan, "whole number"),
    Creature("infinite", lambda: np.inf, "whole number"),
    Creature("a word", lambda: "four", "whole number"),
]  # fmt: skip


def ball(n: float = 1.0, shift: Any = (0.0, 0.0, 0.0), finer: int = 2) -> Soup:
    """Return a cage for the body: an ellipsoid around it, *n* times as large as a snug one."""
    vertices, faces = icosphere(finer)
    return vertices * n * np.array([3.7, 1.4, 1.4]) + shift, faces


def _tetrahedron() -> Soup:
    return TETRAHEDRON[0] * [9.0, 3.0, 3.0], TETRAHEDRON[1]


CAGES = [
    Creature("snug", ball),
    Creature("4 vertices", _tetrahedron),
    Creature("1600 vertices", lambda: _sphere(1600)),
    Creature("2000 vertices", lambda: _sphere(2000), "the limit of the solver is"),
    Creature("ten times as large", lambda: ball(10.0)),
    Creature("almost on the skin, 1e-6", lambda: moved(body(), 1.0 + 1e-6)),
    Creature("a part of it far away", lambda: joined(ball(), ball(0.2, [9.0, 0, 0]))),
    Creature("an empty cavity in it", lambda: joined(ball(3.0), flipped(ball(0.2, [0, 0, 3.0])))),
    Creature("needles in it", lambda: moved(split_near(1e-3), [1.25, 1.45, 1.45])),
    Creature("two parts that cross", lambda: joined(ball(), ball(1.0, [0.3, 0, 0])), "cross"),
    Creature("on the skin", body, "outside"),
    Creature("open", lambda: (ball()[0], ball()[1][3:]), "open"),
    Creature("inward", lambda: flipped(ball()), "inside-out"),
    Creature("half inward", lambda: flipped(ball(), slice(0, 60)), "orient|same way|direction"),
    Creature("too small", lambda: ball(0.7), "outside"),
    Creature("elsewhere", lambda: ball(1.0, [20.0, 0, 0]), "outside"),
    Creature("crossing itself", lambda: _crossed(), "cross"),
    Creature("too large, 1e6", lambda: ball(1e6), "times as large"),
    Creature("flat", lambda: moved(ball(), [1.0, 1.0, 0.0]), "cross|no area|touch"),
    Creature("the body in its cavity", lambda: joined(ball(3.0), flipped(ball())), "outside"),
    Creature("NaN", lambda: moved(ball(), [1.0, np.nan, 1.0]), "NaN"),
    Creature("empty", lambda: (np.empty((0, 3)), np.empty((0, 3), int)), "needs at least 4 faces|no surface"),
    Creature("faces of another", lambda: (ball()[0], body()[1]), "must index|use vertices"),
    Creature("words", lambda: (ball()[0].astype(str), ball()[1]), "must hold numbers", but={"cage in a pipeline": None}),
    Creature("huge, 1e200", lambda: ball(1e200), "too large to compute"),
    Creature("tiny, 1e-200", lambda: ball(1e-200), "no area|too small|outside"),
]  # fmt: skip


def _sphere(n: int) -> Soup:
    sphere = models.sphere(n)
    return sphere.vertices * [3.7, 1.4, 1.4], sphere.faces


def _crossed() -> Soup:
    vertices, faces = ball()
    vertices = vertices.copy()
    vertices[vertices[:, 2].argmax(), 2] = -3.0
    return vertices, faces


LEFT, RIGHT = np.flatnonzero(_left(-2.4)), np.flatnonzero(~_left(2.4))
NEED_ONE = {"held in a session": "needs one vertex or more"}
HELD = [  # (fixed, handle)
    Creature("two ends", lambda: (LEFT, RIGHT)),
    Creature("masks", lambda: (_mask(*LEFT), _mask(*RIGHT))),
    Creature("nothing fixed", lambda: ([], RIGHT)),
    Creature("no handle", lambda: (LEFT, []), but=NEED_ONE),
    Creature("neither", lambda: ([], []), but=NEED_ONE),
    Creature("one vertex each", lambda: (LEFT[:1], RIGHT[:1])),
    Creature("one vertex dragged", lambda: ([], RIGHT[:1])),
    Creature("everything fixed", lambda: (np.ones(258, bool), []), but=NEED_ONE),
    Creature("everything dragged", lambda: ([], np.arange(258))),
    Creature("all but one fixed", lambda: (np.arange(257), [257])),
    Creature("all but one dragged", lambda: ([0], np.arange(1, 258))),
    Creature("every other vertex", lambda: (np.arange(0, 258, 2), np.arange(1, 258, 2))),
    Creature("neighbours", lambda: (body()[1][0, :1], body()[1][0, 1:2])),
    Creature("seventy handles of one vertex", lambda: (LEFT, np.setdiff1d(np.arange(0, 258, 3), LEFT))),
    Creature("the same", lambda: (RIGHT, RIGHT), "both fixed and handle"),
    Creature("overlapping", lambda: (np.arange(9), np.arange(8, 20)), "1 vertices are both fixed"),
    Creature("a number too high", lambda: (LEFT, [258]), "must index 0..257"),
    Creature("a number below 0", lambda: ([-1], RIGHT), "must index 0..257"),
    Creature("numbers with a point", lambda: (LEFT, [1.5, 2.5]), "vertex numbers"),
    Creature("a vertex twice", lambda: (LEFT, [200, 200]), "a vertex twice"),
    Creature("a mask too short", lambda: (LEFT, np.ones(5, bool)), "mask", but={"held in a pipeline": "both fixed and handle"}),
    Creature("NaN", lambda: ([np.nan], RIGHT), "vertex numbers"),
    Creature("words", lambda: (["a"], RIGHT), "vertex numbers"),
    Creature("a table", lambda: (LEFT, [[200, 201], [202, 203]]), "list of vertex numbers"),
    Creature("None", lambda: (None, RIGHT), "must be an array"),
    Creature("of 2^63", lambda: (LEFT, np.array([2**63 + 5], np.uint64)), "must index"),
]  # fmt: skip


def _there() -> Any:
    return body()[0][RIGHT]


ONE_EACH = "one point for each|must be 29 points|must be 66 points"
TARGETS = [
    Creature("at rest", _there),
    Creature("a little up", lambda: _there() + [0, 0, 0.1]),
    Creature("as lists", lambda: _there().tolist()),
    Creature("in single precision", lambda: _there().astype(np.float32)),
    Creature("ten sizes away", lambda: _there() + [60.0, 0, 0]),
    Creature("a hundred sizes away", lambda: _there() + [0, 600.0, 0], "same unit|at most 10 are allowed"),
    Creature("mirrored", lambda: _there() * [1.0, -1.0, 1.0]),
    Creature("turned half round", lambda: _there() * [1.0, -1.0, -1.0]),
    Creature("on the other side of the body", lambda: _there() * [-1.0, 1.0, -1.0]),
    Creature("all in one point", lambda: 0 * _there() + [3.0, 0, 0]),
    Creature("all at what is fixed", lambda: 0 * _there() + [-3.0, 0, 0]),
    Creature("a tenth as large", lambda: (_there() - [3, 0, 0]) * 0.1 + [3, 0, 0]),
    Creature("ten times as large", lambda: (_there() - [3, 0, 0]) * 10 + [3, 0, 0]),
    Creature("shuffled", lambda: _there()[np.random.default_rng(0).permutation(len(RIGHT))]),
    Creature("noise", lambda: _there() + np.random.default_rng(0).normal(0, 0.5, (len(RIGHT), 3))),
    Creature("NaN", lambda: _there() * [1.0, np.nan, 1.0], "NaN"),
    Creature("one NaN", lambda: np.where(np.arange(len(RIGHT))[:, None] == 3, np.nan, _there()), "points have NaN"),
    Creature("at infinity", lambda: _there() + np.inf, "infinite"),
    Creature("1e30 away", lambda: _there() + 1e30, "same unit|diagonals of the mesh away"),
    Creature("1e300 away", lambda: _there() + 1e300, "same unit|diagonals of the mesh away"),
    Creature("too few", lambda: _there()[:-1], ONE_EACH),
    Creature("too many", lambda: np.vstack([_there(), [1, 1, 1]]), ONE_EACH),
    Creature("in the plane", lambda: _there()[:, :2], "shape"),
    Creature("one point", lambda: [3.0, 0.0, 1.0], "shape"),
    Creature("none", lambda: np.empty((0, 3)), ONE_EACH),
    Creature("words", lambda: _there().astype(str).tolist()[:-1] + [["a", "b", "c"]], "numbers"),
    Creature("complex", lambda: _there() + 1j, "real numbers"),
    Creature("ragged", lambda: [[0, 0, 0], [1]], "length"),
]  # fmt: skip

MOTIONS = [  # (4, 4), from rest
    Creature("unity", lambda: np.eye(4)),
    Creature("a mirror", lambda: np.diag([1.0, -1.0, 1.0, 1.0])),
    Creature("flattening", lambda: np.diag([1.0, 1.0, 0.0, 1.0])),
    Creature("a hundredfold", lambda: np.diag([100.0, 100.0, 100.0, 1.0]), "at most 10 are allowed"),
    Creature("a shear", lambda: np.eye(4) + np.eye(4, k=1) * [0, 1, 1, 0]),
    Creature("NaN", lambda: np.eye(4) * np.nan, "finite|nan"),
    Creature("perspective", lambda: np.eye(4) + 0.2 * np.eye(4, k=-1), "must be 0 0 0 1"),
    Creature("nought", lambda: np.zeros((4, 4)), "must be 0 0 0 1"),
    Creature("a plane one", lambda: np.eye(3), ONE_EACH),
    Creature("out of sight", lambda: np.diag([1e30, 1.0, 1.0, 1.0]), "same unit|diagonals of the mesh away"),
    Creature("words", lambda: np.char.add(np.eye(4).astype(str), "x"), "numbers"),
]  # fmt: skip


def _cage() -> Any:
    return ball()[0]


CAGE_POSES = [  # of the snug cage, 66 vertices
    Creature("at rest", _cage),
    Creature("bent", lambda: _cage() + np.outer(_cage()[:, 0] ** 2, [0.0, 0.0, 0.1])),
    Creature("mirrored", lambda: _cage() * [1.0, -1.0, 1.0]),
    Creature("flattened", lambda: _cage() * [1.0, 1.0, 0.0]),
    Creature("all in one point", lambda: _cage() * 0.0 + 1.0),
    Creature("noise", lambda: _cage() + np.random.default_rng(0).normal(0, 1.0, (66, 3))),
    Creature("ten times as large", lambda: _cage() * 10.0),
    Creature("NaN", lambda: _cage() * np.nan, "NaN"),
    Creature("out of sight", lambda: _cage() * 1e30, "at most 10 are allowed"),
    Creature("too few", lambda: _cage()[1:], "must be 66 points"),
    Creature("in the plane", lambda: _cage()[:, :2], "shape"),
    Creature("words", lambda: _cage().astype(str), "must hold numbers"),
]

NUMBERS = [
    Creature("NaN", lambda: np.nan, "must be"), Creature("infinite", lambda: np.inf, "must be"),
    Creature("-1", lambda: -1, "must be"), Creature("-infinite", lambda: -np.inf, "must be"),
    Creature("a word", lambda: "four", "must be"), Creature("a list", lambda: [4], "must be"),
    Creature("complex", lambda: 4j, "must be"), Creature("True", lambda: True, "must be"),
]  # fmt: skip
