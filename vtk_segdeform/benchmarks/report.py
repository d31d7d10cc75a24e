"""Run experiments and write a report: a Markdown file with its figures in the same folder.

The report begins with the ratios and their limits and with skipped measurements, followed by a
section for each experiment.  It is written after every experiment, so that an interrupted run
leaves a report as well.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ..errors import Cancelled, MissingDependencyError, SegDeformError
from ..files import replacing
from ..progress import Progress, part
from . import browser, experiments, felt, mechanisms, paper, peers
from .measuring import conditions, timed
from .scale import Scale
from .sections import Figure, Section, Table
from .tasks import warm_up

EXPERIMENTS: dict[str, Callable[[Scale, Progress | None], Section]] = {
    "drag": felt.run,
    "mechanisms": mechanisms.run,
    "paper": paper.run,
    "figures": experiments.run,
    "peers": peers.run,
    "browser": browser.run,
}
NAME = "report.md"


def write_report(
    folder: Path, scale: Scale, only: Sequence[str] = (), progress: Progress | None = None
) -> list[Section]:
    """Run experiments, write the report to *folder*, and return its sections.

    Parameters
    ----------
    folder : Path
        Folder for ``report.md`` and its figures; created if necessary.
    scale : Scale
        Problem sizes.
    only : sequence of str
        Names of `EXPERIMENTS`; by default all.
    progress : Progress, optional
        Callback; it can cancel.

    Raises
    ------
    KeyError
        If *only* contains an unknown name.
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
            section = Section(name, skipped=[f"all of {name}: {fault}"])
        section.figures[:] = [f for f in section.figures if _drawn(folder, f, section)]
        sections.append(section)
        head = [
            *conditions(),
            f"scale *{scale.name}*; {time.perf_counter() - began:.0f} s so far, of which "
            f"{kernels:.1f} s to load or compile kernels, which is not part of any measurement",
        ]
        with replacing(folder / NAME) as draft:
            draft.write_text(markdown(sections, head), encoding="utf-8")
    return sections


def markdown(sections: Sequence[Section], head: Sequence[str]) -> str:
    """Return the report as Markdown; *head* describes the machine and the run."""
    ratios = [ratio for section in sections for ratio in section.ratios]
    skipped = [line for section in sections for line in section.skipped]
    parts = ["# Benchmarks of vtk_segdeform", "\n".join(f"- {line}" for line in head)]
    parts.append("Times are medians within one run; compare ratios rather than absolute times.")
    if ratios:
        rows = [
            (r.what, r.value, f"{'≤' if r.at_most else '≥'} {r.limit:.3g}", r.verdict)
            for r in ratios
        ]
        met = sum(r.verdict == "met" for r in ratios)
        measured = sum(not math.isnan(r.value) for r in ratios)
        parts += ["## Limits", f"{met} of {measured} measured limits are met."]
        table = Table(("quantity", "measured", "limit", "verdict"), rows, mixed=True)
        parts.append(table.markdown())
    if skipped:
        parts += ["## Not measured", "\n".join(f"- {line}" for line in skipped)]
    for section in sections:
        parts += [f"## {section.title}", *section.text]
        parts += [table.markdown() for table in section.tables]
        parts += [f"![{f.caption}]({f.name})\n\n*{f.caption}*" for f in section.figures]
    return "\n\n".join(parts) + "\n"


def _drawn(folder: Path, figure: Figure, section: Section) -> bool:
    try:
        figure.draw(folder / figure.name)
    except MissingDependencyError as missing:
        section.skipped.append(f"{figure.name} was not drawn: {missing}")
        return False
    return True
