"""A pose of one mesh given to another one with the same faces, as of another person.

    min_p  sum_e |D_e p - g_e|^2 / |x'_e|^2 + sum_i w_i |W~_i p - x'_i - s (y_i - x_i)|^2
    g_e = R_i x'_e + |x'_e| / |x_e| (y_e - R_i x_e),    w_i ~ 1 / (|y_i - x_i|^2 + (0.01 d)^2)

x is the first mesh at rest and y its pose; x' is the second one, with the cages p, W~ and D_e its
differences along edges e from i to j, and s the ratio of both diagonals d.  R_i is the rotation of
the edges around i.  So each edge turns as that of the first mesh, and is stretched as much; the
vertices that did not move tell where the body is.  Both meshes are compared as they lie on each
other: x is turned to be nearest to x'.  Some thousand edges and vertices are enough for
cages.  Between equal meshes the pose is the same, as near as the cages come to it.

Source: R. Sumner, J. Popovic, "Deformation transfer for triangle meshes", SIGGRAPH 2004, from which
this differs in that the unknowns are cages and the volume is preserved exactly.
"""

from __future__ import annotations

import numpy as np

from ..arrays import FloatArray, IntArray
from ..errors import ConstraintError
from ..geometry import closest_rotations, rigid_fit
from ..mesh import Mesh
from . import solving
from .poses import Poses
from .state import Cages, Pose, State

_EDGES, _ANCHORS = 6000, 3000  # of which the pose is copied, at most about twice as many
_STAYED = 0.01  # diagonals; motions that are smaller are none
_ANCHORING, _REGULAR = 1e-2, 1e-9  # weights of all anchors together, and of the cages at rest


def require_alike(mesh: Mesh, other: Mesh) -> None:
    """Raise a ConstraintError unless both meshes have the same faces."""
    if not np.array_equal(mesh.faces, other.faces):
        raise ConstraintError(
            "the other mesh has other faces; poses are copied between meshes that differ in the "
            "positions of their vertices only"
        )


def copied_pose(poses: Poses, state: State, rest: FloatArray, posed: FloatArray) -> Pose:
    """Return the pose of *state* that is like *posed* (n, 3), a pose of the same faces at *rest*.

    It binds *state*, and may run in another thread, as `Poses.bind`.
    """
    after = state.at_rest()
    return solving.free_form(poses, after, _cages_like(poses, after, rest, posed))


def _cages_like(poses: Poses, state: State, x: FloatArray, y: FloatArray) -> Cages:
    mesh, deformer = poses.mesh, poses.bindings.bind(state)
    A, _ = rigid_fit(x, mesh.vertices)
    x, y = x @ A.T, y @ A.T
    edges = mesh.edges[:: 1 + len(mesh.edges) // _EDGES]
    i, j = edges.T
    R = _rotations(mesh, np.unique(i), x, y)[np.searchsorted(np.unique(i), i)]
    own, first, then = (each[j] - each[i] for each in (mesh.vertices, x, y))
    lengths = np.linalg.norm(own, axis=1)
    is_long = (lengths > 0.0) & (np.linalg.norm(first, axis=1) > 0.0)
    ratio = lengths / np.maximum(np.linalg.norm(first, axis=1), np.finfo(float).tiny)
    turned, left = (np.einsum("eij,ej->ei", R, each) for each in (own, first))
    goals = turned + ratio[:, None] * (then - left)
    weights = np.where(is_long, 1.0 / np.maximum(lengths, np.finfo(float).tiny), 0.0)
    some = np.arange(mesh.n_vertices)[:: 1 + mesh.n_vertices // _ANCHORS]
    shift = (mesh.diagonal / np.linalg.norm(np.ptp(x, axis=0))) * (y - x)[some]
    stays = 1.0 / ((shift**2).sum(axis=1) + (_STAYED * mesh.diagonal) ** 2)
    pulls = np.sqrt(_ANCHORING * len(i) * stays / stays.sum()) / mesh.diagonal
    subspace = deformer.subspace
    along = weights[:, None] * (subspace.at(j) - subspace.at(i))
    W = pulls[:, None] * subspace.at(some)
    rest = np.concatenate([cage.vertices for cage in state.cages])
    normal = along.T @ along + W.T @ W
    slope = along.T @ (weights[:, None] * (goals - own)) + W.T @ (pulls[:, None] * shift)
    normal[np.diag_indices_from(normal)] += _REGULAR * np.trace(normal) / len(normal)
    p = rest + np.linalg.solve(normal, slope)
    return tuple(p[columns] for columns in subspace.columns)


def _rotations(mesh: Mesh, ids: IntArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the rotations (k, 3, 3) of the edges around the vertices *ids* (k,), from x to y."""
    around = mesh.adjacency[ids]
    own, other = np.repeat(np.arange(len(ids)), np.diff(around.indptr)), around.indices
    before, now = (each[other] - each[ids[own]] for each in (x, y))
    S = np.zeros((len(ids), 3, 3))
    np.add.at(S, own, np.einsum("ei,ej->eij", before, now))
    return closest_rotations(S)
