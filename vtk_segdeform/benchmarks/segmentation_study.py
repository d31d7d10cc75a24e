"""How finely to segment: the question that the paper leaves open, from 1 to 24 regions.

Twice, since more regions cost in two ways: with the same number of cage vertices in all (the
paper's table 2 and figure 10), and with the same number in each cage.  Distortion is that of the
60 degree bend, solved to the end.
"""

from __future__ import annotations

from statistics import median

from ..errors import CageError
from ..geometry import distortion
from ..progress import Progress
from . import charts
from .drags import AS_PRINTED, frames, seconds_per_step, way_of
from .scale import Scale
from .sections import Cell, Figure, Section, Table
from .tasks import PAPER, Task, bent_cactus, bound, deformer_of, divided

COLUMNS = (
    "regions", "cage vertices", "non-zeros of W", "step ms", "step as printed ms", "steps a frame",
    "frame ms", "distortion", "handle error",
)  # fmt: skip
_LEAST = 8  # vertices of a cage


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table and a plot for each of the two ways, and what they answer."""
    task = bent_cactus(scale.paper_size)
    total, each = scale.study_vertices, scale.study_each
    chosen = divided(task.mesh, None).n_regions
    section = Section("Table 2 and figure 10: how finely to segment")
    ways = {
        f"{total} cage vertices in all": [(r, total) for r in scale.regions if r * _LEAST <= total],
        f"{each} vertices in each cage": [(r, each * r) for r in scale.regions],
    }
    for k, (name, cases) in enumerate(ways.items()):
        rows: list[tuple[Cell, ...]] = []
        for i, (n_regions, n_vertices) in enumerate(cases):
            if progress:
                progress((k + i / len(cases)) / 2, f"{n_regions} regions, {name}")
            try:
                rows.append(row_of(task, n_regions, n_vertices, scale))
            except CageError as fault:
                section.absent.append(f"{n_regions} regions, {name}: {fault}")
        table = Table(COLUMNS, rows, name)
        section.tables.append(table)
        section.words.append(_answer(table, name, chosen))
        section.figures.append(_figure(table, k))
    return section


def row_of(task: Task, n_regions: int, n_vertices: int, scale: Scale) -> tuple[Cell, ...]:
    """Return one row of the study, under `COLUMNS`."""
    deformer = bound(task, n_regions, n_vertices).deformer
    printed = deformer_of(task, deformer.regions, deformer.cages, **PAPER)
    drag = list(frames(deformer, way_of(task, scale.frames)))[1:]
    (step,) = seconds_per_step([(deformer, task)], scale.repeats)
    (as_printed,) = seconds_per_step([(printed, task)], min(scale.repeats, 3), AS_PRINTED)
    deformer.reset()
    solution = deformer.solve(task.targets)
    return (
        n_regions,
        sum(cage.n_vertices for cage in deformer.cages),
        sum(block.size for block in deformer.subspace.blocks),
        1e3 * step,
        1e3 * as_printed,
        int(median(frame.steps for frame in drag)),
        1e3 * median(frame.seconds for frame in drag),
        distortion(task.mesh, solution.vertices),
        solution.handle_error,
    )


def _answer(table: Table, name: str, chosen: int) -> str:
    numbers = [int(number) for number in table.column("regions") if number is not None]

    def least(column: str) -> tuple[int, float]:
        values = [float(value) for value in table.column(column) if value is not None]
        best = min(range(len(values)), key=values.__getitem__)
        return numbers[best], values[best]

    smooth, fast, frame = least("distortion"), least("step as printed ms"), least("frame ms")
    text = (
        f"With {name}: distortion is least with {smooth[0]} regions ({smooth[1]:.3f}), a frame is "
        f"fastest with {frame[0]} ({frame[1]:.1f} ms), a step as printed with {fast[0]} "
        f"({fast[1]:.1f} ms). `n_regions=None` takes {chosen}"
    )
    if chosen not in numbers:
        return text + "."
    mine = table.rows[numbers.index(chosen)]
    at = dict(zip(table.columns, mine, strict=True))
    return text + f": distortion {at['distortion']:.3f}, a frame {at['frame ms']:.1f} ms."


def _figure(table: Table, k: int) -> Figure:
    def values(column: str) -> list[float]:
        return [float("nan") if v is None else float(v) for v in table.column(column)]

    panels = {
        "ms per step": {"ours": values("step ms"), "as printed": values("step as printed ms")},
        "ms per frame": {"ours": values("frame ms")},
        "distortion": {"ours": values("distortion")},
    }
    numbers = values("regions")
    return Figure(
        f"segmentation-{('total', 'each')[k]}.png",
        f"Steps, frames and distortion over the number of regions: {table.title}.",
        lambda path: charts.line_plot(path, numbers, panels, across="regions"),
    )
