"""``segdeform bench``: the experiments of `benchmarks`, as a report in a folder."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

from ..benchmarks import FULL, NAME, QUICK, USUAL, write_report
from ..progress import Progress
from .interactive import interactive_table
from .outputs import Say


def bench(options: Namespace, say: Say, progress: Progress) -> bool:
    """Measure, leave a report, and say what does not hold; or print the table of a drag."""
    if options.interactive:
        say(interactive_table(n_cage_vertices=options.cage_vertices, progress=progress))
        return True
    scale = QUICK if options.quick else FULL if options.full else USUAL
    scale = replace(scale, n_cage_vertices=options.cage_vertices)
    if options.size is not None:
        one = (options.size,)
        scale = replace(
            scale, paper_size=options.size, drag_sizes=one, peer_sizes=one, cage_sizes=one
        )
    sections = write_report(options.output, scale, options.only, progress)
    ratios = [ratio for section in sections for ratio in section.ratios]
    for ratio in ratios:
        verdict = ratio.verdict.strip("*").lower()
        say(f"{verdict:15} {ratio.what}: {ratio.value:.3g}, wanted {ratio.limit:.3g}")
    for section in sections:
        for line in section.absent:
            say(f"not measured    {line}")
    say(f"written         {options.output / NAME}")
    return True
