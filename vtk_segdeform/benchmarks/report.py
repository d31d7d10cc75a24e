"""Run experiments and write a report: a Markdown file with a section for each experiment.

It is written after every experiment, so that an interrupted run leaves a report as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ..errors import Cancelled, SegDeformError
from ..files import replacing
from ..progress import Progress, part
from . import (
    atlas,
    batching,
    constrained,
    felt,
    mechanisms,
    opening,
    paper,
    peers,
    solids,
)
from .measuring import conditions
from .results import Scale, Section
from .tasks import warm_up

EXPERIMENTS: dict[str, Callable[[Scale, Progress | None], Section]] = {
    "drag": felt.run,
    "constraints": constrained.run,
    "open": opening.run,
    "landmarks": atlas.run,
    "mechanisms": mechanisms.run,
    "batch": batching.run,
    "paper": paper.run,
    "peers": peers.run,
    "solids": solids.run,
}
NAME = "report.md"


def write_report(
    folder: Path, scale: Scale, only: Sequence[str] = (), progress: Progress | None = None
) -> list[Section]:
    """Run experiments, write the report to *folder*, and return its sections.

    Parameters
    ----------
    folder : Path
        Folder for ``report.md``; created if necessary.
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
    warm_up()
    sections: list[Section] = []
    for k, (name, run) in enumerate(zip(names, runs, strict=True)):
        try:
            section = run(scale, part(progress, k / len(names), (k + 1) / len(names)))
        except Cancelled:
            raise
        except SegDeformError as fault:
            section = Section(name, skipped=[f"all of {name}: {fault}"])
        sections.append(section)
        head = "\n".join(f"- {line}" for line in [*conditions(), f"scale *{scale.name}*"])
        parts = ["# Benchmarks of vtk_segdeform", head, *(each.markdown() for each in sections)]
        with replacing(folder / NAME) as draft:
            draft.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return sections
