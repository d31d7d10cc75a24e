"""The same energy without cages: every vertex of the mesh is an unknown.

    minimise  E(x) + sum_i omega |x_i - u_i|^2    subject to  V(x) = V_0

The energy is that of `energy`, with one rotation per vertex.  Each iteration fits the rotations,
solves with a sparse matrix that is factored once, and restores the exact volume.  The cages
approximate this solution at a lower cost.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..arrays import FloatArray
from ..energy import reduced_operators, surface_operators
from ..geometry import IntrinsicTriangulation, closest_rotations
from ..solver import total_volume
from ..subspace import Subspace
from .measuring import timed
from .programs import Answer, iterate_to_convergence
from .tasks import CONVERGED, Task

_STRETCH = 10.0  # as in `Deformer`
_POSITION_WEIGHT = 1e2  # of fixed and handle vertices, times the mean diagonal of the matrix


def full_space(task: Task, subspace: Subspace, most: int) -> Answer:
    """Solve *task* over all vertices; the terms have the same weights as in *subspace*."""
    mesh = task.mesh
    (pull, solve_for, weight), set_up = timed(lambda: _factored(task, subspace))
    constrained = np.concatenate([task.fixed, task.handle])
    positions = np.concatenate([mesh.vertices[task.fixed], task.targets])
    volume = total_volume(mesh)

    def iterate(x: FloatArray) -> FloatArray:
        turned = closest_rotations((pull @ x).reshape(-1, 3, 3)).swapaxes(1, 2).reshape(-1, 3)
        right = pull.T @ turned
        right[constrained] += weight * positions
        ahead = solve_for(right)
        direction = solve_for(volume.gradient(ahead))
        step = volume.exact_step(np.hstack([ahead, direction]))
        return np.asarray(ahead + step * direction)

    start = np.array(mesh.vertices)
    near = CONVERGED * mesh.diagonal
    (pose, count), seconds = timed(lambda: iterate_to_convergence(start, near, most, iterate))
    return Answer(pose, set_up, seconds, count)


def _factored(task: Task, subspace: Subspace) -> tuple[Any, Any, float]:
    mesh = task.mesh
    surface = IntrinsicTriangulation.of(mesh.vertices, mesh.faces)
    shape = surface_operators(surface, np.arange(mesh.n_vertices))
    areas, laplacian = shape.areas, shape.laplacian
    inside, between, *_ = reduced_operators(subspace, laplacian, 0.25 / areas, areas)
    share = _STRETCH * float(np.trace(inside) / np.trace(between))
    matrix = laplacian.T @ sparse.diags_array(0.25 / areas) @ laplacian + share * laplacian
    weight = _POSITION_WEIGHT * float(matrix.diagonal().mean())
    weights = np.zeros(mesh.n_vertices)
    weights[np.concatenate([task.fixed, task.handle])] = weight
    factor = splu(
        (matrix + sparse.diags_array(weights)).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        options={"SymmetricMode": True},
    )
    pull = shape.detail + share * shape.fans
    return pull, factor.solve, weight
