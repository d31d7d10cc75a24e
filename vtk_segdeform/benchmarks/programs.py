"""Deformation by other programs, called as documented by each of them.

All are optional and imported inside the call.  A program runs until its pose is within 1e-4 of the
mesh diagonal of the converged one, up to a maximum number of iterations.  Iterations of
as-rigid-as-possible deformation converge linearly: they move the farthest vertex by d, q d, q^2 d
..., so that d q / (1 - q) remains.  Open3D and Blender do not report movement, so their number of
iterations is doubled until the pose moves by no more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import FloatArray
from ..errors import MissingDependencyError
from .measuring import by_turns, timed
from .tasks import CONVERGED, Task

_FEWEST = 50  # iterations of Open3D and Blender


@dataclass(frozen=True, eq=False)
class Answer:
    """The pose (n, 3), the seconds and the iterations of a program."""

    vertices: FloatArray
    set_up: float
    solve: float
    iterations: int


def iterate_to_convergence(
    start: FloatArray, near: float, most: int, iterate: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, int]:
    """Iterate from *start* until *near* (a length) the limit; return the result and the count."""
    here, before = start, math.inf
    for count in range(1, most + 1):
        ahead = iterate(here)
        moved = float(np.linalg.norm(ahead - here, axis=1).max())
        here, rate, before = ahead, moved / before if before else 0.0, moved
        if count > 1 and rate < 1.0 and moved * rate / (1.0 - rate) <= near:
            return here, count
    return here, most


def double_to_convergence(
    near: float, most: int, run: Callable[[int], tuple[FloatArray, float]]
) -> tuple[FloatArray, float, int]:
    """Return the pose and seconds of ``run(count)``, and the count at which it is *near* its limit.

    That is where half as many iterations give the same pose.
    """
    count = min(_FEWEST, most)
    pose, seconds = run(count)
    while 2 * count <= most:
        before, count = pose, 2 * count
        pose, seconds = run(count)
        if np.linalg.norm(pose - before, axis=1).max() <= near:
            break
    return pose, seconds, count


def libigl_arap(task: Task, most: int) -> Answer:
    """Solve by libigl's as-rigid-as-possible deformation (spokes and rims)."""
    (data, positions), set_up = timed(lambda: _arap_data(task))
    data.max_iter = 1
    igl, near = _igl(), CONVERGED * task.mesh.diagonal
    start = np.array(task.mesh.vertices)
    (pose, count), solve = timed(
        lambda: iterate_to_convergence(
            start, near, most, lambda x: igl.arap_solve(positions, data, x)
        )
    )
    return Answer(np.asarray(pose), set_up, solve, count)


def arap_iteration_seconds(task: Task, repeats: int) -> float:
    """Return the processor time of one iteration of libigl's ARAP, the median of *repeats*."""
    data, positions = _arap_data(task)
    data.max_iter = 1
    igl, start = _igl(), np.array(task.mesh.vertices)
    return by_turns([lambda: igl.arap_solve(positions, data, start)], repeats)[0]


def open3d_arap(task: Task, most: int) -> Answer:
    """Solve by Open3D's as-rigid-as-possible deformation, including set-up."""
    try:
        import open3d
    except (ImportError, OSError) as fault:
        raise MissingDependencyError(f"open3d is not installed ({fault})") from None
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(np.array(task.mesh.vertices)),
        open3d.utility.Vector3iVector(task.mesh.faces.astype(np.int32)),
    )
    constrained = open3d.utility.IntVector(_constrained(task).astype(np.int32))
    positions = open3d.utility.Vector3dVector(_positions(task))

    def run(count: int) -> tuple[FloatArray, float]:
        with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
            bent, seconds = timed(
                lambda: mesh.deform_as_rigid_as_possible(constrained, positions, max_iter=count)
            )
        return np.asarray(bent.vertices).copy(), seconds

    pose, solve, count = double_to_convergence(CONVERGED * task.mesh.diagonal, most, run)
    return Answer(pose, 0.0, solve, count)


def blender_laplacian(task: Task, most: int) -> Answer:
    """Solve by Blender's Laplacian Deform modifier; fixed and handle vertices are anchors."""
    try:
        import bpy
    except (ImportError, OSError) as fault:
        raise MissingDependencyError(f"bpy is not installed ({fault})") from None
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = bpy.data.meshes.new("task")
    data.from_pydata(task.mesh.vertices.tolist(), [], task.mesh.faces.tolist())
    body = bpy.data.objects.new("task", data)
    bpy.context.collection.objects.link(body)
    bpy.context.view_layer.objects.active = body
    anchors = body.vertex_groups.new(name="anchors")
    anchors.add(_constrained(task).tolist(), 1.0, "REPLACE")
    modifier: Any = body.modifiers.new("bend", "LAPLACIANDEFORM")
    modifier.vertex_group = "anchors"
    _, set_up = timed(lambda: bpy.ops.object.laplaciandeform_bind(modifier="bend"))
    if not modifier.is_bind:
        raise MissingDependencyError("Blender could not bind its modifier")
    moved = np.array(task.mesh.vertices)
    moved[task.handle] = task.targets

    def evaluate() -> FloatArray:
        data.vertices.foreach_set("co", moved.astype(np.float32).ravel())
        data.update()
        seen = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        out = np.empty(3 * len(moved), dtype=np.float32)
        seen.vertices.foreach_get("co", out)
        return out.reshape(-1, 3).astype(np.float64)

    def run(count: int) -> tuple[FloatArray, float]:
        modifier.iterations = count
        return timed(evaluate)

    pose, solve, count = double_to_convergence(CONVERGED * task.mesh.diagonal, most, run)
    return Answer(pose, set_up, solve, count)


def _igl() -> Any:
    try:
        import igl
    except ImportError as fault:
        raise MissingDependencyError(f"libigl is not installed ({fault})") from None
    return igl


def _arap_data(task: Task) -> tuple[Any, FloatArray]:
    igl = _igl()
    data = igl.ARAPData()
    constrained = _constrained(task).astype(np.int32)
    igl.arap_precomputation(task.mesh.vertices, task.mesh.faces, 3, constrained, data)
    return data, _positions(task)


def _constrained(task: Task) -> np.ndarray[Any, np.dtype[np.int64]]:
    return np.concatenate([task.fixed, task.handle])


def _positions(task: Task) -> FloatArray:
    return np.concatenate([task.mesh.vertices[task.fixed], task.targets])
