"""The paper's table 1: one cage against three regions, in its own formulation and in ours.

    cactus of 5430 vertices, 155 cage vertices in both cases
    paper:  0.55 s a step with one cage, 0.2 s with three regions (2.75 times), 4 steps, +0.02 %

*As printed*: one rotation per vertex, detail only (5), volume linearised (14), blend of eq. (4),
and plain steps.  *Ours*: stretch, rotations by groups, exact volume, curvature and acceleration.
The two cases differ in the non-zeros of W, so only what multiplies by W can gain; the table splits
a step into that and the rest.  Each formulation is measured over what its own steps go over: the
mesh itself as printed, the stand-in of a few thousand points in ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from scipy import linalg

from ..geometry import closest_rotations
from ..progress import Progress
from .drags import AS_PRINTED, frames, seconds_per_step, way_of
from .measuring import by_turns, median_seconds
from .scale import Scale
from .sections import Ratio, Section, Table
from .tasks import PAPER, Bound, Task, bent_cactus, bound

_PRINTED = 0.55 / 0.2
_GROUPS = 300  # rotations of ours
_STEPS, _ROUNDS = 20, 3  # in a row of products with W, and such rows for each repeat


@dataclass(frozen=True)
class Case:
    """One column of the table; times in milliseconds."""

    nonzeros: int
    step: float
    steps: int
    frame: float
    volume: float  # relative change, the largest of the drag
    of_w: float  # of a step: products with W
    volume_pass: float  # of a step: volume and its gradient over the triangles
    rotations: float
    substitution: float  # of a step: two triangular solves
    bind: float  # W, and W^T A^T A W, once

    @property
    def rest(self) -> float:
        """Of a step: sparse operators over the mesh, the line search, Python."""
        parts = self.of_w + self.volume_pass + self.rotations + self.substitution
        return max(self.step - parts, 0.0)


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return the table in both formulations, and how the ratios compare with the paper's."""
    task, n = bent_cactus(scale.paper_size), scale.n_cage_vertices
    tables, ratios, words = [], [], []
    for k, (name, options) in enumerate({"as printed": PAPER, "ours": {}}.items()):
        readies = []
        for n_regions in (1, 3):
            if progress:
                progress(0.5 * k + 0.25 * (n_regions == 3), f"table 1, {name}, {n_regions} regions")
            extra = {**options, "as_printed": bool(options) and n_regions > 1}
            readies.append(bound(task, n_regions, n, **extra))
        products = [_products(ready, plain=bool(options)) for ready in readies]
        of_w = by_turns(products, _ROUNDS * scale.repeats)
        drags = [(ready.deformer, task) for ready in readies]
        many = {"many": AS_PRINTED} if options else {}
        steps = seconds_per_step(drags, scale.repeats, **many)
        one, three = (
            case_of(ready, task, scale, plain=bool(options), taken=(step, seconds / _STEPS))
            for ready, step, seconds in zip(readies, steps, of_w, strict=True)
        )
        tables.append(_table(name, one, three))
        fewer, faster = one.nonzeros / three.nonzeros, one.of_w / three.of_w
        words.append(
            f"Formulation {name}: a step with three regions is {one.step / three.step:.2f} times "
            f"as fast as with one cage, where the paper has {_PRINTED:.2f}. W has {fewer:.2f} "
            f"times fewer non-zeros, and its products are {faster:.2f} times as fast."
        )
        what = f"gain of the products with W over that of their non-zeros, {name}"
        ratios.append(Ratio(what, faster / fewer, 1.0, at_most=False))
    words.append(
        f"{task.mesh.n_vertices} vertices, {n} cage vertices. The drag is the one of the other "
        "tables: 1 % of the diagonal a frame, until the next step moves nothing by more than 1e-4 "
        "of it. The paper does not say when its 4 steps had converged."
    )
    return Section("Table 1: one cage against three regions", words, tables, ratios=ratios)


def case_of(
    ready: Bound, task: Task, scale: Scale, *, plain: bool, taken: tuple[float, float]
) -> Case:
    """Return the measurements of a deformer; *plain* is the paper's formulation.

    The seconds *taken* by a step and by its products with W were measured by turns with another's.
    """
    deformer, mesh, repeats = ready.deformer, task.mesh, scale.repeats
    surface, (volume, *_) = deformer.step_volumes.surface, deformer.step_volumes.constraints
    rng = np.random.default_rng(0)
    m, n = surface.n_columns, mesh.n_vertices
    y = rng.random((surface.n_vertices, 3))
    turns = rng.random((n if plain else min(_GROUPS, n), 3, 3))
    size = m if plain else 3 * m
    square = rng.random((size, size))
    factor = linalg.cho_factor(square @ square.T + np.eye(size), lower=True)
    right = rng.random((size, 6 if plain else 2))

    def ms(work: Any) -> float:
        return 1e3 * median_seconds(work, repeats)

    drag = list(frames(deformer, way_of(task, scale.frames)))[1:]
    return Case(
        nonzeros=sum(int(np.count_nonzero(block)) for block in surface.blocks),
        step=1e3 * taken[0],
        steps=int(median(frame.steps for frame in drag)),
        frame=1e3 * median(frame.seconds for frame in drag),
        volume=_largest(frame.solution.volume_change for frame in drag),
        of_w=1e3 * taken[1],
        volume_pass=ms(lambda: volume.gradient(y)) + 2 * ms(lambda: volume.violation(y)),
        rotations=ms(lambda: closest_rotations(turns)),
        bind=1e3 * ready.bind,
        substitution=ms(lambda: linalg.cho_solve(factor, right, check_finite=False)),
    )


def _products(ready: Bound, *, plain: bool) -> Callable[[], None]:
    """Return what steps do with W: x = W p and W^T y.

    Beside p goes the direction in which the volume is restored, where it is exact; and W^T is
    taken of J_g and, where every vertex turns, of what the rotations pull.  Several steps, as they
    follow each other in a drag: a W that stays in the cache gains by it.
    """
    surface = ready.deformer.step_volumes.surface
    p = np.ones((surface.n_columns, 3 if plain else 6))
    y = np.ones((surface.n_vertices, 3))

    def products() -> None:
        for _ in range(_STEPS):
            surface.map(p)
            surface.adjoints([y, y] if plain else [y])

    return products


def _largest(changes: Iterable[float]) -> float:
    return max(changes, key=abs)


def _table(name: str, one: Case, three: Case) -> Table:
    rows: list[tuple[str, float, float, float | None]] = []
    for label, field in {
        "time per step, ms": "step",
        "- products with W": "of_w",
        "- volume over the triangles": "volume_pass",
        "- rotations": "rotations",
        "- triangular solves": "substitution",
        "- the rest": "rest",
        "bind and factor, once, ms": "bind",
        "non-zeros of W, in steps": "nonzeros",
        "steps a frame": "steps",
        "time per frame, ms": "frame",
    }.items():
        a, b = getattr(one, field), getattr(three, field)
        rows.append((label, a, b, a / b if b else None))
    rows.append(("volume changed by", one.volume, three.volume, None))
    return Table(("", "one cage", "three regions", "ratio"), rows, f"formulation {name}")
