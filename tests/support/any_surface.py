"""Surfaces of every kind, made by script: seams, soups, holes, polygons, flips, fins, walls, parts.

A `Specimen` is one surface as a pyvista PolyData, of a few hundred points so that it is bent in a
fraction of a second.  All of them must be bent as they are.  Where the mesh behind a surface must
be that of a clean original, `clean` makes the original, and where a plain statement about its
borders is possible, `borders` counts them.
"""

# ruff: noqa: E501 - tables, one specimen a line
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import pyvista as pv
from solids import OCTAHEDRON, icosphere, joined, torus
from zoo import Soup, body, cells, flipped, klein, moebius, moved, soup_of, with_face

from vtk_segdeform.io.polygons import polydata_of, triangles_of


@dataclass(frozen=True)
class Specimen:
    """One surface, and what must be true of the mesh that is deformed in its place."""

    name: str
    make: Callable[[], pv.PolyData]
    clean: Callable[[], Soup] | None = None  # vertices and faces of the mesh, in any order
    borders: int | None = None  # how many border loops the mesh has
    turned: bool = False  # whether the given orientation is not the one of the mesh


# Surfaces from triangles and polygons.


def triangles(soup: Soup) -> pv.PolyData:
    """Return triangles as PolyData."""
    vertices, faces = soup
    return polydata_of(np.asarray(vertices, float), np.full(len(faces), 3), np.ravel(faces))


def polygons(points: Any, rows: list[Any]) -> pv.PolyData:
    """Return polygons, each a list of points, as PolyData."""
    counts = np.array([len(row) for row in rows])
    return polydata_of(np.asarray(points, float), counts, np.concatenate(rows).astype(np.int64))


