"""Rotations inside the body: the surface alone is hollow, and crumples when it is twisted.

    min_R  sum_k  v_k |F_k(p) - R_k|^2,      F_k = the gradient of the cages' map at a point inside

The map of a cage is defined everywhere, x(q) = sum_j w_j(q) p_j, so its gradient at a point q is
linear in p; here it is taken by central differences, and blended as the surface above it.  v_k is
the volume around the point.  This is the elasticity of a solid, as rigid as possible, with few
samples: each is one more rotation cluster, of three rows.

Without it a limb that is twisted buckles in jumps.

The points are below patches of the surface, in the largest balls inside the body that touch it.

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
from ..arrays import BoolArray, FloatArray, IntArray
from ..cages import Cage, mean_value_coordinates
from ..geometry import cluster_positions, decimated, inner_balls
from ..mesh import Mesh
from ..subspace import Subspace
from .energy import Energy

_TRACE_SHARE = 0.3  # of the trace of the energy; with 0.1, the twist of a bar jumps
_PATCHES = 200  # with 100, the twist of a bar jumps


@dataclass(frozen=True, eq=False)
class InteriorSamples:
    """Points inside the bodies of a mesh, one below each of k vertices, in q patches."""

    vertices: IntArray  # (k,)
    points: FloatArray  # (k, 3)
    radii: FloatArray  # (k,), of their balls
    volumes: FloatArray  # (k,), around them
    weights: FloatArray  # (r, k): the blend weights
    patches: IntArray  # (k,)

    @classmethod
    def of(cls, mesh: Mesh, weights: FloatArray, encloses: BoolArray) -> InteriorSamples:
        """Return points in those components of *mesh* that are bodies.

        Parameters
        ----------
        mesh : Mesh
            n vertices, c components.
        weights : (r, n) float
            Blend weights of the regions.
        encloses : (c,) bool
            Whether each component is a body.
        """
        component, kept = mesh.components, np.arange(mesh.n_vertices)
        if mesh.n_vertices > sizes.DECIMATED:
            mesh, kept, _ = decimated(mesh, sizes.DECIMATED_POINTS)
            component = component[kept]
        x, area = mesh.vertices, mesh.vertex_areas
        inward, _, diameters = inner_balls(x, mesh.faces)
        radius = 0.5 * diameters
        own = encloses[component] & (area * radius > 0.0)
        own &= diameters < mesh.diagonal  # otherwise nothing is opposite
        x, radius, area, component = x[own], radius[own], area[own], component[own]
        patch = component
        if len(x):
            patch = cluster_positions(x, _PATCHES)
            patch = np.unique([patch, component], axis=1, return_inverse=True)[1].ravel()
        points = x + 0.75 * radius[:, None] * inward[own]
        return cls(kept[own], points, radius, area * radius, weights[:, kept[own]], patch)

    def means(self, stiffness: FloatArray | None = None) -> Interior:
        """Return the mean of each patch; *stiffness* (n,) are factors of the volumes, or 1."""
        volume, patch = self.volumes, self.patches
        if stiffness is not None:
            volume = volume * stiffness[self.vertices]
        if not len(volume):
            return Interior(self.points, self.radii, volume, self.weights)
        total = np.asarray(np.bincount(patch, volume), dtype=np.float64)

        def mean(values: FloatArray) -> FloatArray:
            return np.asarray(np.bincount(patch, volume * values) / total)

        middle = np.stack([mean(axis) for axis in self.points.T], axis=1)
        blend = np.stack([mean(each) for each in self.weights])
        return Interior(middle, mean(self.radii), total, blend)


@dataclass(frozen=True, eq=False)
class Interior:
    """Points inside the bodies of a mesh, each below a patch of the surface."""

    points: FloatArray  # (k, 3)
    radii: FloatArray  # (k,), of their balls
    volumes: FloatArray  # (k,), around them
    weights: FloatArray  # (r, k): the blend weights

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        weights: FloatArray,
        encloses: BoolArray,
        stiffness: FloatArray | None = None,
    ) -> Interior:
        """Return the means of `InteriorSamples` over their patches."""
        return InteriorSamples.of(mesh, weights, encloses).means(stiffness)

    def gradients(self, cages: Sequence[Cage], subspace: Subspace) -> FloatArray:
        """Return the gradients (k, 3, m) of the map of *cages* at the points, in W~'s columns."""
        found = np.zeros((len(self.points), 3, subspace.n_columns))
        for cage, own, alpha in zip(cages, subspace.columns, self.weights, strict=True):
            some = np.flatnonzero(alpha > 0.0)
            step = 1e-3 * self.radii[some, None]
            ways = np.multiply.outer(np.concatenate([np.eye(3), -np.eye(3)]), step)
            sides = np.swapaxes(ways[..., 0], 1, 2) + self.points[some]  # (6, k, 3)
            rows = mean_value_coordinates(sides.reshape(-1, 3), cage.vertices, cage.faces)
            ahead, back = rows.reshape(2, 3, len(some), len(cage.vertices))
            slopes = alpha[some, None] * (ahead - back) / (2.0 * step)
            found[some, :, own] = np.swapaxes(slopes, 0, 1)
        return found


def interior_weights(energy: Energy, gradients: FloatArray, volumes: FloatArray) -> FloatArray:
    """Return v (k,): the *volumes* (k,) around the points, in units of *energy*, of the surface.

    *gradients* (k, 3, m) are those of the map of the cages at the points.
    """
    if not len(volumes):
        return volumes
    flat = gradients.reshape(3 * len(volumes), -1)
    stiffness = float(np.repeat(volumes, 3) @ np.einsum("km,km->k", flat, flat))
    return _TRACE_SHARE * float(np.trace(energy.quadratic)) / stiffness * volumes


def with_interior(energy: Energy, gradients: FloatArray, weights: FloatArray) -> Energy:
    """Return *energy* plus that inside the body.

    Parameters
    ----------
    energy : Energy
        Of the surface.
    gradients : (k, 3, m) float
        Of the map of the cages, at k points.
    weights : (k,) float
        v.
    """
    if not len(weights):
        return energy
    flat = gradients.reshape(3 * len(weights), -1)
    load = np.repeat(weights, 3)[:, None] * flat
    return replace(
        energy,
        quadratic=energy.quadratic + flat.T @ load,
        constant=energy.constant + 3.0 * float(weights.sum()),
        rotation_operator=np.concatenate([energy.rotation_operator, load]),
    )


def grown_gradients(energy: Energy, weights: FloatArray, p: FloatArray) -> FloatArray:
    """Return the gradients (k, 3, m) over the body with cages *p* (m, 3) instead of that at rest.

    *energy* contains those at rest with *weights* v (k,), as its last rotation clusters.  Where the
    body at *p* is turned inside out, they stay those at rest.
    """
    rows = energy.rotation_operator[len(energy.rotation_operator) - 3 * len(weights) :]
    at_rest = rows.reshape(len(weights), 3, -1) / weights[:, None, None]
    jacobian = at_rest @ p
    jacobian[np.linalg.det(jacobian) <= 0.0] = np.eye(3)
    return np.asarray(np.linalg.solve(jacobian, at_rest), dtype=np.float64)
