"""Rotations inside the body: the surface alone is hollow, and crumples when it is twisted.

    min_R  sum_k  v_k |F_k(p) - R_k|^2,      F_k = the gradient of the cages' map at a point inside

The map of the cages is defined everywhere, x(q) = sum_j w_j(q) p_j, so its gradient at a point q is
linear in p; here it is taken by central differences.  v_k is the volume around the point.  This is
the elasticity of a solid, as rigid as possible, with few samples: each is one more rotation cluster
of three rows.

Without it, bars and a cactus that were twisted in steps of 5 degrees to 270 and back jumped by .12
to .17 of the diagonal, several times; with it the longest step is .012.

The points are spread evenly over the largest balls inside the body, which touch its surface: their
centres and the points half way to them, so the same for a mesh that is turned or mirrored.

Source
------
I. Chao, U. Pinkall, P. Sanan, P. Schroeder, "A simple geometric model for elastic deformations",
SIGGRAPH 2010: the energy.  The balls: `geometry.local_volume`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import sizes
from ..arrays import BoolArray, FloatArray
from ..cages import Cage
from ..geometry import cluster_positions, decimated, inner_balls
from ..mesh import Mesh
from ..subspace import bind_passengers
from .energy import Energy

# Share of the trace of the energy.  With .1 twists still jump, with 1 poses of a dog are 4 % farther
# from the true ones.
_SHARE = 0.3
_POINTS = 200  # with 100, the twist of a bar jumps
_DEPTHS = 0.5, 1.0  # of the points, in radii of their balls
_STEP = 0.1  # of the central differences, in radii


@dataclass(frozen=True, eq=False)
class Interior:
    """Points inside the bodies of a mesh."""

    points: FloatArray  # (k, 3)
    radii: FloatArray  # (k,), of their balls
    volumes: FloatArray  # (k,), around them

    @classmethod
    def of(cls, mesh: Mesh, encloses: BoolArray) -> Interior:
        """Return points in those components of *mesh* that are bodies, *encloses* (c,)."""
        component = mesh.components
        if mesh.n_vertices > sizes.DECIMATED:
            mesh, kept, _ = decimated(mesh, sizes.DECIMATED_POINTS)
            component = component[kept]
        x, faces = mesh.vertices, mesh.faces
        inward, _, diameters = inner_balls(x, faces)
        radius = 0.5 * diameters
        own = encloses[component] & (radius > 0.0) & (mesh.vertex_areas > 0.0)
        own &= radius < 0.5 * mesh.diagonal  # otherwise nothing is opposite
        x, inward, radius, area = x[own], inward[own], radius[own], mesh.vertex_areas[own]
        points = np.concatenate([x + d * radius[:, None] * inward for d in _DEPTHS])
        radii, volumes = np.tile(radius, len(_DEPTHS)), np.tile(area * radius, len(_DEPTHS))
        if not len(points):
            return cls(points, radii, volumes)
        cluster = cluster_positions(points, _POINTS)
        total = np.bincount(cluster, volumes)
        middle = np.stack([np.bincount(cluster, volumes * axis) / total for axis in points.T], 1)
        away = np.linalg.norm(points - middle[cluster], axis=1)
        order = np.lexsort((away, cluster))  # the nearest to the middle: it is inside
        first = order[np.searchsorted(cluster[order], np.arange(len(total)))]
        return cls(points[first], radii[first], total)


def with_interior(
    energy: Energy, mesh: Mesh, weights: FloatArray, cages: Sequence[Cage], interior: Interior
) -> Energy:
    """Return *energy* plus that of the *interior*.

    Parameters
    ----------
    energy : Energy
        With rotations of clusters.
    mesh : Mesh
        At rest.
    weights : (r, n) float
        Blend weights of the regions.
    cages : sequence of r Cage
        At rest.
    interior : Interior
        Of the mesh.
    """
    count = len(interior.points)
    if not count:
        return energy
    step = _STEP * interior.radii[:, None]
    sides = [interior.points + sign * step * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    bound = bind_passengers(mesh, weights, cages, np.concatenate(sides))
    rows = bound.subspace.at(np.arange(6 * count)).reshape(3, 2, count, -1)
    gradients = np.swapaxes((rows[:, 0] - rows[:, 1]) / (2.0 * step), 0, 1)  # (k, 3, m)
    stiffness = np.einsum("kam,kam->k", gradients, gradients)
    total = float(interior.volumes @ stiffness)
    v = _SHARE * float(np.trace(energy.quadratic)) / total * interior.volumes
    flat = gradients.reshape(3 * count, -1)
    load = np.repeat(v, 3)[:, None] * flat
    operator = np.concatenate([np.asarray(energy.covariance_operator), load])
    return replace(
        energy,
        quadratic=energy.quadratic + flat.T @ load,
        constant=energy.constant + 3.0 * float(v.sum()),
        covariance_operator=operator,
        load_operator=operator,
    )
