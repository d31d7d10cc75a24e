"""Sample meshes at any resolution.

The cactus and the dinosaur imitate the two models of the paper (section 5) as bodies with limbs;
the cactus has ribs, the fine detail that a deformation must preserve.  Both stand on z = 0, with z
up and height 1, like the default `bar`; `sphere` and `torus` are centred at the origin.

All functions are deterministic.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from ..arrays import FloatArray, IntArray, is_number, is_whole
from ..checks import shown
from ..errors import ArgumentError, MeshError
from ..mesh import Mesh
from .implicit import Limb, standing_body

_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))  # the golden angle, radians
# Larger hulls or grids take minutes and gigabytes.
_MOST_VERTICES, _MOST_DIVISIONS = 10_000_000, 1000


def cactus(n_vertices: int = 5430) -> Mesh:
    """Return a saguaro: a ribbed trunk with two arms bent upwards, in the plane y = 0.

    Parameters
    ----------
    n_vertices : int
        Exact number of vertices, 500 or more.  The cactus of the paper has 5430.

    Examples
    --------
    >>> cactus(1000).n_vertices
    1000
    """
    trunk = Limb(
        [(0, 0, -0.1), (0, 0, 0.3), (0, 0, 0.6), (0, 0, 0.9)],
        [0.095, 0.11, 0.114, 0.1],
        ribs=9,
        height=0.075,
    )
    left = Limb(
        [(0, 0, 0.35), (-0.13, 0, 0.36), (-0.245, 0, 0.42), (-0.285, 0, 0.55), (-0.287, 0, 0.74)],
        [0.055, 0.062, 0.067, 0.068, 0.06],
        ribs=7,
        height=0.075,
    )
    right = Limb(
        [(0, 0, 0.52), (0.12, 0, 0.53), (0.21, 0, 0.58), (0.24, 0, 0.69), (0.242, 0, 0.82)],
        [0.05, 0.056, 0.061, 0.061, 0.054],
        ribs=7,
        height=0.075,
    )
    _require(n_vertices, 500)
    return standing_body([trunk, left, right], int(n_vertices), blend=0.035)


def dinosaur(n_vertices: int = 8000) -> Mesh:
    """Return a long-necked dinosaur on four legs with plates along its back; it faces +x.

    Parameters
    ----------
    n_vertices : int
        Exact number of vertices, 1000 or more.

    Examples
    --------
    >>> dinosaur(3000).n_vertices
    3000
    """
    spine = Limb(
        [(-1.12, 0, 0.34), (-0.8, 0, 0.28), (-0.45, 0, 0.4), (-0.1, 0, 0.48), (0.22, 0, 0.49)]
        + [(0.45, 0, 0.64), (0.55, 0, 0.84), (0.62, 0, 0.93)],
        [0.028, 0.055, 0.12, 0.19, 0.15, 0.082, 0.06, 0.058],
    )
    head = Limb([(0.6, 0, 0.945), (0.69, 0, 0.94), (0.79, 0, 0.9)], [0.062, 0.063, 0.042])
    legs = [
        Limb(
            [(x, 0.65 * side * y, 0.42), (x + knee, side * y, 0.21), (x, side * y, -0.05)],
            [0.115, 0.068, 0.075],
        )
        for x, y, knee in [(-0.3, 0.13, 0.03), (0.16, 0.115, -0.03)]
        for side in (-1, 1)
    ]
    plates = [
        Limb([(x, 0, z), (x - 0.025, 0, z + rise)], [0.035, 0.015])
        for x, z, rise in [
            (-0.69, 0.33, 0.08), (-0.57, 0.42, 0.09), (-0.45, 0.51, 0.1), (-0.32, 0.59, 0.11),
            (-0.18, 0.64, 0.12), (-0.03, 0.65, 0.12), (0.12, 0.64, 0.11), (0.25, 0.625, 0.09),
            (0.37, 0.66, 0.07),
        ]
    ]  # fmt: skip
    _require(n_vertices, 1000)
    return standing_body([spine, head, *legs, *plates], int(n_vertices), blend=0.035)


def bar(
    size: tuple[float, float, float] = (0.2, 0.2, 1.0),
    divisions: tuple[int, int, int] = (8, 8, 40),
) -> Mesh:
    """Return a rectangular bar on z = 0, centred; (8, 8, 40) gives 1410 vertices.

    Parameters
    ----------
    size : (width, depth, height)
        Edge lengths.
    divisions : (a, b, c) int
        Number of divisions per edge: the bar has 2 (ab + bc + ca) + 2 vertices.
    """
    if not (_are_three(size) and all(is_number(each) and each > 0 for each in size)):
        raise ArgumentError(f"size must be three positive numbers; got {shown(size)}")
    if not (
        _are_three(divisions) and all(is_whole(each, 1, _MOST_DIVISIONS) for each in divisions)
    ):
        raise ArgumentError(
            f"divisions must be three whole numbers, 1 to {_MOST_DIVISIONS}; got {shown(divisions)}"
        )
    divisions = int(divisions[0]), int(divisions[1]), int(divisions[2])
    sides, faces, count = [], [], 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for level in (0, divisions[axis]):
            side = np.empty(((divisions[u] + 1) * (divisions[v] + 1), 3), dtype=np.int64)
            side[:, axis] = level
            side[:, [u, v]] = np.indices((divisions[u] + 1, divisions[v] + 1)).reshape(2, -1).T
            triangles = _chequered(divisions[u], divisions[v])
            faces.append(count + (triangles if level else triangles[:, ::-1]))
            sides.append(side)
            count += len(side)
    lattice, number = np.unique(np.concatenate(sides), axis=0, return_inverse=True)
    vertices = (lattice / divisions - [0.5, 0.5, 0.0]) * size
    return _made(vertices, number.ravel()[np.concatenate(faces)], f"size {shown(size)}")


def torus(n_vertices: int = 3000, *, major: float = 1.0, minor: float = 0.35) -> Mesh:
    """Return a torus about z; consecutive vertices wind around its tube.

    Parameters
    ----------
    n_vertices : int
        Exact number of vertices, 30 or more.
    major, minor : float
        Radius of the ring and of the tube.
    """
    _require(n_vertices, 30)
    if not (is_number(minor) and is_number(major) and 0 < minor < major):
        raise ArgumentError(
            f"a torus needs 0 < minor < major; got {shown(minor)} and {shown(major)}"
        )
    n_vertices = int(n_vertices)
    around = max(3, round(np.sqrt(n_vertices * minor / major)))  # vertices in one winding
    k = np.arange(n_vertices)
    a = 2 * np.pi * k / n_vertices
    b = a * round(n_vertices / around)
    ring = major + minor * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), minor * np.sin(b)], axis=-1)
    next_, above, beyond = ((k + step) % n_vertices for step in (1, around, around + 1))
    faces = np.concatenate(
        [np.stack([k, above, beyond], axis=-1), np.stack([k, beyond, next_], axis=-1)]
    )
    return _made(vertices, faces, f"major {shown(major)} and minor {shown(minor)}")


def sphere(n_vertices: int = 2562, *, radius: float = 1.0) -> Mesh:
    """Return a sphere about the origin: the convex hull of points on a golden-angle spiral."""
    _require(n_vertices, 4)
    if not (is_number(radius) and radius > 0):
        raise ArgumentError(f"radius must be a positive number; got {shown(radius)}")
    k = np.arange(int(n_vertices))
    z = 1.0 - (2.0 * k + 1.0) / n_vertices
    ring = np.sqrt(1.0 - z**2)
    vertices = np.stack([ring * np.cos(_GOLDEN * k), ring * np.sin(_GOLDEN * k), z], axis=-1)
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    a, b, c = vertices[faces.T]
    inward = np.einsum("ij,ij->i", a, np.cross(b, c)) < 0
    faces[inward] = faces[inward, ::-1]
    return _made(radius * vertices, faces, f"radius {shown(radius)}")


def _made(vertices: FloatArray, faces: IntArray, what: str) -> Mesh:
    """Return the mesh; ArgumentError if *what* gives none, being too small or too large."""
    try:
        return Mesh(vertices, faces)
    except MeshError as fault:
        raise ArgumentError(f"cannot make a mesh with {what}: {fault}") from None


def _require(n_vertices: int, least: int) -> None:
    if not is_whole(n_vertices, least, _MOST_VERTICES):
        raise ArgumentError(
            f"n_vertices must be a whole number, {least} to {_MOST_VERTICES}; "
            f"got {shown(n_vertices)}"
        )


def _are_three(values: object) -> bool:
    sequence = isinstance(values, Sequence) or (isinstance(values, np.ndarray) and values.ndim == 1)
    return sequence and len(values) == 3  # type: ignore[arg-type]


def _chequered(p: int, q: int) -> IntArray:
    """Return the triangles (2 p q, 3) of a p by q grid of squares with alternating diagonals."""
    i, j = np.indices((p, q)).reshape(2, -1)
    a = i * (q + 1) + j
    b, c, d = a + q + 1, a + q + 2, a + 1  # counter-clockwise from a
    odd = ((i + j) % 2 == 1)[:, None]
    one = np.where(odd, np.stack([a, b, d], axis=-1), np.stack([a, b, c], axis=-1))
    two = np.where(odd, np.stack([b, c, d], axis=-1), np.stack([a, c, d], axis=-1))
    return np.concatenate([one, two])


def random_limbs(n_vertices: int = 5430, seed: int = 0) -> Mesh:
    """Return a standing trunk, about one unit tall, with four to six bent limbs, all random.

    Parameters
    ----------
    n_vertices : int
        Exact number of vertices, 500 or more.
    seed : int
        Of the random numbers, 0 or more; equal seeds give equal bodies.

    Raises
    ------
    ArgumentError
        If a number is out of range.
    """
    _require(n_vertices, 500)
    if not is_whole(seed, 0):
        raise ArgumentError(f"seed must be a whole number, 0 or more; got {shown(seed)}")
    rng = np.random.default_rng(int(seed))
    lean = rng.uniform(-0.15, 0.15, 2)
    trunk = [(s * lean[0], s * lean[1], 0.9 * s) for s in (-0.1, 0.35, 0.7, 1.0)]
    limbs = [Limb(trunk, rng.uniform(0.09, 0.15, 4).tolist())]
    for around in rng.permutation(6)[: rng.integers(4, 7)]:
        height, turn = rng.uniform(0.2, 0.9), np.pi / 3.0 * (around + rng.uniform(-0.3, 0.3))
        way = np.array([np.cos(turn), np.sin(turn), rng.uniform(-0.4, 0.6)])
        points = [np.array([*height * lean, 0.9 * height])]
        for _ in range(3):
            points.append(points[-1] + rng.uniform(0.1, 0.18) * way / np.linalg.norm(way))
            way = way + rng.uniform(-0.6, 0.6, 3)
        points = [np.array([x, y, max(z, 0.08)]) for x, y, z in points]
        radii = np.linspace(rng.uniform(0.05, 0.08), rng.uniform(0.03, 0.05), 4)
        limbs.append(Limb([tuple(p.tolist()) for p in points], radii.tolist()))
    return standing_body(limbs, int(n_vertices), blend=0.04)
