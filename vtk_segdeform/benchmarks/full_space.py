"""Our own energy without cages: every vertex of the mesh is an unknown.

    minimise  E(x) + sum_i omega |x_i - u_i|^2    subject to  V(x) = V_0

Detail and stretch as in `energy`, one rotation per vertex; each round fits the rotations, solves
with a sparse matrix that is factored once, and ends on the exact volume.  This is what the cages
are an approximation of, and what they save.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..arrays import FloatArray
from ..energy import reduced_operators, surface_operators
from ..geometry import (
    IntrinsicTriangulation,
    closest_rotations,
    signed_volume,
    step_to_volume,
    volume_along,
    volume_gradient,
)
from ..subspace import Subspace
from .measuring import timed
from .programs import Answer, until_rest
from .tasks import NEAR, Task

_STRETCH = 10.0  # as in `Deformer`
_HOLD = 1e2  # times the mean diagonal of the shape's matrix, for each vertex that is held


def full_space(task: Task, subspace: Subspace, most: int) -> Answer:
    """Solve *task* over all vertices; the terms weigh as they do in *subspace*."""
    mesh = task.mesh
    (pull, solve_for, weight), set_up = timed(lambda: _factored(task, subspace))
    held = np.concatenate([task.fixed, task.handle])
    places = np.concatenate([mesh.vertices[task.fixed], task.targets])
    volume = signed_volume(mesh.vertices, mesh.faces)

    def iterate(x: FloatArray) -> FloatArray:
        turned = closest_rotations((pull @ x).reshape(-1, 3, 3)).swapaxes(1, 2).reshape(-1, 3)
        right = pull.T @ turned
        right[held] += weight * places
        ahead = solve_for(right)
        direction = solve_for(volume_gradient(ahead, mesh.faces))
        path = volume_along(ahead, direction, mesh.faces)
        return np.asarray(ahead + step_to_volume(path, volume) * direction)

    start = np.array(mesh.vertices)
    near = NEAR * mesh.diagonal
    (pose, count), seconds = timed(lambda: until_rest(start, near, most, iterate))
    return Answer(pose, set_up, seconds, count)


def _factored(task: Task, subspace: Subspace) -> tuple[Any, Any, float]:
    mesh = task.mesh
    surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
    shape = surface_operators(surface, np.arange(mesh.n_vertices))
    areas, laplacian = shape.areas, shape.laplacian
    inside, between, *_ = reduced_operators(subspace, laplacian, 0.25 / areas, areas)
    share = _STRETCH * float(np.trace(inside) / np.trace(between))
    matrix = laplacian.T @ sparse.diags_array(0.25 / areas) @ laplacian + share * laplacian
    weight = _HOLD * float(matrix.diagonal().mean())
    holding = np.zeros(mesh.n_vertices)
    holding[np.concatenate([task.fixed, task.handle])] = weight
    factor = splu(
        (matrix + sparse.diags_array(holding)).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        options={"SymmetricMode": True},
    )
    pull = shape.detail + share * shape.fans
    return pull, factor.solve, weight