def sheet(n: int = 17, m: int = 9, rise: float = 0.3) -> tuple[Any, Any]:
    """Return points and quadrilaterals (k, 4) of a slightly curved rectangle, 4 by 2."""
    u, v = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-1, 1, m), indexing="ij")
    points = np.stack([u, v, rise * np.cos(u)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
    here = (i * m + j).ravel()
    return points, np.stack([here, here + m, here + m + 1, here + 1], axis=1)


def cut(quads: Any) -> Any:
    """Return two triangles (2 k, 3) for each quadrilateral (k, 4)."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def triangulated(points: Any, quads: Any) -> Soup:
    """Return quadrilaterals cut as they are cut by the package."""
    return points, triangles_of(polygons(points, quads))


def capsule() -> tuple[Any, Any]:
    """Return points and quadrilaterals of a closed, long box with rounded faces."""
    box = pv.Box((-3, 3, -1, 1, -1, 1), level=5, quads=True).clean()
    x = np.asarray(box.points, float)
    x[:, 1:] *= np.sqrt(1.2 - (x[:, :1] / 3.6) ** 2)
    return x, box.regular_faces


# Faults and features, added to a surface.


def split(soup: Soup, group: Any) -> tuple[Soup, Any]:
    """Return a soup with points doubled between *group* (m,) of faces, and the group of points."""
    vertices, faces = soup
    keys, number = np.unique(
        np.stack([faces.ravel(), np.repeat(group, faces.shape[1])], axis=1),
        axis=0,
        return_inverse=True,
    )
    return (vertices[keys[:, 0]], number.reshape(faces.shape)), keys[:, 1]


def octants(soup: Soup) -> Any:
    """Return the octant of each face, an int from 0 to 7."""
    return (soup[0][soup[1]].mean(axis=1) > 1e-9) @ [1, 2, 4]


def seam(soup: Soup, *, negative_zero: bool = False) -> pv.PolyData:
    """Return a surface with doubled points along its texture seam, and equal normals there."""
    smooth = _normals(soup)
    group = octants(soup) & 1
    (points, faces), of_points = split((np.hstack([soup[0], smooth]), soup[1]), group)
    points, normals = points[:, :3].copy(), points[:, 3:]
    if negative_zero:
        points[(points == 0) & (of_points == 1)[:, None]] = -0.0
    surface = triangles((points, faces))
    angle = np.arctan2(points[:, 2], points[:, 1]) / (2 * np.pi)
    surface.point_data["UV"] = np.stack([points[:, 0], angle + of_points], axis=1)
    surface.point_data.active_texture_coordinates_name = "UV"
    surface.point_data["Normals"] = normals
    surface.point_data.active_normals_name = "Normals"
    return surface


def creased(soup: Soup) -> pv.PolyData:
    """Return a surface with points doubled along sharp edges, where its normals differ."""
    surface = triangles(split(soup, octants(soup))[0])
    surface.point_data["Normals"] = _normals((surface.points, surface.regular_faces))
    surface.point_data.active_normals_name = "Normals"
    return surface


def _normals(soup: Soup) -> Any:
    """Return the unit normals of vertices, weighted by area."""
    vertices, faces = soup
    a, b, c = vertices[faces.T]
    normals = np.zeros_like(vertices)
    np.add.at(normals, faces, np.cross(b - a, c - a)[:, None])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def holed(soup: Soup, count: int) -> Soup:
    """Return a surface without *count* faces of which no two share a vertex."""
    vertices, faces = soup
    free, chosen = np.ones(len(vertices), bool), []
    for k in np.random.default_rng(5).permutation(len(faces)):
        if len(chosen) < count and free[faces[k]].all():
            free[faces[np.isin(faces, faces[k]).any(axis=1)]] = False
            chosen.append(k)
    assert len(chosen) == count
    return vertices, np.delete(faces, chosen, axis=0)


def some(n: int, share: float, seed: int = 0) -> Any:
    """Return a mask that is true for a share of n."""
    return np.random.default_rng(seed).random(n) < share


def part(soup: Soup, kept: Any) -> Soup:
    """Return the faces of a mask, and the vertices that they use."""
    used, faces = np.unique(soup[1][kept], return_inverse=True)
    return soup[0][used], faces.reshape(-1, 3)


def half(soup: Soup, axis: int = 2) -> Soup:
    """Return the faces above the middle."""
    return part(soup, soup[0][soup[1]].mean(axis=1)[:, axis] > 1e-9)


def _with_cells(surface: pv.PolyData) -> pv.PolyData:
    """Return a surface with two lines and three vertex cells, and an array over all cells."""
    n = surface.n_points
    both = pv.PolyData()
    both.points = np.vstack([surface.points, [[-3.0, 0, 2], [0, 0, 2], [3, 0, 2]]])
    both.verts = np.array([1, 0, 1, n, 1, n + 2])
    both.lines = np.array([2, n, n + 1, 3, n, n + 1, n + 2])
    both.faces = surface.faces
    both.cell_data["number"] = np.arange(both.n_cells)
    both.point_data["kind"] = np.arange(both.n_points) % 5
    return both


def _with_points(surface: pv.PolyData, *more: Any) -> pv.PolyData:
    """Return a surface with points that are in no cell: first, between and last."""
    n, counts = surface.n_points, len(more)
    first = counts // 2
    longer = pv.PolyData()
    longer.points = np.vstack([more[:first], surface.points, more[first:]])
    corners = surface.faces.copy()
    corners[np.arange(len(corners)) % 4 != 0] += first
    longer.faces = corners
    longer.point_data["number"] = np.arange(n + counts)
    return longer


def with_arrays(surface: pv.PolyData) -> pv.PolyData:
    """Return a surface with arrays of every type, some of them with special values."""
    surface = surface.copy()
    rng = np.random.default_rng(3)
    for attributes, n in (
        (surface.point_data, surface.n_points),
        (surface.cell_data, surface.n_cells),
    ):
        for kind in ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "?"):
            attributes[f"a {kind}"] = rng.integers(0, 100, n).astype(kind)
        attributes["RGBA"] = rng.integers(0, 255, (n, 4)).astype(np.uint8)
        attributes["tensor"] = rng.normal(size=(n, 9))
        attributes["name"] = np.array([f"part {k % 7}" for k in range(n)])
        special = rng.normal(size=n)
        special[:3] = np.nan, np.inf, -0.0
        attributes["special"] = special
    surface.field_data["unit"] = np.array(["mm"])
    surface.field_data["numbers"] = np.arange(3)
    surface.point_data.set_vectors(rng.normal(size=(surface.n_points, 3)), "vectors")
    surface.point_data.set_scalars(rng.normal(size=surface.n_points), "temperature")
    return surface


def with_normals(surface: pv.PolyData) -> pv.PolyData:
    """Return a surface with normals of points and cells, along its own orientation."""
    return surface.compute_normals(
        point_normals=True, cell_normals=True, split_vertices=False, consistent_normals=False, auto_orient_normals=False
    )  # fmt: skip


def in_single(surface: pv.PolyData) -> pv.PolyData:
    """Return a surface with points in single precision."""
    surface = surface.copy()
    surface.points = np.asarray(surface.points, np.float32)
    return surface


# Surfaces of their own.


def hexagons() -> pv.PolyData:
    """Return the body with the faces around some vertices merged: polygons that are not flat."""
    vertices, faces = body()
    free, rows, left = np.ones(len(vertices), bool), [], np.ones(len(faces), bool)
    for centre in range(len(vertices)):
        around = np.flatnonzero((faces == centre).any(axis=1) & left)
        if len(around) == 6 and free[faces[around]].all():
            free[faces[around]] = False
            after = {
                row[(at + 1) % 3]: row[(at + 2) % 3]
                for row in faces[around].tolist()
                for at in [row.index(centre)]
            }
            ring = [next(iter(after))]
            while after[ring[-1]] != ring[0]:
                ring.append(after[ring[-1]])
            rows.append(ring)
            left[around] = False
    assert len(rows) > 10
    return polygons(vertices, [*rows, *faces[left]])  # the centres are in no face


def concave() -> pv.PolyData:
    """Return a long prism over a U: two caps of eight corners, concave, and quadrilaterals."""
    outline = np.array([[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2.0]])
    slices, n = np.linspace(0, 9, 10), len(outline)
    points = np.concatenate([np.column_stack([np.full(n, x), outline]) for x in slices])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    sides = [
        np.stack([s * n + k, s * n + after, (s + 1) * n + after, (s + 1) * n + k], 1)
        for s in range(9)
    ]
    return polygons(points, [k[::-1], 9 * n + k, *np.concatenate(sides)])


def book() -> Soup:
    """Return three pages along one spine: edges with three faces, in the middle of everything."""
    points, quads = sheet(17, 5, 0.0)
    turned = []
    for angle in (0.0, 2.1, 4.2):
        y = points[:, 1] + 1.0
        turned.append(
            (np.stack([points[:, 0], y * np.cos(angle), y * np.sin(angle)], 1), cut(quads))
        )
    return welded(joined(*turned))


def welded(soup: Soup) -> Soup:
    """Return a surface with equal points merged, to nine digits."""
    points, number = np.unique(np.round(soup[0], 9) + 0.0, axis=0, return_inverse=True)
    return points, number.reshape(-1)[soup[1]]


def touching(*at: tuple[int, int, int], keep_walls: bool = False) -> Soup:
    """Return bars of cells that touch along an edge, at a vertex or by a face, welded."""
    bars = [moved(cells(np.ones((4, 1, 1)), 1), 1.0, np.multiply(place, [4, 1, 1])) for place in at]
    soup = welded(joined(*bars))
    if keep_walls:
        return soup
    _, first, count = np.unique(
        np.sort(soup[1], axis=1), axis=0, return_index=True, return_counts=True
    )
    return soup[0], soup[1][np.sort(first[count == 1])]


def walled() -> Soup:
    """Return a box of three rooms, with the two walls between them."""
    filled = [moved(cells(np.ones((2, 2, 2)), 1), 1.0, [2.0 * k, 0, 0]) for k in range(3)]
    vertices, faces = welded(joined(*filled))
    middle = vertices[faces].mean(axis=1)
    wall = np.isin(middle[:, 0], (2.0, 4.0))
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices, faces[~wall | np.isin(np.arange(len(faces)), first)]


def envelope() -> Soup:
    """Return a closed shell without thickness: both sides of a sheet, joined at its border."""
    points, quads = sheet()
    top = cut(quads)
    n = len(points)
    ids = np.arange(n).reshape(17, 9)
    inner = np.zeros(n, bool)
    inner[ids[1:-1, 1:-1].ravel()] = True
    other = np.where(inner, n + np.cumsum(inner) - 1, np.arange(n))
    return np.vstack([points, points[inner]]), np.concatenate([top, other[top][:, ::-1]])


def hanging() -> Soup:
    """Return a box of which one half is split into smaller faces: T-junctions of vertices."""
    coarse = part(cells(np.ones((4, 2, 2)), 1), _outside(cells(np.ones((4, 2, 2)), 1), 4.0))
    fine = cells(np.ones((4, 2, 2)), 2)
    fine = moved(part(fine, _outside(fine, 0.0)), 1.0, [4.0, 0, 0])
    return welded(joined(coarse, fine))


def _outside(soup: Soup, x: float) -> Any:
    return soup[0][soup[1]].mean(axis=1)[:, 0] != x


def finned() -> Soup:
    """Return the body with a row of triangles that stand on edges along its length."""
    vertices, faces = body()
    top = np.flatnonzero(np.abs(vertices[:, 1]) < 1e-9)
    top = top[vertices[top, 2] > 0]
    top = top[np.argsort(vertices[top, 0])]
    tips = vertices[top] + [0, 0, 0.4]
    number = len(vertices) + np.arange(len(top))
    fin = [[top[:-1], top[1:], number[:-1]], [top[1:], number[1:], number[:-1]]]
    return np.vstack([vertices, tips]), np.concatenate([faces, *(np.stack(f, 1) for f in fin)])


def _flat_faces(soup: Soup) -> pv.PolyData:
    """Return a surface with faces of two corners, of one corner, and of three on a line."""
    vertices, faces = soup
    a, b, n = *faces[9, :2], len(vertices)
    middle = 0.5 * (vertices[a] + vertices[b])
    more = [[3, 3, 4], [5, 5, 5], [7, 8, 7], [a, n, b]]
    return triangles((np.vstack([vertices, middle]), np.vstack([faces, more])))


def _flat_part(soup: Soup) -> pv.PolyData:
    """Return a surface with a part beside it that is one face of three corners on a line."""
    return triangles(joined(soup, ([[-1.0, 0, 2], [0, 0, 2], [1, 0, 2]], np.array([[0, 1, 2]]))))


def _parts() -> pv.PolyData:
    """Return two closed bodies, a cup, a sheet and a single triangle."""
    ball = icosphere(2)
    cup = half(moved(ball, 0.8), 2)
    points, quads = sheet(9, 5)
    one = np.array([[0.0, 0, 3], [1, 0, 3], [0, 1, 3]]), np.array([[0, 1, 2]])
    return triangles(
        joined(
            body(),
            moved(ball, 0.5, [0, 4, 0]),
            moved(cup, 1.0, [0, -3, 0]),
            moved((points, cut(quads)), 1.0, [0, 0, -3]),
            one,
        )
    )


def _mixed_quads() -> pv.PolyData:
    """Return quadrilaterals with a texture seam, one flipped patch and two holes."""
    points, quads = capsule()
    group = (points[quads].mean(axis=1)[:, 1] > 0).astype(int)
    keys, number = np.unique(
        np.stack([quads.ravel(), np.repeat(group, 4)], 1), axis=0, return_inverse=True
    )
    quads = number.reshape(-1, 4)
    points = points[keys[:, 0]]
    quads[10:40] = quads[10:40, ::-1]
    surface = polygons(points, np.delete(quads, [70, 150], axis=0))
    surface.point_data["UV"] = np.column_stack([points[:, 0], keys[:, 1] + points[:, 2]])
    surface.point_data.active_texture_coordinates_name = "UV"
    surface.cell_data["material"] = np.arange(surface.n_cells) % 3
    return surface


def _mixed_cells() -> pv.PolyData:
    """Return polygons, strips, lines and vertex cells in one surface, in VTK's order."""
    u = concave()
    strips = triangles(moved(body(), 0.5, [4.0, 1.0, 4.0])).strip()
    surface = pv.PolyData()
    n = u.n_points
    surface.points = np.vstack([u.points, strips.points])
    surface.faces = u.faces
    moved_strips, rest = [], strips.strips
    while len(rest):
        moved_strips += [[rest[0]], rest[1 : rest[0] + 1] + n]
        rest = rest[rest[0] + 1 :]
    surface.strips = np.concatenate(moved_strips)
    surface.lines = np.array([2, 0, n])
    surface.verts = np.array([1, 5])
    surface.cell_data["number"] = np.arange(surface.n_cells)
    return surface


FINE = moved(torus(84, 32), [3.0, 1.0, 1.0])
QUADS = capsule()
SHEET = sheet()
TWO = joined(body(), moved(icosphere(2), 0.7, [0.0, 2.5, 0.0]))

CLOSED = [
    Specimen("closed triangles", lambda: triangles(body()), body, 0),
    Specimen("texture seam", lambda: seam(body()), body, 0),
    Specimen("seam with negative zeros", lambda: seam(body(), negative_zero=True), body, 0),
    Specimen("split normals", lambda: creased(body()), body, 0),
    Specimen("triangle soup", lambda: triangles(soup_of(body())), body, 0),
    Specimen("triangle soup in single precision", lambda: in_single(triangles(soup_of(body()))), lambda: (body()[0].astype(np.float32).astype(float), body()[1]), 0),
    Specimen("30 % of faces flipped", lambda: triangles(flipped(body(), some(512, 0.3))), body, 0, True),
    Specimen("one component flipped", lambda: triangles(flipped(TWO, slice(512, None))), lambda: TWO, 0, True),
    Specimen("inside out", lambda: triangles(flipped(body())), body, 0, True),
    Specimen("inside out, with normals", lambda: with_normals(triangles(flipped(body()))), body, 0, True),
    Specimen("flipped soup", lambda: triangles(soup_of(flipped(body(), some(512, 0.5)))), body, 0, True),
    Specimen("strips", lambda: triangles(body()).strip(), body, 0),
    Specimen("quadrilaterals", lambda: polygons(*QUADS), lambda: triangulated(*QUADS), 0),
    Specimen("quadrilaterals with normals", lambda: with_normals(polygons(*QUADS)), lambda: triangulated(*QUADS), 0),
    Specimen("cylinder with caps", lambda: pv.Cylinder(resolution=24, height=5.0).clean(), borders=0),
    Specimen("cylinder with sharp edges", lambda: pv.Cylinder(resolution=24, height=5.0), borders=0),
    Specimen("cube of pyvista", lambda: pv.Cube(x_length=3.0), borders=0),
    Specimen("concave polygons", concave, borders=0),
    Specimen("polygons that are not flat", hexagons, borders=0),
    Specimen("duplicate faces", lambda: triangles(with_face(body(), *body()[1][:40])), body, 0),
    Specimen("duplicate faces, turned", lambda: triangles(with_face(body(), *body()[1][:40, ::-1])), body, 0),
    Specimen("flat and degenerate faces", lambda: _flat_faces(body())),
    Specimen("a part of flat faces only", lambda: _flat_part(body())),
    Specimen("unused points", lambda: _with_points(triangles(body()), [9, 9, 9], [0, 0, 0], [3, 0, 0]), body, 0),
    Specimen("NaN in unused points", lambda: _with_points(triangles(body()), [np.nan] * 3, [np.inf, 0, 0], [0, 0, 0], [1, np.nan, 1]), body, 0),
    Specimen("lines and vertices", lambda: _with_cells(triangles(body())), body, 0),
    Specimen("single precision", lambda: in_single(triangles(body())), lambda: (body()[0].astype(np.float32).astype(float), body()[1]), 0),
    Specimen("far from the origin", lambda: triangles(soup_of(moved(body(), 1.0, [6e5, -6e5, 6e5]))), lambda: moved(body(), 1.0, [6e5, -6e5, 6e5]), 0),
    Specimen("tiny", lambda: triangles(soup_of(moved(body(), 1e-9))), lambda: moved(body(), 1e-9), 0),
    Specimen("huge", lambda: triangles(soup_of(moved(body(), 1e9))), lambda: moved(body(), 1e9), 0),
    Specimen("arrays of every type", lambda: with_arrays(triangles(body())), body, 0),
    Specimen("two bodies", lambda: triangles(TWO), lambda: TWO, 0),
    Specimen("inner cavity, both outward", lambda: triangles(joined(body(), moved(icosphere(2), 0.5))), lambda: joined(body(), flipped(moved(icosphere(2), 0.5))), 0, True),
    Specimen("torus soup", lambda: triangles(soup_of(moved(torus(24, 10), [2.0, 1, 1]))), lambda: moved(torus(24, 10), [2.0, 1, 1]), 0),
]  # fmt: skip

OPEN = [
    Specimen("one hole", lambda: triangles(holed(body(), 1)), lambda: holed(body(), 1), 1),
    Specimen("12 holes", lambda: triangles(holed(body(), 12)), lambda: holed(body(), 12), 12),
    Specimen("200 holes", lambda: triangles(holed(FINE, 200)), lambda: holed(FINE, 200), 200),
    Specimen("half a body", lambda: triangles(half(body())), lambda: half(body()), 1),
    Specimen("half a body, one end", lambda: triangles(half(body(), 0)), lambda: half(body(), 0), 1),
    Specimen("sheet of quadrilaterals", lambda: polygons(*SHEET), lambda: triangulated(*SHEET), 1),
    Specimen("flat sheet", lambda: triangles((sheet(rise=0.0)[0], cut(SHEET[1]))), lambda: (sheet(rise=0.0)[0], cut(SHEET[1])), 1),
    Specimen("sheet, 30 % flipped", lambda: triangles(flipped((SHEET[0], cut(SHEET[1])), some(256, 0.3))), borders=1, turned=True),
    Specimen("plane of pyvista", lambda: pv.Plane(i_size=3.0, i_resolution=12, j_resolution=6), borders=1),
    Specimen("sphere of pyvista", lambda: pv.Sphere(theta_resolution=16, phi_resolution=12), borders=0),
    Specimen("tube", lambda: pv.Cylinder(resolution=16, height=4.0, capping=False), borders=2),
    Specimen("open soup", lambda: triangles(soup_of(holed(body(), 12))), lambda: holed(body(), 12), 12),
    Specimen("holed, 30 % flipped", lambda: triangles(flipped(holed(body(), 12), some(500, 0.3))), lambda: holed(body(), 12), 12, True),
    Specimen("open, inside out", lambda: triangles(flipped(holed(body(), 1))), lambda: holed(body(), 1), 1, True),
    Specimen("several parts, some open", _parts, borders=3),
    Specimen("T-junctions of vertices", lambda: triangles(hanging())),
    Specimen("one triangle", lambda: triangles((np.eye(3), np.array([[0, 1, 2]]))), borders=1),
    Specimen("one quadrilateral", lambda: polygons(np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]), [[0, 1, 2, 3]]), borders=1),
    Specimen("Moebius strip", lambda: triangles(moebius()), turned=True),
]  # fmt: skip

