"""Mean value coordinates of points with respect to a closed triangular cage, eqs. (15)-(19).

Seen from x, a face covers a spherical triangle on the unit sphere around x.  The integral m of the
unit vectors over it is half the sum of its sides theta_i, each times the normal of its plane; the
components along the corners of the face are the weights.  They reproduce x because the integral
over the whole sphere vanishes:

    m = sum_j w_j (p_j - x)        sum over all faces of m = 0                           (17)
    x = sum_j w_j p_j / sum_j w_j                                                        (18)

Written in the frame of the face, with i an edge and the corner opposite to it,

    h         distance of x from the plane, positive on the inner side; its foot is the projection
    a_i       distance of the foot from edge i, in the plane, positive towards corner i
    H_i       distance of corner i from edge i: a_i / H_i are the foot's barycentric coordinates
    A_i       sqrt(a_i^2 + h^2), distance of x from the line of edge i
    theta_i   angle of edge i as seen from x;  b_i = theta_i / A_i
    gamma_i   angle of the face at corner i

the weight of corner j is

    w_j = (a_j S + h (b_j - b_{j+1} cos gamma_{j-1} - b_{j-1} cos gamma_{j+1})) / (2 H_j)
    S   = (a_1 b_1 + a_2 b_2 + a_3 b_3) / h

This is w_j of [JSW05] Fig. 4 with the determinant cancelled analytically.  There is no division by
the sine of an angle, so points in the plane of a face or on the line of an edge are no special
case, and on a face S, which grows as 2 pi / h, gives the barycentric coordinates.  Only S needs
care: near the plane, with the foot outside the face, its terms cancel to O(h^2).  There alpha_i,
the angle of the edge as seen from the *foot*, is subtracted from each term: the alpha_i sum to
zero, and the differences psi_i = alpha_i - a_i b_i are small.  With t the coordinate along the edge
relative to the foot, and for a >= 0 (psi is odd in a):

    psi_i = [atan(t (A - a) / (a A + t^2))]_{t_1}^{t_2} + (1 - a/A) theta_i,   A - a = h^2 / (A + a)

Errors of the weights, measured against 60 digits on octahedron, cube, sphere and torus: 1e-13
inside, on the cage and at distances of 1e-16 to 1e-3 from it; 3e-12 in the plane of a face or on
the line of an edge, up to 3 face sizes outside; 1e-15 / k for a face of height k times its length.

Source
------
[JSW05] T. Ju, S. Schaefer, J. Warren, "Mean value coordinates for closed triangular meshes",
        ACM Trans. Graph. 24(3), 561-566, 2005.
[FKR05] M. Floater, G. Kos, M. Reimers, "Mean value coordinates in 3D", Computer Aided
        Geometric Design 22(7), 623-631, 2005.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, as_faces, as_points
from ..checks import as_callable
from ..errors import ArgumentError, CageError
from ..kernels import compiled_kernels, in_parallel, inputs
from ..mesh import connectivity_faults, counted, face_edges, flat_faces
from ..progress import Progress

# Lengths are relative to the diagonal of the cage.
_ON_EDGE = 1e-14  # points at this distance are on the vertex or edge
_OFF_PLANE = 1e-30  # added to h, so that it is never exactly 0
_NEAR_PLANE = 1e-3  # of max |a|: for smaller |h|, S is the sum of psi_i
FARTHEST_POINT = 1e60  # diagonals; fourth powers of larger distances overflow


def mean_value_coordinates(
    points: ArrayLike,
    cage_vertices: ArrayLike,
    cage_faces: ArrayLike,
    *,
    progress: Progress | None = None,
) -> FloatArray:
    """Return the mean value coordinates W of *points*: x = W p (15) with p the cage vertices.

    Parameters
    ----------
    points : (n, 3) float
        Points inside, outside or on the cage.
    cage_vertices : (m, 3) float
        In the length unit of *points*; the weights are dimensionless.
    cage_faces : (k, 3) int
        Closed and consistently oriented, inward or outward.
    progress : callable, optional
        Called with a fraction in 0..1 and a text; raise `Cancelled` in it to stop.

    Returns
    -------
    weights : (n, m) float
        Rows sum to 1 (16) and ``weights @ cage_vertices`` reproduces *points*.  Weights are
        positive inside a convex cage and may be negative elsewhere.

    Raises
    ------
    ValueError
        If an array has the wrong shape, non-finite numbers or indices out of range.
    CageError
        If the cage is not a closed, oriented two-manifold, or has faces without area.

    Examples
    --------
    The centre of a regular tetrahedron is the mean of its corners.

    >>> corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> mean_value_coordinates([[0, 0, 0]], corners, faces).round(6)
    array([[0.25, 0.25, 0.25, 0.25]])
    """
    if progress is not None:
        as_callable(progress, "progress")
    x = as_points(points, "points")
    p = as_points(cage_vertices, "cage_vertices")
    faces = as_faces(cage_faces, len(p), "cage_faces")
    _require_closed(p, faces)
    low, high = p.min(axis=0), p.max(axis=0)
    centre, size = (low + high) / 2.0, np.linalg.norm(high - low)
    if max(x.max(initial=0.0), -x.min(initial=0.0)) > FARTHEST_POINT * size:
        raise ArgumentError(
            f"points must be within {FARTHEST_POINT:.0e} diagonals of the cage; "
            "some are farther away"
        )
    cage = _prepare((p - centre) / size, faces)
    weights = np.empty((len(x), len(p)))
    kernels = compiled_kernels(len(x))
    arguments = inputs(*_as_arrays(cage, faces)) if kernels else ()

    def work(start: int, stop: int) -> None:
        local = (x[start:stop] - centre) / size
        if kernels:
            kernels.weights(*inputs(local), *arguments, weights[start:stop])
        else:
            weights[start:stop] = _weights(cage, local.T).T

    # Temporary arrays of a quarter of a megabyte fit the cache; fewer than 16 rows are slower.
    rows = max(16, (1 << 15) // faces.size)
    in_parallel(work, len(x), rows, progress=progress, message="mean value coordinates")
    return weights


class _Cage(NamedTuple):
    """Quantities that do not depend on x.  Edge and corner i of face f are row i k + f of 3 k."""

    p: FloatArray  # (m, 3)
    edges: IntArray  # (e, 2)
    edge_length: FloatArray  # (e, 1)
    edge_of: IntArray  # (3, k)
    first: IntArray  # (e,) a row of 3 k for each edge
    planes: FloatArray  # (4 k, 4): maps (x, 1) to a_1, a_2, a_3, h of each face
    start: FloatArray  # (3, k, 3) start of edge i
    along: FloatArray  # (3, k, 3) unit vector of edge i
    length: FloatArray  # (3, k)
    cosine: FloatArray  # (3, k, 1) of gamma_i
    halved: FloatArray  # (3, k, 1): 1 / (2 H_i)
    by_vertex: IntArray  # (3 k,) rows sorted by vertex
    begins: IntArray  # (m,) first position of each vertex in by_vertex


def _prepare(p: FloatArray, faces: IntArray) -> _Cage:
    start, end = p[faces.T[[1, 2, 0]]], p[faces.T[[2, 0, 1]]]
    length = np.linalg.norm(end - start, axis=2)
    along = (end - start) / length[..., None]
    normal = np.cross(end[0] - start[0], end[1] - start[1])
    twice_area = np.linalg.norm(normal, axis=1)
    normal /= twice_area[:, None]
    inward = np.cross(normal, along)
    planes = np.empty((4, len(faces), 4))
    planes[:3, :, :3], planes[3, :, :3] = inward, -normal
    planes[:3, :, 3] = -np.einsum("ikx,ikx->ik", inward, start)
    planes[3, :, 3] = np.einsum("kx,kx->k", normal, start.mean(axis=0))
    edges, edge_of = face_edges(faces)
    corner = faces.T.ravel()
    by_vertex = np.argsort(corner, kind="stable")
    return _Cage(
        p=p,
        edges=edges,
        edge_length=np.linalg.norm(p[edges[:, 1]] - p[edges[:, 0]], axis=1)[:, None],
        edge_of=edge_of.T,
        first=np.unique(edge_of.T, return_index=True)[1],
        planes=planes.reshape(-1, 4),
        start=start,
        along=along,
        length=length,
        cosine=-np.einsum("ikx,ikx->ik", along[[1, 2, 0]], along[[2, 0, 1]])[..., None],
        halved=(length / (2.0 * twice_area))[..., None],
        by_vertex=by_vertex,
        begins=np.searchsorted(corner[by_vertex], np.arange(len(p))),
    )


def _as_arrays(cage: _Cage, faces: IntArray) -> tuple[FloatArray | IntArray, ...]:
    """Return the arguments of the compiled kernel."""
    planes, starts = cage.planes.reshape(4, len(faces), 4), np.stack([cage.start, cage.along])
    numbers = np.stack([cage.length, cage.cosine[..., 0], cage.halved[..., 0]])
    limits = np.array([_ON_EDGE, _OFF_PLANE, _NEAR_PLANE])
    return cage.p, cage.edges, cage.edge_of.T, faces, planes, starts, numbers, limits


def _weights(cage: _Cage, x: FloatArray) -> FloatArray:
    """Return the weights (m, n) of the points *x* (3, n), given as columns."""
    n = x.shape[1]
    distances = (cage.planes @ np.vstack([x, np.ones(n)])).reshape(4, -1, n)
    distances[3] += _OFF_PLANE
    a, h = distances[:3], distances[3]
    A = np.sqrt(a * a + h * h)
    d2 = ((cage.p[:, :, None] - x) ** 2).sum(axis=1)
    i, j = cage.edges.T
    from_edge = A.reshape(-1, n)[cage.first]
    dot = d2[i] + d2[j] - cage.edge_length**2  # twice (p_i - x).(p_j - x)
    theta = np.arctan2(2.0 * cage.edge_length * from_edge, dot)
    b = theta[cage.edge_of] / A

    S = np.einsum("ikn,ikn->kn", a, b)
    cancels = (np.abs(h) < _NEAR_PLANE * np.abs(a).max(axis=0)) & (a.min(axis=0) < 0.0)
    face, k = np.nonzero(cancels)
    S[face, k] = _sum_near_plane(cage, face, x[:, k], distances[:, face, k])
    S /= h
    w = np.empty_like(a)
    for r, s, t in (0, 1, 2), (1, 2, 0), (2, 0, 1):
        w[r] = b[r] - b[s] * cage.cosine[t] - b[t] * cage.cosine[s]
    w *= h
    w += a * S
    w *= cage.halved
    weights = np.add.reduceat(w.reshape(-1, n)[cage.by_vertex], cage.begins)

    # On edges and vertices the faces give different rounding errors; set the weights directly.
    edge, k = np.nonzero((from_edge <= _ON_EDGE) & (dot < 0.0))
    i, j = i[edge], j[edge]
    weights[:, k] = 0.0
    weights[i, k], weights[j, k] = np.sqrt(d2[j, k]), np.sqrt(d2[i, k])
    vertex, k = np.nonzero(d2 <= _ON_EDGE**2)
    weights[:, k] = 0.0
    weights[vertex, k] = 1.0
    return np.asarray(weights / weights.sum(axis=0))


def _sum_near_plane(
    cage: _Cage, face: IntArray, x: FloatArray, distances: FloatArray
) -> FloatArray:
    """Return a_1 b_1 + a_2 b_2 + a_3 b_3 by psi_i for pairs of *face* (n,) and *x* (3, n), (n,)."""
    a, h = distances[:3], distances[3]
    size, length = np.abs(a), cage.length[:, face]
    A = np.sqrt(a * a + h * h)
    gap = h * h / (A + size)
    t1 = np.einsum("inx,inx->in", cage.start[:, face] - x.T, cage.along[:, face])
    t2 = t1 + length
    psi = np.arctan2(t2 * gap, size * A + t2 * t2) - np.arctan2(t1 * gap, size * A + t1 * t1)
    psi += gap / A * np.arctan2(A * length, A * A + t1 * t2)
    return np.asarray(-np.copysign(psi, a).sum(axis=0))


def _require_closed(p: FloatArray, faces: IntArray) -> None:
    faults = connectivity_faults(len(p), faces)
    if not faults and len(flat := flat_faces(p, faces)):
        faults = [f"{counted(len(flat), 'face has', 'faces have')} no area"]
    if faults:
        raise CageError("cage_faces is not a closed cage: " + "; ".join(faults))
