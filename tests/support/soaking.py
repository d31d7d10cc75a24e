"""Long drags that check the volume of every pose, and the memory of the process."""

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

SWEEP = 40  # events of one sweep, back and forth
NAME = "tip"


def resident() -> int:
    """Return the resident memory of the process in bytes; 0 if the system does not report it."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except FileNotFoundError:
        return 0


def slender() -> Scene:
    """Return an ellipsoid of 66 vertices in two cages of 18, which is fast to solve."""
    ball, faces = icosphere(2)
    mesh = Mesh(ball * [3.0, 0.8, 0.8], faces)
    x = mesh.vertices[:, 0]
    around, cage_faces = icosphere(1)
    masks = np.array([x <= 0.5, x >= -0.5])
    cages = [Cage(around * [3.4, 1.6, 1.6] + [side, 0, 0], cage_faces) for side in (-1.25, 1.25)]
    regions = Regions.from_masks(mesh, masks)
    return Scene(mesh, regions, tuple(cages), np.flatnonzero(x < -2.2), np.flatnonzero(x > 2.2))


def sways(scene: Scene, count: int, degrees: float) -> Iterator[np.ndarray]:
    """Yield *count* targets, back and forth, every sweep about another axis."""
    for event in range(count):
        sweep, part = divmod(event, SWEEP)
        rng = np.random.default_rng(sweep)
        axis, shift = rng.normal(size=3), rng.normal(0.0, 0.1, 3)
        share = rng.uniform(0.2, 1.0) * np.sin(2.0 * np.pi * part / SWEEP)
        yield scene.turned(degrees * share, axis) + share * shift


@dataclass
class LongDrag:
    """One drag of any number of events, which checks the volume after each.

    Attributes
    ----------
    worst : float
        The largest |dV|/V of all poses.
    steps, events : int
        Steps of the solver, and calls of it.
    """

    scene: Scene = field(repr=False)
    session: Session = field(init=False, repr=False)
    worst: float = 0.0
    steps: int = 0
    events: int = 0

    def __post_init__(self) -> None:
        self.session = self.scene.session(NAME)
        self._volume = signed_volume(self.scene.mesh.vertices, self.scene.mesh.faces)

    def follow(self, targets: np.ndarray, max_steps: int) -> Solution:
        """Follow *targets* with at most *max_steps* steps, as one mouse event does."""
        return self._checked(self.session.drag({NAME: targets}, max_steps=max_steps))

    def arrive(self, targets: np.ndarray, max_steps: int = 8) -> Solution:
        """Refine at *targets* until the pose is final."""
        solution = self.follow(targets, max_steps)
        for _ in range(500):
            if solution.status is not Status.STEP_LIMIT:
                return solution
            solution = self._checked(self.session.refine(max_steps=max_steps))
        raise AssertionError("the pose is not final after 500 calls")

    def _checked(self, solution: Solution) -> Solution:
        faces = self.scene.mesh.faces
        change = signed_volume(self.session.vertices, faces) / self._volume - 1.0
        assert abs(change) <= 1e-12, f"event {self.events}: the volume is off by {change:.1e}"
        self.worst = max(self.worst, abs(change))
        self.steps += solution.steps
        self.events += 1
        return solution

    @property
    def distance_from_rest(self) -> float:
        """The largest distance of a vertex from its rest position, in diagonals."""
        mesh = self.scene.mesh
        return float(np.abs(self.session.vertices - mesh.vertices).max() / mesh.diagonal)
