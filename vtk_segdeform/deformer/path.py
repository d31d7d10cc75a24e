"""Where a deformer is: the only value of it that changes."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..arrays import FloatArray
from ..solver import GaussNewton, SolverOptions, SolverResult


@dataclass(eq=False)
class Path:
    """The last pose, and what the next solve continues with."""

    solver: GaussNewton  # with its factor, its acceleration and the way of the last solves
    p: FloatArray  # (m, 3), the cages of the pose, in solver coordinates
    end: FloatArray  # (m, 3), where the solver ended: p, before the exact volumes
    targets: FloatArray  # (k, 3)

    def solve(self, places: FloatArray, options: SolverOptions) -> SolverResult:
        """Minimise from the last pose, for *places* (s, 3)."""
        result = self.solver.minimise(self.end, places, options)
        self.p = self.end = result.p
        return result

    def continue_from(self, p: FloatArray) -> None:
        """Continue from cages *p* (m, 3), and preserve the volumes of that pose."""
        self.p = self.end = p
        self.solver.volumes = self.solver.volumes.preserved_at(p)

    def copy(self) -> Path:
        """Return a path that continues from here independently."""
        return replace(self, solver=self.solver.copy())
