"""One run of all experiments, as a Markdown file with its plots beside it.

What must hold comes first, whoever wins; then what was not measured, and why; then each experiment.
The file is written anew after every experiment, so that a run that is stopped leaves what it had.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ..errors import Cancelled, MissingDependencyError, SegDeformError
from ..files import replacing
from ..progress import Progress, part
from . import cage_making, drag_profile, experiments, peers, segmentation_study, table_one
from .measuring import conditions, timed
from .scale import Scale
from .sections import Figure, Section, Table
from .tasks import warm_up

EXPERIMENTS: dict[str, Callable[[Scale, Progress | None], Section]] = {
    "drag": drag_profile.run,
    "table1": table_one.run,
    "segmentation": segmentation_study.run,
    "figures": experiments.run,
    "peers": peers.run,
    "cages": cage_making.run,
}
NAME = "report.md"


def write_report(
    folder: Path, scale: Scale, only: Sequence[str] = (), progress: Progress | None = None
) -> list[Section]:
    """Run the experiments into *folder*, made if it is not there, and return what they found.

    Parameters
    ----------
    folder : Path
        Gets ``report.md`` and the pictures it shows.
    scale : Scale
        How much to measure.
    only : sequence of str
        Names of `EXPERIMENTS`; none means all.
    progress : Progress, optional
        Called between the parts; may cancel.

    Raises
    ------
    KeyError
        If *only* names something else.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = list(only) or list(EXPERIMENTS)
    runs = [EXPERIMENTS[name] for name in names]
    began = time.perf_counter()
    _, kernels = timed(warm_up)
    sections: list[Section] = []
    for k, (name, run) in enumerate(zip(names, runs, strict=True)):
        try:
            section = run(scale, part(progress, k / len(names), (k + 1) / len(names)))
        except Cancelled:
            raise
        except SegDeformError as fault:
            section = Section(name, absent=[f"all of {name}: {fault}"])
        shown = [figure for figure in section.figures if _drawn(folder, figure, section)]
        section.figures[:] = shown
        sections.append(section)
        head = [
            *conditions(),
            f"scale *{scale.name}*; {time.perf_counter() - began:.0f} s so far; loading, and at "
            f"the first run compiling, kernels took {kernels:.1f} s and counts nowhere",
        ]
        with replacing(folder / NAME) as draft:
            draft.write_text(markdown(sections, head), encoding="utf-8")
    return sections


def markdown(sections: Sequence[Section], head: Sequence[str]) -> str:
    """Return the report; *head* says what it was measured on."""
    ratios = [ratio for section in sections for ratio in section.ratios]
    absent = [line for section in sections for line in section.absent]
    parts = ["# vtk_segdeform, measured", "\n".join(f"- {line}" for line in head)]
    parts.append("Times are medians of one run: read the ratios, not the digits.")
    if ratios:
        rows = [
            (r.what, r.value, f"{'≤' if r.at_most else '≥'} {r.limit:.3g}", r.verdict)
            for r in ratios
        ]
        broken = sum(r.verdict.startswith("**") for r in ratios)
        known = sum(not math.isnan(r.value) for r in ratios)
        parts += ["## What must hold", f"{known - broken} of {known} that were measured hold."]
        parts.append(Table(("", "measured", "wanted", ""), rows).markdown())
    if absent:
        parts += ["## Not measured", "\n".join(f"- {line}" for line in absent)]
    for section in sections:
        parts += [f"## {section.title}", *section.words]
        parts += [table.markdown() for table in section.tables]
        parts += [f"![{f.caption}]({f.name})\n\n*{f.caption}*" for f in section.figures]
    return "\n\n".join(parts) + "\n"


def _drawn(folder: Path, figure: Figure, section: Section) -> bool:
    try:
        figure.draw(folder / figure.name)
    except MissingDependencyError as missing:
        section.absent.append(f"{figure.name} is not drawn: {missing}")
        return False
    return True
