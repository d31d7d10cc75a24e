"""Table 1 of the paper: one cage and three regions, in the paper's formulation and in ours.

    cactus of 5430 vertices, 155 cage vertices in both cases
    paper:  0.55 s per step with one cage, 0.2 s with three regions (2.75 times), 4 steps, +0.02 %

*Paper*: one rotation per vertex, detail only (5), linearised volume (14), blend weights of eq. (4),
no acceleration.  *Ours*: stretch, rotation clusters, exact volume, Hessian and acceleration.

With three regions W has fewer non-zeros, so only products with W become faster; the table
separates them from the rest of a step.  Products are measured with the rows that the steps use:
the mesh in the paper's formulation, a coarse volume of a few thousand points in ours.
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
from .drags import MANY_PAPER_STEPS, drag_path, frames, seconds_per_step
from .measuring import by_turns, median_seconds
from .scale import Scale
from .sections import Ratio, Section, Table
from .tasks import PAPER, Prepared, Task, bent_cactus, prepare

_PAPER_SPEED_UP = 0.55 / 0.2
_CLUSTERS = 300  # of rotations, in our formulation
_STEPS, _ROUNDS = 20, 3  # steps in one measurement of products with W; measurements per repeat


@dataclass(frozen=True)
class Case:
    """One column of the table; times in milliseconds."""

    nonzeros: int  # of W
    step: float
    steps: int  # per frame
    frame: float
    volume_change: float  # largest of the drag
    products: float  # with W, per step
    volume: float  # volume and its gradient, per step
    rotations: float  # per step
    substitution: float  # two triangular solves, per step
    bind: float  # W and W^T A^T A W, once

    @property
    def rest(self) -> float:
        """Time per step of sparse operators, line search and Python."""
        parts = self.products + self.volume + self.rotations + self.substitution
        return max(self.step - parts, 0.0)


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return the table in both formulations, with ratios to those of the paper."""
    task, n = bent_cactus(scale.paper_size), scale.n_cage_vertices
    tables, ratios, text, changes = [], [], [], []
    for k, (name, options) in enumerate({"paper": PAPER, "ours": {}}.items()):
        cases = []
        for n_regions in (1, 3):
            if progress:
                progress(0.5 * k + 0.25 * (n_regions == 3), f"table 1, {name}, {n_regions} regions")
            extra = {**options, "as_printed": bool(options) and n_regions > 1}
            cases.append(prepare(task, n_regions, n, **extra))
        products = [_products(case, plain=bool(options)) for case in cases]
        product_times = by_turns(products, _ROUNDS * scale.repeats)
        drags = [(case.deformer, task) for case in cases]
        many = {"many": MANY_PAPER_STEPS} if options else {}
        steps = seconds_per_step(drags, scale.repeats, **many)
        one, three = (
            measured(case, task, scale, plain=bool(options), taken=(step, seconds / _STEPS))
            for case, step, seconds in zip(cases, steps, product_times, strict=True)
        )
        tables.append(_table(name, one, three))
        changes.append((name, one.volume_change, three.volume_change))
        fewer, faster = one.nonzeros / three.nonzeros, one.products / three.products
        text.append(
            f"Formulation *{name}*: three regions make a step {one.step / three.step:.2f} times as "
            f"fast as one cage ({_PAPER_SPEED_UP:.2f} times in the paper). W has {fewer:.2f} times "
            f"fewer non-zeros, and products with W are {faster:.2f} times as fast."
        )
        what = f"speed-up of products with W / reduction of its non-zeros, {name}"
        ratios.append(Ratio(what, faster / fewer, 1.0, at_most=False))
    title = "largest relative volume change of a frame"
    tables.append(Table(("formulation", "one cage", "three regions"), changes, title))
    text.append(
        f"{task.mesh.n_vertices} vertices, {n} cage vertices. The drag is the same as in the other "
        "tables: handles move by 1 % of the mesh diagonal per frame, and a frame has converged "
        "when the next step moves no vertex by more than 1e-4 of it. The paper does not define "
        "the convergence of its 4 steps."
    )
    return Section("Table 1: one cage and three regions", text, tables, ratios=ratios)


def measured(
    prepared: Prepared, task: Task, scale: Scale, *, plain: bool, taken: tuple[float, float]
) -> Case:
    """Return the measurements of a deformer; *plain* is the paper's formulation.

    *taken* are the seconds of a step and of its products with W, measured alternately with those of
    the other case.
    """
    deformer, mesh, repeats = prepared.deformer, task.mesh, scale.repeats
    surface, (volume, *_) = deformer.step_volumes.surface, deformer.step_volumes.constraints
    rng = np.random.default_rng(0)
    m, n = surface.n_columns, mesh.n_vertices
    y = rng.random((surface.n_vertices, 3))
    turns = rng.random((n if plain else min(_CLUSTERS, n), 3, 3))
    size = m if plain else 3 * m
    square = rng.random((size, size))
    factor = linalg.cho_factor(square @ square.T + np.eye(size), lower=True)
    right = rng.random((size, 6 if plain else 2))

    def ms(work: Any) -> float:
        return 1e3 * median_seconds(work, repeats)

    drag = list(frames(deformer, drag_path(task, scale.frames)))[1:]
    return Case(
        nonzeros=sum(int(np.count_nonzero(block)) for block in surface.blocks),
        step=1e3 * taken[0],
        steps=int(median(frame.steps for frame in drag)),
        frame=1e3 * median(frame.seconds for frame in drag),
        volume_change=_largest(frame.solution.volume_change for frame in drag),
        products=1e3 * taken[1],
        volume=ms(lambda: volume.gradient(y)) + 2 * ms(lambda: volume.violation(y)),
        rotations=ms(lambda: closest_rotations(turns)),
        bind=1e3 * prepared.bind,
        substitution=ms(lambda: linalg.cho_solve(factor, right, check_finite=False)),
    )


def _products(prepared: Prepared, *, plain: bool) -> Callable[[], None]:
    """Return a function that computes the products with W of several steps: x = W p and W^T y.

    With exact volume, W also multiplies the direction of the volume correction.  W^T multiplies J_g
    and, with one rotation per vertex, the rotated detail.  Steps follow each other as in a drag, so
    that a W that fits in the processor cache has this advantage.
    """
    surface = prepared.deformer.step_volumes.surface
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
        "step, ms": "step",
        "- products with W, ms": "products",
        "- volume, ms": "volume",
        "- rotations, ms": "rotations",
        "- triangular solves, ms": "substitution",
        "- other, ms": "rest",
        "binding, once, ms": "bind",
        "non-zeros of W": "nonzeros",
        "steps per frame": "steps",
        "frame, ms": "frame",
    }.items():
        a, b = getattr(one, field), getattr(three, field)
        rows.append((label, a, b, a / b if b else None))
    columns = ("quantity", "one cage", "three regions", "ratio")
    return Table(columns, rows, f"formulation: {name}", mixed=True)
