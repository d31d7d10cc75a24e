"""``segdeform bench``: run experiments and write a report."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

from ..benchmarks import (
    FULL,
    NAME,
    QUICK,
    USUAL,
    plot_history,
    read_history,
    record,
    write_report,
)
from ..errors import ArgumentError
from ..kernels import wait_until_compiled
from ..progress import Progress
from .interactive import interactive_table
from .opening import DRAWN_SIZES, opening_table
from .outputs import Say


def bench(options: Namespace, say: Say, progress: Progress) -> bool:
    """Run experiments and print their ratios; or plot recorded runs, or time a drag."""
    if options.history:
        plot = options.output / "history.png"
        runs = read_history(options.history)
        options.output.mkdir(parents=True, exist_ok=True)
        plot_history(runs, plot)
        say(f"written         {plot}")
        return True
    if options.record:
        read_history(options.record)  # report errors before the measurements
    if options.open and not options.interactive:
        raise ArgumentError("--open requires --interactive")
    wait_until_compiled()
    if options.open:
        sizes = DRAWN_SIZES if options.full else DRAWN_SIZES[:2]
        sizes = sizes if options.size is None else (options.size,)
        _print_table(opening_table(sizes=sizes, progress=progress), say)
        return True
    if options.interactive:
        _print_table(
            interactive_table(n_cage_vertices=options.cage_vertices, progress=progress), say
        )
        return True
    scale = QUICK if options.quick else FULL if options.full else USUAL
    scale = replace(scale, n_cage_vertices=options.cage_vertices)
    if options.size is not None:
        one = (options.size,)
        scale = replace(scale, paper_size=options.size, drag_sizes=one, peer_sizes=one)
    sections = write_report(options.output, scale, options.only, progress)
    ratios = [ratio for section in sections for ratio in section.ratios]
    for ratio in ratios:
        say(f"{ratio.verdict.strip('*'):15} {ratio.what}: {ratio.value:.3g} ({ratio.limit_text})")
    for section in sections:
        for line in section.skipped:
            say(f"not measured    {line}")
    if options.record:
        record(options.record, scale.name, ratios)
        say(f"recorded        {options.record}")
    say(f"written         {options.output / NAME}")
    return True


def _print_table(table: str, say: Say) -> None:
    for line in table.split("\n"):
        say(line)
