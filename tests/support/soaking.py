"""Long drags, and what is watched while they go on: the volume, and the memory of the process."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scenes import Scene
from solids import icosphere

from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.geometry.volume import signed_volume
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session.session import Session
from vtk_segdeform.solver.solution import Solution, Status

SWEEP = 40  # events there and back
NAME = "tip"


def resident() -> int:
    """Return the bytes that the process has in memory now; 0 where the system does not tell."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except FileNotFoundError:
        return 0


def slender() -> Scene:
    """Return an ellipsoid of 66 vertices in two cages of 18: what solving it takes is small."""
    ball, faces = icosphere(2)
    mesh = Mesh(ball * [3.0, 0.8, 0.8], faces)
    x = mesh.vertices[:, 0]
    around, cage_faces = icosphere(1)
    masks = np.array([x <= 0.5, x >= -0.5])
    cages = [Cage(around * [3.4, 1.6, 1.6] + [side, 0, 0], cage_faces) for side in (-1.25, 1.25)]
    regions = Regions.from_masks(mesh, masks)
    return Scene(mesh, regions, tuple(cages), np.flatnonzero(x < -2.2), np.flatnonzero(x > 2.2))


def session_of(scene: Scene) -> Session:
    """Return a session of *scene*, at rest, its handle called `NAME`."""
    session = Session(scene.mesh)
    session.set_regions(scene.regions)
    session.set_cages(scene.cages)
    session.set_fixed(scene.fixed)
    session.add_handle(scene.handle, NAME)
    return session


def sways(scene: Scene, count: int, degrees: float) -> Iterator[np.ndarray]:
    """Yield *count* targets: there and back, each time about another axis and another way."""
    for event in range(count):
        sweep, part = divmod(event, SWEEP)
        rng = np.random.default_rng(sweep)
        axis, shift = rng.normal(size=3), rng.normal(0.0, 0.1, 3)
        share = rng.uniform(0.2, 1.0) * np.sin(2.0 * np.pi * part / SWEEP)
        yield scene.turned(degrees * share, axis) + share * shift


@dataclass
class LongDrag:
    """One drag, of as many events as it is given, each seen to keep the volume.

    Attributes
    ----------
    worst : float
        The largest |dV|/V of all poses.
    steps, events : int
        Of the solver, and what was asked of it.
    """

    scene: Scene = field(repr=False)
    session: Session = field(init=False, repr=False)
    worst: float = 0.0
    steps: int = 0
    events: int = 0

    def __post_init__(self) -> None:
        self.session = session_of(self.scene)
        self._volume = signed_volume(self.scene.mesh.vertices, self.scene.mesh.faces)

    def follow(self, targets: np.ndarray, max_steps: int) -> Solution:
        """Go on to *targets*, with as many steps as an event has time for."""
        return self._seen(self.session.drag({NAME: targets}, max_steps=max_steps))

    def arrive(self, targets: np.ndarray, max_steps: int = 8) -> Solution:
        """Stay at *targets* until the pose is final."""
        solution = self.follow(targets, max_steps)
        for _ in range(500):
            if solution.status is not Status.STEP_LIMIT:
                return solution
            solution = self._seen(self.session.refine(max_steps=max_steps))
        raise AssertionError("it never ends")

    def _seen(self, solution: Solution) -> Solution:
        faces = self.scene.mesh.faces
        change = signed_volume(self.session.vertices, faces) / self._volume - 1.0
        assert abs(change) <= 1e-12, f"event {self.events}: the volume is off by {change:.1e}"
        self.worst = max(self.worst, abs(change))
        self.steps += solution.steps
        self.events += 1
        return solution

    @property
    def away(self) -> float:
        """How far the farthest vertex is from where it is at rest, in diagonals."""
        mesh = self.scene.mesh
        return float(np.abs(self.session.vertices - mesh.vertices).max() / mesh.diagonal)
