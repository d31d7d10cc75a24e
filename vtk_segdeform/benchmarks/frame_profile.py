"""Profile of one drag: the times of its parts.

    step      one step of the solver; it should not depend on the size of the mesh, so it is
              measured alternately with steps of the smallest mesh
    map       x = W p
    volume    the volume of the mesh, once
    other     the rest of a frame: Hessian at its start, position constraints
    normals   at all vertices
    render    off-screen, by OpenGL
    options   frames that avoid folds or contact, divided by those that do not

Handles move by 1 % of the mesh diagonal per frame; `drags` defines when a frame has converged.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np

from ..arrays import FloatArray
from ..errors import MissingDependencyError
from ..kernels import in_parallel, one_blas_thread
from ..solver import total_volume
from ..subspace import Subspace
from .drags import drag_path, frames, seconds_per_step, times_beside_first
from .drawing import drawing_seconds
from .measuring import forget_peak, median_seconds, peak_memory, timed
from .scale import Scale
from .tasks import bent_cactus, make_deformer, prepare, warm_up

_NAN = float("nan")
_PIECE = 1 << 18
_OPTION_FRAMES = 15  # there, and as many back
_PAUSE = 0.5  # seconds after the set-up, until idle threads of BLAS stop spinning


@dataclass(frozen=True)
class Profile:
    """Measurements for one mesh size: times in milliseconds, set-up in seconds."""

    vertices: int
    segment: float
    cages: float
    bind: float  # including the cache on disk
    reopen: float  # binding from the cache
    memory: float  # peak of the set-up, gigabytes
    frame: float
    steps: int
    step: float
    smallest_step: float  # a step of the smallest mesh
    map: float
    volume: float
    normals: float
    render: float
    read: float  # W from memory
    volume_change: float  # largest of all frames
    processors: float  # processor time of a frame
    with_folds: float  # time of a frame that avoids folds, divided by that of one that does not
    with_contact: float  # the same for contact
    arap: float = _NAN
    arap_processors: float = _NAN

    @property
    def set_up(self) -> float:
        """Seconds from a mesh to its first frame."""
        return self.segment + self.cages + self.bind

    @property
    def stepping(self) -> float:
        """Time of the steps of a frame."""
        return self.steps * self.step

    @property
    def other(self) -> float:
        """Time of a frame except steps, map and volume."""
        return max(self.frame - self.stepping - self.map - self.volume, 0.0)


def profile_of(size: int, scale: Scale) -> Profile:
    """Return the profile for one mesh size, without ARAP; run it in its own process."""
    task = bent_cactus(size)
    warm_up()
    forget_peak()
    with TemporaryDirectory() as cache:
        prepared = prepare(task, 3, scale.n_cage_vertices, cache=cache)
        memory = peak_memory()
        deformer = prepared.deformer
        regions, cages = deformer.regions, deformer.cages
        reopen = timed(lambda: make_deformer(task, regions, cages, cache=cache))[1]
        smallest_task = bent_cactus(scale.drag_sizes[0])
        smallest = prepare(smallest_task, 3, scale.n_cage_vertices).deformer, smallest_task
    time.sleep(_PAUSE)
    reads = [timed(lambda: _read(deformer.subspace))[1] for _ in range(scale.repeats)]
    drag = list(frames(deformer, drag_path(task, scale.frames)))[1:]
    reads += [timed(lambda: _read(deformer.subspace))[1] for _ in range(scale.repeats)]
    pose = drag[-1].solution.vertices
    cage_vertices = drag[-1].solution.cage_vertices
    whole = total_volume(task.mesh)
    hold = partial(deformer.hold, fixed=deformer.fixed, handle=deformer.handle)
    variants = [hold(), hold(avoid_folds=True), hold(avoid_contact=True)]
    path = drag_path(task, _OPTION_FRAMES)
    _, with_folds, with_contact = times_beside_first(variants, [*path, *path[::-1]])
    steps = seconds_per_step([smallest, (deformer, task)], scale.repeats)
    try:
        normals, render = drawing_seconds(task.mesh, pose, scale.repeats)
    except MissingDependencyError:
        normals = render = _NAN
    return Profile(
        vertices=task.mesh.n_vertices,
        segment=prepared.segment,
        cages=prepared.cages,
        bind=prepared.bind,
        reopen=reopen,
        memory=memory,
        frame=1e3 * median(frame.seconds for frame in drag),
        steps=int(median(frame.steps for frame in drag)),
        step=1e3 * steps[1],
        smallest_step=1e3 * steps[0],
        map=1e3 * median_seconds(lambda: deformer.surface(cage_vertices), scale.repeats),
        volume=1e3 * median_seconds(lambda: whole.violation(pose), scale.repeats),
        normals=1e3 * normals,
        render=1e3 * render,
        read=1e3 * median(reads),
        with_folds=with_folds,
        with_contact=with_contact,
        processors=1e3 * median(frame.processors for frame in drag),
        volume_change=max(abs(frame.solution.volume_change) for frame in drag),
    )


def _read(subspace: Subspace) -> None:
    """Read W from memory once, in all threads."""
    for block in subspace.blocks:
        flat = np.asarray(getattr(block, "values", block)).reshape(-1)

        def read(start: int, stop: int, flat: FloatArray = flat) -> None:
            np.dot(flat[start:stop], flat[start:stop])

        with one_blas_thread():  # other threads would keep spinning during the next measurement
            in_parallel(read, len(flat), _PIECE)
