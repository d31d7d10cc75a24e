"""Smoothing of the borders between parts on the mesh: short, in creases, around connected parts.

Borders move by mean curvature: the indicator of each part diffuses, and every vertex is assigned to
the part of largest value [MBO].  Diffusion is slow across concave edges, so that a border near a
crease moves into the crease.

Source
------
[MBO] B. Merriman, J. Bence, S. Osher, "Diffusion generated motion by mean curvature",
      Computational Crystal Growers Workshop, 73-83, 1992.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..arrays import IntArray
from ..geometry import distinct_lengths, nearest_source
from ..mesh import Mesh, connected
from .coarse import symmetric

_CREASE_RADIUS = 0.06  # relative to sqrt(area): a concave edge of this radius halves the diffusion
_ROUNDS = 3  # of diffusion


def within_rings(graph: sparse.csr_array, ids: IntArray, rings: int) -> IntArray:
    """Return the vertices up to *rings* edges away from *ids*, sorted."""
    reached = np.zeros(graph.shape[0], dtype=bool)
    reached[ids] = True
    for _ in range(rings):
        others = graph[ids].indices
        ids = np.unique(others[~reached[others]])
        if not len(ids):
            break
        reached[ids] = True
    return np.flatnonzero(reached)


def smooth_borders(mesh: Mesh, labels: IntArray) -> IntArray:
    """Return labels with short borders along creases; no part shrinks by half in a round.

    A border moves by a limited number of rings per round, and diffusion reaches one ring per step;
    so vertices farther than that from all borders keep their labels and are not processed.
    """
    area = mesh.face_areas.sum()
    edge = np.median(mesh.adjacency.data)
    # At the scale of an edge in a mesh of 3,000 vertices.
    steps = int(np.clip(np.ceil(4.0 * area / 3000 / edge**2), 4, 60))
    rings = int(np.ceil(np.sqrt(steps))) + 1
    borders = np.unique(mesh.edges[np.diff(labels[mesh.edges], axis=1)[:, 0] != 0])
    zone = within_rings(mesh.adjacency, borders, _ROUNDS * rings + steps + 1)
    diffusion = _diffusion(mesh, zone, edge)
    far = np.bincount(np.delete(labels, zone), minlength=labels.max() + 1)
    label = labels[zone]
    for _ in range(_ROUNDS):
        most, smooth = np.zeros(len(zone)), label.copy()
        for part in np.unique(label):
            near = within_rings(diffusion, np.flatnonzero(label == part), rings)
            step = diffusion[near][:, near]
            amount = (label[near] == part).astype(float)
            for _ in range(steps):
                amount = step @ amount
            more = amount > most[near]
            most[near[more]] = amount[more]
            smooth[near[more]] = part
        before, after = (far + np.bincount(each, minlength=len(far)) for each in (label, smooth))
        label = np.where((after < before / 2)[label], label, smooth)
    labels = labels.copy()
    labels[zone] = label
    return labels


def _diffusion(mesh: Mesh, zone: IntArray, usual: float) -> sparse.csr_array:
    """Return the matrix of a diffusion step among the vertices *zone* (k,), (k, k).

    A vertex keeps at least half; neighbours get the rest, less of it across creases, and less along
    edges longer than *usual*, so that diffusion is uniform in space.  The normal curvature of an
    edge is (n_j - n_i).(x_j - x_i) / |x_j - x_i|^2, negative where the surface is concave.  The
    outermost ring is inaccurate.
    """
    k, number = len(zone), np.full(mesh.n_vertices, -1)
    number[zone] = np.arange(k)
    faces = mesh.faces[(number >= 0)[mesh.faces].any(axis=1)]
    a, b, c = mesh.vertices[faces.T]
    cross = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    corner = number[faces.ravel()] + 1  # 0: beyond the zone
    normal = np.stack([np.bincount(corner, axis, minlength=k + 1) for axis in cross.T], axis=1)[1:]
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    edges = number[mesh.edges]
    edges = edges[(edges >= 0).all(axis=1)]
    i, j = edges.T
    along = mesh.vertices[zone[j]] - mesh.vertices[zone[i]]
    size = np.maximum(np.einsum("ij,ij->i", along, along), np.finfo(float).tiny)
    curvature = np.einsum("ij,ij->i", normal[j] - normal[i], along) / size
    concavity = _CREASE_RADIUS * np.sqrt(mesh.face_areas.sum()) * np.maximum(-curvature, 0.0)
    share = symmetric(edges, np.minimum(1.0, usual**2 / size) / (1.0 + concavity**2), k)
    degree = np.maximum(np.diff(share.indptr), 1)
    moves = sparse.diags_array(0.5 / degree) @ share
    return sparse.csr_array(moves + sparse.diags_array(1.0 - moves.sum(axis=1)))


def connected_parts(mesh: Mesh, labels: IntArray) -> IntArray:
    """Return labels of connected parts: smaller pieces join the part of the nearest vertex."""
    i, j = mesh.edges[labels[mesh.edges[:, 0]] == labels[mesh.edges[:, 1]]].T
    piece = connected(len(labels), i, j)
    label = np.empty(piece.max() + 1, dtype=np.int64)
    label[piece] = labels
    order = np.argsort(-np.bincount(piece), kind="stable")
    _, largest = np.unique(label[order], return_index=True)
    stray = np.ones(len(label), dtype=bool)
    stray[order[largest]] = False
    near = within_rings(mesh.adjacency, np.flatnonzero(stray[piece]), 1)
    settled = np.flatnonzero(~stray[piece[near]])
    labels = labels.copy()
    labels[near] = labels[near[nearest_source(distinct_lengths(mesh)[near][:, near], settled)]]
    return labels