TANGLED = [
    Specimen("fin", lambda: triangles(with_face(body(), [0, *body()[1][5][:2]]))),
    Specimen("row of fins", lambda: triangles(finned())),
    Specimen("book of three pages", lambda: triangles(book())),
    Specimen("book, flipped at random", lambda: triangles(flipped(book(), some(384, 0.3))), turned=True),
    Specimen("bodies sharing an edge", lambda: triangles(touching((0, 0, 0), (0, 1, 1)))),
    Specimen("bodies sharing a vertex", lambda: triangles(touching((0, 0, 0), (1, 1, 1)))),
    Specimen("bodies sharing a face", lambda: triangles(touching((0, 0, 0), (1, 0, 0)))),
    Specimen("bodies sharing a face twice", lambda: triangles(touching((0, 0, 0), (1, 0, 0), keep_walls=True))),
    Specimen("inner walls", lambda: triangles(walled())),
    Specimen("inner walls, soup", lambda: triangles(soup_of(walled()))),
    Specimen("Klein bottle", lambda: triangles(klein()), turned=True),
    Specimen("closed shell without thickness", lambda: triangles(envelope())),
    Specimen("two sheets, one upon the other", lambda: triangles(joined((SHEET[0], cut(SHEET[1])), (SHEET[0], cut(SHEET[1])[:, ::-1])))),
    Specimen("self-intersecting parts", lambda: triangles(joined(body(), moved(icosphere(2), 0.7, [2.5, 0, 0]))), borders=0),
    Specimen("thirty parts", lambda: triangles(joined(*(moved(OCTAHEDRON, 0.3, [k, 0, 0]) for k in range(30)))), borders=0),
]  # fmt: skip

MIXED = [
    Specimen("seam, flipped patch, holes and quadrilaterals", _mixed_quads, borders=2, turned=True),
    Specimen("polygons, strips, lines and vertices", _mixed_cells, borders=0),
    Specimen("seams, arrays, holes and unused points", lambda: with_arrays(_with_points(seam(holed(body(), 12)), [0, 0, 5], [np.nan, 0, 0])), lambda: holed(body(), 12), 12),
    Specimen("soup, fins and single precision", lambda: in_single(triangles(soup_of(finned())))),
    Specimen("soup of everything, flipped", lambda: triangles(soup_of(flipped(reduce(joined, [walled(), moved(book(), 1.0, [0, 6, 0]), moved(half(body()), 1.0, [0, 0, 6])]), some(1000, 0.2)[: len(walled()[1]) + len(book()[1]) + len(half(body())[1])]))), turned=True),
    Specimen("seam with normals and fins", lambda: seam(finned())),
]  # fmt: skip

SPECIMENS = [*CLOSED, *OPEN, *TANGLED, *MIXED]
