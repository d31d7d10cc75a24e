"""One drag at one size, measured part by part.

    begin     the rest of a frame: how the energy curves where it starts, what holds the handles
    step      one more step of the solver; must not depend on the size of the mesh, so that it is
              taken by turns with steps of the smallest one
    map       x = W p
    volume    that of the whole mesh, once
    normals   at all vertices;  render: off the screen, by whatever OpenGL there is

Handles move by 1 % of the diagonal a frame; a frame is as many steps as `drags` says.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np

from ..arrays import FloatArray
from ..errors import MissingDependencyError
from ..kernels import in_parallel, one_blas_thread
from ..solver import total_volume
from ..subspace import Subspace
from .drags import frames, seconds_per_step, way_of
from .drawing import drawing_seconds
from .measuring import forget_peak, median_seconds, peak_memory, timed
from .scale import Scale
from .tasks import bent_cactus, bound, deformer_of, warm_up

_NAN = float("nan")
_PIECE = 1 << 18
_SETTLING = 0.5  # seconds, in which BLAS's threads give up waiting for more after the set-up


@dataclass(frozen=True)
class Profile:
    """What was measured at one size; times in milliseconds, set-up in seconds."""

    vertices: int
    segment: float
    cages: float
    bind: float  # what it leaves on disk included
    again: float  # what was kept of the mesh, its regions and cages is opened
    memory: float  # gigabytes, at most, while setting up
    frame: float
    steps: int
    step: float
    beside: float  # a step of the smallest mesh, by turns with it
    map: float
    volume: float
    normals: float
    render: float
    stream: float
    change: float  # of the volume, the largest of all frames
    processors: float  # of a frame, milliseconds of all of them
    arap: float = _NAN
    arap_processors: float = _NAN

    @property
    def set_up(self) -> float:
        """Seconds from a mesh to its first frame."""
        return self.segment + self.cages + self.bind

    @property
    def stepping(self) -> float:
        """Of the frame: its steps."""
        return self.steps * self.step

    @property
    def begin(self) -> float:
        """Of the frame: what is not steps, map or volume."""
        return max(self.frame - self.stepping - self.map - self.volume, 0.0)


def profiled(size: int, scale: Scale) -> Profile:
    """Return the profile of one size, without ARAP; run it in a process of its own."""
    task = bent_cactus(size)
    warm_up()
    forget_peak()
    with TemporaryDirectory() as cache:
        ready = bound(task, 3, scale.n_cage_vertices, cache=cache)
        memory = peak_memory()
        deformer = ready.deformer
        what = deformer.regions, deformer.cages
        again = timed(lambda: deformer_of(task, *what, cache=cache))[1]
        smallest = bent_cactus(scale.drag_sizes[0])
        beside = bound(smallest, 3, scale.n_cage_vertices).deformer, smallest
    time.sleep(_SETTLING)
    streams = [timed(lambda: _stream(deformer.subspace))[1] for _ in range(scale.repeats)]
    drag = list(frames(deformer, way_of(task, scale.frames)))[1:]
    streams += [timed(lambda: _stream(deformer.subspace))[1] for _ in range(scale.repeats)]
    pose = drag[-1].solution.vertices
    cages = drag[-1].solution.cage_vertices
    whole = total_volume(task.mesh)
    steps = seconds_per_step([beside, (deformer, task)], scale.repeats)
    try:
        normals, render = drawing_seconds(task.mesh, pose, scale.repeats)
    except MissingDependencyError:
        normals = render = _NAN
    return Profile(
        vertices=task.mesh.n_vertices,
        segment=ready.segment,
        cages=ready.cages,
        bind=ready.bind,
        again=again,
        memory=memory,
        frame=1e3 * median(frame.seconds for frame in drag),
        steps=int(median(frame.steps for frame in drag)),
        step=1e3 * steps[1],
        beside=1e3 * steps[0],
        map=1e3 * median_seconds(lambda: deformer.surface(cages), scale.repeats),
        volume=1e3 * median_seconds(lambda: whole.violation(pose), scale.repeats),
        normals=1e3 * normals,
        render=1e3 * render,
        stream=1e3 * median(streams),
        processors=1e3 * median(frame.processors for frame in drag),
        change=max(abs(frame.solution.volume_change) for frame in drag),
    )


def _stream(subspace: Subspace) -> None:
    """Read W once, by all threads."""
    for block in subspace.blocks:
        flat = block.reshape(-1)

        def read(start: int, stop: int, flat: FloatArray = flat) -> None:
            np.dot(flat[start:stop], flat[start:stop])

        with one_blas_thread():  # others would go on spinning through what is timed next
            in_parallel(read, len(flat), _PIECE)
