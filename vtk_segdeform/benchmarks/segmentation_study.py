"""The number of regions: time and distortion with 1 to 24 regions, an open question of the paper.

The study is made twice: with a constant total of cage vertices, as in the paper's figure 10, and
with a constant number per cage.  Distortion is that of the converged 60 degree bend.
"""

from __future__ import annotations

from statistics import median

from ..errors import CageError
from ..geometry import distortion
from ..progress import Progress
from . import charts
from .drags import drag_path, frames, seconds_per_step
from .scale import Scale
from .sections import Cell, Figure, Section, Table
from .tasks import Task, bent_cactus, make_regions, prepare

COLUMNS = (
    "regions", "cage vertices", "non-zeros of W", "step, ms", "steps per frame",
    "frame, ms", "distortion", "handle error",
)  # fmt: skip
_MIN_CAGE = 8  # vertices of a cage


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table, a plot and a summary for each of the two studies."""
    task = bent_cactus(scale.paper_size)
    total, each = scale.study_vertices, scale.study_each
    chosen = make_regions(task.mesh, None).n_regions
    section = Section("Figure 10: the number of regions")
    studies = {
        f"{total} cage vertices in total": [
            (r, total) for r in scale.regions if r * _MIN_CAGE <= total
        ],
        f"{each} vertices in each cage": [(r, each * r) for r in scale.regions],
    }
    for k, (name, cases) in enumerate(studies.items()):
        rows: list[tuple[Cell, ...]] = []
        for i, (n_regions, n_vertices) in enumerate(cases):
            if progress:
                progress((k + i / len(cases)) / 2, f"{n_regions} regions, {name}")
            try:
                rows.append(row_of(task, n_regions, n_vertices, scale))
            except CageError as fault:
                section.skipped.append(f"{n_regions} regions, {name}: {fault}")
        table = Table(COLUMNS, rows, name)
        section.tables.append(table)
        section.text.append(_summary(table, name, chosen))
        section.figures.append(_figure(table, k))
    return section


def row_of(task: Task, n_regions: int, n_vertices: int, scale: Scale) -> tuple[Cell, ...]:
    """Return a row of `COLUMNS`."""
    deformer = prepare(task, n_regions, n_vertices).deformer
    drag = list(frames(deformer, drag_path(task, scale.frames)))[1:]
    (step,) = seconds_per_step([(deformer, task)], scale.repeats)
    deformer.reset()
    solution = deformer.solve(task.targets)
    return (
        n_regions,
        sum(cage.n_vertices for cage in deformer.cages),
        sum(block.size for block in deformer.subspace.blocks),
        1e3 * step,
        int(median(frame.steps for frame in drag)),
        1e3 * median(frame.seconds for frame in drag),
        distortion(task.mesh, solution.vertices),
        solution.handle_error,
    )


def _summary(table: Table, name: str, chosen: int) -> str:
    numbers = [int(number) for number in table.column("regions") if number is not None]

    def least(column: str) -> tuple[int, float]:
        values = [float(value) for value in table.column(column) if value is not None]
        best = min(range(len(values)), key=values.__getitem__)
        return numbers[best], values[best]

    smooth, step, frame = least("distortion"), least("step, ms"), least("frame, ms")
    text = (
        f"With {name}: lowest distortion with {smooth[0]} regions ({smooth[1]:.3f}), fastest frame "
        f"with {frame[0]} ({frame[1]:.1f} ms), fastest step with {step[0]} "
        f"({step[1]:.1f} ms). `n_regions=None` chooses {chosen}"
    )
    if chosen not in numbers:
        return text + "."
    row = dict(zip(table.columns, table.rows[numbers.index(chosen)], strict=True))
    return text + f": distortion {row['distortion']:.3f}, frame {row['frame, ms']:.1f} ms."


def _figure(table: Table, k: int) -> Figure:
    def values(column: str) -> list[float]:
        return [float("nan") if v is None else float(v) for v in table.column(column)]

    panels = {
        "ms per step": {"ours": values("step, ms")},
        "ms per frame": {"ours": values("frame, ms")},
        "distortion": {"ours": values("distortion")},
    }
    numbers = values("regions")
    return Figure(
        f"segmentation-{('total', 'each')[k]}.png",
        f"Time per step, time per frame and distortion by number of regions: {table.title}.",
        lambda path: charts.line_plot(path, numbers, panels, across="regions"),
    )
